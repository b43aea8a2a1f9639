"""One planner on one map: answers to queries, compared with published lengths."""

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

ANY_ANGLE = frozenset({"lazy_theta", "polyanya", "theta"})  # their routes can be shorter
TOLERANCE = 0.01  # [cells] published lengths have 2 to 8 decimals


class BenchmarkAnswer(NamedTuple):
    """Answer of a planner to a query."""

    query: MovingAIQuery
    length: float | None  #: length of the route [cells]; None without a route
    ms: float  #: search time
    agrees: bool  #: whether it agrees with the published length


class BenchmarkRunner:
    """A planner on a map; the robot is a point and a cell is 1 m wide.

    Parameters
    ----------
    blocked_map : BlockedMap or BlockedVoxels
    planner : str
    """

    def __init__(self, blocked_map: BlockedMap | BlockedVoxels, planner: str) -> None:
        settings_class = get_planner(planner).settings
        self.planner, self.settings = planner, settings_class()
        grid = grid_of(blocked_map)
        began = time.perf_counter()
        corner = (0.5,) * blocked_map.blocked.ndim
        problem = PlanningProblem(grid, start=corner, goal=corner, footprint=0.0, clear_start=False)
        self.engine = self._engine(problem)
        self.setup_ms = 1e3 * (time.perf_counter() - began)

    def run(self, query: MovingAIQuery) -> BenchmarkAnswer:
        """Return the answer of the planner; without a route where it reaches a limit."""
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
        """Whether the length is the published one, times at most the bound of the planner.

        Any-angle routes can be shorter than published, but not shorter than the straight line.
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
    """Return the counts of queries, solutions and mismatches, and search times [ms].

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
    """Solve a query along a diagonal, so that everything is compiled and loaded.

    Parameters
    ----------
    planner : str
    dimensions : 2 or 3

    Raises
    ------
    ProblemError
        The length is wrong or not comparable: the planner drives curves or has no bound.
    """
    free = np.zeros((4,) * dimensions, dtype=np.bool_)
    blocked_map: BlockedMap | BlockedVoxels = BlockedVoxels(free, 1.0, (0.0, 0.0, 0.0))
    if dimensions == 2:
        blocked_map = BlockedMap(free, free, 1.0, (0.0, 0.0))
    corners = (0,) * dimensions, (3,) * dimensions
    query = MovingAIQuery(Path(), free.shape, *corners, math.dist(*corners), 0)
    runner = BenchmarkRunner(blocked_map, planner)
    try:
        agrees = runner.run(query).agrees
    except ProblemError:  # such as a missing heading
        agrees = False
    if not agrees:
        expected = "one that moves between cells, or at any angle, up to a bound of the shortest"
        raise ProblemError("planner", expected, repr(planner))
