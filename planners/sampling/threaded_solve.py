"""Planners that run threads of their own: PRM and PRM*.

No exception may pass through these threads, and they must not be asked whether to stop while they
wait for the interpreter. So OMPL's own clock stops them, time and again, in a thread that signals
don't reach.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any

from planners.sampling.task import Task

EXACT = "EXACT_SOLUTION"
SLICE = 0.05  # [s] they are stopped that often, to look whether to


def solve_in_slices(planner: Any, definition: Any, task: Task, errors: list[BaseException]) -> str:
    """Run a planner until it ends or is to; return the name of its status.

    Parameters
    ----------
    planner, definition
        OMPL's planner, and its problem.
    task : Task
    errors : list of exceptions
        Of what the planner calls back, by `collect_errors`: the first ends the search, and is
        raised.
    """
    stopped, busy, ending = threading.Event(), threading.Lock(), Future[str]()
    costs: list[float] = []

    def solved() -> str:
        status = ""
        while not (stopped.is_set() or errors):
            status = str(planner.solve(SLICE).getStatus().name)
            if status == EXACT:
                costs.append(task.objective.scale * float(definition.getSolutionPath().length()))
            if (costs and task.name == "prm") or task.clock.is_up:
                break
        return EXACT if costs else status  # the last slice may have been too short to look

    def work() -> None:
        with busy:
            try:
                ending.set_result(solved())
            except BaseException as error:  # it is raised where it is waited for
                ending.set_exception(error)

    def tell() -> None:
        for cost in costs:
            task.reporter.report(cost)

    try:
        threading.Thread(target=work).start()
        while not wait([ending], timeout=SLICE).done:  # a wait without end hears no signal
            tell()
            if task.reporter.enough or task.reporter.has_had(task.settings.improve_for):
                stopped.set()
        tell()
        status = ending.result()
    finally:
        # A pool forgets a thread at whose start it is interrupted. This one has ended when `busy`
        # is free, or has not begun to search and won't.
        stopped.set()
        with busy:
            pass
    if errors:
        raise errors[0]
    return status


def collect_errors(check: Callable[..., bool], errors: list[BaseException]) -> Callable[..., bool]:
    """Return a check that says no instead of raising, and keeps what it would have raised."""

    def guard(*args: Any) -> bool:
        try:
            return check(*args)
        except BaseException as error:
            errors.append(error)
            return False

    return guard
