"""Theta* and Lazy Theta*: A* whose lines take shortcuts at any angle during the search."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import ONE
from planners.search.base import SearchSettings
from planners.search.grid_search import CostmapSearch, GridQuery
from planners.search.kernels.astar import FAR, TARGET
from planners.search.kernels.theta import advance, parents, seed


class ThetaSettings(SearchSettings):
    """Settings of Theta*."""


class LazyThetaSettings(SearchSettings):
    """Settings of Lazy Theta*."""


class Theta(CostmapSearch):
    """Theta* (Nash, Daniel, Koenig, Felner 2007): short lines, though not always the shortest.

    Lines turn at cell centres. They stay in the squares between the centres of four traversable
    cells, and on the straight pieces between two. Costs must be uniform.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(5.5, 5.5), goal=(29.5, 12.5), footprint=2.0)
    >>> theta = Theta(Costmap.of(problem))
    >>> theta.search(problem.start, problem.goal, ThetaSettings()).waypoints.tolist()
    [[5.5, 5.5], [29.5, 12.5]]
    """

    name = "theta"
    needs_uniform = True
    lazy: ClassVar[bool] = False

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        self.costs = np.zeros(costmap.traversable.size)
        self.marks = np.zeros((costmap.traversable.size, 2), dtype=np.int64)
        self.queries = 0

    def _bound(self, settings: Any) -> None:
        return None

    def _seed(self, query: GridQuery) -> None:
        self.queries += 1
        size = seed(
            _in_cells(query.ends.sources),
            _in_cells(query.ends.targets),
            self.costmap.width,
            self.costs,
            self.marks,
            self.queries,
            self.heap,
        )
        self.state = np.array([size, FAR, -1, 0], dtype=np.int64)

    def _advance(self, query: GridQuery) -> int:
        return advance(
            self.costmap.moves,
            _in_cells(query.ends.targets),
            self.lazy,
            self.costs,
            self.marks,
            self.queries,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _trace(self) -> Ints:
        return self._cells(parents(self.marks, int(self.state[TARGET]))[::-1])


class LazyTheta(Theta):
    """Lazy Theta* (Nash, Koenig, Tovey 2010): checks the line of sight once per expanded cell."""

    name = "lazy_theta"
    lazy = True


def _in_cells(joined: Ints) -> Floats:
    """Return rows of row, column and cost with the cost as a length in cells."""
    scaled: Floats = joined / np.array([1.0, 1.0, ONE])
    return scaled
