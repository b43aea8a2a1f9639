"""Objective of sampling planners: the length, the costs of the map's cells, and the time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count, pairwise
from typing import Any

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from planners.costmap.costmap import Costmap
from planners.costmap.swept_footprint import shape_of
from planners.errors import ProblemError
from planners.problem.costs import MAX_NON_OBSTACLE
from planners.problem.problem import Pose
from planners.sampling.kernels.edge_costs import (
    COST,
    DRIVE,
    LENGTH,
    TURN,
    curve_cost,
    curve_length,
    line_cost,
    slide_cost,
)
from planners.sampling.kernels.edges import ARM, BULGE
from planners.sampling.kernels.edges import TURNING as TURNING_RADIUS
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.ompl_states import PollSchedule, reader
from planners.sampling.settings import FLAT, TURNING, SamplingSettings, StateSpace

# Planners that compare costs while they search; the others accept an objective and never use it.
# PRM and PRM* would use it in threads of their own, which deadlocks: a thread waits for Python's
# interpreter lock, whose holder waits for the thread.
COST_AWARE = frozenset({"bfmt", "bitstar", "fmt", "informedrrtstar", "rrtstar", "sorrtstar"})
# In dubins, FMT evaluates hundreds of thousands of costs between two termination checks, and BFMT
# is not supported.
NOT_COST_AWARE_IN_DUBINS = frozenset({"bfmt", "fmt"})
BOUND_FACTOR = 1.0 - 1e-10  # keeps a lower bound below the cost in spite of rounding


class Objective:
    """Cost of a path.

    It is ``length_weight`` times the length, plus the map's costs along the line of base_link,
    plus ``time_weight`` times the duration [s].

    Parameters
    ----------
    validator : MotionValidator
        On a 3-D map, all metres cost the same.
    settings : SamplingSettings

    Attributes
    ----------
    is_native : bool
        Whether the cheapest path is the shortest one, so that OMPL's own objective is used. Its
        cost is OMPL's length [m]: in se2, a radian counts as ``yaw_weight`` metres.
    edge, least : callable
        Take the coordinates of two states; return OMPL's cost of the edge between them, and a
        lower bound of the cost of any path between them.
    scale : float
        Factor on OMPL's costs: 1, except with its own objective.

    Raises
    ------
    SettingsError
        All costs are zero.

    Notes
    -----
    The length is that of the route. For a curve it is that of the chords between its poses, which
    also determine the cells that are crossed. The costmap's cost of a cell is added to each metre
    in it; in cells where the footprint fits only in a part, or only at some headings, a metre has
    the greatest possible cost.

    The duration is that at full speed: the length over ``max_speed``. Where base_link turns while
    it drives, in se2 and along arcs, it is the longer of the length along the arc over
    ``max_speed`` and the turn over ``max_turn_rate``. Acceleration is not modelled.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.costs import CostSettings
    >>> from planners.problem.problem import PlanningProblem
    >>> from planners.sampling.motion_validator2d import MotionValidator2D
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[:32] = -0.5
    >>> grid.fuse(np.array([0, 0]), field)
    >>> costs = CostSettings(confidence_weight=2.0)
    >>> problem = PlanningProblem(grid, start=(4, 4), goal=(30, 4), footprint=0.9, costs=costs)
    >>> validator = MotionValidator2D(Costmap.of(problem), "r2", 1.0)
    >>> objective = Objective(validator, SamplingSettings())
    >>> states = [validator.state_of(xy) for xy in ((4, 12), (10, 12), (10, 20))]
    >>> objective.cost(states[:2]), objective.cost(states), objective.is_native
    (12.0, 24.0, False)
    """

    edge: Callable[..., float]
    least: Callable[..., float]

    def __init__(self, validator: MotionValidator, settings: SamplingSettings) -> None:
        self.space: StateSpace = validator.space
        costmap = validator.costmap if isinstance(validator.costmap, Costmap) else None
        is_uniform = costmap is None or costmap.uniform
        if is_uniform and settings.length_weight == 0 and settings.time_weight == 0:
            expected = "more than 0, as nothing else costs anything"
            raise SettingsError("length_weight", expected, "0")
        self.is_native = is_uniform and not _turns_take_time(self.space, settings)
        speed = settings.length_weight + settings.time_weight / settings.max_speed
        self.scale = speed if self.is_native else 1.0
        self._cost_per_metre = self.scale  # at least
        if costmap is None:
            self.edge = self.least = _distance
        elif self.is_native:
            self.edge = self.least = _ompl_length(costmap, self.space, settings)
        else:
            self.edge = _edge(costmap, self.space, settings)
            self.least = _least(costmap, self.space, settings)
            per_second = settings.time_weight / settings.max_speed
            self._cost_per_metre = _least_cost_per_metre(costmap, settings) + per_second

    def cost(self, states: Sequence[Pose]) -> float:
        """Return the cost of a path."""
        return self.scale * math.fsum(self.edge(*a, *b) for a, b in pairwise(states))

    def max_length(self, cost: float) -> float:
        """Return an upper bound of the length of a path of a given cost [m]."""
        return cost / self._cost_per_metre if self._cost_per_metre > 0 else math.inf

    def check(self, planner: str) -> None:
        """Check that a planner supports the objective.

        Raises
        ------
        ProblemError
            The planner minimises the length only; the message names those that support it.
        """
        cost_aware = COST_AWARE - (NOT_COST_AWARE_IN_DUBINS if self.space == "dubins" else set())
        if not self.is_native and planner not in cost_aware:
            expected = f"one that supports costs and times in {self.space!r}"
            hint = f"Take one of these: {', '.join(sorted(cost_aware))}."
            raise ProblemError("planner", expected, repr(planner), hint=hint)

    def to_ompl(self, base: Any, information: Any, poll: Callable[[], None]) -> Any:
        """Return the objective as OMPL's.

        Parameters
        ----------
        base : module
            OMPL's.
        information : object
            OMPL's space information.
        poll : callable
            Called at intervals; it may raise to end the search.
        """
        if self.is_native:
            return base.PathLengthOptimizationObjective(information)
        read, ompl_cost, zero = reader(self.space), base.Cost, base.Cost(0.0)
        calls, schedule = count(1), PollSchedule(poll)

        def to_method(cost: Callable[..., float]) -> Callable[..., Any]:
            def method(_: Any, a: Any, b: Any) -> Any:
                if (call := next(calls)) >= schedule.due:
                    schedule(call)
                return ompl_cost(cost(*read(a), *read(b)))

            return method

        # The class is made here: one that outlives the search is reported as a leak at exit.
        methods = {
            "stateCost": lambda _, state: zero,
            "motionCost": to_method(self.edge),
            "motionCostHeuristic": to_method(self.least),
        }
        return type("Costs", (base.OptimizationObjective,), methods)(information)


def _turns_take_time(space: StateSpace, settings: SamplingSettings) -> bool:
    """Whether the duration of a path is not simply its length over the speed."""
    if settings.time_weight == 0 or space in FLAT:
        return False
    speed_on_arcs = settings.max_turn_rate * settings.turning_radius
    return space not in TURNING or speed_on_arcs < settings.max_speed


def _ompl_length(
    costmap: Costmap, space: StateSpace, settings: SamplingSettings
) -> Callable[..., float]:
    """Return a function for OMPL's distance between two states."""
    if space == "r2":
        return _distance
    numbers = _numbers(costmap, settings)
    if space in TURNING:
        return partial(curve_length, space == "dubins", numbers)
    yaw_weight = settings.yaw_weight
    return lambda ax, ay, a, bx, by, b: (
        math.hypot(bx - ax, by - ay) + yaw_weight * abs(math.remainder(b - a, math.tau))
    )


def _edge(costmap: Costmap, space: StateSpace, settings: SamplingSettings) -> Callable[..., float]:
    costs = np.minimum(costmap.costs, MAX_NON_OBSTACLE)
    shared = costs, _numbers(costmap, settings), _prices(costmap, settings)
    if space == "r2":
        return partial(line_cost, *shared)
    if space == "se2":
        return partial(slide_cost, *shared)
    return partial(curve_cost, space == "dubins", *shared)


def _least(costmap: Costmap, space: StateSpace, settings: SamplingSettings) -> Callable[..., float]:
    """Return a function for the cost of the shortest path over the cheapest cells.

    For curves this is the shortest curve, a far tighter bound than the straight line. It is less
    than any real cost by more than rounding errors: BIT* prunes states that can't improve its
    route, and with a bound above the real cost it prunes the route's own vertices and crashes.
    """
    metre = BOUND_FACTOR * _least_cost_per_metre(costmap, settings)
    second = BOUND_FACTOR * settings.time_weight
    drive, turn = second / settings.max_speed, second / settings.max_turn_rate
    if space == "r2":
        return lambda ax, ay, bx, by: (metre + drive) * math.hypot(bx - ax, by - ay)

    def least(length: float, a: float, b: float) -> float:
        turned = abs(math.remainder(b - a, math.tau))
        return metre * length + max(drive * length, turn * turned)

    if space == "se2":
        return lambda ax, ay, a, bx, by, b: least(math.hypot(bx - ax, by - ay), a, b)
    numbers = _numbers(costmap, settings)
    metre *= _shortest_chord(numbers)
    length_of = partial(curve_length, space == "dubins", numbers)
    return lambda ax, ay, a, bx, by, b: least(length_of(ax, ay, a, bx, by, b), a, b)


def _least_cost_per_metre(costmap: Costmap, settings: SamplingSettings) -> float:
    """Return the least cost of a metre, without its duration."""
    cheapest = min(int(costmap.costs.min()), MAX_NON_OBSTACLE)
    return settings.length_weight + costmap.top * cheapest / MAX_NON_OBSTACLE


def _distance(*places: float) -> float:
    half = len(places) // 2
    return math.dist(places[:half], places[half:])


def _numbers(costmap: Costmap, settings: SamplingSettings) -> Floats:
    size = costmap.window.resolution
    shape = shape_of(costmap.problem.shape, size, slack=costmap.slack)
    return np.array([size, settings.turning_radius / size, *shape[3:]])


def _prices(costmap: Costmap, settings: SamplingSettings) -> Floats:
    size, second = costmap.window.resolution, settings.time_weight
    prices = np.empty(4)
    prices[LENGTH] = settings.length_weight * size
    prices[COST] = size * costmap.top / MAX_NON_OBSTACLE
    prices[DRIVE] = second * size / settings.max_speed
    prices[TURN] = second / settings.max_turn_rate
    return prices


def _shortest_chord(numbers: Floats) -> float:
    """Return the least ratio of a chord between two poses to its arc."""
    # As in `cuts`: steps are at most half a cell long, and deviate from their chord by the bulge.
    radius, arm, bulge = map(float, numbers[[TURNING_RADIUS, ARM, BULGE]])
    half = min(math.acos(max(1.0 - bulge / (radius + arm), 0.0)), 0.25 / radius)
    return math.sin(half) / half
