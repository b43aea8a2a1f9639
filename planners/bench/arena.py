"""A planner on a map, asked one query after another, and what comes of it."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundmap.io.map_images import BlockedMap, BlockedVoxels, grid_of
from groundmap.io.movingai_scen import MovingAIQuery
from planners.astar3d import AStar3D
from planners.costmap import Costmap
from planners.engine import Engine, Found, SearchSettings
from planners.errors import ProblemError, TimeLimitError, UnsolvedError
from planners.polyline import length_of
from planners.problem import PlanningProblem
from planners.registry import named
from planners.voxels import Voxels

ANY_ANGLE = frozenset({"lazy_theta", "polyanya", "theta"})  # planners that may cut short
TOLERANCE = 0.01  # [cells] published lengths carry 2 to 8 decimals


class Answer(NamedTuple):
    """What a planner made of a query."""

    query: MovingAIQuery
    length: float | None  #: of the route [cells]; None if there was none
    ms: float  #: time that the search took
    agrees: bool  #: with what was published


class Arena:
    """A planner on a map, ready to be asked: the robot is a point, cells are of 1 m.

    Parameters
    ----------
    found : BlockedMap or BlockedVoxels
    planner : str
    """

    def __init__(self, found: BlockedMap | BlockedVoxels, planner: str) -> None:
        settings_class = named(planner).settings
        self.planner, self.settings = planner, settings_class()
        grid = grid_of(found)
        began = time.perf_counter()
        corner = (0.5,) * found.blocked.ndim
        problem = PlanningProblem(grid, start=corner, goal=corner, footprint=0.0, clear_start=False)
        self.engine = self._engine(problem)
        self.setup_ms = 1e3 * (time.perf_counter() - began)

    def ask(self, query: MovingAIQuery) -> Answer:
        """Return the planner's answer; running out of time, or of ideas, is none."""
        start, goal = (
            tuple(index + 0.5 for index in cell[::-1]) for cell in (query.start, query.goal)
        )
        began = time.perf_counter()
        try:
            found = self.engine.search(start, goal, self.settings)
        except (TimeLimitError, UnsolvedError):
            return Answer(query, None, 1e3 * (time.perf_counter() - began), agrees=False)
        ms = 1e3 * (time.perf_counter() - began)
        if found is None:
            return Answer(query, None, ms, agrees=not query.solvable)
        return Answer(query, length_of(found.waypoints), ms, agrees=self._agrees(query, found))

    def _engine(self, problem: PlanningProblem) -> Engine | AStar3D:
        if problem.grid.ndim == 2:
            return named(self.planner).engine(Costmap.of(problem))
        if self.planner != "astar":
            raise ProblemError("planner", "'astar', on voxels", repr(self.planner))
        self.settings = SearchSettings()
        return AStar3D(Voxels.of(problem))

    def _agrees(self, query: MovingAIQuery, found: Found) -> bool:
        """Whether a route is as long as published, or as much longer as its planner grants.

        A planner of any angle may cut short: down to the straight line.
        """
        if found.headings is not None or not query.solvable:
            return False
        length = length_of(found.waypoints)
        if self.planner in ANY_ANGLE:
            shortest, bound = math.dist(query.start, query.goal), 1.0
        elif found.bound is None:
            return False
        else:
            shortest, bound = query.length, found.bound
        return shortest - TOLERANCE <= length <= bound * query.length + TOLERANCE


def figures(answers: list[Answer]) -> dict[str, Any]:
    """Return how many queries there were, solved and mismatched, and how long they took [ms].

    Examples
    --------
    >>> query = MovingAIQuery(Path("a.map"), (9, 9), (0, 0), (0, 2), 2.0, 2)
    >>> figures([Answer(query, 2.0, 1.5, True), Answer(query, None, 0.5, False)])
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
    found: BlockedMap | BlockedVoxels = BlockedVoxels(free, 1.0, (0.0, 0.0, 0.0))
    if dimensions == 2:
        found = BlockedMap(free, free, 1.0, (0.0, 0.0))
    corners = (0,) * dimensions, (3,) * dimensions
    query = MovingAIQuery(Path(), free.shape, *corners, math.dist(*corners), 0)
    arena = Arena(found, planner)
    try:
        agrees = arena.ask(query).agrees
    except ProblemError:  # such as a place without a heading
        agrees = False
    if not agrees:
        expected = "one that moves between cells, or at any angle, up to a bound of the shortest"
        raise ProblemError("planner", expected, repr(planner))
