"""What sampling planners can be told; OMPL itself is not needed for that."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from planners.problem.footprint import Footprint
from planners.problem.problem import PlanningProblem, Pose
from planners.search.base import SearchSettings

StateSpace = Literal["r2", "se2", "dubins", "reeds_shepp", "r3"]
TURNING: tuple[StateSpace, ...] = ("dubins", "reeds_shepp")  # spaces of bounded curvature
FLAT: tuple[StateSpace, ...] = ("r2", "r3")  # spaces without a yaw
GOAL_TOLERANCE = 1e-9  # [m; rad] by which a route may miss what will do as a goal


class SamplingSettings(SearchSettings):
    """What a sampling planner can be told.

    Those up to `keep_graph` are for all of them, but for a few that say why they refuse one (PRM
    counts no iterations, BFMT takes one goal). The others are parameters of single planners,
    by the names that OMPL's setters have (``range`` is ``setRange``); where none is given, OMPL's
    own value counts, and a planner that has no such parameter refuses it.
    """

    space: StateSpace | None = Field(
        None,
        description="r2 (places), se2 (poses, turning on the spot), dubins (forward, turning"
        " radius), reeds_shepp (backwards too), r3 (on 3-D maps); none: se2 for an outline whose"
        " start and goal have a yaw, else r2 or r3",
    )
    seed: int = Field(0, ge=0, lt=2**31, description="of the random numbers")
    iterations: int | None = Field(
        None,
        ge=1,
        description="stop after the planner looked so often whether to; runs then repeat exactly",
    )
    improve_for: float = Field(
        1.0,
        ge=0,
        le=3600,
        description="planners that go on to better their route do so that long [s]; with"
        " iterations, until these are used up",
    )
    simplify: bool = Field(True, description="shorten the route afterwards, where that works")
    turning_radius: float = Field(
        1.0, ge=0.01, le=1000, description="tightest turn of base_link [m]; dubins, reeds_shepp"
    )
    yaw_weight: float = Field(
        0.5, gt=0, le=1000, description="a radian counts as that many metres [m/rad]; se2"
    )
    goals: tuple[tuple[float, ...], ...] = Field(
        (),
        max_length=1000,
        description="other goals that will do: x, y [m] and, for poses, yaw [rad]",
    )
    goal_radius: float = Field(
        0.0, ge=0, le=1e6, description="places that near to a goal will do [m]"
    )
    goal_yaw_tolerance: float = Field(
        0.0, ge=0, le=math.pi, description="headings that near to a goal's will do [rad]"
    )
    length_weight: float = Field(
        1.0, ge=0, le=1000, description="what a metre costs; the map's costs are added to it [1/m]"
    )
    time_weight: float = Field(
        0.0, ge=0, le=1000, description="what a second costs at max_speed and max_turn_rate [1/s]"
    )
    max_speed: float = Field(1.0, gt=0, le=1000, description="of base_link [m/s]")
    max_turn_rate: float = Field(1.0, gt=0, le=1000, description="of base_link [rad/s]")
    warm_start: bool = Field(
        False,
        description="begin with A*'s route: look only where a better one may be, and return it if"
        " none is found",
    )
    keep_graph: bool = Field(
        False, description="keep the tree or roadmap that was grown, in the route's `graph`"
    )

    range: float | None = Field(None, gt=0, le=1e6, description="longest edge of a tree [m]")
    goal_bias: float | None = Field(None, ge=0, le=1, description="share of samples at the goal")
    intermediate_states: bool | None = Field(None, description="add the states along edges, too")
    max_nearest_neighbors: int | None = Field(
        None, ge=1, le=10**6, description="edges tried from a new state [states]"
    )
    rewire_factor: float | None = Field(
        None, ge=1, le=100, description="neighbourhood over the least that optimality needs"
    )
    batch_size: int | None = Field(None, ge=1, le=10**4, description="of ordered sampling [states]")
    samples_per_batch: int | None = Field(None, ge=1, le=10**5, description="[states]")
    num_samples: int | None = Field(
        None, ge=1, le=10**6, description="samples [states]; none: more and more, from 1000 on"
    )
    num_sampling_attempts: int | None = Field(None, ge=1, le=10**4, description="for one sample")
    radius_multiplier: float | None = Field(
        None, ge=1, le=5, description="neighbourhood over the least that optimality needs"
    )
    free_space_volume: float | None = Field(
        None, gt=0, description="of what is free, at most [m²; in se2 m² rad]"
    )
    border_fraction: float | None = Field(
        None, gt=0, le=1, description="share of expansions from the outer cells"
    )
    min_valid_path_fraction: float | None = Field(
        None, gt=0, le=1, description="shortest share of a motion that is kept"
    )
    failed_expansion_cell_score_factor: float | None = Field(
        None, gt=0, le=1, description="what a failure leaves of a cell's score"
    )
    prune_threshold: float | None = Field(
        None, ge=0, le=1, description="prune after a betterment by this share"
    )
    prune_threshold_fraction: float | None = Field(
        None, ge=0, le=1, description="prune after a betterment by this share"
    )
    delay_cc: bool | None = Field(None, description="check the cheapest neighbours first, only")
    tree_pruning: bool | None = Field(None, description="drop states that can't better the route")
    pruning: bool | None = Field(None, description="drop states that can't better the route")
    pruned_measure: bool | None = Field(None, description="neighbourhoods by what is left")
    informed_sampling: bool | None = Field(None, description="sample what may better the route")
    sample_rejection: bool | None = Field(None, description="the same, by rejection")
    new_state_rejection: bool | None = Field(None, description="reject states that can't help")
    admissible_cost_to_come: bool | None = Field(None, description="bound by straight lines")
    focus_search: bool | None = Field(None, description="all of the above that narrow the search")
    k_nearest: bool | None = Field(None, description="neighbours by number, not by distance")
    use_k_nearest: bool | None = Field(None, description="neighbours by number, not by distance")
    nearest_k: bool | None = Field(None, description="neighbours by number, not by distance")
    strict_queue_ordering: bool | None = Field(None, description="keep the queue always sorted")
    delay_rewiring_until_initial_solution: bool | None = Field(None, description="rewire later")
    just_in_time_sampling: bool | None = Field(None, description="sample where needed next")
    drop_samples_on_prune: bool | None = Field(None, description="forget samples when pruning")
    stop_on_soln_improvement: bool | None = Field(None, description="stop at each betterment")
    cache_cc: bool | None = Field(None, description="remember which edges were checked")
    heuristics: bool | None = Field(None, description="steer towards the goal")
    extended_fmt: bool | None = Field(None, description="sample on where the first samples fail")

    @field_validator("goals", mode="before")
    @classmethod
    def _are_places(cls, goals: Any) -> Any:
        places = isinstance(goals, (list, tuple, np.ndarray))
        if not (places and all(isinstance(one, (list, tuple, np.ndarray)) for one in goals)):
            raise PydanticCustomError("places", "a list of places, such as [[3, 4], [5, 6]]")
        return [tuple(one) for one in goals]

    def uses_headings(self, problem: PlanningProblem) -> bool:
        """Whether an outline is turned with the robot."""
        start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
        return self.space_for(problem.shape, start, goal, axes=problem.grid.ndim) not in FLAT

    @property
    def takes_other_goals(self) -> bool:
        """Whether a route may end elsewhere than at the problem's goal."""
        return bool(self.goals) or self.goal_radius > 0 or self.goal_yaw_tolerance > 0

    def accepts_end(self, end: Pose, goal: Pose, *, axes: int) -> bool:
        """Whether a route to a goal may end in a pose: near enough to one, turned as it will do."""
        near, turned = self.goal_radius + GOAL_TOLERANCE, self.goal_yaw_tolerance + GOAL_TOLERANCE
        return any(
            math.dist(end[:axes], other[:axes]) <= near
            and all(
                abs(math.remainder(yaw - asked, math.tau)) <= turned
                for yaw, asked in zip(end[axes:], other[axes:], strict=False)
            )
            for other in (goal, *self.goals)
        )

    def space_for(
        self, footprint: Footprint, start: Pose, goal: Pose, *, axes: int = 2
    ) -> StateSpace:
        """Return the space to plan in on a map of two axes or three."""
        if axes == 3:
            return "r3"
        if self.space is not None:
            return self.space
        turned = len(start) == 3 and len(goal) == 3
        return "se2" if turned and not footprint.is_disc else "r2"

    def parameters(self) -> dict[str, float]:
        """Return the planner's own parameters that were given, by name."""
        own = [name for name in PARAMETERS if getattr(self, name) is not None]
        return {name: getattr(self, name) for name in own}


_NAMES = tuple(SamplingSettings.model_fields)
PARAMETERS: tuple[str, ...] = _NAMES[_NAMES.index("keep_graph") + 1 :]


def setter_of(name: str) -> str:
    """Return the name of OMPL's setter of a parameter.

    Examples
    --------
    >>> setter_of("goal_bias"), setter_of("delay_cc"), setter_of("extended_fmt")
    ('setGoalBias', 'setDelayCC', 'setExtendedFMT')
    """
    words = [word.upper() if word in ("cc", "fmt") else word.title() for word in name.split("_")]
    return f"set{''.join(words)}"


ONE_WAY = "It also follows edges backwards, which can't be driven: take 'rrt' or 'bitstar'."
ENDLESS = "It may look for a better sample for ever: take 'informedrrtstar'."
# Switches that a planner inherits and dies of.
FIXED = {("sorrtstar", name) for name in ("focus_search", "informed_sampling", "sample_rejection")}
# What ends the process, or brings paths that can't be driven: tried by
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
    """Return why a planner is not let loose in a space; None if it is.

    Examples
    --------
    >>> refusal("aorrtc", "r2"), refusal("prm", "r2")
    ("OMPL's AORRTC crashes: take 'bitstar'.", None)
    """
    return REFUSED.get((planner, None), REFUSED.get((planner, space)))
