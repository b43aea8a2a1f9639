"""The clock of a search: it counts from the call, and stands still while kernels are compiled."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from numba import njit

from oracles_planning import free_field, grid_of
from planners import OWN_PLANNERS, PlanningProblem, TimeLimitError, plan
from planners.costmap.costmap import Costmap
from planners.sampling.ompl_states import MAX_CALLS, POLL_INTERVAL, PollSchedule
from planners.search.base import Clock, now
from planners.search.kernels.compiling import compiled_for


def test_compilation_takes_no_time_on_the_clock() -> None:
    @njit
    def inner(values: Any) -> Any:
        return np.sort(values) + values.sum()

    @njit
    def outer(values: Any) -> Any:
        return inner(values)[::-1]

    clock = Clock("astar", None)
    before, began = compiled_for(), time.perf_counter()
    outer(np.arange(3.0))
    wall, compiled = time.perf_counter() - began, compiled_for() - before
    assert 0.5 * wall < compiled <= wall  # not twice, though one kernel compiles the other
    assert clock.seconds < wall


def test_the_clock_goes_on_beside_compilation() -> None:
    before = now()
    while now() == before:  # a clock that stands still never ends this
        pass
    assert now() > before


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))
def test_the_time_limit_counts_from_the_call(planner: str, monkeypatch: pytest.MonkeyPatch) -> None:
    seconds = [0.0]
    for module in ("search.base", "route.solve", "planning"):
        monkeypatch.setattr(f"planners.{module}.now", lambda: seconds[0])
    made = Costmap.of

    def slowly(problem: PlanningProblem) -> Costmap:
        seconds[0] += 5.0
        return made(problem)

    grid = grid_of(free_field(16, 16))
    asked = PlanningProblem(grid, start=(3, 3, 0), goal=(9, 9, 0), footprint=0.5)
    monkeypatch.setattr(Costmap, "of", slowly)
    with pytest.raises(TimeLimitError, match=r"no route within time_limit = 4 s \(0 nodes"):
        plan(asked, planner, time_limit=4.0)
    assert plan(asked, planner, time_limit=6.0).audit == "clean"


@pytest.mark.parametrize(("slow", "calls_between"), [(10.0 * POLL_INTERVAL, 1), (0.0, MAX_CALLS)])
def test_slower_calls_are_fewer_between_two_polls(
    slow: float, calls_between: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    moments, polls = [0.0], []
    monkeypatch.setattr("planners.sampling.ompl_states.time.perf_counter", lambda: moments[0])
    schedule = PollSchedule(lambda: polls.append(schedule.due - schedule.step))
    for call in range(1, 5000):
        moments[0] += slow
        if call >= schedule.due:
            schedule(call)
    assert polls[-1] - polls[-2] == calls_between
