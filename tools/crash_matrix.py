"""Plan random problems in processes that can crash, and report every fault.

Each attempt draws a map, a problem, a planner and its settings (see tools/random_problems.py) and
plans once in a worker process. A fault is

- a process that ended, or did not answer within the patience;
- an answer more than 0.5 s after the time limit, both in wall time and in CPU time, since a process
  can wait for a processor. The first attempt of a process can compile or load kernels, so a late
  attempt is repeated, and is a fault only if it is late each time;
- an exception that is not a documented error of the library.

::

    make crash-matrix ATTEMPTS=20000 SEED=7
    .venv/bin/python tools/crash_matrix.py --attempts 2000 --planner bitstar --space dubins
    .venv/bin/python tools/crash_matrix.py --seed 7 --only 1234

`--refused` also tries the combinations in `planners.sampling.settings.REFUSED`. Use it with a new
version of OMPL: entries without a fault can be removed. The exit code is 1 if there was a fault.
"""

from __future__ import annotations

import argparse
import faulthandler
import secrets
import sys
import time
import traceback
from collections import Counter
from contextlib import closing
from functools import partial
from typing import NamedTuple, get_args

from random_problems import Attempt, Choice, all_planners, draw

from groundmap.errors import SettingsError
from planners import NoRouteError, ProblemError, plan
from planners.bench.samplers import processors
from planners.bench.worker_pool import worker_pool
from planners.sampling import settings
from planners.sampling.settings import StateSpace

GRACE = 0.5  # [s] after the time limit before an answer is late
REPEATS = 3  # of a late attempt
PATIENCE = 180.0  # [s] for one attempt, compilation included
MEMORY = 4 * 2**30  # [bytes] for each process
EVERY = 500  # attempts between two lines of progress


class Task(NamedTuple):
    """An attempt, by its seed and number."""

    choice: Choice
    seed: int
    number: int


class Ending(NamedTuple):
    """Result of an attempt."""

    kind: str  #: "route", the name of an error, or a fault in capitals
    detail: str = ""
    over: float = 0.0  #: [s] after the time limit


FAULTS = ("ENDED", "LATE", "EXCEPTION")


def attempt_task(task: Task) -> Ending:
    """Plan, and repeat the attempt if it is late."""
    if not faulthandler.is_enabled():
        _set_up_process(task)
    attempt = draw(*task)
    over, ending = 0.0, Ending("")
    for _ in range(REPEATS):
        began, ran = time.perf_counter(), time.process_time()
        ending = _plan(attempt)
        seconds = min(time.perf_counter() - began, time.process_time() - ran)
        over = seconds - attempt.settings["time_limit"]
        if over <= GRACE or ending.kind == "EXCEPTION":
            return ending._replace(over=max(over, 0.0))
    return Ending("LATE", f"{over:.2f} s: {ending.kind}", over)


def _set_up_process(task: Task) -> None:
    faulthandler.enable()
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 -- missing on some platforms

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if task.choice.refused:
        settings.REFUSED.clear()


def _plan(attempt: Attempt) -> Ending:
    try:
        plan(attempt.problem, attempt.planner, **attempt.settings)
    except (NoRouteError, ProblemError, SettingsError) as error:
        return Ending(type(error).__name__)
    except Exception as error:  # all other exceptions are faults
        frames = traceback.extract_tb(error.__traceback__)
        where = f"{frames[-1].filename.rsplit('/', 1)[-1]}:{frames[-1].lineno}"
        return Ending("EXCEPTION", f"{type(error).__name__} in {where}: {str(error)[:200]}")
    return Ending("route")


def _lost(_: Task, reason: str) -> Ending:
    return Ending("ENDED", reason)


def _line(task: Task, ending: Ending) -> str:
    attempt = draw(*task)
    settings = ", ".join(f"{key}={value}" for key, value in attempt.settings.items())
    size = attempt.problem.grid.resolution
    facts = f"{attempt.planner}, cells of {size:.3g} m, {attempt.problem.costs}, {settings}"
    return f"{ending.kind} {task.number} ({facts}): {ending.detail}"


def main() -> int:
    """Run the attempts, print each fault, progress and a summary; return the exit code."""
    options = _arguments()
    choice = Choice(
        (options.planner,) if options.planner else all_planners(),
        (options.space,) if options.space else get_args(StateSpace),
        options.refused,
    )
    numbers = range(options.attempts) if options.only is None else [options.only]
    print(f"seed {options.seed}, {len(numbers)} attempts, {options.jobs} processes", flush=True)
    tasks = map(partial(Task, choice, options.seed), numbers)
    endings, latest, began = Counter[str](), 0.0, time.perf_counter()
    with closing(
        worker_pool(tasks, attempt_task, jobs=options.jobs, patience=options.patience, lost=_lost)
    ) as results:
        for count, (task, ending) in enumerate(results, start=1):
            endings[ending.kind] += 1
            latest = max(latest, ending.over)
            if ending.kind in FAULTS or options.only is not None:
                print(_line(task, ending), flush=True)
            if count % EVERY == 0:
                print(f"{count} attempts, {time.perf_counter() - began:.0f} s", flush=True)
    kinds = ", ".join(f"{endings[kind]} {kind}" for kind in sorted(endings))
    faults = ", ".join(f"{endings[kind]} {kind.lower()}" for kind in FAULTS)
    print(f"seed {options.seed}: {kinds}")
    print(f"{endings.total()} attempts: {faults}; at most {latest:.2f} s after the limit")
    return 1 if any(endings[kind] for kind in FAULTS) else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--attempts", type=int, default=2000, help="default: 2000")
    parser.add_argument(
        "--seed", type=int, default=secrets.randbelow(2**31), help="default: random"
    )
    parser.add_argument(
        "--jobs", type=int, default=processors(), help="processes; default: one per processor"
    )
    parser.add_argument("--planner", choices=all_planners(), help="default: all")
    parser.add_argument("--space", choices=get_args(StateSpace), help="default: all")
    parser.add_argument("--only", type=int, help="number of a single attempt to repeat")
    parser.add_argument(
        "--patience", type=float, default=PATIENCE, help="for one attempt [s]; default: 180 s"
    )
    parser.add_argument("--refused", action="store_true", help="also try refused combinations")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
