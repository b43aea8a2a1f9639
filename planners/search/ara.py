"""ARA*: a first route soon, better ones while time remains, each with a bound on its cost."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from pydantic import Field

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.search.base import (
    Cancel,
    Clock,
    Improvement,
    OnImproved,
    SearchResult,
    SearchSettings,
)
from planners.search.grid_search import CostmapSearch, GridQuery, kernel_arrays
from planners.search.kernels.ara import WAITS, advance, least_total, reopen, settle
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    MARK,
    ROOT,
    SIZE,
    SLICE_DONE,
    TARGET,
    UNIT,
    seed,
    trace,
)


class ARASettings(SearchSettings):
    """Settings of ARA*."""

    first_weight: float = Field(
        3.0, ge=1, le=10, description="the first route costs at most this many times the least"
    )
    step: float = Field(
        0.5, ge=0.01, le=10, description="difference between a bound and the next weight"
    )
    final_bound: float = Field(
        1.0, ge=1, le=10, description="stop when a route costs at most this many times the least"
    )


class ARA(CostmapSearch):
    """Anytime repairing A* (Likhachev, Gordon, Thrun 2003).

    Weighted A* is repeated with decreasing weights. An iteration expands no cell twice: cells that
    it reaches at a lower cost after their expansion wait for the next iteration, which starts from
    these and from all others that wait. Nothing is searched from scratch.

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
    >>> result = ara.search(problem.start, problem.goal, ARASettings(),
    ...                     on_improved=lambda better: costs.append(round(better.cost, 2)))
    >>> result.bound, costs == sorted(costs, reverse=True), costs[-1] == round(result.cost, 2)
    (1.0, True, True)
    """

    name = "ara"

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        self.arrays = kernel_arrays(costmap)
        self.labels = np.zeros((costmap.blocked.size, 2), dtype=np.int64)
        self.first = self.turn = self.weight = 0

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
            x and y [m, map]; the rest is ignored.
        settings : ARASettings
        on_improved : callable, optional
            Called with every `Improvement`: costs never rise and bounds fall; the last one is the
            result of `search`. If it returns True, the search ends with that route.
        cancel : Cancel, optional
            Such as a `threading.Event`: once set, the search ends with the best route so far.

        Raises
        ------
        TimeLimitError
            The time limit is exceeded before the first route; with a limit of 0, always.
        CancelledError
            The search is cancelled before the first route.
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
        """Yield routes of decreasing bounds until one is optimal or time is up."""
        query = GridQuery(start, goal, self._join(start, goal), settings)
        if query.ends.direct:
            waypoints = self._direct_result(query).waypoints
            yield Improvement(length_of(waypoints), 1.0, clock.seconds, waypoints)
            return
        self._seed(query)
        last = _scale(settings.final_bound)
        best: Improvement | None = None
        least, finished = 1.0, True
        while finished:
            finished = self._iterate(query, clock)
            total = int(self.state[BEST])
            if total == FAR:
                if not finished:
                    clock.check(int(self.state[EXPANDED]))
                return
            least = max(least, self._least_total(query.ends.targets))
            bound = max(total / least, 1.0)
            if finished:  # then the weight is a bound, too
                least, bound = (
                    max(least, total * UNIT / self.weight),
                    min(bound, self.weight / UNIT),
                )
            if best is None or bound < best.bound:
                cost, waypoints = self._route(query)
                # A shortened end piece may have made the previous route the shorter one.
                if best is not None and best.cost <= cost:
                    cost, waypoints = best.cost, best.waypoints
                best = Improvement(cost, bound, clock.seconds, waypoints)
                yield best
            if self.weight <= last:
                return
            self.weight = max(last, _scale(bound - settings.step))

    def _seed(self, query: GridQuery) -> None:
        self.weight = _scale(query.settings.first_weight)
        self.first = self.turn = self.turn + 1
        mark, width = MARK * self.first + WAITS + ROOT, self.costmap.width
        size = seed(*query.ends[:2], self.weight, width, mark, self.labels, self.heap)
        self.state[:] = size, FAR, -1, 0

    def _iterate(self, query: GridQuery, clock: Clock) -> bool:
        """Search until the best route costs at most weight / `UNIT` times the least, or time is up.

        Returns
        -------
        bool
            False if time is up.
        """
        (_, costs, steps, width), targets = self.arrays, query.ends.targets
        reopen(width, targets, self.weight, self.labels, self.turn + 1, self.heap, self.state)
        self.turn += 2
        status = SLICE_DONE
        while status not in (FOUND, EXHAUSTED) and not clock.is_up:
            status = self._search_slice(query)
        settle(costs, steps, width, targets, self.labels, self.first, self.state)
        return status in (FOUND, EXHAUSTED)

    def _advance(self, query: GridQuery) -> int:
        return advance(
            *self.arrays,
            query.ends.targets,
            self.weight,
            self.labels,
            self.first,
            self.turn,
            self.heap,
            self.state,
            self.slice_size,
        )

    def _least_total(self, targets: Ints) -> int:
        """Return a cost that no route falls below, unless the best one does."""
        width, size = self.costmap.width, self.state[SIZE]
        return min(least_total(width, targets, self.labels, self.heap, size), int(self.state[BEST]))

    def _route(self, query: GridQuery) -> tuple[float, Floats]:
        """Return the best route's cost [m] and waypoints [m, map]."""
        waypoints = self._line(query, self._trace())
        return self._cost(waypoints), waypoints

    def _trace(self) -> Ints:
        return self._cells(trace(self.labels, self.costmap.width, int(self.state[TARGET]))[::-1])


def _scale(weight: float) -> int:
    """Return a weight in 1/256, rounded down."""
    return math.floor(weight * UNIT)
