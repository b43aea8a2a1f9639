"""Costs of paths: exact along straight lines, close along curves, at least the lower bound."""

from __future__ import annotations

import math
import subprocess
import sys
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, grid_of
from planners import plan
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.errors import ProblemError
from planners.geometry.curves import dubins, reeds_shepp
from planners.geometry.polyline import cross_cells, length_of
from planners.problem.costs import CostSettings
from planners.problem.problem import PlanningProblem, Pose
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.objectives import COST_AWARE, Objective
from planners.sampling.ompl_module import ompl, samplers
from planners.sampling.ompl_states import space_of, state_of
from planners.sampling.settings import SamplingSettings, StateSpace
from strategies import rngs

CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
SIZE, SIDE = 0.5, 24  # [m] of a cell, [cells] of a map
CURVED: tuple[StateSpace, ...] = ("dubins", "reeds_shepp")
PLANE: tuple[StateSpace, ...] = ("r2", "se2", *CURVED)
WEIGHTED = CostSettings(clearance_weight=2.0, confidence_weight=1.0)
PLAIN = CostSettings()
needs_ompl = pytest.mark.skipif(not samplers(), reason="ompl is not installed")


def field_of(rng: np.random.Generator) -> Floats:
    """Return evidence of free cells of all confidences, and a few blocked ones."""
    z = -rng.uniform(0.05, 1.0, (SIDE, SIDE))
    z[rng.random((SIDE, SIDE)) < 0.05] = BLOCKED
    return z


def validator_over(
    z: Floats, space: StateSpace, costs: CostSettings = WEIGHTED, *, disc: float = 0.6
) -> MotionValidator2D:
    ends: dict[str, Any] = {"start": (1, 1, 0), "goal": (1, 1, 0)}
    footprint: Any = disc if space == "r2" else CAR
    problem = PlanningProblem(
        grid_of(z, resolution=SIZE), **ends, footprint=footprint, costs=costs, clear_start=False
    )
    return MotionValidator2D(Costmap.of(problem), space, 1.0)


def objective_of(validator: MotionValidator2D, **options: Any) -> Objective:
    return Objective(validator, SamplingSettings(**options))


def states_of(rng: np.random.Generator, validator: MotionValidator2D, count: int) -> list[Pose]:
    return [
        validator.state_of(
            (*rng.uniform(1.0, SIZE * SIDE - 1.0, 2), rng.uniform(-math.pi, math.pi))
        )
        for _ in range(count)
    ]


def extra_along(validator: MotionValidator2D, line: Floats) -> float:
    """Return the costs that cells add to a line [m, map], computed independently."""
    costmap = validator.costmap
    cells, lengths = cross_cells(costmap.to_cells(line))
    costs = np.minimum(costmap.costs[tuple(cells.T)], 252) / 252
    return float((costs * lengths).sum()) * costmap.window.resolution * costmap.top


def sampled_along(validator: MotionValidator2D, line: Floats, count: int) -> float:
    """Return the same from the cells at dense places on it."""
    costmap, total = validator.costmap, 0.0
    for a, b in pairwise(line):
        places = a + (np.arange(count)[:, None] + 0.5) / count * (b - a)
        col, row = np.floor(costmap.to_cells(places)).astype(int).T
        mean = np.minimum(costmap.costs[row, col], 252).mean() / 252
        total += mean * float(np.hypot(*(b - a))) * costmap.top
    return total


@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs())
@settings(max_examples=15)
def test_a_path_costs_its_length_plus_the_costs_of_its_cells(
    space: StateSpace, rng: np.random.Generator
) -> None:
    validator = validator_over(field_of(rng), space)
    objective = objective_of(validator, length_weight=1.5)
    states = states_of(rng, validator, 4)
    line = validator.poses(states)[:, :2]
    expected = 1.5 * length_of(line) + extra_along(validator, line)
    assert objective.cost(states) == pytest.approx(expected, rel=1e-9)
    assert objective.cost(states) == pytest.approx(
        sum(objective.edge(*a, *b) for a, b in pairwise(states)), rel=1e-12
    )


@pytest.mark.parametrize("space", ["r2", "se2"])
@given(rng=rngs())
@settings(max_examples=15)
def test_dense_samples_of_a_line_converge_to_its_cost(
    space: StateSpace, rng: np.random.Generator
) -> None:
    validator = validator_over(field_of(rng), space)
    objective = objective_of(validator, length_weight=0.0)
    states = states_of(rng, validator, 2)
    exact, line = objective.cost(states), validator.poses(states)[[0, -1], :2]
    off = [abs(sampled_along(validator, line, count) - exact) for count in (1000, 100_000)]
    # Each of at most 2 * SIDE borders is off by less than one of the places.
    steps = validator.costmap.top * length_of(line) * 2 * SIDE
    assert off[0] <= steps / 1000
    assert off[1] <= steps / 100_000


def test_the_costs_of_lines_on_a_simple_map_are_those_worked_out_by_hand() -> None:
    z = np.full((SIDE, SIDE), -1.0)
    z[:, 12:] = -0.5  # from x = 6 m on, a metre costs half as much again
    costs = CostSettings(confidence_weight=1.0)
    validator = validator_over(z, "r2", costs)
    objective = objective_of(validator)
    low, right, high = (validator.state_of(xy) for xy in ((4.0, 4.0), (8.0, 4.0), (8.0, 7.0)))
    assert objective.edge(*low, *right) == 2.0 + 2.0 * 1.5
    assert objective.edge(*right, *high) == 3.0 * 1.5
    assert objective.edge(*low, *high) == pytest.approx(5.0 * 1.25)
    assert objective.edge(*low, *low) == 0.0
    assert objective.cost([low, right, high]) == 9.5


def test_a_metre_in_a_cell_with_a_blocked_centre_has_the_greatest_cost() -> None:
    z = np.full((SIDE, SIDE), -1.0)
    z[11] = BLOCKED  # from y = 5.5 m on: 0.45 m from the line, 0.25 m from its cells' centres
    costs = CostSettings(clearance_weight=3.0, inflation_radius=1.0)
    validator = validator_over(z, "r2", costs, disc=0.3)
    a, b = validator.state_of((4.0, 5.05)), validator.state_of((8.0, 5.05))
    assert validator.is_clear(*a, *b)
    cells = np.floor(validator.costmap.to_cells([(4.2, 5.05), (7.8, 5.05)])).astype(int)
    assert validator.costmap.costs[tuple(cells.T[::-1])].tolist() == [253, 253]
    assert objective_of(validator).edge(*a, *b) == pytest.approx(4.0 * (1.0 + 3.0))


@pytest.mark.parametrize("space", ["r2", "se2"])
@given(rng=rngs(), share=st.floats(0.0, 1.0))
@settings(max_examples=40)
def test_the_cost_of_a_line_is_the_sum_of_its_parts(
    space: StateSpace, rng: np.random.Generator, share: float
) -> None:
    validator = validator_over(field_of(rng), space)
    objective = objective_of(validator, time_weight=0.7, max_turn_rate=0.4)
    a, b = states_of(rng, validator, 2)
    change = [q - p for p, q in zip(a, b, strict=True)]
    if space == "se2":
        change[2] = math.remainder(change[2], math.tau)
    middle = tuple(p + share * d for p, d in zip(a, change, strict=True))
    parts = objective.edge(*a, *middle) + objective.edge(*middle, *b)
    assert parts == pytest.approx(objective.edge(*a, *b), rel=1e-9)


@pytest.mark.parametrize("space", ["r2", "se2", "reeds_shepp"])
@given(rng=rngs())
@settings(max_examples=30)
def test_a_reversed_path_has_the_same_cost(space: StateSpace, rng: np.random.Generator) -> None:
    validator = validator_over(field_of(rng), space)
    objective = objective_of(validator, time_weight=0.7, max_turn_rate=0.4)
    a, b = states_of(rng, validator, 2)
    assert objective.edge(*b, *a) == pytest.approx(objective.edge(*a, *b), rel=1e-9)


@pytest.mark.parametrize("costs", [PLAIN, WEIGHTED])
@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs(), speed=st.floats(0.1, 5.0))
@settings(max_examples=15)
def test_no_path_costs_less_than_the_lower_bound(
    space: StateSpace, costs: CostSettings, rng: np.random.Generator, speed: float
) -> None:
    validator = validator_over(field_of(rng), space, costs)
    objective = objective_of(validator, time_weight=0.7, max_turn_rate=0.4, max_speed=speed)
    states = states_of(rng, validator, 5)
    a, b = states[0], states[-1]
    least = objective.least(*a, *b)
    assert 0.0 <= least <= objective.edge(*a, *b) * (1.0 + 1e-9)
    assert least <= objective.cost(states) * (1.0 + 1e-9)
    if not objective.is_native:
        assert least >= math.dist(a[:2], b[:2]) * (1.0 + 0.7 / speed) * (1.0 - 1e-3)
    assert objective.least(*a, *a) == 0.0


@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs())
@settings(max_examples=10)
def test_with_uniform_cells_the_cost_is_proportional_to_the_length(
    space: StateSpace, rng: np.random.Generator
) -> None:
    z = np.full((SIDE, SIDE), -0.5)
    validator = validator_over(z, space, CostSettings(confidence_weight=2.0))
    objective = objective_of(validator)
    poses = np.column_stack([rng.uniform(5.0, 7.0, (4, 2)), rng.uniform(-3.0, 3.0, 4)])
    states = [validator.state_of(pose) for pose in poses.tolist()]
    length = length_of(validator.poses(states)[:, :2])
    assert objective.cost(states) == pytest.approx(2.0 * length, rel=1e-9)
    if space in ("r2", "se2"):
        assert objective.least(*states[0], *states[1]) == pytest.approx(objective.cost(states[:2]))


@given(rng=rngs())
@settings(max_examples=30)
def test_the_duration_of_a_line_is_that_of_the_slower_of_drive_and_turn(
    rng: np.random.Generator,
) -> None:
    speed, rate = rng.uniform(0.2, 3.0, 2).tolist()
    options = {"length_weight": 0.0, "time_weight": 2.0, "max_speed": speed, "max_turn_rate": rate}
    validator = validator_over(np.full((SIDE, SIDE), -1.0), "se2", PLAIN)
    a, b = states_of(rng, validator, 2)
    turned = abs(math.remainder(b[2] - a[2], math.tau))
    seconds = max(math.dist(a[:2], b[:2]) / speed, turned / rate)
    assert objective_of(validator, **options).edge(*a, *b) == pytest.approx(2.0 * seconds)
    place = validator_over(np.full((SIDE, SIDE), -0.5), "r2", CostSettings(confidence_weight=1e-9))
    line = objective_of(place, **options).edge(*a[:2], *b[:2])
    assert line == pytest.approx(2.0 * math.dist(a[:2], b[:2]) / speed)


@pytest.mark.parametrize("space", CURVED)
@given(rng=rngs())
@settings(max_examples=30)
def test_the_duration_of_a_curve_is_that_of_all_its_arcs(
    space: StateSpace, rng: np.random.Generator
) -> None:
    speed, rate = rng.uniform(0.2, 3.0, 2).tolist()
    options = {"length_weight": 0.0, "time_weight": 2.0, "max_speed": speed, "max_turn_rate": rate}
    validator = validator_over(
        np.full((SIDE, SIDE), -0.5), space, CostSettings(confidence_weight=1e-9)
    )
    a, b = states_of(rng, validator, 2)
    curve = (dubins if space == "dubins" else reeds_shepp)(a, b, radius=1.0)
    arcs = zip(np.abs(curve.lengths), np.abs(curve.curvatures), strict=True)
    seconds = sum(max(length / speed, length * bend / rate) for length, bend in arcs)
    assert objective_of(validator, **options).edge(*a, *b) == pytest.approx(2.0 * seconds)


@needs_ompl
@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs())
@settings(max_examples=15)
def test_a_cost_of_length_only_is_that_of_ompl(space: StateSpace, rng: np.random.Generator) -> None:
    validator = validator_over(np.full((SIDE, SIDE), -1.0), space, PLAIN)
    options = SamplingSettings(yaw_weight=0.3, length_weight=4.0)
    objective = Objective(validator, options)
    assert objective.is_native
    base = ompl().base
    theirs = space_of(base, space, (0.0, 0.0, 20.0, 20.0), options)
    information = base.SpaceInformation(theirs)
    information.setup()
    native = objective.to_ompl(base, information, lambda: None)
    assert type(native) is base.PathLengthOptimizationObjective
    a, b = states_of(rng, validator, 2)
    x, y = state_of(theirs, a, space), state_of(theirs, b, space)
    assert objective.edge(*a, *b) == pytest.approx(native.motionCost(x, y).value(), rel=1e-6)
    assert objective.least(*a, *b) == objective.edge(*a, *b)
    assert objective.scale == 4.0
    assert objective.cost([a, b]) == pytest.approx(4.0 * native.motionCost(x, y).value(), rel=1e-6)


@needs_ompl
@pytest.mark.parametrize("space", PLANE)
def test_ompl_uses_our_costs(space: StateSpace) -> None:
    rng = np.random.default_rng(7)
    validator = validator_over(field_of(rng), space)
    objective = objective_of(validator, time_weight=1.0)
    base, geometric, _ = ompl()
    theirs = space_of(base, space, (0.0, 0.0, 20.0, 20.0), SamplingSettings())
    information = base.SpaceInformation(theirs)
    information.setup()
    asked = objective.to_ompl(base, information, lambda: None)
    states = states_of(rng, validator, 4)
    path = geometric.PathGeometric(information)
    for state in states:
        path.append(state_of(theirs, state, space))
    assert path.cost(asked).value() == pytest.approx(objective.cost(states), rel=1e-12)
    a, b = (state_of(theirs, state, space) for state in states[:2])
    assert asked.motionCostHeuristic(a, b).value() == objective.least(*states[0], *states[1])
    assert asked.isSymmetric() == (space != "dubins")


def test_the_objective_is_native_if_the_cheapest_path_is_the_shortest() -> None:
    z = np.full((SIDE, SIDE), -1.0)
    cases: list[tuple[StateSpace, dict[str, float], bool]] = [
        ("r2", {}, True),
        ("r2", {"length_weight": 3.0}, True),
        ("r2", {"length_weight": 0.0, "time_weight": 1.0}, True),
        ("se2", {}, True),
        ("se2", {"time_weight": 1.0}, False),
        ("dubins", {"time_weight": 1.0}, True),
        ("dubins", {"time_weight": 1.0, "max_turn_rate": 0.9}, False),
        ("reeds_shepp", {"time_weight": 1.0, "max_speed": 1.1}, False),
    ]
    for space, options, is_native in cases:
        assert objective_of(validator_over(z, space, PLAIN), **options).is_native == is_native
        assert not objective_of(validator_over(z, space), **options).is_native


def test_planners_without_cost_support_are_rejected_on_costs() -> None:
    z = np.full((SIDE, SIDE), -1.0)
    expensive, plain = (objective_of(validator_over(z, "r2", costs)) for costs in (WEIGHTED, PLAIN))
    for planner in COST_AWARE:
        expensive.check(planner)
    for planner in ("rrtconnect", "prmstar"):
        plain.check(planner)
        with pytest.raises(ProblemError, match=rf"costs .* in 'r2', got '{planner}'.* bfmt, bit"):
            expensive.check(planner)
    curved = objective_of(validator_over(z, "dubins"))
    curved.check("bitstar")
    with pytest.raises(ProblemError, match=r"in 'dubins', got 'fmt'. .*: bitstar, informedrrt"):
        curved.check("fmt")


def test_weights_that_are_all_zero_are_rejected() -> None:
    z = np.full((SIDE, SIDE), -1.0)
    with pytest.raises(SettingsError, match="length_weight: expected more than 0, as nothing else"):
        objective_of(validator_over(z, "r2", PLAIN), length_weight=0.0)
    assert objective_of(validator_over(z, "r2"), length_weight=0.0).edge(1, 1, 2, 2) > 0.0


def test_the_cost_on_a_3d_map_is_the_length() -> None:
    grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    problem = PlanningProblem(grid, start=(4, 4, 4), goal=(5, 5, 5), footprint=0.8)
    objective = Objective(MotionValidator3D(Voxels.of(problem)), SamplingSettings(time_weight=2.0))
    assert objective.is_native
    assert objective.edge(0, 0, 0, 1, 2, 2) == objective.least(0, 0, 0, 1, 2, 2) == 3.0


@pytest.mark.parametrize("costs", [PLAIN, WEIGHTED])
@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs())
@settings(max_examples=10)
def test_no_path_is_longer_than_its_cost_allows(
    space: StateSpace, costs: CostSettings, rng: np.random.Generator
) -> None:
    validator = validator_over(field_of(rng), space, costs)
    for options in ({}, {"length_weight": 4.0}, {"length_weight": 0.1, "time_weight": 1.0}):
        objective = objective_of(validator, **options)
        states = states_of(rng, validator, 3)
        longest = objective.max_length(objective.cost(states))
        assert length_of(validator.poses(states)[:, :2]) <= longest * (1.0 + 1e-9)


def test_the_length_is_unbounded_if_metres_may_cost_nothing() -> None:
    validator = validator_over(np.full((SIDE, SIDE), -1.0), "r2")
    assert objective_of(validator, length_weight=0.0).max_length(1.0) == math.inf


def around_a_block(space: StateSpace, costs: CostSettings) -> PlanningProblem:
    z = np.full((SIDE, SIDE), -1.0)
    z[8:16, 8:16] = BLOCKED
    return PlanningProblem(
        grid_of(z, resolution=SIZE),
        start=(2.0, 2.0, 0.0),
        goal=(10.0, 10.0, 1.5),
        footprint=0.4 if space == "r2" else [(-0.3, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.3, 0.3)],
        costs=costs,
        clear_start=False,
    )


@needs_ompl
@pytest.mark.parametrize("planner", sorted(COST_AWARE))
def test_routes_of_cost_aware_planners_cost_little_more_than_those_of_a_star(planner: str) -> None:
    problem = around_a_block("r2", CostSettings(clearance_weight=3.0))
    options: dict[str, Any] = (
        {} if "fmt" in planner else {"iterations": 6000 if planner == "bitstar" else 600}
    )
    route = plan(problem, planner, **options)
    assert route.audit == "clean"
    assert route.cost <= 1.03 * plan(problem, "astar").cost
    validator = MotionValidator2D(Costmap.of(problem), "r2", 1.0)
    states = [validator.state_of(xy) for xy in route.waypoints.tolist()]
    assert route.cost == pytest.approx(objective_of(validator).cost(states))


@needs_ompl
@pytest.mark.parametrize("space", PLANE)
def test_a_clearance_weight_increases_the_clearance(space: StateSpace) -> None:
    options: dict[str, Any] = {"space": space, "iterations": 3000}
    near, far = (
        plan(around_a_block(space, CostSettings(clearance_weight=weight)), "bitstar", **options)
        for weight in (0.0, 10.0)
    )
    assert far.mean_clearance > near.mean_clearance + 0.1
    assert far.length > near.length
    assert far.cost >= far.length * (1.0 - 1e-9)


@needs_ompl
def test_a_time_weight_reduces_the_duration() -> None:
    problem = around_a_block("se2", PLAIN)
    options: dict[str, Any] = {"space": "se2", "iterations": 600, "max_turn_rate": 0.2}
    validator = MotionValidator2D(Costmap.of(problem), "se2", 1.0)
    hurried = SamplingSettings(length_weight=0.0, time_weight=1.0, max_turn_rate=0.2)
    costs = []
    other: dict[str, Any] = {"length_weight": 0.0, "time_weight": 1.0}
    for weights in ({}, other):
        route = plan(problem, "rrtstar", **options, **weights)
        poses = np.column_stack([route.waypoints, route.headings]).tolist()
        costs.append(
            Objective(validator, hurried).cost([validator.state_of(pose) for pose in poses])
        )
    assert costs[1] <= costs[0] * (1.0 + 1e-9)


@needs_ompl
def test_a_seed_repeats_a_route_over_costly_cells() -> None:
    problem = around_a_block("r2", CostSettings(clearance_weight=3.0))
    first, again = (plan(problem, "rrtstar", iterations=300, seed=5) for _ in range(2))
    np.testing.assert_array_equal(again.waypoints, first.waypoints)
    assert again.cost == first.cost


@pytest.mark.parametrize("space", PLANE)
@given(rng=rngs())
@settings(max_examples=15)
def test_no_lower_bound_exceeds_a_cost_by_rounding(
    space: StateSpace, rng: np.random.Generator
) -> None:
    # Over cells of the least cost, the exact bound equals the cost.
    validator = validator_over(
        np.full((SIDE, SIDE), -0.5), space, CostSettings(confidence_weight=1.0)
    )
    objective = objective_of(validator)
    for a, b in pairwise(states_of(rng, validator, 40)):
        half: Pose = (*(0.5 * (p + q) for p, q in zip(a[:2], b[:2], strict=True)), *a[2:])
        assert objective.least(*a, *b) < objective.edge(*a, *b)
        assert objective.least(*a, *b) < objective.edge(*a, *half) + objective.edge(*half, *b)


CRASHED = """
import numpy as np
from groundmap import ConfidenceGrid
from planners import PlanningProblem, plan
from planners.problem.costs import CostSettings
grid, rng = ConfidenceGrid(resolution=0.012), np.random.default_rng(7)
field = np.full((24, 24), -1.0, dtype=np.float32)
field[8:16, 4:16] = 1.0
field[rng.random((24, 24)) < 0.05] = -0.3
grid.fuse(np.array([0, 0]), field)
costs = CostSettings(clearance_weight=10.0, inflation_radius=0.0, confidence_weight=10.0)
ends = {"start": 0.012 * np.array([10.3, 3.2]), "goal": 0.012 * np.array([11.7, 20.1])}
problem = PlanningProblem(grid, **ends, footprint=0.0, costs=costs)
print(plan(problem, "bitstar", time_limit=None, iterations=3000, seed=7).audit)
"""


@needs_ompl
def test_bitstar_does_not_prune_its_own_route() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", CRASHED], capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "clean\n", "")
