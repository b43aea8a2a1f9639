"""States that a route may end in: clear, within the tolerances, the goal itself first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import PlanningProblem, ProblemError, SamplingSettings
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.sampling.goal_sampling import MIN_SAMPLES, SAMPLES, goal_states
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.settings import StateSpace
from strategies import rngs

CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
TURNS: list[StateSpace] = ["se2", "dubins", "reeds_shepp"]
ALL: list[StateSpace] = ["r2", *TURNS]


def validator_over(
    field: Any, space: StateSpace, *, footprint: Any = 0.5, resolution: float = 0.25
) -> MotionValidator2D:
    grid = grid_of(field, resolution=resolution)
    ends: dict[str, Any] = {"start": (1, 1, 0), "goal": (1, 1, 0)}
    problem = PlanningProblem(grid, **ends, footprint=footprint, clear_start=False)
    return MotionValidator2D(Costmap.of(problem), space, 1.0)


def on_map(validator: MotionValidator2D, states: list[tuple[float, ...]]) -> np.ndarray:
    places = np.array(states)[:, :2]
    return np.asarray(places + validator.costmap.window.origin)


def speckled(rng: np.random.Generator) -> Bools:
    blocked: Bools = rng.random((48, 48)) < rng.choice([0.01, 0.05, 0.2])
    return blocked


@pytest.mark.parametrize("space", ALL)
def test_without_tolerances_the_clear_goals_are_returned_in_order(space: StateSpace) -> None:
    field = free_field(48, 48)
    field[:, 30:] = BLOCKED
    validator = validator_over(field, space)
    options = SamplingSettings(goals=((2.0, 9.0, 1.0), (9.0, 2.0, 1.0), (5.0, 5.0, 2.0)))
    states = goal_states(validator, options, (4.0, 3.0, 0.5), seed=0)
    asked = [(4.0, 3.0, 0.5), (2.0, 9.0, 1.0), (5.0, 5.0, 2.0)]
    assert states == [validator.state_of(pose) for pose in asked]


@pytest.mark.parametrize("space", ALL)
@given(
    rng=rngs(),
    radius=st.floats(0.1, 4.0),
    tolerance=st.floats(0.01, math.pi),
    seed=st.integers(0, 9),
)
@settings(max_examples=25)
def test_states_are_clear_and_within_the_tolerances_and_sorted_by_distance(
    space: StateSpace, rng: np.random.Generator, radius: float, tolerance: float, seed: int
) -> None:
    validator = validator_over(np.where(speckled(rng), BLOCKED, FREE), space, footprint=CAR)
    goal = (*rng.uniform(1.0, 11.0, 2).tolist(), float(rng.uniform(-math.pi, math.pi)))
    options = SamplingSettings(goal_radius=radius, goal_yaw_tolerance=tolerance, yaw_weight=0.5)
    states = goal_states(validator, options, goal, seed)
    own = validator.state_of(goal)
    assert (own in states) == validator.is_clear(*own, *own)
    assert own not in states[1:]
    distances = []
    for state in states:
        assert validator.is_clear(*state, *state)
        distance = math.dist(state[:2], own[:2])
        assert distance <= radius + 1e-9
        turn = 0.0 if space == "r2" else abs(math.remainder(state[2] - own[2], math.tau))
        assert turn <= tolerance + 1e-9
        distances.append(distance + 0.5 * turn)
    np.testing.assert_allclose(distances, sorted(distances), atol=1e-9)


def test_samples_are_uniform_over_the_disc() -> None:
    validator = validator_over(free_field(48, 48), "r2")
    shares = []
    for seed in range(20):
        states = goal_states(validator, SamplingSettings(goal_radius=3.0), (6, 6), seed)
        assert len(states) == SAMPLES + 1
        distance = np.hypot(*(on_map(validator, states[1:]) - (6, 6)).T)
        shares.append(np.mean(distance <= 1.5))  # a quarter of the area
    assert abs(np.mean(shares) - 0.25) < 0.05


def test_a_small_pocket_of_free_cells_is_sampled() -> None:
    field = np.full((200, 200), BLOCKED, dtype=np.float32)
    field[120:124, 40:44] = FREE  # 1 m² of the disc of 314 m²
    for space in ALL:
        validator = validator_over(field, space, footprint=0.3)
        states = goal_states(validator, SamplingSettings(goal_radius=10.0), (12, 25, 0), seed=0)
        assert states
        assert (np.abs(on_map(validator, states) - (10.5, 30.5)) <= 0.5).all()


def test_a_goal_radius_larger_than_the_map_is_clipped_to_the_map() -> None:
    validator = validator_over(free_field(48, 48), "r2")
    states = goal_states(validator, SamplingSettings(goal_radius=1e6), (500, 500), seed=0)
    assert len(states) == SAMPLES
    assert goal_states(validator, SamplingSettings(goal_radius=10), (500, 500), seed=0) == []


@pytest.mark.parametrize("space", TURNS)
def test_a_goal_without_a_yaw_is_sampled_at_the_yaws_that_fit(space: StateSpace) -> None:
    field = np.full((48, 48), BLOCKED, dtype=np.float32)
    field[20:25, 4:44] = FREE  # 1.25 m wide, which the car fits in along x only
    validator = validator_over(field, space, footprint=CAR)
    options = SamplingSettings(goal_yaw_tolerance=math.pi)
    goal = (6.0, 5.625)
    states = goal_states(validator, options, goal, seed=0)
    assert len(states) > 5
    turns = np.array([state[2] for state in states])
    assert (np.abs(np.sin(turns)) < 0.3).all()
    assert {np.cos(turn) > 0 for turn in turns} == {True, False}
    assert goal_states(validator, options, (*goal, math.pi / 2), seed=0)
    assert (
        goal_states(
            validator, SamplingSettings(goal_yaw_tolerance=1.0), (*goal, math.pi / 2), seed=0
        )
        == []
    )


def test_equal_seeds_repeat_the_samples_and_other_seeds_do_not() -> None:
    validator = validator_over(free_field(48, 48), "se2", footprint=CAR)
    options = SamplingSettings(goal_radius=1.0, goal_yaw_tolerance=0.5)
    first, again, other = (goal_states(validator, options, (6, 6, 1), seed) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_many_goals_share_the_samples() -> None:
    validator = validator_over(free_field(48, 48), "r2")
    goals = tuple((x, y) for x in np.linspace(2, 9, 10).tolist() for y in (3.0, 6.0))
    states = goal_states(
        validator, SamplingSettings(goals=goals, goal_radius=0.5), (10, 10), seed=0
    )
    assert len(states) == 21 + 21 * MIN_SAMPLES


def test_in_3d_samples_fill_the_ball() -> None:
    grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    grid.fuse(np.zeros(3, dtype=np.int64), np.full((16, 16, 16), FREE, dtype=np.float32))
    validator = MotionValidator3D(
        Voxels.of(PlanningProblem(grid, start=(4, 4, 4), goal=(4, 4, 4), footprint=0.5))
    )
    states = goal_states(
        validator, SamplingSettings(goal_radius=2.0, goals=((1.5, 1.5, 1.5),)), (4, 4, 4), seed=0
    )
    assert states[:2] == [validator.state_of((4, 4, 4)), validator.state_of((1.5, 1.5, 1.5))]
    assert len(states) == SAMPLES + 2
    assert np.ptp(np.array(states)[:, 2]) > 2.0
    blocked = np.full((16, 16, 16), BLOCKED, dtype=np.float32)
    blocked[10:13, 10:13, 10:13] = FREE
    grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    grid.fuse(np.zeros(3, dtype=np.int64), blocked)
    problem = PlanningProblem(grid, start=(5.75,) * 3, goal=(3, 3, 3), footprint=0.7)
    pocket = MotionValidator3D(Voxels.of(problem))
    states = goal_states(pocket, SamplingSettings(goal_radius=6.0), (3, 3, 3), seed=0)
    assert states
    np.testing.assert_allclose(states, [pocket.state_of((5.75,) * 3)] * len(states), atol=0.1)


@pytest.mark.parametrize("space", TURNS)
def test_goals_without_a_yaw_need_a_flat_space_or_a_full_yaw_tolerance(space: StateSpace) -> None:
    validator = validator_over(free_field(48, 48), space)
    with pytest.raises(ProblemError, match=r"goal: expected x, y \[m\] and yaw \[rad\] in .* got"):
        goal_states(validator, SamplingSettings(goal_yaw_tolerance=3.0), (6, 6), seed=0)
    with pytest.raises(SettingsError, match=r"goals\[1\]: expected x, y \[m\] and yaw .* got"):
        goal_states(validator, SamplingSettings(goals=((1, 1, 1), (2, 2))), (6, 6, 0), seed=0)


def test_goals_of_too_few_or_too_many_coordinates_are_rejected() -> None:
    validator = validator_over(free_field(48, 48), "r2")
    for wrong in ((1.0,), (1.0, 2.0, 3.0, 4.0)):
        with pytest.raises(SettingsError, match=r"goals\[0\]: .* and optionally yaw .* in r2, got"):
            goal_states(validator, SamplingSettings(goals=(wrong,)), (6, 6), seed=0)
