"""What is asked of a planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal, get_args

import numpy as np

from groundmap.arrays import Floats
from groundmap.grid import ConfidenceGrid
from groundmap.window import EPSILON
from planners.errors import Point, ProblemError

Unknown = Literal["avoid", "allow"]


@dataclass(frozen=True)
class PlanningProblem:
    """From where to where, with which footprint, on which map.

    Parameters
    ----------
    grid : ConfidenceGrid
        A 2-D map.
    start, goal : sequence of float
        x, y [m, map] and optionally yaw [rad].
    footprint : float [m]
        Radius of the robot.
    unknown : {"avoid", "allow"}
        Whether unknown and contested cells may lie under the swept footprint.
    clear_start : bool, default True
        Whether *unknown* cells near the start count as free; non-free and contested ones never do.
    clear_start_radius : float [m], optional
        Cells are near whose square comes within this distance of the start; twice the footprint
        radius unless told. (What a forward camera sees next to itself is a wedge narrower than
        the footprint: with only the cells under the footprint cleared, the disc could never
        leave.)
    epsilon : float, default 0.01
        Cells of a smaller absolute confidence are contested.

    Raises
    ------
    ProblemError
        A place that is not 2 or 3 finite numbers, a footprint that is not a radius of 0 or more,
        another grid than a 2-D one, an option out of its range.

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
    footprint: float
    unknown: Unknown = "avoid"
    clear_start: bool = True
    clear_start_radius: float | None = None
    epsilon: float = EPSILON

    def __post_init__(self) -> None:
        """Check every value, and turn numbers into floats."""
        if not isinstance(self.grid, ConfidenceGrid):
            raise ProblemError("grid", "a 2-D ConfidenceGrid", repr(self.grid))
        if self.grid.ndim != 2:
            raise ProblemError("grid", "a 2-D ConfidenceGrid", f"one of {self.grid.ndim}-D")
        object.__setattr__(self, "start", _pose("start", self.start))
        object.__setattr__(self, "goal", _pose("goal", self.goal))
        object.__setattr__(self, "footprint", _radius("footprint", self.footprint))
        if self.clear_start_radius is not None:
            radius = _radius("clear_start_radius", self.clear_start_radius)
            object.__setattr__(self, "clear_start_radius", radius)
        if self.unknown not in get_args(Unknown):
            raise ProblemError("unknown", "'avoid' or 'allow'", repr(self.unknown))
        if not 0 < self.epsilon < 1:
            raise ProblemError("epsilon", "a number between 0 and 1", repr(self.epsilon))

    @property
    def start_xy(self) -> Point:
        """x, y of the start [m, map]."""
        return float(self.start[0]), float(self.start[1])

    @property
    def goal_xy(self) -> Point:
        """x, y of the goal [m, map]."""
        return float(self.goal[0]), float(self.goal[1])

    @property
    def clear_radius(self) -> float:
        """How near unknown cells come to the start that count as free [m]."""
        if self.clear_start_radius is None:
            return 2.0 * self.footprint
        return self.clear_start_radius


def _pose(name: str, values: Sequence[float] | Floats) -> tuple[float, ...]:
    expected = "x, y [m] and optionally yaw [rad], all finite"
    try:
        pose = tuple(float(value) for value in values)
    except (TypeError, ValueError) as error:
        raise ProblemError(name, expected, repr(values)) from error
    if len(pose) not in (2, 3) or not np.isfinite(pose).all():
        raise ProblemError(name, expected, repr(values))
    return pose


def _radius(name: str, value: float) -> float:
    expected = "a radius of 0 or more [m]"
    if np.ndim(value) != 0:
        raise ProblemError(name, expected, "a polygon", hint="Polygons are not supported yet.")
    try:
        radius = float(value)
    except (TypeError, ValueError) as error:
        raise ProblemError(name, expected, repr(value)) from error
    if not (np.isfinite(radius) and radius >= 0):
        raise ProblemError(name, expected, repr(value))
    return radius
