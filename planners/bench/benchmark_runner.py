"""A planner on a map, asked one query after another, and what comes of it."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundmap.io.map_images import BlockedMap, BlockedVoxels, grid_of
from groundmap.io.movingai_scen import MovingAIQuery
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.errors import ProblemError, TimeLimitError, UnsolvedError
from planners.geometry.polyline import length_of
from planners.problem.problem import PlanningProblem
from planners.registry import get_planner
from planners.search.astar3d import AStar3D
from planners.search.base import Engine, SearchResult, SearchSettings

ANY_ANGLE = frozenset({"lazy_theta", "polyanya", "theta"})  # planners that may cut short
TOLERANCE = 0.01  # [cells] published lengths carry 2 to 8 decimals


class BenchmarkAnswer(NamedTuple):
    """What a planner made of a query."""

    query: MovingAIQuery
    length: float | None  #: of the route [cells]; None if there was none
    ms: float  #: time that the search took
    agrees: bool  #: with what was published


class BenchmarkRunner:
    """A planner on a map, ready to be asked: the robot is a point, cells are of 1 m.

    Parameters
    ----------
    result : BlockedMap or BlockedVoxels
    planner : str
    """

    def __init__(self, result: BlockedMap | BlockedVoxels, planner: str) -> None:
        settings_class = get_planner(planner).settings
        self.planner, self.settings = planner, settings_class()
        grid = grid_of(result)
        began = time.perf_counter()
        corner = (0.5,) * result.blocked.ndim
        problem = PlanningProblem(grid, start=corner, goal=corner, footprint=0.0, clear_start=False)
        self.engine = self._engine(problem)
        self.setup_ms = 1e3 * (time.perf_counter() - began)

    def ask(self, query: MovingAIQuery) -> BenchmarkAnswer:
        """Return the planner's answer; running out of time, or of ideas, is none."""
        start, goal = (
            tuple(index + 0.5 for index in cell[::-1]) for cell in (query.start, query.goal)
        )
        began = time.perf_counter()
        try:
            result = self.engine.search(start, goal, self.settings)
        except (TimeLimitError, UnsolvedError):
            return BenchmarkAnswer(query, None, 1e3 * (time.perf_counter() - began), agrees=False)
        ms = 1e3 * (time.perf_counter() - began)
        if result is None:
            return BenchmarkAnswer(query, None, ms, agrees=not query.solvable)
        return BenchmarkAnswer(
            query, length_of(result.waypoints), ms, agrees=self._agrees(query, result)
        )

    def _engine(self, problem: PlanningProblem) -> Engine | AStar3D:
        if problem.grid.ndim == 2:
            return get_planner(self.planner).engine(Costmap.of(problem))
        if self.planner != "astar":
            raise ProblemError("planner", "'astar', on voxels", repr(self.planner))
        self.settings = SearchSettings()
        return AStar3D(Voxels.of(problem))

    def _agrees(self, query: MovingAIQuery, result: SearchResult) -> bool:
        """Whether a route is as long as published, or as much longer as its planner grants.

        A planner of any angle may cut short: down to the straight line.
        """
        if result.headings is not None or not query.solvable:
            return False
        length = length_of(result.waypoints)
        if self.planner in ANY_ANGLE:
            shortest, bound = math.dist(query.start, query.goal), 1.0
        elif result.bound is None:
            return False
        else:
            shortest, bound = query.length, result.bound
        return shortest - TOLERANCE <= length <= bound * query.length + TOLERANCE


def figures(answers: list[BenchmarkAnswer]) -> dict[str, Any]:
    """Return how many queries there were, solved and mismatched, and how long they took [ms].

    Examples
    --------
    >>> query = MovingAIQuery(Path("a.map"), (9, 9), (0, 0), (0, 2), 2.0, 2)
    >>> figures([BenchmarkAnswer(query, 2.0, 1.5, True), BenchmarkAnswer(query, None, 0.5, False)])
    {'queries': 2, 'solved': 1, 'unsolvable': 0, 'mismatches': 1, 'median_ms': 1.0, 'p95_ms': 1.45}
    """
    ms = np.array([answer.ms for answer in answers])
    return {
        "queries": len(answers),
        "solved": sum(answer.length is not None for answer in answers),
        "unsolvable": sum(not answer.query.solvable for answer in answers),
        "mismatches": sum(not answer.agrees for answer in answers),
        "median_ms": float(np.median(ms)),
        "p95_ms": float(np.percentile(ms, 95)),
    }


def warm_up(planner: str, dimensions: int) -> None:
    """Have everything compiled, or loaded, that a query takes; the planner must solve a simple one.

    Raises
    ------
    ProblemError
        It turns in curves, grants no bound, or does not get along diagonals as it should.
    """
    free = np.zeros((4,) * dimensions, dtype=np.bool_)
    result: BlockedMap | BlockedVoxels = BlockedVoxels(free, 1.0, (0.0, 0.0, 0.0))
    if dimensions == 2:
        result = BlockedMap(free, free, 1.0, (0.0, 0.0))
    corners = (0,) * dimensions, (3,) * dimensions
    query = MovingAIQuery(Path(), free.shape, *corners, math.dist(*corners), 0)
    runner = BenchmarkRunner(result, planner)
    try:
        agrees = runner.ask(query).agrees
    except ProblemError:  # such as a place without a heading
        agrees = False
    if not agrees:
        expected = "one that moves between cells, or at any angle, up to a bound of the shortest"
        raise ProblemError("planner", expected, repr(planner))
