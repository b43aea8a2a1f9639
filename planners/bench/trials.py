"""Run one sampling planner on one query with one seed, and record its costs over time."""

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
    """One of `WORKLOADS` by name, or a map with the footprint that moves on it."""

    name: str
    map_file: Path | None = None
    footprint: float | tuple[tuple[float, ...], ...] = 0.0
    turning_radius: float = 1.0

    def cases(self) -> Cases:
        """Return the queries; they are built once per process."""
        return _cases(self)


@cache
def _cases(work: Workload) -> Cases:
    if work.map_file is None:
        return WORKLOADS[work.name]()
    return cases_on(work.map_file, work.footprint, turning_radius=work.turning_radius)


class Trial(NamedTuple):
    """A planner in a state space with one seed."""

    work: Workload
    space: StateSpace
    planner: str
    seed: int
    time_limit: float  #: [s]
    improve_for: float  #: [s], time to keep improving after the first route


class Attempt(NamedTuple):
    """Result of a trial."""

    seconds: float  #: total time, the costmap included [s]
    improvements: tuple[tuple[float, float], ...] = ()  #: (seconds, cost) of each better route
    reason: str = ""  #: why there is no route

    @property
    def solved(self) -> bool:
        """Whether there is a route."""
        return not self.reason

    @property
    def first(self) -> float:
        """Time of OMPL's first route [s]."""
        return self.improvements[0][0]

    @property
    def cost(self) -> float:
        """Cost of the returned route."""
        return self.improvements[-1][1]


def make_attempt(trial: Trial) -> Attempt:
    """Return the result of a trial; its time excludes compilation and building the map."""
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
    """Plan once, and record time and cost of each improvement.

    Parameters
    ----------
    case : Case
    planner : str
    space : StateSpace
    seed : int
    time_limit : float [s]
    improve_for : float [s]
        Time to keep improving after the first route.
    """
    improvements: list[tuple[float, float]] = []
    began = time.perf_counter()

    def record(improvement: Improvement) -> None:
        improvements.append((time.perf_counter() - began, improvement.cost))

    try:
        plan(
            case.problem,
            planner,
            on_improved=record,
            space=space,
            seed=seed,
            time_limit=time_limit,
            improve_for=improve_for,
            **case.settings,
        )
    except (NoRouteError, AuditError) as error:
        reason = f"{type(error).__name__}: {error}"
        return Attempt(time.perf_counter() - began, reason=reason)
    return Attempt(time.perf_counter() - began, tuple(improvements))


def lost_attempt(trial: Trial, reason: str) -> Attempt:
    """Return the result of a trial whose process ended.

    Parameters
    ----------
    trial : Trial
    reason : str
    """
    return Attempt(trial.time_limit, reason=reason)


def shortest(case: Case) -> float | None:
    """Return the length of the shortest known route in "r2" [m], None without a route.

    It is the length of the route of `polyanya`, or of its shortcut, which can pass obstacles at
    the exact radius of the disc.
    """
    try:
        route = plan(case.problem, "polyanya")
    except NoRouteError:
        return None
    return min(route.length, shortcut(case.problem, route).length)


@cache
def _warm_up(planner: str, space: StateSpace) -> None:
    """Plan a simple problem, once per process, so that everything is compiled and loaded."""
    free = np.zeros((18, 18) if space != "r3" else (18, 18, 18), dtype=np.bool_)
    if space == "r3":
        grid = grid_of(BlockedVoxels(free, 0.5, (0.0, 0.0, 0.0)))
        problem = PlanningProblem(grid, start=(2, 2, 2), goal=(7, 5, 3), footprint=0.5)
    else:
        grid, cart = grid_of(BlockedMap(free, free, 0.5, (0.0, 0.0))), rectangle(0.3, 0.7, 0.6)
        problem = PlanningProblem(grid, start=(2, 2, 0), goal=(7, 5, 0), footprint=cart)
    run_once(Case(problem, {}), planner, space, seed=0, time_limit=2.0, improve_for=0.1)
