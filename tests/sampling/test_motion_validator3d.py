"""Lines of a ball among voxels are clear if and only if the ball keeps its distance."""

from __future__ import annotations

import math
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize_scalar

from groundmap.arrays import Bools, Floats
from groundmap.grid.grid import ConfidenceGrid
from planners import AuditError, PlanningProblem
from planners.audit.audit import audit
from planners.costmap.voxel_map import FARTHEST_SQUARED, Voxels
from planners.geometry.rounding import SLACK
from planners.problem.problem import Pose
from planners.sampling.kernels.edges3d import line_clear
from planners.sampling.motion_validator3d import MotionValidator3D
from strategies import rngs

SIDE = 16  # [voxels] of a map
FINE = 64  # places along a line at which the slow oracle begins
ENOUGH = 3 * (2 * SIDE + 5) ** 2  # [(half voxels)²] farther than anything on such a map


def speckled(rng: np.random.Generator, *, shares: tuple[float, ...] = (0.002, 0.02, 0.1)) -> Bools:
    blocked: Bools = rng.random((SIDE,) * 3) < rng.choice(shares)
    return blocked


def masks() -> st.SearchStrategy[Bools]:
    """Draw blocked voxels, or none."""
    shapes = st.tuples(*[st.integers(1, 6)] * 3)
    cells = st.sampled_from([False, False, False, False, True])
    return shapes.flatmap(lambda shape: arrays(np.bool_, shape, elements=cells))


def validator_over(
    blocked: Bools, radius: float, *, size: float = 0.5, **asked: Any
) -> MotionValidator3D:
    grid = ConfidenceGrid(resolution=size, origin=(-3.0, 2.0, 1.0))
    grid.fuse(np.zeros(3, dtype=np.int64), np.where(blocked, 1.0, -1.0).astype(np.float32))
    middle = np.array([-3.0, 2.0, 1.0]) + 0.5 * SIDE * size
    ends: dict[str, Any] = {"start": middle, "goal": middle, "clear_start": False}
    return MotionValidator3D(Voxels.of(PlanningProblem(grid, **ends, footprint=radius, **asked)))


def state_in(validator: MotionValidator3D, rng: np.random.Generator, *, grain: float = 0.0) -> Pose:
    """Draw a place in the tile; with a grain [voxels], one on such a lattice."""
    at = rng.uniform(2.0, SIDE + 2.0, 3)
    if grain > 0.0:
        at = np.round(at / grain) * grain
    return tuple((at * validator.costmap.window.resolution).tolist())


def line_in(
    validator: MotionValidator3D,
    rng: np.random.Generator,
    *,
    grain: float = 0.0,
    longest: float = SIDE,
) -> tuple[Pose, Pose]:
    a, b = (
        np.array(state_in(validator, rng, grain=grain)),
        np.array(state_in(validator, rng, grain=grain)),
    )
    away = np.linalg.norm(b - a)
    if grain == 0.0 and away > 0.0:
        b = a + (b - a) * min(1.0, rng.uniform(0.0, longest) / away)
    return tuple(a.tolist()), tuple(b.tolist())


def gaps(points: Floats, cubes: Floats, size: float) -> Floats:
    """Return the distances of points [m] to cubes [voxels]."""
    beyond = np.maximum(np.maximum(cubes * size - points, points - (cubes + 1.0) * size), 0.0)
    distances: Floats = np.sqrt((beyond**2).sum(axis=-1))
    return distances


def clearance(validator: MotionValidator3D, a: Pose, b: Pose) -> float:
    """Return the distance [m] of a line to the blocked cubes.

    Along a line, the distance to a cube is convex: SciPy finds its minimum. Cubes are left out if
    another one is closer by more than the spacing of the sampled places.
    """
    size, first, last = validator.costmap.window.resolution, np.array(a), np.array(b)
    cubes = np.argwhere(validator.costmap.blocked)[:, ::-1].astype(np.float64)
    places = first + np.linspace(0.0, 1.0, FINE + 1)[:, None] * (last - first)
    rough = np.min([gaps(place, cubes, size) for place in places], axis=0)
    least = float(rough.min())
    for cube in cubes[rough <= least + math.dist(a, b) / FINE]:
        minimum = minimize_scalar(
            lambda t, cube=cube: gaps(first + t * (last - first), cube, size) ** 2,
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 1e-12},
        )
        least = min(least, math.sqrt(minimum.fun))
    return least


# Lines


@pytest.mark.parametrize("radius", [0.0, 0.2, 0.5, 1.3])
@given(rng=rngs())
@settings(max_examples=15)
def test_a_line_is_clear_if_and_only_if_the_ball_keeps_its_distance(
    radius: float, rng: np.random.Generator
) -> None:
    validator = validator_over(speckled(rng), radius)
    for longest in (0.3, 2.0, SIDE):
        a, b = line_in(validator, rng, longest=longest)
        away = clearance(validator, a, b)
        if abs(away - radius) > 1e-6 or away == 0.0:
            assert validator.is_clear(*a, *b) == (away >= max(radius, 1e-9))


@pytest.mark.parametrize("size", [0.01, 0.5, 8.0])
@given(rng=rngs(), radius=st.sampled_from([0.25, 0.5, math.sqrt(0.5), 1.0, 1.75]))
@settings(max_examples=20)
def test_a_line_is_clear_if_and_only_if_the_audit_passes_it(
    size: float, radius: float, rng: np.random.Generator
) -> None:
    # On a lattice of quarters of voxels, lines touch cubes that they must not enter.
    validator = validator_over(speckled(rng), radius * size, size=size)
    for grain in (0.0, 0.25, 0.5):
        a, b = line_in(validator, rng, grain=grain, longest=SIDE * size)
        start, goal = validator.poses([a, b])
        asked = asked_along(validator, start, goal)
        if validator.is_clear(*a, *b):
            audit(asked, np.array([start, goal]))
        else:
            with pytest.raises(AuditError, match="comes too close to"):
                audit(asked, np.array([start, goal]))


def asked_along(validator: MotionValidator3D, start: Floats, goal: Floats) -> PlanningProblem:
    """Return the problem of a line on the same map."""
    of = validator.costmap.problem
    return PlanningProblem(
        of.grid, start=start, goal=goal, footprint=of.footprint, clear_start=False
    )


@given(rng=rngs(), grain=st.sampled_from([0.0, 0.25, 1.0]))
@settings(max_examples=40)
def test_the_reversed_line_is_clear_if_the_line_is(rng: np.random.Generator, grain: float) -> None:
    validator = validator_over(speckled(rng), 0.5)
    for _ in range(20):
        a, b = line_in(validator, rng, grain=grain)
        assert validator.is_clear(*a, *b) == validator.is_clear(*b, *a)


@given(rng=rngs())
@settings(max_examples=30)
def test_a_part_of_a_clear_line_is_clear(rng: np.random.Generator) -> None:
    validator = validator_over(speckled(rng), 0.3)
    for _ in range(20):
        a, b = line_in(validator, rng)
        if validator.is_clear(*a, *b):
            inner = np.sort(rng.random(8))[:, None]
            states = np.array(a) + inner * (np.array(b) - np.array(a))
            assert validator.are_clear([a, *map(tuple, states.tolist()), b])


@pytest.mark.parametrize(
    ("radius", "off", "passes"),
    [(1.0, 0.0, True), (1.0, 1e-3, False), (0.999, 1e-3, True), (1.0 + 1e-6, 0.0, False)],
)
def test_a_ball_passes_a_hole_of_exactly_its_size(radius: float, off: float, passes: bool) -> None:
    blocked = np.zeros((SIDE,) * 3, dtype=np.bool_)
    blocked[:, :, 8] = True
    blocked[5:9, 5:9, 8] = False  # 2 m wide, around (5.5, 4.5)
    validator = validator_over(blocked, radius)
    states = [validator.state_of((x, 5.5 + off, 4.5)) for x in (-1.0, 3.0)]
    assert validator.are_clear(states) == passes


def test_states_off_the_map_are_not_clear() -> None:
    validator = validator_over(np.zeros((SIDE,) * 3, dtype=np.bool_), 0.5, unknown="allow")
    assert (validator.squared == FARTHEST_SQUARED).all()
    width = 0.5 * validator.squared.shape[0]
    inside = 3.0, 3.0, 3.0
    for axis, beyond in product(range(3), (-1e-9, width, math.inf, math.nan)):
        outside = tuple(beyond if i == axis else value for i, value in enumerate(inside))
        assert not validator.is_clear(*inside, *outside)
        assert not validator.is_clear(*outside, *inside)
        assert not validator.is_clear(*outside, *outside)
    corners = product((0.0, math.nextafter(width, 0.0)), repeat=3)
    places = np.random.default_rng(0).uniform(0.0, width, (500, 3)).tolist()
    for corner, place in product(corners, places):  # whose sums round to places off the map
        assert validator.is_clear(*place, *corner)
    assert validator.is_clear(*inside, *inside)


def test_the_kernel_agrees_with_its_python_function() -> None:
    validator = validator_over(np.zeros((SIDE,) * 3, dtype=np.bool_), 0.5)
    a, b = (3.0, 3.0, 3.0), (6.0, 5.0, 4.0)
    assert validator.is_clear(*a, *b) is True  # the only type that OMPL's bindings accept
    assert line_clear.py_func(validator.squared, 0.5, 0.5, SLACK, *a, *b)


# Regions


@pytest.mark.parametrize("radius", [0.0, 0.2, 0.5])
@given(rng=rngs())
@settings(max_examples=25)
def test_reachable_states_lie_in_the_region_and_its_bounds(
    radius: float, rng: np.random.Generator
) -> None:
    validator = validator_over(speckled(rng, shares=(0.1, 0.35, 0.6)), radius)
    states = [state for _ in range(60) for state in line_in(validator, rng, longest=1.5)]
    for a, b in zip(states[::2], states[1::2], strict=True):
        bounds, region = validator.bounds(a, b), validator.region(a)
        if validator.is_clear(*a, *b):
            assert bounds is not None
            assert region[validator.cell_of(a)]
            assert region[validator.cell_of(b)]
        assert (bounds is not None) == region[validator.cell_of(b)]
        if bounds is not None:
            assert all(bounds[i] <= c[i] <= bounds[i + 3] for c in (a, b) for i in range(3))


@given(rng=rngs())
@settings(max_examples=15)
def test_a_clear_place_outside_a_region_belongs_to_a_disjoint_region(
    rng: np.random.Generator,
) -> None:
    validator = validator_over(speckled(rng, shares=(0.2, 0.4)), 0.3)
    states = [state_in(validator, rng, grain=grain) for grain in (0.0, 0.5, 1.0) for _ in range(15)]
    clear = [state for state in states if validator.is_clear(*state, *state)]
    for a, b in pairwise(clear):
        here, there = validator.region(a), validator.region(b)
        assert here[validator.cell_of(a)]
        assert (here == there).all() if here[validator.cell_of(b)] else not (here & there).any()
        assert not (here & validator.costmap.blocked).any()


def test_a_wall_or_a_far_too_narrow_hole_separates_regions() -> None:
    blocked = np.zeros((SIDE,) * 3, dtype=np.bool_)
    blocked[:, :, 8] = True
    for hole, radius, joined in ((0, 0.0, False), (1, 0.7, False), (1, 0.2, True), (4, 0.7, True)):
        blocked[6 : 6 + hole, 6 : 6 + hole, 8] = False
        validator = validator_over(blocked, radius)
        start, goal = validator.state_of((-1.0, 4.0, 4.0)), validator.state_of((3.0, 4.0, 4.0))
        assert (validator.bounds(start, goal) is not None) == joined
    assert validator.bounds(start, validator.state_of((1.25, 2.5, 2.5))) is None  # within the wall


# Paths


@given(rng=rngs())
@settings(max_examples=20)
def test_places_survive_the_conversion_to_states(rng: np.random.Generator) -> None:
    validator = validator_over(np.zeros((SIDE,) * 3, dtype=np.bool_), 0.5)
    given_places = rng.uniform((-2.0, 2.0, 1.0), (4.0, 8.0, 7.0), (5, 3))
    states = [validator.state_of((*place, 0.7)) for place in given_places.tolist()]
    np.testing.assert_allclose(validator.poses(states), given_places, rtol=0.0, atol=1e-12)
    assert [validator.cell_of(state) for state in states] == [
        tuple(validator.costmap.window.world_to_cell(place)[0]) for place in given_places
    ]


def test_the_longest_edge_grows_with_the_clearance() -> None:
    blocked = np.zeros((SIDE,) * 3, dtype=np.bool_)
    lengths = []
    for share in (0.0, 0.01, 0.1):
        blocked |= np.random.default_rng(1).random(blocked.shape) < share
        validator = validator_over(blocked, 0.1)
        start = validator.state_of((1.0, 6.0, 5.0))
        bounds = validator.bounds(start, start)
        assert bounds is not None
        lengths.append(validator.max_edge_length(validator.region(start), bounds))
    assert lengths[0] == pytest.approx(0.2 * SIDE * 0.5 * math.sqrt(3.0))  # limited by the extent
    assert lengths[0] >= lengths[1] > lengths[2] > 0.0
