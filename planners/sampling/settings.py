"""Settings of sampling planners, and the spaces that each planner supports; no need for OMPL."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from planners.problem.footprint import Footprint
from planners.problem.problem import PlanningProblem, Pose
from planners.sampling.ompl_parameters import OmplParameters
from planners.search.base import SearchSettings

StateSpace = Literal["r2", "se2", "dubins", "reeds_shepp", "r3"]
TURNING: tuple[StateSpace, ...] = ("dubins", "reeds_shepp")  # spaces of bounded curvature
FLAT: tuple[StateSpace, ...] = ("r2", "r3")  # spaces without a yaw
GOAL_TOLERANCE = 1e-9  # [m; rad] added to the goal tolerances for rounding


class SamplingSettings(OmplParameters, SearchSettings):
    """Settings of sampling planners.

    All planners take those declared here, with a few exceptions that are rejected with a reason
    (PRM does not count iterations, BFMT takes a single goal). Those of `OmplParameters` belong to
    single planners.
    """

    space: StateSpace | None = Field(
        None,
        description="state space: r2 (places), se2 (poses, turning on the spot), dubins (forward,"
        " turning radius), reeds_shepp (backwards too), r3 (on 3-D maps); default: se2 for an"
        " outline whose start and goal have a yaw, else r2 or r3",
    )
    seed: int = Field(0, ge=0, lt=2**31, description="seed of the random numbers")
    iterations: int | None = Field(
        None,
        ge=1,
        description="number of termination checks after which the planner stops; runs then repeat"
        " exactly",
    )
    improve_for: float = Field(
        1.0,
        ge=0,
        le=3600,
        description="time to keep improving after the first route [s]; with iterations, until these"
        " are used up",
    )
    simplify: bool = Field(True, description="shorten the route afterwards where possible")
    turning_radius: float = Field(
        1.0, ge=0.01, le=1000, description="tightest turn of base_link [m]; dubins, reeds_shepp"
    )
    yaw_weight: float = Field(
        0.5, gt=0, le=1000, description="length that a radian counts as [m/rad]; se2"
    )
    goals: tuple[tuple[float, ...], ...] = Field(
        (),
        max_length=1000,
        description="alternative goals: x, y [m] and, for poses, yaw [rad]",
    )
    goal_radius: float = Field(
        0.0, ge=0, le=1e6, description="accepted distance from a goal's position [m]"
    )
    goal_yaw_tolerance: float = Field(
        0.0, ge=0, le=math.pi, description="accepted difference from a goal's yaw [rad]"
    )
    length_weight: float = Field(
        1.0, ge=0, le=1000, description="cost of a metre; the map's costs are added to it [1/m]"
    )
    time_weight: float = Field(
        0.0, ge=0, le=1000, description="cost of a second at max_speed and max_turn_rate [1/s]"
    )
    max_speed: float = Field(1.0, gt=0, le=1000, description="speed limit of base_link [m/s]")
    max_turn_rate: float = Field(
        1.0, gt=0, le=1000, description="turn rate limit of base_link [rad/s]"
    )
    warm_start: bool = Field(
        False,
        description="begin with A*'s route: search only where a cheaper one is possible, and return"
        " A*'s if none is found",
    )
    keep_graph: bool = Field(
        False, description="keep the planner's tree or roadmap in the route's `graph`"
    )

    @field_validator("goals", mode="before")
    @classmethod
    def _are_places(cls, goals: Any) -> Any:
        places = isinstance(goals, (list, tuple, np.ndarray))
        if not (places and all(isinstance(one, (list, tuple, np.ndarray)) for one in goals)):
            raise PydanticCustomError("places", "a list of places, such as [[3, 4], [5, 6]]")
        return [tuple(one) for one in goals]

    def uses_headings(self, problem: PlanningProblem) -> bool:
        """Whether the state space of a problem has a yaw."""
        start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
        return self.space_for(problem.shape, start, goal, axes=problem.grid.ndim) not in FLAT

    @property
    def takes_other_goals(self) -> bool:
        """Whether a route may end elsewhere than at the problem's goal."""
        return bool(self.goals) or self.goal_radius > 0 or self.goal_yaw_tolerance > 0

    def accepts_end(self, end: Pose, goal: Pose, *, axes: int) -> bool:
        """Whether a pose is within the tolerances of the goal or of an alternative goal.

        Parameters
        ----------
        end, goal : tuple of float
            x, y (, z) [m, map] and, where the space has one, yaw [rad].
        axes : {2, 3}
            Of the map.
        """
        distance = self.goal_radius + GOAL_TOLERANCE
        turn = self.goal_yaw_tolerance + GOAL_TOLERANCE
        return any(
            math.dist(end[:axes], other[:axes]) <= distance
            and all(
                abs(math.remainder(yaw - goal_yaw, math.tau)) <= turn
                for yaw, goal_yaw in zip(end[axes:], other[axes:], strict=False)
            )
            for other in (goal, *self.goals)
        )

    def space_for(
        self, footprint: Footprint, start: Pose, goal: Pose, *, axes: int = 2
    ) -> StateSpace:
        """Return the state space of a problem.

        Parameters
        ----------
        footprint : Footprint
        start, goal : tuple of float
            x, y (, z) [m, map], optionally yaw [rad].
        axes : {2, 3}
            Of the map.
        """
        if axes == 3:
            return "r3"
        if self.space is not None:
            return self.space
        has_yaw = len(start) == 3 and len(goal) == 3
        return "se2" if has_yaw and not footprint.is_disc else "r2"


ONE_WAY = "It also follows edges backwards, which can't be driven: take 'rrt' or 'bitstar'."
ENDLESS = "Its search for a better sample may never end: take 'informedrrtstar'."
# Planners and spaces that crash the process, or yield paths that can't be driven, as found by
# `tools/crash_matrix.py --refused`.
REFUSED: dict[tuple[str, StateSpace | None], str] = {
    ("aorrtc", None): "OMPL's AORRTC crashes: take 'bitstar'.",
    ("bfmt", "dubins"): ONE_WAY,
    ("bkpiece1", "dubins"): ONE_WAY,
    ("lbkpiece1", "dubins"): ONE_WAY,
    ("prm", "dubins"): ONE_WAY,
    ("prmstar", "dubins"): ONE_WAY,
    ("sorrtstar", "se2"): ENDLESS,
    ("sorrtstar", "dubins"): ENDLESS,
    ("sorrtstar", "reeds_shepp"): ENDLESS,
}


def refusal(planner: str, space: StateSpace) -> str | None:
    """Return why a planner is not supported in a state space; None if it is.

    Parameters
    ----------
    planner : str
    space : {"r2", "se2", "dubins", "reeds_shepp", "r3"}

    Examples
    --------
    >>> refusal("aorrtc", "r2"), refusal("prm", "r2")
    ("OMPL's AORRTC crashes: take 'bitstar'.", None)
    """
    return REFUSED.get((planner, None), REFUSED.get((planner, space)))
