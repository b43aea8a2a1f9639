"""What sampling planners make small: the length, what the map adds to it, and the time."""

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
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.ompl_states import Glance, reader
from planners.sampling.settings import FLAT, TURNING, SamplingSettings, StateSpace

# Planners that compare costs while they search. OMPL doesn't tell: the others take an objective,
# too, and never ask it. PRM and PRM* would, from a thread of their own, which waits for Python's
# lock while the search that holds it waits for the thread: it never ends.
HEEDING = frozenset({"bfmt", "bitstar", "fmt", "informedrrtstar", "rrtstar", "sorrtstar"})
# There, FMT asks for hundreds of thousands of costs between two looks at the clock, and its twin
# can't plan at all.
HEEDLESS_FORWARD = frozenset({"bfmt", "fmt"})
SURE = 1.0 - 1e-10  # share of a lower bound that rounding leaves below the cost


class Objective:
    """What a path costs.

    ``length_weight`` times its length, plus what the map's costs add to each metre of base_link's
    line, plus ``time_weight`` times the seconds it takes.

    Parameters
    ----------
    validator : MotionValidator or MotionValidator3D
        On a 3-D map, all metres cost the same.
    settings : SamplingSettings

    Attributes
    ----------
    is_native : bool
        Whether the cheapest path is the shortest one, so that OMPL's own objective does. Its cost
        is what OMPL calls the length, in metres: in "se2", a radian counts as ``yaw_weight`` of
        them.
    edge, least : callable
        Take the numbers of two states. What the edge between them costs, as OMPL counts; what no
        path between them can cost less than.
    scale : float
        What OMPL's costs are multiplied by: 1, but for its own objective.

    Raises
    ------
    SettingsError
        Nothing costs anything.

    Notes
    -----
    The length is that of the route: a curve's is that of the chords between its poses, of which
    the cells count that they cross. A metre in a cell costs what the costmap says, extra; in cells
    where only a part of them, or only some headings, leave room for the footprint, it costs as
    much as the dearest metre there can be.

    Seconds are those at full speed: the length over ``max_speed``. Where base_link turns while it
    drives, in "se2" and along arcs, it takes as long as the slower of both: the length, along the
    arc, or the turn over ``max_turn_rate``. Nothing is added for speeding up and down.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.costs import CostSettings
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> field = np.full((64, 64), -1.0, dtype=np.float32)
    >>> field[:32] = -0.5
    >>> grid.fuse(np.array([0, 0]), field)
    >>> costs = CostSettings(confidence_weight=2.0)
    >>> problem = PlanningProblem(grid, start=(4, 4), goal=(30, 4), footprint=0.9, costs=costs)
    >>> validator = MotionValidator(Costmap.of(problem), "r2", 1.0)
    >>> objective = Objective(validator, SamplingSettings())
    >>> states = [validator.state_of(xy) for xy in ((4, 12), (10, 12), (10, 20))]
    >>> objective.cost(states[:2]), objective.cost(states), objective.is_native
    (12.0, 24.0, False)
    """

    edge: Callable[..., float]
    least: Callable[..., float]

    def __init__(
        self, validator: MotionValidator | MotionValidator3D, settings: SamplingSettings
    ) -> None:
        self.space: StateSpace = validator.space
        costmap = validator.costmap if isinstance(validator, MotionValidator) else None
        plain = costmap is None or costmap.uniform
        if plain and settings.length_weight == 0 and settings.time_weight == 0:
            expected = "more than 0, as nothing else costs anything"
            raise SettingsError("length_weight", expected, "0")
        self.is_native = plain and not _turns_take_time(self.space, settings)
        speed = settings.length_weight + settings.time_weight / settings.max_speed
        self.scale = speed if self.is_native else 1.0
        self._metre = self.scale  # what a metre costs at least
        if costmap is None:
            self.edge = self.least = _distance
        elif self.is_native:
            self.edge = self.least = _native(costmap, self.space, settings)
        else:
            self.edge = _edge(costmap, self.space, settings)
            self.least = _least(costmap, self.space, settings)
            self._metre = _metre(costmap, settings) + settings.time_weight / settings.max_speed

    def cost(self, states: Sequence[Pose]) -> float:
        """Return what a path costs."""
        return self.scale * math.fsum(self.edge(*a, *b) for a, b in pairwise(states))

    def longest(self, cost: float) -> float:
        """Return how long a path is at most that costs so much [m]."""
        return cost / self._metre if self._metre > 0 else math.inf

    def check(self, planner: str) -> None:
        """Check that a planner heeds the objective, or need not.

        Raises
        ------
        ProblemError
            It looks at lengths only; the sentence names those that don't.
        """
        heeding = HEEDING - HEEDLESS_FORWARD if self.space == "dubins" else HEEDING
        if not self.is_native and planner not in heeding:
            expected = f"one that heeds costs and times in {self.space!r}"
            hint = f"Take one of these: {', '.join(sorted(heeding))}."
            raise ProblemError("planner", expected, repr(planner), hint=hint)

    def as_ompl(self, base: Any, information: Any, look: Callable[[], None]) -> Any:
        """Return the objective as OMPL takes it; it looks around now and then."""
        if self.is_native:
            return base.PathLengthOptimizationObjective(information)
        read, cost, nothing = reader(self.space), base.Cost, base.Cost(0.0)
        calls, glance = count(1), Glance(look)

        def priced(price: Callable[..., float]) -> Callable[..., Any]:
            def method(_: Any, a: Any, b: Any) -> Any:
                if (call := next(calls)) >= glance.due:
                    glance(call)
                return cost(price(*read(a), *read(b)))

            return method

        # The class is made here: one that outlives the search is reported as a leak at exit.
        methods = {
            "stateCost": lambda _, state: nothing,
            "motionCost": priced(self.edge),
            "motionCostHeuristic": priced(self.least),
        }
        return type("Costs", (base.OptimizationObjective,), methods)(information)


def _turns_take_time(space: StateSpace, settings: SamplingSettings) -> bool:
    """Whether the seconds of a path are not simply its length over the speed."""
    if settings.time_weight == 0 or space in FLAT:
        return False
    tightest = settings.max_turn_rate * settings.turning_radius
    return space not in TURNING or tightest < settings.max_speed


def _native(
    costmap: Costmap, space: StateSpace, settings: SamplingSettings
) -> Callable[..., float]:
    """Return OMPL's distance between two states."""
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
    told = costs, _numbers(costmap, settings), _prices(costmap, settings)
    if space == "r2":
        return partial(line_cost, *told)
    if space == "se2":
        return partial(slide_cost, *told)
    return partial(curve_cost, space == "dubins", *told)


def _least(costmap: Costmap, space: StateSpace, settings: SamplingSettings) -> Callable[..., float]:
    """Return what gives the cost of the shortest path between two states over the cheapest cells.

    Of curves, that is the shortest one, and not the straight line: it tells far more. It is less
    than any real cost by more than rounding: BIT* prunes what can't improve its route, and where
    rounding made this bound the larger one, it pruned vertices of the route itself and crashed.
    """
    metre, second = SURE * _metre(costmap, settings), SURE * settings.time_weight
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


def _metre(costmap: Costmap, settings: SamplingSettings) -> float:
    """Return what a metre costs at least, beside the time it takes."""
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
    """Return the least share that a chord between two poses may be of its arc."""
    # As `cuts` does it: steps are half a cell long at most, and leave their chord by the bulge.
    radius, arm, bulge = map(float, numbers[[TURNING_RADIUS, ARM, BULGE]])
    half = min(math.acos(max(1.0 - bulge / (radius + arm), 0.0)), 0.25 / radius)
    return math.sin(half) / half
