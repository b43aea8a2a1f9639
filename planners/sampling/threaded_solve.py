"""Runs planners that start threads of their own: PRM and PRM*.

No exception may pass through these threads, and their termination condition must not call Python,
which would wait for the interpreter lock. OMPL's own clock therefore stops them in short slices, in
a thread that no signal interrupts.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any

from planners.sampling.task import Task

EXACT = "EXACT_SOLUTION"
SLICE = 0.05  # [s] of search between two checks whether to stop


def solve_in_slices(planner: Any, definition: Any, task: Task, errors: list[BaseException]) -> str:
    """Run a planner until it ends or has to stop; return the name of its status.

    Parameters
    ----------
    planner, definition : object
        OMPL's planner and problem definition.
    task : Task
    errors : list of exceptions
        Errors of the planner's callbacks, as `collect_errors` adds them: the first one ends the
        search and is raised.
    """
    stopped, busy, result = threading.Event(), threading.Lock(), Future[str]()
    costs: list[float] = []

    def solve() -> str:
        status = ""
        while not (stopped.is_set() or errors):
            status = str(planner.solve(SLICE).getStatus().name)
            if status == EXACT:
                costs.append(task.objective.scale * float(definition.getSolutionPath().length()))
            if (costs and task.name == "prm") or task.clock.is_up:
                break
        return EXACT if costs else status  # the last slice may end before it returns the solution

    def work() -> None:
        with busy:
            try:
                result.set_result(solve())
            except BaseException as error:  # the waiting thread raises it
                result.set_exception(error)

    def report() -> None:
        for cost in costs:
            task.reporter.report(cost)

    try:
        threading.Thread(target=work).start()
        while not wait([result], timeout=SLICE).done:  # a wait without timeout blocks signals
            report()
            improve_for = task.settings.improve_for
            if task.reporter.should_stop or task.reporter.has_improved_for(improve_for):
                stopped.set()
        report()
        status = result.result()
    finally:
        # A thread pool may lose a thread if an interrupt arrives while it starts. Once `busy` is
        # free, this thread has either ended, or sees `stopped` before it searches.
        stopped.set()
        with busy:
            pass
    if errors:
        raise errors[0]
    return status


def collect_errors(check: Callable[..., bool], errors: list[BaseException]) -> Callable[..., bool]:
    """Return a check that returns False instead of raising an error.

    Parameters
    ----------
    check : callable
    errors : list of exceptions
        Receives the errors.
    """

    def guarded(*args: Any) -> bool:
        try:
            return check(*args)
        except BaseException as error:
            errors.append(error)
            return False

    return guarded
