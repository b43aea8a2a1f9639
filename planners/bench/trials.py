"""One sampling planner, one query, one seed: what comes of it, and when."""

from __future__ import annotations

import time
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.io.map_images import BlockedMap, BlockedVoxels, grid_of
from planners.bench.benchmark_problems import WORKLOADS, Case, Cases, rectangle
from planners.bench.maps import cases_on
from planners.errors import AuditError, NoRouteError
from planners.planning import plan
from planners.problem.problem import PlanningProblem
from planners.route.shortcut import shortcut
from planners.sampling.settings import StateSpace
from planners.search.base import Improvement


class Workload(NamedTuple):
    """Where a query is: one of `WORKLOADS` by name, or a map with what drives there."""

    name: str
    map_file: Path | None = None
    footprint: float | tuple[tuple[float, ...], ...] = 0.0
    turning_radius: float = 1.0

    def cases(self) -> Cases:
        """Return its queries, made once in a process."""
        return _cases(self)


@cache
def _cases(work: Workload) -> Cases:
    if work.map_file is None:
        return WORKLOADS[work.name]()
    return cases_on(work.map_file, work.footprint, turning_radius=work.turning_radius)


class Trial(NamedTuple):
    """What is tried: a planner in a space, with one seed."""

    work: Workload
    space: StateSpace
    planner: str
    seed: int
    time_limit: float  #: [s]
    improve_for: float  #: [s], of planners that go on to better their route


class Attempt(NamedTuple):
    """What came of a trial."""

    seconds: float  #: until there was an answer, the costmap included [s]
    betters: tuple[tuple[float, float], ...] = ()  #: (seconds, cost) of each better route
    reason: str = ""  #: why there is no route

    @property
    def solved(self) -> bool:
        """Whether it brought a route."""
        return not self.reason

    @property
    def first(self) -> float:
        """When there was a route, as OMPL found it [s]."""
        return self.betters[0][0]

    @property
    def cost(self) -> float:
        """Cost of the route that was handed out."""
        return self.betters[-1][1]


def make_attempt(trial: Trial) -> Attempt:
    """Return what comes of a trial; what it needs is made and compiled before its time begins."""
    case = trial.work.cases()[trial.space]
    _warm_up(trial.planner, trial.space)
    return run_once(
        case,
        trial.planner,
        trial.space,
        seed=trial.seed,
        time_limit=trial.time_limit,
        improve_for=trial.improve_for,
    )


def run_once(
    case: Case, planner: str, space: StateSpace, *, seed: int, time_limit: float, improve_for: float
) -> Attempt:
    """Plan once, and note each betterment as it comes."""
    betters: list[tuple[float, float]] = []
    began = time.perf_counter()

    def note(better: Improvement) -> None:
        betters.append((time.perf_counter() - began, better.cost))

    try:
        plan(
            case.problem,
            planner,
            on_improved=note,
            space=space,
            seed=seed,
            time_limit=time_limit,
            improve_for=improve_for,
            **case.settings,
        )
    except (NoRouteError, AuditError) as error:
        reason = f"{type(error).__name__}: {error}"
        return Attempt(time.perf_counter() - began, reason=reason)
    return Attempt(time.perf_counter() - began, tuple(betters))


def lost_attempt(trial: Trial, reason: str) -> Attempt:
    """Return what comes of a trial whose process ended."""
    return Attempt(trial.time_limit, reason=reason)


def shortest(case: Case) -> float | None:
    """Return the length of the shortest route in "r2", as far as other planners know [m].

    `polyanya` keeps to lines over free blocks of cells; pulled tight, its route keeps the disc's
    exact distance. None where it finds no way.
    """
    try:
        route = plan(case.problem, "polyanya")
    except NoRouteError:
        return None
    return min(route.length, shortcut(case.problem, route).length)


@cache
def _warm_up(planner: str, space: StateSpace) -> None:
    """Have all compiled and loaded that a planner needs in a space, once in a process."""
    free = np.zeros((18, 18) if space != "r3" else (18, 18, 18), dtype=np.bool_)
    if space == "r3":
        grid = grid_of(BlockedVoxels(free, 0.5, (0.0, 0.0, 0.0)))
        problem = PlanningProblem(grid, start=(2, 2, 2), goal=(7, 5, 3), footprint=0.5)
    else:
        grid, cart = grid_of(BlockedMap(free, free, 0.5, (0.0, 0.0))), rectangle(0.3, 0.7, 0.6)
        problem = PlanningProblem(grid, start=(2, 2, 0), goal=(7, 5, 0), footprint=cart)
    run_once(Case(problem, {}), planner, space, seed=0, time_limit=2.0, improve_for=0.1)
