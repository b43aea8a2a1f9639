"""The planning problem: from start to goal, with a footprint, on a map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, is_number
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import EPSILON
from planners.error_messages import Point
from planners.errors import ProblemError
from planners.problem.costs import CostSettings
from planners.problem.footprint import LARGEST, Footprint

FARTHEST = 1e300  # [m], of start and goal: in cells of any size, still a finite number

Pose = tuple[float, ...]  #: x, y [m, map] and optionally yaw [rad]

PLAIN = CostSettings()  # the shortest route is the best
Unknown = Literal["avoid", "allow", "penalise"]


@dataclass(frozen=True)
class PlanningProblem:
    """Start, goal, footprint and costs on a map.

    Parameters
    ----------
    grid : ConfidenceGrid
        A map, 2-D or 3-D.
    start, goal : sequence of float
        x, y (in 3-D: x, y, z) [m, map] and optionally yaw [rad].
    footprint : float or array_like, shape (n, 2)
        Radius of the robot [m], or the corners of its outline [m, base_link]. Planners without
        headings keep the clearance of the disc that contains the outline at every heading.
    unknown : {"avoid", "allow", "penalise"}
        Whether the footprint may sweep unknown and contested cells: never, without extra cost, or
        at an extra cost (``costs.unknown_weight``).
    costs : CostSettings, optional
        Extra costs per metre; default: none.
    clear_start : bool, default True
        Whether *unknown* cells near the start count as free; non-free and contested ones never do.
        `Route.start_unknown_area` is the area of those that a route uses, `Route.known_clearance`
        its distance to them.
    clear_start_radius : float, optional [m]
        Cells whose square comes within this distance of the start are cleared. Default: the
        footprint's radius plus half its width, which is twice the radius of a disc. (A forward
        camera sees a wedge next to itself that is narrower than the footprint: if only the cells
        under the footprint were cleared, the disc could never leave.)
    cleared_at : sequence of float, optional
        Centre of the cleared cells: x, y (in 3-D: x, y, z) [m, map]. Default: the start. It allows
        several problems on one map to share the cleared cells.
    epsilon : float, default 0.01
        Cells with a smaller absolute confidence are contested.

    Raises
    ------
    ProblemError
        A place that is not 2 or 3 finite numbers (in 3-D: 3 or 4), a footprint that is neither a
        radius of 0 or more nor a simple polygon, an invalid grid, an option out of its range.

    Examples
    --------
    >>> problem = PlanningProblem(ConfidenceGrid(), start=(0, 0), goal=(60, 4), footprint=0.9)
    >>> problem.goal, problem.clear_radius
    ((60.0, 4.0), 1.8)
    >>> PlanningProblem(ConfidenceGrid(), start=(0, float("nan")), goal=(60, 4), footprint=0.9)
    Traceback (most recent call last):
        ...
    planners.errors.ProblemError: start: expected x, y [m] and optionally yaw [rad], all finite, \
got (0, nan).
    """

    grid: ConfidenceGrid
    _: KW_ONLY
    start: Sequence[float] | Floats
    goal: Sequence[float] | Floats
    footprint: Footprint | float | npt.ArrayLike
    unknown: Unknown = "avoid"
    costs: CostSettings = PLAIN
    clear_start: bool = True
    clear_start_radius: float | None = None
    cleared_at: Sequence[float] | Floats | None = None
    epsilon: float = EPSILON

    def __post_init__(self) -> None:
        """Check every value, and convert numbers to floats."""
        if not isinstance(self.grid, ConfidenceGrid):
            raise ProblemError("grid", "a ConfidenceGrid", repr(self.grid))
        if not isinstance(self.costs, CostSettings):
            raise ProblemError("costs", "CostSettings", repr(self.costs))
        object.__setattr__(self, "start", _pose("start", self.start, self.grid.ndim))
        object.__setattr__(self, "goal", _pose("goal", self.goal, self.grid.ndim))
        if not isinstance(self.footprint, Footprint):
            object.__setattr__(self, "footprint", Footprint.of(self.footprint))
        if self.grid.ndim == 3 and not self.shape.is_disc:
            raise ProblemError("footprint", "a radius, on a 3-D map", "a polygon")
        if self.clear_start_radius is not None:
            radius = _radius("clear_start_radius", self.clear_start_radius)
            object.__setattr__(self, "clear_start_radius", radius)
        if self.cleared_at is not None:
            place = _pose("cleared_at", self.cleared_at, self.grid.ndim)
            object.__setattr__(self, "cleared_at", place)
        if not isinstance(self.unknown, str) or self.unknown not in get_args(Unknown):
            expected = "'avoid', 'allow' or 'penalise'"
            raise ProblemError("unknown", expected, repr(self.unknown))
        if not isinstance(self.clear_start, bool):
            raise ProblemError("clear_start", "True or False", repr(self.clear_start))
        if not (is_number(self.epsilon) and 0 < self.epsilon < 1):
            raise ProblemError("epsilon", "a number between 0 and 1", repr(self.epsilon))

    @property
    def shape(self) -> Footprint:
        """The footprint as a `Footprint`."""
        assert isinstance(self.footprint, Footprint)
        return self.footprint

    @property
    def radius(self) -> float:
        """Radius of the disc that contains the footprint at every heading [m]."""
        return self.shape.radius

    @property
    def avoids_unknown(self) -> bool:
        """Whether unknown and contested cells are blocked like non-free ones."""
        return self.unknown == "avoid"

    @property
    def start_xy(self) -> Point:
        """x, y of the start (on a 3-D map also z) [m, map]."""
        return tuple(map(float, self.start[: self.grid.ndim]))

    @property
    def goal_xy(self) -> Point:
        """x, y of the goal (on a 3-D map also z) [m, map]."""
        return tuple(map(float, self.goal[: self.grid.ndim]))

    @property
    def start_yaw(self) -> float | None:
        """Yaw at the start [rad], or None."""
        return _yaw(self.start, self.grid.ndim)

    @property
    def goal_yaw(self) -> float | None:
        """Yaw at the goal [rad], or None."""
        return _yaw(self.goal, self.grid.ndim)

    @property
    def clear_place(self) -> Point:
        """Centre of the unknown cells that count as free: x, y (in 3-D: x, y, z) [m, map]."""
        place = self.start if self.cleared_at is None else self.cleared_at
        return tuple(map(float, place[: self.grid.ndim]))

    @property
    def clears_its_start(self) -> bool:
        """Whether unknown cells around this start count as free."""
        return self.clear_start and self.clear_place == self.start_xy

    @property
    def clear_radius(self) -> float:
        """Distance from the cleared place within which unknown cells count as free [m]."""
        if self.clear_start_radius is None:
            return self.radius + self.shape.width / 2.0
        return self.clear_start_radius

    def check_dimensions(self, dimensions: int, *, hint: str = "") -> None:
        """Check that the map has a number of dimensions.

        Parameters
        ----------
        dimensions : {2, 3}
        hint : str, optional
            What to do otherwise, for the message.

        Raises
        ------
        ProblemError
        """
        if self.grid.ndim != dimensions:
            expected, got = f"a {dimensions}-D map", f"a {self.grid.ndim}-D map"
            if dimensions == 2 and not hint:
                hint = "Plan on `grid.collapse()`, the map of a band of heights."
            raise ProblemError("grid", expected, got, hint=hint)


def _pose(name: str, values: Sequence[float] | Floats, ndim: int) -> tuple[float, ...]:
    axes = "x, y" if ndim == 2 else "x, y, z"
    expected = f"{axes} [m] and optionally yaw [rad], all finite"
    places = isinstance(values, np.ndarray) and values.ndim == 1
    places |= isinstance(values, Sequence) and not isinstance(values, str)
    if not places or len(values) not in (ndim, ndim + 1) or not all(map(is_number, values)):
        raise ProblemError(name, expected, repr(values))
    if max(map(abs, values[:ndim])) > FARTHEST:
        raise ProblemError(name, f"a place within {FARTHEST:g} m of the origin", repr(values))
    return tuple(map(float, values))


def _yaw(pose: Sequence[float] | Floats, ndim: int) -> float | None:
    return float(pose[ndim]) if len(pose) > ndim else None


def _radius(name: str, value: float) -> float:
    if not (is_number(value) and 0 <= value <= LARGEST):
        raise ProblemError(name, f"a radius from 0 to {LARGEST:g} [m]", repr(value))
    return float(value)
