"""Edges between sampled states are clear if and only if their swept area is."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats
from oracles_curves import placed_at
from oracles_planning import BLOCKED, FREE, grid_of, union_of_squares
from planners.costmap.costmap import Costmap
from planners.geometry.polyline import length_of
from planners.problem.problem import PlanningProblem
from planners.sampling.kernels.edges import curve_clear, slide_clear
from planners.sampling.kernels.lines import line_clear
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.settings import StateSpace
from strategies import rngs

CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
ELL = [(-0.6, -0.6), (0.9, -0.6), (0.9, 0.0), (0.0, 0.0), (0.0, 0.9), (-0.6, 0.9)]
SIZE, SIDE = 0.5, 24  # [m] of a cell, [cells] of a map
FINE = 200  # poses that a slow oracle checks along an edge


def speckled(rng: np.random.Generator) -> Bools:
    blocked: Bools = rng.random((SIDE, SIDE)) < rng.choice([0.01, 0.03, 0.1])
    return blocked


def validator_over(
    blocked: Bools, footprint: Any, space: StateSpace, *, radius: float = 1.0
) -> MotionValidator2D:
    grid = grid_of(np.where(blocked, BLOCKED, FREE), resolution=SIZE)
    ends: dict[str, Any] = {"start": (1, 1, 0), "goal": (1, 1, 0)}
    problem = PlanningProblem(grid, **ends, footprint=footprint, clear_start=False)
    return MotionValidator2D(Costmap.of(problem), space, radius)


def forbidden(validator: MotionValidator2D) -> shapely.Geometry:
    """Return the blocked squares [m, map]."""
    window = validator.costmap.window
    squares = union_of_squares(validator.costmap.blocked)
    return shapely.transform(squares, lambda xy: xy * window.resolution + window.origin)


def pose_of(rng: np.random.Generator) -> tuple[float, float, float]:
    x, y = rng.uniform(1.0, SIZE * SIDE - 1.0, 2).tolist()
    return x, y, float(rng.uniform(-math.pi, math.pi))


@pytest.mark.parametrize("radius", [0.0, 0.3, 1.1])
@given(rng=rngs())
@settings(max_examples=40)
def test_a_line_is_clear_if_and_only_if_the_disc_keeps_its_distance(
    radius: float, rng: np.random.Generator
) -> None:
    validator = validator_over(speckled(rng), radius, "r2")
    walls = forbidden(validator)
    for _ in range(20):
        a, b = pose_of(rng)[:2], pose_of(rng)[:2]
        away = float(shapely.distance(shapely.LineString([a, b]), walls))
        assume(abs(away - radius) > 1e-9 or away == 0.0)
        expected = away >= max(radius, 1e-9)
        assert validator.is_clear(*validator.state_of(a), *validator.state_of(b)) == expected


@pytest.mark.parametrize("footprint", [0.5, CAR, ELL])
@pytest.mark.parametrize("space", ["se2", "dubins", "reeds_shepp"])
@given(rng=rngs())
@settings(max_examples=12)
def test_an_edge_is_clear_if_its_swept_area_is(
    space: StateSpace, footprint: Any, rng: np.random.Generator
) -> None:
    validator = validator_over(speckled(rng), footprint, space)
    walls = forbidden(validator)
    shape = validator.costmap.problem.shape
    outline = shapely.Point(0, 0).buffer(0.5) if shape.is_disc else shapely.Polygon(shape.polygon)
    for _ in range(6):
        a, b = (validator.state_of(pose_of(rng)) for _ in range(2))
        poses = validator.poses([a, b])
        swept = shapely.union_all([placed_at(outline, pose) for pose in denser(poses)])
        inside = shapely.buffer(walls, -1e-6, join_style="mitre")
        outside = shapely.buffer(walls, 0.02)  # a step of a curve is about 1 mm off its chord
        if validator.is_clear(*a, *b):
            assert not swept.intersects(inside)
            assert within_map(validator, poses)
        elif within_map(validator, poses):
            dense = denser(denser(denser(poses)))  # a corner may touch between two poses
            assert any(placed_at(outline, pose).intersects(outside) for pose in dense)


def denser(poses: Floats) -> Floats:
    """Return poses with those half-way between, in order."""
    turns = np.remainder(np.diff(poses[:, 2]) + np.pi, 2.0 * np.pi) - np.pi
    steps = np.column_stack([np.diff(poses[:, :2], axis=0), turns])
    pairs = np.stack([poses[:-1], poses[:-1] + 0.5 * steps], axis=1)
    return np.concatenate([pairs.reshape(-1, 3), poses[-1:]])


def within_map(validator: MotionValidator2D, poses: Floats) -> bool:
    cells = validator.costmap.to_cells(poses[:, :2])
    return bool((cells >= 0).all() and (cells < validator.costmap.blocked.shape[0]).all())


@pytest.mark.parametrize("space", ["r2", "se2", "reeds_shepp"])
@given(rng=rngs())
@settings(max_examples=20)
def test_the_reversed_edge_is_clear_if_the_edge_is(
    space: StateSpace, rng: np.random.Generator
) -> None:
    validator = validator_over(speckled(rng), CAR if space != "r2" else 0.5, space)
    for _ in range(10):
        a, b = (validator.state_of(pose_of(rng)) for _ in range(2))
        assert validator.is_clear(*a, *b) == validator.is_clear(*b, *a)
        there, back = validator.poses([a, b]), validator.poses([b, a])
        np.testing.assert_allclose(back[::-1, :2], there[:, :2], atol=1e-9)


@pytest.mark.parametrize("space", ["se2", "dubins", "reeds_shepp"])
@given(rng=rngs())
@settings(max_examples=20)
def test_poses_lead_from_state_to_state_in_steps_of_half_a_cell(
    space: StateSpace, rng: np.random.Generator
) -> None:
    validator = validator_over(np.zeros((SIDE, SIDE), dtype=np.bool_), CAR, space)
    states = [validator.state_of(pose_of(rng)) for _ in range(4)]
    poses = validator.poses(states)
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= 0.5 * SIZE + 1e-9
    for state in states:
        x, y = state[:2] + validator.costmap.window.origin
        off = np.hypot(poses[:, 0] - x, poses[:, 1] - y)
        turn = np.remainder(poses[:, 2] - state[2] + np.pi, 2.0 * np.pi) - np.pi
        assert (off + np.abs(turn)).min() <= 1e-9
    assert length_of(poses[:, :2]) > 0.0


@given(rng=rngs(), at=st.integers(0, 2**20))
@settings(max_examples=30)
def test_reachable_states_lie_in_the_bounds(rng: np.random.Generator, at: int) -> None:
    rng = np.random.default_rng(at)
    validator = validator_over(rng.random((SIDE, SIDE)) < 0.35, 0.2, "r2")
    states = [validator.state_of(pose_of(rng)[:2]) for _ in range(40)]
    clear = [state for state in states if validator.is_clear(*state, *state)]
    assume(len(clear) > 1)
    for a, b in pairwise(clear):
        bounds = validator.bounds(a, b)
        if validator.is_clear(*a, *b):
            assert bounds is not None
        if bounds is not None:
            for state in (a, b):
                assert bounds[0] <= state[0] <= bounds[2]
                assert bounds[1] <= state[1] <= bounds[3]


@given(rng=rngs())
@settings(max_examples=20)
def test_a_check_outlives_its_validator_and_agrees_with_its_kernel(
    rng: np.random.Generator,
) -> None:
    blocked = speckled(rng)
    for space in get_args(StateSpace):
        if space == "r3":
            continue
        footprint = 0.3 if space == "r2" else CAR
        validator = validator_over(blocked, footprint, space)
        kernel, is_clear = kernel_of(validator), validator.is_clear
        del validator
        gc.collect()
        for _ in range(20):
            ends = [pose_of(rng)[: 2 if space == "r2" else 3] for _ in range(2)]
            assert is_clear(*ends[0], *ends[1]) is kernel(*ends[0], *ends[1])


def kernel_of(validator: MotionValidator2D) -> Callable[..., bool]:
    """Return the check with copies of all its arrays."""
    body: list[Any] = [array.copy() for array in validator.body]
    if validator.space == "r2":
        return partial(
            line_clear,
            body[0],
            body[2],
            SIZE,
            validator.costmap.radius / SIZE,
            validator.shape.touch,
        )
    if validator.space == "se2":
        return partial(slide_clear, *body)
    return partial(curve_clear, validator.space == "dubins", *body)


@pytest.mark.parametrize("footprint", [0.0, 0.3, CAR])
@pytest.mark.parametrize("space", ["r2", "se2", "dubins"])
def test_states_off_the_map_are_not_clear(space: StateSpace, footprint: Any) -> None:
    validator = validator_over(np.zeros((SIDE, SIDE), dtype=np.bool_), footprint, space)
    high = SIZE * np.array(validator.costmap.blocked.shape[::-1])
    inside = validator.state_of((6.0, 6.0, 0.0))[:2]
    yaw = () if space == "r2" else (0.3,)
    assert validator.is_clear(*inside, *yaw, *inside, *yaw)
    for x in (-0.1, np.nextafter(0.0, -1.0), high[0], math.inf, -math.inf, math.nan):
        off = float(x), inside[1]
        assert not validator.is_clear(*inside, *yaw, *off, *yaw)
        assert not validator.is_clear(*off, *yaw, *inside, *yaw)
    corner = tuple(np.nextafter(high, 0.0).tolist())
    assert not validator.is_clear(
        *inside, *yaw, *corner, *yaw
    )  # the surroundings of a map are unknown


def test_the_longest_edge_follows_the_clearance_up_to_a_share_of_the_extent() -> None:
    hall = np.zeros((SIDE, SIDE), dtype=np.bool_)
    lengths = []
    for walls in (hall, speckled_evenly(3), speckled_evenly(2)):
        validator = validator_over(walls, 0.0, "r2")
        state = validator.state_of((SIZE / 2.0, SIZE / 2.0))
        region, bounds = validator.region(state), validator.bounds(state, state)
        assert bounds is not None
        lengths.append(validator.max_edge_length(region, bounds))
    assert lengths[0] == pytest.approx(0.2 * math.sqrt(2.0) * SIZE * SIDE)
    assert lengths[0] > lengths[1] > lengths[2] > SIZE


def speckled_evenly(every: int) -> Bools:
    blocked = np.zeros((SIDE, SIDE), dtype=np.bool_)
    blocked[every - 1 :: every, every - 1 :: every] = True
    return blocked
