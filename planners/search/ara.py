"""ARA*: a route soon, better ones while time remains, and how far from the best each may be."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from pydantic import Field

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import Ends, ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.search.base import (
    SLICE,
    Cancel,
    Clock,
    Improvement,
    OnImproved,
    SearchResult,
    SearchSettings,
)
from planners.search.kernels.ara import (
    DONE,
    HEAP_FULL,
    SLICE_DONE,
    WAITS,
    advance,
    least_total,
    reopen,
    settle,
)
from planners.search.kernels.astar import BEST, EXPANDED, FAR, MARK, ROOT, SIZE, TARGET, UNIT, trace

FIRST_ROOM = 1 << 14  # heap entries to begin with


class ARASettings(SearchSettings):
    """What ARA* can be told."""

    first_weight: float = Field(
        3.0, ge=1, le=10, description="the first route costs at most this many times the least"
    )
    step: float = Field(
        0.5, ge=0.01, le=10, description="how far below the bound reached the next weight lies"
    )
    final_bound: float = Field(
        1.0, ge=1, le=10, description="stop when a route costs at most this many times the least"
    )


class ARA:
    """Anytime repairing A* (Likhachev, Gordon, Thrun 2003).

    Weighted A* again and again with falling weights. An iteration expands no cell twice: cells
    that it reaches at a lower cost after they were expanded wait for the next, which begins with
    these and with all that was waiting anyway; nothing is searched from scratch.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> grid.fuse(np.array([9, 20]), np.full((40, 9), 1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(9.5, 30.5), goal=(50.5, 30.5), footprint=2.0)
    >>> ara = ARA(Costmap.of(problem))
    >>> costs = []
    >>> found = ara.search(problem.start, problem.goal, ARASettings(),
    ...                    on_improved=lambda better: costs.append(round(better.cost, 2)))
    >>> found.bound, costs == sorted(costs, reverse=True), costs[-1] == round(found.cost, 2)
    (1.0, True, True)
    """

    name: ClassVar[str] = "ara"

    def __init__(self, costmap: Costmap) -> None:
        self.costmap = costmap
        self.moves, self.costs = costmap.moves.ravel(), costmap.costs.ravel()
        self.labels = np.zeros((costmap.blocked.size, 2), dtype=np.int64)
        self.first = self.turn = 0
        self.heap = np.empty((FIRST_ROOM, 2), dtype=np.int64)
        self.state = np.zeros(4, dtype=np.int64)

    def search(
        self,
        start: Pose,
        goal: Pose,
        settings: ARASettings,
        *,
        on_improved: OnImproved | None = None,
        cancel: Cancel | None = None,
    ) -> SearchResult | None:
        """Return the best route that was found in time, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x and y [m, map]; what follows is ignored.
        settings : ARASettings
        on_improved : callable, optional
            Called with every `Improvement`: costs never rise and bounds fall; the last is what
            `search` returns. If it returns True, the search ends with that route.
        cancel : Cancel, optional
            Such as a `threading.Event`: once set, the search ends with the best route so far.

        Raises
        ------
        TimeLimitError
            Time ran out before there was a first route; with a limit of 0, always.
        CancelledError
            Likewise.
        """
        clock = Clock(self.name, settings.time_limit, cancel)
        clock.check(0)
        self.state[EXPANDED] = 0
        best = None
        for best in self._improvements(start, goal, settings, clock):
            enough = on_improved is not None and on_improved(best)
            if enough or best.bound <= settings.final_bound:
                break
        if best is None:
            return None
        expanded = int(self.state[EXPANDED])
        return SearchResult(best.waypoints, expanded, bound=best.bound, cost=best.cost)

    def _improvements(
        self, start: Pose, goal: Pose, settings: ARASettings, clock: Clock
    ) -> Iterator[Improvement]:
        """Yield routes, each with a smaller bound, until one is the best or time is up."""
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            waypoints = waypoints_through(self.costmap, start, goal, np.empty((0, 2), int))
            yield Improvement(length_of(waypoints), 1.0, clock.seconds, waypoints)
            return
        self._seed(ends)
        weight, last = _scale(settings.first_weight), _scale(settings.final_bound)
        best: Improvement | None = None
        least, status = 1.0, DONE
        while status == DONE:
            status = self._iterate(ends, weight, clock)
            total = int(self.state[BEST])
            if total == FAR:
                if status != DONE:
                    clock.check(int(self.state[EXPANDED]))
                return
            least = max(least, self._least_total(ends))
            bound = max(total / least, 1.0)
            if status == DONE:  # then the weight is a bound, too
                least, bound = max(least, total * UNIT / weight), min(bound, weight / UNIT)
            if best is None or bound < best.bound:
                cost, waypoints = self._route(start, goal)
                # A shortened end may have made the route before the shorter one.
                if best is not None and best.cost <= cost:
                    cost, waypoints = best.cost, best.waypoints
                best = Improvement(cost, bound, clock.seconds, waypoints)
                yield best
            if weight <= last:
                return
            weight = max(last, _scale(bound - settings.step))

    def _seed(self, ends: Ends) -> None:
        """Begin a query: the sources wait."""
        self.turn += 1
        self.first = self.turn
        self.state[:] = 0, FAR, -1, 0
        for row, col, cost in ends.sources.tolist():
            node = row * self.costmap.width + col
            self.labels[node] = cost, MARK * self.first + WAITS + ROOT
            self.heap[self.state[SIZE]] = 0, node  # keyed by `reopen`
            self.state[SIZE] += 1

    def _iterate(self, ends: Ends, weight: int, clock: Clock) -> int:
        """Search until the best route costs at most weight / `UNIT` times the least, or time is up.

        Returns
        -------
        int
            `DONE` or `SLICE_DONE`.
        """
        width, targets = self.costmap.width, ends.targets
        reopen(width, targets, weight, self.labels, self.turn + 1, self.heap, self.state)
        self.turn += 2
        status = SLICE_DONE
        while status != DONE and not clock.is_up:
            status = self._advance(targets, weight)
        settle(self.costs, self.costmap.steps, width, targets, self.labels, self.first, self.state)
        return DONE if status == DONE else SLICE_DONE

    def _advance(self, targets: Ints, weight: int) -> int:
        status = advance(
            self.moves,
            self.costs,
            self.costmap.steps,
            self.costmap.width,
            targets,
            weight,
            self.labels,
            self.first,
            self.turn,
            self.heap,
            self.state,
            SLICE,
        )
        if status == HEAP_FULL:
            self.heap = np.concatenate([self.heap, np.empty_like(self.heap)])
        return status

    def _least_total(self, ends: Ends) -> int:
        """Return what no route costs less than, unless the best does."""
        width, size = self.costmap.width, self.state[SIZE]
        least = least_total(width, ends.targets, self.labels, self.heap, size)
        return min(least, int(self.state[BEST]))

    def _route(self, start: Pose, goal: Pose) -> tuple[float, Floats]:
        """Return the best route's cost and waypoints [m, map]."""
        turns = trace(self.labels, self.costmap.width, int(self.state[TARGET]))[::-1]
        cells = np.column_stack(np.divmod(turns, self.costmap.width))
        waypoints = waypoints_through(self.costmap, start, goal, cells)
        # Where all metres are alike, the line's own length: merging end pieces may shorten it.
        if self.costmap.uniform:
            return length_of(waypoints), waypoints
        return float(self.state[BEST]) / ONE * self.costmap.window.resolution, waypoints


def _scale(weight: float) -> int:
    """Return a weight in 1/256, not above what was asked for."""
    return math.floor(weight * UNIT)
