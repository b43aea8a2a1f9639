"""Theta* and Lazy Theta*: A* whose lines take shortcuts at any angle while it searches."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.problem.problem import Pose
from planners.search.base import SLICE, Clock, SearchResult, SearchSettings, check_uniform
from planners.search.kernels.astar import (
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    SIZE,
    SLICE_DONE,
    TARGET,
)
from planners.search.kernels.theta import advance, parents, seed

FIRST_ROOM = 1 << 14  # heap entries to begin with


class ThetaSettings(SearchSettings):
    """What Theta* can be told."""


class LazyThetaSettings(SearchSettings):
    """What Lazy Theta* can be told."""


class Theta:
    """Theta* (Nash, Daniel, Koenig, Felner 2007): short lines, though not always the shortest.

    Lines turn at cell centres and keep to the squares between the centres of four cells that can
    be stood on, and the straight pieces between two. Every metre has to cost the same.

    Raises
    ------
    ProblemError
        The costmap makes some metres dearer than others.

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

    name: ClassVar[str] = "theta"
    lazy: ClassVar[bool] = False

    def __init__(self, costmap: Costmap) -> None:
        check_uniform(self.name, costmap)
        self.costmap = costmap
        self.costs = np.zeros(costmap.traversable.size)
        self.marks = np.zeros((costmap.traversable.size, 2), dtype=np.int64)
        self.query = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return a short route from start to goal, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x and y [m, map]; what follows is ignored.
        settings : ThetaSettings or LazyThetaSettings

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            return SearchResult(
                waypoints_through(self.costmap, start, goal, np.empty((0, 2), int)), 0
            )
        targets = _in_cells(ends.targets)
        state = self._seed(_in_cells(ends.sources), targets)
        status = SLICE_DONE
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            status = self._advance(targets, state)
        if status == EXHAUSTED:
            return None
        turns = parents(self.marks, int(state[TARGET]))[::-1]
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        waypoints = waypoints_through(self.costmap, start, goal, cells)
        return SearchResult(waypoints, int(state[EXPANDED]), bound=None)

    def _seed(self, sources: Floats, targets: Floats) -> Ints:
        self.query += 1
        state = np.array([0, FAR, -1, 0], dtype=np.int64)
        width = self.costmap.width
        state[SIZE] = seed(sources, targets, width, self.costs, self.marks, self.query, self.heap)
        return state

    def _advance(self, targets: Floats, state: Ints) -> int:
        status = advance(
            self.costmap.moves,
            targets,
            self.lazy,
            self.costs,
            self.marks,
            self.query,
            self.heap,
            state,
            SLICE,
        )
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status


class LazyTheta(Theta):
    """Lazy Theta* (Nash, Koenig, Tovey 2010): looks for a line of sight once per expanded cell."""

    name = "lazy_theta"
    lazy = True


def _in_cells(joined: Ints) -> Floats:
    """Return rows of row, column and cost with the cost as a length in cells."""
    scaled: Floats = joined / np.array([1.0, 1.0, ONE])
    return scaled
