"""Replanning for a moving robot on a growing map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.grid.cell_set import CellSet
from planners.costmap.costmap import Costmap, whole_cells
from planners.costmap.endpoint_check import check_on_map
from planners.costmap.extent import padded_bounds
from planners.error_messages import Point
from planners.errors import ProblemError
from planners.geometry.rounding import slack_at
from planners.problem.problem import PlanningProblem
from planners.route.route import Route
from planners.route.solve import solve
from planners.search.base import now
from planners.search.dstar_lite import DStarLite, DStarLiteSettings


class IncrementalPlanner:
    """Routes on a changing map to one goal from the current position of a robot.

    Each route has the cost of the route of `planners.plan` on the current map, but D* Lite repairs
    only the part of the search that is affected by changes since the last route.

    Parameters
    ----------
    problem : PlanningProblem
        Its grid is the changing map, its start the first position of the robot.
    recent : bool, default True
        Whether each route keeps away from what is there now, the cells that the newest views of
        the grid's mapper saw as non-free (`groundmap.ConfidenceGrid.recent`). They take the place
        of ``problem.recent`` if the grid has any.
    **settings
        Settings of `planners.search.dstar_lite.DStarLiteSettings`.

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

    def __init__(self, problem: PlanningProblem, *, recent: bool = True, **settings: Any) -> None:
        problem.check_dimensions(2)
        if not isinstance(recent, bool):
            raise ProblemError("recent", "True or False", repr(recent))
        self.problem = problem
        self.recent = recent
        self.settings = DStarLiteSettings(**settings)
        self._costmap: Costmap | None = None
        self._engine: DStarLite | None = None
        self._took_recent = False  # from the grid

    def update(
        self, changed: npt.ArrayLike, *, recent: CellSet | npt.ArrayLike | None = None
    ) -> None:
        """Register changed cells of the grid; only the affected part of the costmap is updated.

        Parameters
        ----------
        changed : array_like of int, shape (n, 2)
            Cells [row, col] of the grid, such as `groundmap.GroundMapper.changed`, including
            cells that the map did not have before.
        recent : CellSet or array_like of int, shape (n, 2), optional
            What is there now, such as `groundmap.GroundMapper.recent` of a mapper with another
            grid. From now on it takes the place of what the grid itself has.

        Raises
        ------
        ProblemError
            An array of another shape, or not of integers; `recent` of another lattice.
        """
        cells = whole_cells(changed)
        if recent is not None:
            self.problem = replace(self.problem, recent=recent)
            self.recent = False
        if self._costmap is not None:
            self._costmap = self._costmap.with_changes(cells)

    def plan(
        self,
        start: Sequence[float] | Floats | None = None,
        goal: Sequence[float] | Floats | None = None,
    ) -> Route:
        """Return an audited route on the current map.

        Parameters
        ----------
        start : sequence of float, optional
            Position of the robot: x, y [m] and optionally yaw [rad]; default: the last one.
        goal : sequence of float, optional
            A new goal, with which the search starts over; default: the last one. It is kept even
            if it is outside the map, which may grow to include it.

        Raises
        ------
        ProblemError
            A place that is not 2 or 3 finite numbers.
        OutsideMapError, NonFreeError, UnknownSpaceError
            The footprint does not fit at the start or the goal.
        EnclosedError
            No route connects them.
        TimeLimitError
            Time ran out. The next call continues the search.
        AuditError
            The route violates the requested clearance or endpoints: changed cells were not passed
            to `update`, or the planner has a bug.
        """
        began = now()
        problem = replace(
            self.problem,
            start=self.problem.start if start is None else start,
            goal=self.problem.goal if goal is None else goal,
        )
        if self.recent and (len(newest := problem.grid.recent) or self._took_recent):
            problem = replace(problem, recent=newest)
            self._took_recent = True
        self.problem = problem
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
        """Return the costmap of the current problem; the cleared cells move with the start."""
        before = self._costmap
        if before is None:
            return Costmap.of(self.problem)
        here = replace(before, problem=self.problem)
        moved = _differing(before.problem.recent_set, self.problem.recent_set)
        if _ends(before.problem) == _ends(self.problem) and len(moved) == 0:
            return here
        now, then = padded_bounds(self.problem), padded_bounds(before.problem)
        if not self.problem.avoids_unknown and (now != then).any():
            return Costmap.of(self.problem)  # cells around the map are traversable, too
        cells = np.concatenate([_unknown_cells(before), _unknown_cells(here)])
        return here.with_changes(np.concatenate([cells + before.lower_cell, moved]))


def _ends(problem: PlanningProblem) -> tuple[Point, Point]:
    return problem.start_xy, problem.goal_xy


def _differing(before: CellSet, after: CellSet) -> Ints:
    """Return the cells that are in one of two sets, shape (n, 2)."""
    cells, counts = np.unique(
        np.concatenate([before.cells, after.cells]), axis=0, return_counts=True
    )
    differing: Ints = cells[counts == 1]
    return differing


def _unknown_cells(costmap: Costmap) -> Ints:
    """Return the unknown cells near the cleared place and at the ends, also off the window."""
    problem, window = costmap.problem, costmap.window
    # Slightly more than the radius, as squares that only touch it are cleared, too.
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
