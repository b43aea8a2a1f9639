"""Worker processes, watched: no case runs too long, takes too much memory, or ends unnoticed."""

from __future__ import annotations

import multiprocessing
import resource
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

BATCH = 100  # cases that a worker gets at once
READY = -1  # what a worker says instead of a case's number when it is warm
SPAWN = multiprocessing.get_context("spawn")


class Limits(NamedTuple):
    """What one case may take."""

    seconds: float
    megabytes: float  #: peak of the worker process


class Report(NamedTuple):
    """One case, as the worker that ran it reports it."""

    target: str
    number: int
    ending: str
    place: str = ""
    text: str = ""
    megabytes: float = 0.0  #: peak of the process so far
    folder: Path | None = None  #: the files of a failure


class Job(NamedTuple):
    """Cases of one target, by their numbers."""

    target: str
    numbers: list[int]


Run = Callable[[str, int, Path], Report]  #: target, number and folder of a case


@dataclass
class _Worker:
    """A process and what it is at."""

    process: Any
    pipe: Connection
    folder: Path
    left: Job | None = None
    since: float = 0.0
    warm: bool = False


class Pool:
    """Workers that run cases.

    Parameters
    ----------
    start : callable
        Called in every new worker with its folder; returns what runs a case there. It may take as
        long as it needs: the watchdog watches cases only.
    folder : Path
        Each worker has a folder in it; what a case writes is in the folder ``case`` there.
    workers : int
    limits : Limits
    """

    def __init__(
        self, start: Callable[[Path], Run], folder: Path, *, workers: int, limits: Limits
    ) -> None:
        self._start, self._folder, self._limits = start, folder, limits
        self._born = 0
        self._slow: set[tuple[str, int]] = set()  # cases that took too long once
        self._returned: list[Job] = []  # what workers that were replaced did not get to
        self._workers = [self._new() for _ in range(workers)]

    def run(self, jobs: Iterator[Job]) -> Iterator[Report]:
        """Yield a report for every case of the jobs, in the order in which they end."""
        while True:
            for worker in self._workers:
                if worker.warm and worker.left is None:
                    self._give(worker, self._returned.pop() if self._returned else next(jobs, None))
            if all(worker.warm and worker.left is None for worker in self._workers):
                return
            wait([worker.pipe for worker in self._workers], timeout=0.2)
            for place in range(len(self._workers)):
                yield from self._listen(place)

    def close(self) -> None:
        """End the workers."""
        for worker in self._workers:
            worker.process.kill()
            worker.process.join()

    def _new(self) -> _Worker:
        self._born += 1
        folder = self._folder / f"worker-{self._born}"
        folder.mkdir(parents=True)
        ours, theirs = SPAWN.Pipe()
        process = SPAWN.Process(target=_work, args=(self._start, theirs, folder), daemon=True)
        process.start()
        theirs.close()
        return _Worker(process, ours, folder)

    def _give(self, worker: _Worker, job: Job | None) -> None:
        if job is not None:
            worker.left, worker.since = job, time.monotonic()
            worker.pipe.send(job)

    def _listen(self, place: int) -> Iterator[Report]:
        """Yield what a worker reports, and put a new one in its place if it must not go on."""
        worker = self._workers[place]
        try:
            while worker.pipe.poll():
                report: Report = worker.pipe.recv()
                if report.number == READY:
                    worker.warm = True
                    continue
                self._done(worker)
                if report.megabytes > self._limits.megabytes:
                    text = f"the process has taken {report.megabytes:.0f} MB\n{report.text}"
                    yield report._replace(ending="memory", place="memory", text=text)
                    self._replace(place)
                    return
                yield report
        except (EOFError, OSError):
            yield from self._lost(place, "ended")
            return
        if worker.left and time.monotonic() - worker.since > self._limits.seconds:
            yield from self._lost(place, "hang")

    def _done(self, worker: _Worker) -> None:
        """Take the first case off what a worker has left."""
        assert worker.left is not None
        numbers = worker.left.numbers[1:]
        worker.left = Job(worker.left.target, numbers) if numbers else None
        worker.since = time.monotonic()

    def _lost(self, place: int, ending: str) -> Iterator[Report]:
        """Report the case that a worker did not come back from, and replace the worker."""
        worker = self._workers[place]
        if not worker.warm or worker.left is None:
            raise RuntimeError("A worker ended while it was running no case: see its traceback.")
        target, number = worker.left.target, worker.left.numbers[0]
        if ending == "hang" and (target, number) not in self._slow:
            # Once more: it may have compiled something, or the machine was busy.
            self._slow.add((target, number))
            self._replace(place)
            return
        self._done(worker)
        code = self._replace(place)
        text = f"{target}, case {number}: {ending}, exit code {code}"
        yield Report(target, number, ending, ending, text, folder=worker.folder / "case")

    def _replace(self, place: int) -> int | None:
        """Put a new worker in the place of one, and return that one's exit code."""
        old = self._workers[place]
        old.process.join(timeout=0.5)
        old.process.kill()
        old.process.join()
        if old.left is not None:
            self._returned.append(old.left)
        self._workers[place] = self._new()
        code: int | None = old.process.exitcode
        return code


def _work(start: Callable[[Path], Run], pipe: Connection, folder: Path) -> None:
    """Run cases until the parent ends this process."""
    run = start(folder)
    pipe.send(Report("", READY, "ready"))
    while True:
        job: Job = pipe.recv()
        for number in job.numbers:
            case = folder / "case"
            shutil.rmtree(case, ignore_errors=True)
            case.mkdir()
            report = run(job.target, number, case)
            pipe.send(report._replace(megabytes=peak_megabytes()))


def peak_megabytes() -> float:
    """Return the most memory that this process has held so far [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
