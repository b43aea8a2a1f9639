"""A*, and what differs from it by a weight: Dijkstra's search and weighted A*."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from groundmap.arrays import Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.search.base import SLICE, Clock, SearchResult, SearchSettings
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    MARK,
    ROOT,
    SIZE,
    TARGET,
    UNIT,
    advance,
    estimate,
    inflate,
    trace,
)
from planners.search.kernels.heap import push

FIRST_ROOM = 1 << 14  # heap entries to begin with


class AStarSettings(SearchSettings):
    """What A* can be told."""


class DijkstraSettings(SearchSettings):
    """What Dijkstra's search can be told."""


class WeightedAStarSettings(SearchSettings):
    """What weighted A* can be told."""

    weight: float = Field(
        1.5, ge=1, le=10, description="a route costs at most this many times the least"
    )


class AStar:
    """A* over orthogonal and diagonal moves between cell centres (Hart, Nilsson, Raphael 1968).

    Start and goal are joined to the centres around them by straight pieces. Arrays are allocated
    once, and never cleared.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(5.5, 5.5), goal=(9.5, 8.5), footprint=2.0)
    >>> astar = AStar(Costmap.of(problem))
    >>> astar.search(problem.start, problem.goal, AStarSettings()).waypoints.tolist()
    [[5.5, 5.5], [8.5, 8.5], [9.5, 8.5]]
    """

    name: ClassVar[str] = "astar"

    def __init__(self, costmap: Costmap) -> None:
        cells = costmap.blocked.size
        self.costmap = costmap
        self.moves, self.costs = costmap.moves.ravel(), costmap.costs.ravel()
        self.labels = np.zeros((cells, 2), dtype=np.int64)
        self.query = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)

    def weight(self, settings: SearchSettings) -> float:
        """Return how much more than itself the estimate counts."""
        return 1.0

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return the route of least cost from start to goal, or None if there is none.

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        weight = self.weight(settings)
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            return SearchResult(
                waypoints_through(self.costmap, start, goal, np.empty((0, 2), int)), 0
            )
        scaled = round(weight * UNIT)
        state = self._seed(ends.sources, ends.targets, scaled)
        status = -1
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            status = self._advance(ends.targets, scaled, state)
        if status == EXHAUSTED:
            return None
        turns = trace(self.labels, self.costmap.width, int(state[TARGET]))[::-1]
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        waypoints = waypoints_through(self.costmap, start, goal, cells)
        cost = float(state[BEST]) / ONE * self.costmap.window.resolution
        # Where all metres are alike, the line's own length: merging end pieces may shorten it.
        cost = length_of(waypoints) if self.costmap.uniform else cost
        return SearchResult(waypoints, int(state[EXPANDED]), bound=max(weight, 1.0), cost=cost)

    def _seed(self, sources: Ints, targets: Ints, weight: int) -> Ints:
        """Begin a query: put the sources on an empty heap."""
        self.query += 1
        state = np.array([0, FAR, -1, 0], dtype=np.int64)
        for row, col, cost in sources.tolist():
            node = row * self.costmap.width + col
            self.labels[node] = cost, MARK * self.query + ROOT
            h = inflate(estimate(row, col, targets), weight)
            state[SIZE] = push(self.heap, state[SIZE], cost + h, h, node)
        return state

    def _advance(self, targets: Ints, weight: int, state: Ints) -> int:
        status = advance(
            self.moves,
            self.costs,
            self.costmap.steps,
            self.costmap.width,
            targets,
            weight,
            self.labels,
            self.query,
            self.heap,
            state,
            SLICE,
        )
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status


class Dijkstra(AStar):
    """Dijkstra's search: A* without an estimate, to compare with."""

    name = "dijkstra"

    def weight(self, settings: SearchSettings) -> float:
        """Return 0: the estimate doesn't count."""
        return 0.0


class WeightedAStar(AStar):
    """Weighted A* (Pohl 1970): faster, for a route that costs at most `weight` times the least."""

    name = "weighted_astar"

    def weight(self, settings: SearchSettings) -> float:
        """Return the weight that was asked for, up to 1/256."""
        assert isinstance(settings, WeightedAStarSettings)
        return math.floor(settings.weight * UNIT) / UNIT
