"""The command behind ``make fuzz``."""

from __future__ import annotations

import argparse
import os
import random
import secrets
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from fuzz.case import Target, outcome_of
from fuzz.draw import Draw
from fuzz.pool import BATCH, Job, Limits, Pool
from fuzz.summary import Summary
from fuzz.targets import CALLS, FILES, TARGETS
from fuzz.worker import Start


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the fuzzer; return 0 if nothing failed, otherwise 1."""
    options = _options(arguments)
    if options.case is not None:
        return _one_case(options.only[0], options.seed, options.case)
    chosen = [
        target for target in TARGETS.values() if not options.only or target.name in options.only
    ]
    files = [target for target in chosen if target.name in FILES]
    calls = [target for target in chosen if target.name in CALLS]
    print(f"seed {options.seed}", flush=True)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    summary = Summary(options.seed, options.keep)
    with tempfile.TemporaryDirectory() as folder:
        limits = Limits(options.timeout, options.memory)
        pool = Pool(
            Start(options.seed, tuple(target.name for target in chosen)),
            Path(folder),
            workers=options.workers,
            limits=limits,
        )
        try:
            jobs = _jobs(files, options.files, calls, options.calls, options.seed)
            for report in pool.run(_until(jobs, options.seconds)):
                summary.add(report)
        finally:
            pool.close()
            summary.print()
    return 1 if summary.failures else 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser("fuzz", description="Fuzz every reader and the public API.")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**9))
    parser.add_argument("--files", type=int, default=10_000, help="damaged files")
    parser.add_argument("--calls", type=int, default=10_000, help="calls of the API")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="time for all cases")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--timeout", type=float, default=10.0, help="of a case [s]")
    parser.add_argument("--memory", type=float, default=1000.0, help="peak of a worker [MB]")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-failures"), help="failures go here")
    parser.add_argument("--only", action="append", choices=sorted(TARGETS), metavar="TARGET")
    parser.add_argument("--case", type=int, help="run one case of the target in this process")
    options = parser.parse_args(arguments)
    if options.case is not None and (options.only is None or len(options.only) != 1):
        parser.error("--case needs the target that it is of: --only TARGET")
    return options


def _one_case(name: str, seed: int, number: int) -> int:
    folder = Path(tempfile.mkdtemp())
    draw = Draw(case_seed(seed, name, number))
    outcome = outcome_of(TARGETS[name], draw, folder)
    print(outcome.ending, outcome.place, outcome.text or "\n".join(draw.record), sep="\n")
    print(f"files: {folder}")
    return 0


def case_seed(seed: int, target: str, number: int) -> str:
    """Return what names a case."""
    return f"{seed}/{target}/{number}"


def _jobs(
    files: Sequence[Target], file_cases: int, calls: Sequence[Target], call_cases: int, seed: int
) -> Iterator[Job]:
    """Yield batches that share the cases among the targets by their weights, in mixed order."""
    jobs = [*_shared(files, file_cases), *_shared(calls, call_cases)]
    random.Random(seed).shuffle(jobs)
    yield from jobs


def _shared(targets: Sequence[Target], cases: int) -> Iterator[Job]:
    whole = sum(target.weight for target in targets)
    done, passed = 0, 0.0
    for target in targets:
        passed += target.weight
        count = round(cases * passed / whole) - done
        done += count
        for first in range(0, count, BATCH):
            yield Job(target.name, list(range(first, min(first + BATCH, count))))


def _until(jobs: Iterator[Job], seconds: float) -> Iterator[Job]:
    """Yield jobs as long as the time lasts, which begins when a worker first asks for one."""
    end = time.monotonic() + seconds
    for job in jobs:
        if time.monotonic() > end:
            return
        yield job


if __name__ == "__main__":
    sys.exit(main())
