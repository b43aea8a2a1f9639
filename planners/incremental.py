"""Planning again and again on a map that grows, from a robot that moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap, whole_cells
from planners.costmap.endpoint_check import check_on_map
from planners.costmap.extent import padded_bounds
from planners.error_messages import Point
from planners.geometry.rounding import slack_at
from planners.problem.problem import PlanningProblem
from planners.route.route import Route
from planners.route.solve import solve
from planners.search.base import now
from planners.search.dstar_lite import DStarLite, DStarLiteSettings


class IncrementalPlanner:
    """Routes to one goal, on a live map, from wherever the robot is.

    Each route is what `planners.plan` would return at that moment (of routes that cost the same,
    perhaps another), but only what changed since the last one is worked out again, by D* Lite.

    Parameters
    ----------
    problem : PlanningProblem
        Its grid is the live map; its start, where the robot is at first.
    **settings
        Those of `planners.search.dstar_lite.DStarLiteSettings`.

    Raises
    ------
    ProblemError
        A 3-D map.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> planner = IncrementalPlanner(
    ...     PlanningProblem(grid, start=(2, 10.25), goal=(30.25, 10.25), footprint=0.9)
    ... )
    >>> planner.plan().length
    28.25
    >>> grid.fuse(np.array([20, 30]), np.full((1, 1), 1.0, dtype=np.float32))
    >>> planner.update([[20, 30]])
    >>> round(planner.plan(start=(5.25, 10.25)).length, 2)
    26.24
    """

    def __init__(self, problem: PlanningProblem, **settings: Any) -> None:
        problem.check_dimensions(2)
        self.problem = problem
        self.settings = DStarLiteSettings(**settings)
        self._costmap: Costmap | None = None
        self._engine: DStarLite | None = None

    def update(self, changed: npt.ArrayLike) -> None:
        """Take over cells of the grid that changed; only what they touch is worked out again.

        Parameters
        ----------
        changed : array_like of int, shape (n, 2)
            Cells [row, col] of the grid, such as `groundmap.GroundMapper.changed`;
            cells that the map did not have before among them.

        Raises
        ------
        ProblemError
            Something else than cells.
        """
        cells = whole_cells(changed)
        if self._costmap is not None:
            self._costmap = self._costmap.with_changes(cells)

    def plan(
        self,
        start: Sequence[float] | Floats | None = None,
        goal: Sequence[float] | Floats | None = None,
    ) -> Route:
        """Return the route on the map as it is now, which the audit passed.

        Parameters
        ----------
        start : sequence of float, optional
            Where the robot is now: x, y [m] and optionally yaw [rad]; where it was unless told.
        goal : sequence of float, optional
            Another goal. The search then begins anew. It is kept
            even if it is refused: the map may grow to it.

        Raises
        ------
        ProblemError
            A place that is not 2 or 3 finite numbers.
        OutsideMapError, NonFreeError, UnknownSpaceError
            Start or goal is no place for the footprint.
        EnclosedError
            No route joins them.
        TimeLimitError
            Time ran out. The next call goes on where this one ended.
        AuditError
            The route keeps not what was asked: cells that changed were not said with `update`,
            or a bug in the planner.
        """
        began = now()
        self.problem = replace(
            self.problem,
            start=self.problem.start if start is None else start,
            goal=self.problem.goal if goal is None else goal,
        )
        check_on_map(self.problem)
        costmap = self._costmap = self._costmap_now()
        return solve(costmap, self._engine_on(costmap), self.settings, began=began)

    def _engine_on(self, costmap: Costmap) -> DStarLite:
        if self._engine is None:
            self._engine = DStarLite(costmap)
        elif self._engine.costmap.costs is not costmap.costs:  # else only the start moved
            self._engine.update(costmap)
        return self._engine

    def _costmap_now(self) -> Costmap:
        """Return the costmap of the problem as it is now: what is cleared moves with the start."""
        before = self._costmap
        if before is None:
            return Costmap.of(self.problem)
        here = replace(before, problem=self.problem)
        if _ends(before.problem) == _ends(self.problem):
            return here
        now, then = padded_bounds(self.problem), padded_bounds(before.problem)
        if not self.problem.avoids_unknown and (now != then).any():
            return Costmap.of(self.problem)  # what lies around the map may be driven on, too
        cells = np.concatenate([_unknown_cells(before), _unknown_cells(here)])
        return here.with_changes(cells + before.lower_cell)


def _ends(problem: PlanningProblem) -> tuple[Point, Point]:
    return problem.start_xy, problem.goal_xy


def _unknown_cells(costmap: Costmap) -> Ints:
    """Return cells near what is cleared, and the ends', if unknown or beyond the window."""
    problem, window = costmap.problem, costmap.window
    # A little more than the radius: squares that only touch it are cleared, too.
    slack = slack_at(problem.clear_place)
    reach = problem.clear_radius + 2.0 * slack if problem.clear_start else 0.0
    corners = [np.array(problem.clear_place) - reach, np.array(problem.clear_place) + reach]
    first, last = window.world_to_cell(corners)
    around = np.argwhere(np.ones(last - first + 1)) + first
    ends = window.world_to_cell([problem.start_xy, problem.goal_xy])
    cells = np.concatenate([around, ends])
    inside = window.contains(cells)
    known = np.zeros(len(cells), dtype=np.bool_)
    known[inside] = window.count[tuple(cells[inside].T)] > 0
    unknown: Ints = cells[~known]
    return unknown
