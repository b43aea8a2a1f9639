"""A*, and two searches that differ from it by a weight: Dijkstra's and weighted A*."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import Field

from groundmap.arrays import Ints
from planners.costmap.costmap import Costmap
from planners.search.base import SearchSettings
from planners.search.grid_search import CostmapSearch, GridQuery, kernel_arrays
from planners.search.kernels.astar import FAR, MARK, ROOT, TARGET, UNIT, advance, seed, trace


class AStarSettings(SearchSettings):
    """Settings of A*."""


class DijkstraSettings(SearchSettings):
    """Settings of Dijkstra's search."""


class WeightedAStarSettings(SearchSettings):
    """Settings of weighted A*."""

    weight: float = Field(
        1.5, ge=1, le=10, description="a route costs at most this many times the least"
    )


class AStar(CostmapSearch):
    """A* over orthogonal and diagonal moves between cell centres (Hart, Nilsson, Raphael 1968).

    Start and goal are joined to the centres around them by straight pieces.

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

    name = "astar"

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        self.arrays = kernel_arrays(costmap)
        self.labels = np.zeros((costmap.blocked.size, 2), dtype=np.int64)
        self.queries = 0

    def weight(self, settings: SearchSettings) -> float:
        """Return the factor by which the estimate is multiplied."""
        return 1.0

    def _bound(self, settings: Any) -> float:
        return max(self.weight(settings), 1.0)

    def _seed(self, query: GridQuery) -> None:
        self.queries += 1
        mark, weight = MARK * self.queries + ROOT, round(self.weight(query.settings) * UNIT)
        width = self.costmap.width
        size = seed(*query.ends[:2], weight, width, mark, self.labels, self.heap)
        self.state = np.array([size, FAR, -1, 0], dtype=np.int64)

    def _advance(self, query: GridQuery) -> int:
        return advance(
            *self.arrays,
            query.ends.targets,
            round(self.weight(query.settings) * UNIT),
            self.labels,
            self.queries,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _trace(self) -> Ints:
        return self._cells(trace(self.labels, self.costmap.width, int(self.state[TARGET]))[::-1])


class Dijkstra(AStar):
    """Dijkstra's search: A* without an estimate, for comparison."""

    name = "dijkstra"

    def weight(self, settings: SearchSettings) -> float:
        """Return 0: no estimate is used."""
        return 0.0


class WeightedAStar(AStar):
    """Weighted A* (Pohl 1970): faster, for a route that costs at most `weight` times the least."""

    name = "weighted_astar"

    def weight(self, settings: SearchSettings) -> float:
        """Return the weight of the settings, rounded down to a multiple of 1/256."""
        assert isinstance(settings, WeightedAStarSettings)
        return math.floor(settings.weight * UNIT) / UNIT
