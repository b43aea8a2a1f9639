"""Plan at random in processes that may crash, and report what no caller should see.

Each attempt draws a map, a problem, a planner and its settings (see tools/random_problems.py) and
plans once in one of some worker processes. A fault is

- a process that ended, or that did not answer within the patience;
- an answer more than 0.5 s after the time limit, by the clock and by the time that the process ran:
  on a busy machine it also waits for its turn. As the first attempt in a process may compile or
  load kernels, an attempt that is late is repeated, and counts only if it is late each time;
- an exception that is not one of the library's refusals.

::

    make crash-matrix ATTEMPTS=20000 SEED=7
    .venv/bin/python tools/crash_matrix.py --attempts 2000 --planner bitstar --space dubins
    .venv/bin/python tools/crash_matrix.py --seed 7 --only 1234

`--refused` also tries what `planners.sampling.settings.REFUSED` lists. Run that when another
version of OMPL comes out: an entry without a fault may be taken off the list. The exit code is 1 if
there was a fault.
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

GRACE = 0.5  # [s] by which an answer may come after the time limit
REPEATS = 3  # of an attempt that is late, before that counts
PATIENCE = 180.0  # [s] for one attempt and its compilation
MEMORY = 4 * 2**30  # [bytes] for each process
EVERY = 500  # attempts between two lines of progress


class Task(NamedTuple):
    """Which attempt to make."""

    choice: Choice
    seed: int
    number: int


class Ending(NamedTuple):
    """How an attempt ended."""

    kind: str  #: "route", the name of a refusal, or a fault in capitals
    detail: str = ""
    over: float = 0.0  #: [s] after the time limit


FAULTS = ("ENDED", "LATE", "EXCEPTION")


def tried(task: Task) -> Ending:
    """Make an attempt."""
    if not faulthandler.is_enabled():
        _begin(task)
    attempt = draw(*task)
    over, ending = 0.0, Ending("")
    for _ in range(REPEATS):
        began, ran = time.perf_counter(), time.process_time()
        ending = _planned(attempt)
        seconds = min(time.perf_counter() - began, time.process_time() - ran)
        over = seconds - attempt.settings["time_limit"]
        if over <= GRACE or ending.kind == "EXCEPTION":
            return ending._replace(over=max(over, 0.0))
    return Ending("LATE", f"{over:.2f} s: {ending.kind}", over)


def _begin(task: Task) -> None:
    faulthandler.enable()
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 -- not everywhere

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if task.choice.refused:
        settings.REFUSED.clear()


def _planned(attempt: Attempt) -> Ending:
    try:
        plan(attempt.problem, attempt.planner, **attempt.settings)
    except (NoRouteError, ProblemError, SettingsError) as error:
        return Ending(type(error).__name__)
    except Exception as error:  # whatever it is, it is reported
        frames = traceback.extract_tb(error.__traceback__)
        where = f"{frames[-1].filename.rsplit('/', 1)[-1]}:{frames[-1].lineno}"
        return Ending("EXCEPTION", f"{type(error).__name__} in {where}: {str(error)[:200]}")
    return Ending("route")


def _lost(_: Task, reason: str) -> Ending:
    return Ending("ENDED", reason)


def _line(task: Task, ending: Ending) -> str:
    attempt = draw(*task)
    told = ", ".join(f"{key}={value}" for key, value in attempt.settings.items())
    size = attempt.problem.grid.resolution
    what = f"{attempt.planner}, cells of {size:.3g} m, {attempt.problem.costs}, {told}"
    return f"{ending.kind} {task.number} ({what}): {ending.detail}"


def main() -> int:
    """Run the attempts, print each fault, progress and a summary; return the exit code."""
    told = _arguments()
    choice = Choice(
        (told.planner,) if told.planner else all_planners(),
        (told.space,) if told.space else get_args(StateSpace),
        told.refused,
    )
    numbers = range(told.attempts) if told.only is None else [told.only]
    print(f"seed {told.seed}, {len(numbers)} attempts, {told.jobs} processes", flush=True)
    tasks = map(partial(Task, choice, told.seed), numbers)
    ends, most, began = Counter[str](), 0.0, time.perf_counter()
    with closing(
        worker_pool(tasks, tried, jobs=told.jobs, patience=told.patience, lost=_lost)
    ) as results:
        for count, (task, ending) in enumerate(results, start=1):
            ends[ending.kind] += 1
            most = max(most, ending.over)
            if ending.kind in FAULTS or told.only is not None:
                print(_line(task, ending), flush=True)
            if count % EVERY == 0:
                print(f"{count} attempts, {time.perf_counter() - began:.0f} s", flush=True)
    print(f"seed {told.seed}: " + ", ".join(f"{ends[kind]} {kind}" for kind in sorted(ends)))
    faults = ", ".join(f"{ends[kind]} {kind.lower()}" for kind in FAULTS)
    print(f"{ends.total()} attempts: {faults}; at most {most:.2f} s after the limit")
    return 1 if any(ends[kind] for kind in FAULTS) else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--attempts", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--jobs", type=int, default=processors())
    parser.add_argument("--planner", choices=all_planners())
    parser.add_argument("--space", choices=get_args(StateSpace))
    parser.add_argument("--only", type=int, help="number of the one attempt to make")
    parser.add_argument("--patience", type=float, default=PATIENCE, help="for one attempt [s]")
    parser.add_argument("--refused", action="store_true", help="try what is refused, too")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
