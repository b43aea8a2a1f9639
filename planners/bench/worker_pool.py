"""A pool of worker processes: a worker that crashes or hangs loses its current task only."""

from __future__ import annotations

import multiprocessing
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

CHECK_INTERVAL = 1.0  # [s] between two checks for overdue workers


class _Worker(Generic[T, R]):
    """A process and its current task."""

    task: T
    due: float

    def __init__(self, act: Callable[[T], R]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, child_pipe = context.Pipe()
        self.process = context.Process(target=_work, args=(child_pipe, act), daemon=True)
        resource_tracker.ensure_running()  # if started with the process, it would unblock SIGINT
        # A terminal sends Ctrl-C to all processes of the group; only the main process handles it.
        previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with _deferred_signals():
                self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, previous)
        child_pipe.close()

    def send(self, task: T, patience: float) -> None:
        """Send a task to the process."""
        self.task, self.due = task, time.monotonic() + patience
        with suppress(OSError):  # the process has ended: `wait` returns its pipe as ready
            self.pipe.send(task)

    @property
    def is_overdue(self) -> bool:
        """Whether the current task has taken longer than the patience."""
        return time.monotonic() >= self.due

    def kill(self) -> None:
        """Kill the process and release its resources."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


@contextmanager
def _deferred_signals() -> Generator[None]:
    """Handle SIGINT and SIGTERM after the block: a process that starts would miss its task.

    The mask alone does not defer them, since other threads of the process receive them.
    """
    received: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for kind in (signal.SIGINT, signal.SIGTERM):
            if callable(signal.getsignal(kind)):
                handlers[kind] = signal.signal(kind, lambda got, _: received.append(got))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for deferred in received:
            signal.raise_signal(deferred)


def worker_pool(
    tasks: Iterable[T],
    act: Callable[[T], R],
    *,
    jobs: int,
    patience: float,
    lost: Callable[[T, str], R],
) -> Generator[tuple[T, R]]:
    """Yield tasks with their results, in the order in which they are completed.

    Parameters
    ----------
    tasks : iterable
        Each task can be pickled.
    act : callable
        Function of a module that other processes can import; maps a task to its result.
    jobs : int
        Number of processes.
    patience : float [s]
        A process that takes longer for a task is killed.
    lost : callable
        Returns the result of a task whose process ended or was killed, from the task and a reason.
    """
    pending = deque(tasks)
    workers: list[_Worker[T, R]] = []
    try:
        while pending or workers:
            while pending and len(workers) < jobs:
                workers.append(_Worker(act))
                workers[-1].send(pending.popleft(), patience)
            ready = wait([worker.pipe for worker in workers], timeout=CHECK_INTERVAL)
            for worker in [one for one in workers if one.pipe in ready or one.is_overdue]:
                task = worker.task
                result, alive = _receive(worker, lost, patience)
                if alive and pending:
                    worker.send(pending.popleft(), patience)
                else:
                    workers.remove(worker)
                    worker.kill()
                yield task, result
    finally:
        for worker in workers:
            worker.kill()


def _receive(worker: _Worker[T, R], lost: Callable[[T, str], R], patience: float) -> tuple[R, bool]:
    """Return the result of a worker's task, and whether the worker can take another task."""
    if not worker.pipe.poll():
        return lost(worker.task, f"its process did not end within {patience:g} s"), False
    try:
        result: R = worker.pipe.recv()
    except (EOFError, OSError):  # OSError: the process ended before it read its task
        worker.process.join()
        return lost(worker.task, f"its process ended with {worker.process.exitcode}"), False
    return result, True


def _work(pipe: Connection[Any, Any], act: Callable[[Any], Any]) -> None:
    """Work on one task after another until the pipe is closed."""
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(act(task))
