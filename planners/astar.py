"""A*: the shortest route over the moves between neighbouring cells."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from pydantic import Field

from groundmap.arrays import Floats, Ints
from groundmap.settings import Settings
from planners.costmap import Costmap
from planners.errors import Point, TimeLimitError
from planners.kernels.astar import (
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    MARK,
    ONE,
    ROOT,
    SIZE,
    TARGET,
    advance,
    estimate,
    trace,
)
from planners.kernels.heap import push
from planners.links import Links, is_clear, links
from planners.polyline import merged

SLICE = 100_000  # expansions between two looks at the clock: about 20 ms
FIRST_ROOM = 1 << 14  # heap entries to begin with


class AStarSettings(Settings):
    """What A* can be told."""

    time_limit: float | None = Field(30.0, ge=0, description="search time [s]; none: no limit")


class Found(NamedTuple):
    """What a planner brings back."""

    waypoints: Floats  #: shape (n, 2) [m, map], start and goal included
    expanded: int  #: nodes the search expanded


def astar(costmap: Costmap, settings: AStarSettings) -> Found | None:
    """Return the shortest route, or None if there is none.

    Shortest means: over orthogonal and diagonal moves between cell centres, with start and goal
    joined to the centres around them by straight pieces.

    Raises
    ------
    TimeLimitError
    """
    problem = costmap.problem
    return AStar(costmap).search(problem.start_xy, problem.goal_xy, settings)


class AStar:
    """The searches of one costmap: arrays are allocated once, and never cleared."""

    def __init__(self, costmap: Costmap) -> None:
        cells = costmap.blocked.size
        self.costmap = costmap
        self.moves = costmap.moves.ravel()
        self.labels = np.zeros((cells, 2), dtype=np.int64)
        self.query = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)

    def search(self, start: Point, goal: Point, settings: AStarSettings) -> Found | None:
        """Return the shortest route from start to goal [m, map], or None if there is none.

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        began = time.perf_counter()
        limit = settings.time_limit
        radius = self.costmap.problem.footprint
        if limit != 0 and is_clear(self.costmap, *self._in_cells(start, goal), radius=radius):
            return Found(merged(np.array([start, goal])), 0)
        targets = self._targets(links(self.costmap, goal, radius=radius))
        state = self._seed(links(self.costmap, start, radius=radius), targets)
        status = -1
        while status not in (FOUND, EXHAUSTED):
            if limit is not None and time.perf_counter() - began >= limit:
                raise TimeLimitError("astar", time_limit=limit, expanded=int(state[EXPANDED]))
            status = self._advance(targets, state)
        if status == EXHAUSTED:
            return None
        return Found(self._waypoints(start, goal, int(state[TARGET])), int(state[EXPANDED]))

    def _in_cells(self, start: Point, goal: Point) -> tuple[Point, Point]:
        (ax, ay), (bx, by) = self.costmap.to_cells([start, goal]).tolist()
        return (ax, ay), (bx, by)

    def _costs(self, lengths: Floats) -> Ints:
        scaled: Ints = np.rint(lengths / self.costmap.window.resolution * ONE).astype(np.int64)
        return scaled

    def _targets(self, joined: Links) -> Ints:
        return np.column_stack([joined.cells, self._costs(joined.lengths)])

    def _seed(self, joined: Links, targets: Ints) -> Ints:
        """Begin a query: put the sources on an empty heap."""
        self.query += 1
        state = np.array([0, FAR, -1, 0], dtype=np.int64)
        if len(targets) == 0:
            return state
        for (row, col), cost in zip(joined.cells, self._costs(joined.lengths), strict=True):
            node = row * self.costmap.width + col
            self.labels[node] = cost, MARK * self.query + ROOT
            h = estimate(row, col, targets)
            state[SIZE] = push(self.heap, state[SIZE], cost + h, h, node)
        return state

    def _advance(self, targets: Ints, state: Ints) -> int:
        status = advance(
            self.moves,
            self.costmap.width,
            targets,
            self.labels,
            self.query,
            self.heap,
            state,
            SLICE,
        )
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status

    def _waypoints(self, start: Point, goal: Point, last: int) -> Floats:
        turns = trace(self.labels, self.costmap.width, last)[::-1]
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        centres = self.costmap.window.cell_to_world(cells)
        return merged(np.concatenate([[start], centres, [goal]]))
