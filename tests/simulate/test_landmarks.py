"""Landmarks: on their surfaces, in the set densities, and moving with their owners."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.simulate.landmarks import (
    GROUND,
    LONGEST,
    OFF,
    LandmarkSet,
    present_at,
    sample_landmarks,
)
from groundmap.simulate.shapes import pole, table, wall
from groundmap.simulate.world import Hole, Solid, World
from strategies import rngs

HAIR = 1e-5  # [m]
BLOCK = shapely.box(4, 4, 7, 6)
PIT = shapely.box(12, 2, 15, 5)
BOUNDS = (0.0, 0.0, 20.0, 10.0)

WORLD = World(
    bounds=BOUNDS,
    solids=(
        Solid(BLOCK, top=1.5),
        Solid(wall([(1, 1), (1, 8), (3, 8)]), top=2.0, lines=1.0),
        Solid(shapely.box(8, 6, 11, 9).difference(shapely.box(9, 7, 10, 8)), top=1.0),
        Solid(pole(17, 7, radius=0.3), top=3.0, texture=20.0),
        *table(16, 1, 18, 3),
        Solid(shapely.box(8, 1, 9, 2), top=1.0, velocity=(0.5, 0.25), present=(2.0, 5.0)),
    ),
    holes=(Hole(PIT, depth=1.25),),
    ground_lines=0.2,
)


def of(marks: LandmarkSet, owner: int) -> Floats:
    xyz: Floats = marks.xyz[marks.owner == owner]
    return xyz


def off_the_sides(solid: Solid, xyz: Floats) -> Floats:
    """Return the distances of points from the upright faces [m]."""
    from_outline = shapely.distance(shapely.points(xyz[:, :2]), solid.outline.boundary)
    from_heights = np.maximum(solid.bottom - xyz[:, 2], xyz[:, 2] - solid.top)
    distance: Floats = np.hypot(from_outline, np.maximum(from_heights, 0.0))
    return distance


def off_the_top(solid: Solid, xyz: Floats) -> Floats:
    from_outline = shapely.distance(shapely.points(xyz[:, :2]), solid.outline)
    distance: Floats = np.hypot(from_outline, xyz[:, 2] - solid.top)
    return distance


def area_of(solid: Solid) -> float:
    """Area of the sides and the top [m²]."""
    return float(solid.outline.length * (solid.top - solid.bottom) + solid.outline.area)


def assert_poisson(count: int, mean: float) -> None:
    assert abs(count - mean) <= 5.0 * np.sqrt(mean)


@settings(max_examples=15)
@given(rngs())
def test_points_lie_a_hair_off_the_surface_of_their_owner(rng: np.random.Generator) -> None:
    points = sample_landmarks(WORLD, rng).points
    for row, solid in enumerate(WORLD.solids):
        xyz = of(points, row)
        assert (np.minimum(off_the_sides(solid, xyz), off_the_top(solid, xyz)) < HAIR).all()
        inside = shapely.contains_xy(solid.outline, xyz[:, :2])
        assert (~inside | (xyz[:, 2] > solid.top)).all()


@settings(max_examples=15)
@given(rngs())
def test_points_of_no_solid_lie_on_the_ground_or_in_a_hole(rng: np.random.Generator) -> None:
    xyz = of(sample_landmarks(WORLD, rng).points, GROUND)
    inside = shapely.contains_xy(PIT, xyz[:, :2])
    on_floor = inside & (xyz[:, 2] == -1.25)
    rim = shapely.distance(shapely.points(xyz[:, :2]), PIT.boundary)
    on_walls = inside & (rim < HAIR) & (xyz[:, 2] > -1.25) & (xyz[:, 2] < 0)
    on_ground = ~inside & (xyz[:, 2] == 0)
    assert (on_floor | on_walls | on_ground).all()
    assert on_floor.any()
    assert on_walls.any()
    assert (shapely.distance(shapely.points(xyz[:, :2]), shapely.box(*BOUNDS)) == 0).all()


@settings(max_examples=15)
@given(rngs())
def test_the_number_of_points_follows_the_densities(rng: np.random.Generator) -> None:
    points = sample_landmarks(WORLD, rng).points
    for row, solid in enumerate(WORLD.solids):
        assert_poisson(len(of(points, row)), solid.texture * area_of(solid))
    ground = of(points, GROUND)
    assert_poisson(len(ground), WORLD.ground_texture * (200.0 + PIT.length * 1.25))
    floor = ground[ground[:, 2] == -1.25]
    assert_poisson(len(floor), WORLD.ground_texture * PIT.area)


def test_points_are_spread_evenly_over_a_face_and_a_top() -> None:
    block = Solid(BLOCK, top=1.5, texture=400.0)
    xyz = sample_landmarks(
        World(bounds=BOUNDS, solids=(block,)), np.random.default_rng(1)
    ).points.xyz
    front = xyz[np.abs(xyz[:, 1] - (4.0 - OFF)) < 1e-9]  # the face at y = 4
    for along, low, high in ((front[:, 0], 4.0, 7.0), (front[:, 2], 0.0, 1.5)):
        counts, _ = np.histogram(along, bins=6, range=(low, high))
        for count in counts.tolist():
            assert_poisson(count, 400.0 * 3.0 * 1.5 / 6)
    top = xyz[xyz[:, 2] > 1.5]
    counts, _, _ = np.histogram2d(top[:, 0], top[:, 1], bins=(3, 2), range=((4, 7), (4, 6)))
    for count in counts.ravel().tolist():
        assert_poisson(int(count), 400.0)


@settings(max_examples=15)
@given(rngs())
def test_segments_lie_on_the_sides_of_their_owner(rng: np.random.Generator) -> None:
    segments = sample_landmarks(WORLD, rng).segments
    for row, solid in enumerate(WORLD.solids):
        ends = of(segments, row)
        for places in (ends[:, 0], ends[:, 1], ends.mean(axis=1)):
            assert (off_the_sides(solid, places) < HAIR).all()
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        assert (lengths <= LONGEST + 1e-9).all()
        upright = np.abs(ends[:, 1, :2] - ends[:, 0, :2]).max(axis=1) < 1e-9
        level = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) < 1e-9
        assert (upright ^ level).all()


def test_upper_and_upright_edges_are_covered_from_end_to_end() -> None:
    block = Solid(BLOCK, top=1.5, lines=0.0)
    world = World(bounds=BOUNDS, solids=(block,))
    ends = sample_landmarks(world, np.random.default_rng(1)).segments.xyz
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    upright = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) > 0
    assert (ends[~upright, :, 2] == 1.5).all()
    assert lengths[upright].sum() == pytest.approx(4 * 1.5)
    assert lengths[~upright].sum() == pytest.approx(BLOCK.length)
    assert upright.sum() == 4 * 2  # 1.5 m in pieces of 1.2 m at most
    assert (~upright).sum() == 2 * 3 + 2 * 2
    upper = shapely.union_all(shapely.linestrings(ends[~upright, :, :2]))
    assert shapely.hausdorff_distance(upper, BLOCK.boundary) < HAIR


def test_the_number_of_segments_follows_the_densities() -> None:
    block = Solid(BLOCK, top=1.5, lines=30.0, edges=False)
    ground = World(bounds=BOUNDS, solids=(block,), ground_lines=10.0)
    segments = sample_landmarks(ground, np.random.default_rng(1)).segments
    ends = of(segments, 0)
    upright = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) > 0
    for count in (int(upright.sum()), int((~upright).sum())):
        assert_poisson(count, 30.0 * BLOCK.length * 1.5)
    assert_poisson(len(of(segments, GROUND)), 10.0 * 200.0)


@settings(max_examples=15)
@given(rngs())
def test_lines_on_the_ground_lie_on_it_and_not_over_holes(rng: np.random.Generator) -> None:
    ends = of(sample_landmarks(WORLD, rng).segments, GROUND)
    assert (ends[..., 2] == 0).all()
    assert shapely.distance(shapely.linestrings(ends[..., :2]), PIT).min(initial=np.inf) > 0
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert ((lengths >= 0.3 - 1e-9) & (lengths <= LONGEST + 1e-9)).all()


def test_a_bare_world_has_no_landmarks() -> None:
    bare = Solid(BLOCK, top=1.5, texture=0.0, lines=0.0, edges=False)
    world = World(bounds=BOUNDS, solids=(bare,), holes=(Hole(PIT, depth=1.0),), ground_texture=0.0)
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    assert (len(landmarks.points), len(landmarks.segments)) == (0, 0)
    assert landmarks.points.xyz.shape == (0, 3)
    assert landmarks.segments.xyz.shape == (0, 2, 3)


def test_the_same_seed_samples_the_same_landmarks() -> None:
    one, same, other = (sample_landmarks(WORLD, np.random.default_rng(seed)) for seed in (1, 1, 2))
    for mine, its, theirs in zip(one, same, other, strict=True):
        np.testing.assert_array_equal(mine.xyz, its.xyz)
        np.testing.assert_array_equal(mine.owner, its.owner)
        assert not np.array_equal(mine.xyz[:50], theirs.xyz[:50])


def test_landmarks_move_appear_and_vanish_with_their_owner() -> None:
    landmarks, moving = sample_landmarks(WORLD, np.random.default_rng(1)), len(WORLD.solids) - 1
    for marks in landmarks:
        theirs = marks.owner == moving
        assert theirs.any()
        for time, there in ((0.0, False), (2.0, True), (4.5, True), (5.0, False)):
            xyz, present = present_at(marks, WORLD, time)
            np.testing.assert_array_equal(present, ~theirs | there)
            np.testing.assert_array_equal(xyz[~theirs], marks.xyz[~theirs])
            shift = xyz[theirs] - marks.xyz[theirs]
            np.testing.assert_allclose(
                shift, np.broadcast_to((0.5 * time, 0.25 * time, 0.0), shift.shape), atol=1e-12
            )


def test_a_world_of_more_landmarks_than_memory_is_refused() -> None:
    box = Solid(shapely.box(4, 4, 5, 5), top=1.0, texture=4e6)
    for world in (
        World(bounds=(0, 0, 1e5, 6e4), ground_texture=12.0),
        World(bounds=(0, 0, 10, 10), solids=(box,)),
    ):
        with pytest.raises(InputError, match=r"^world: expected at most 1e\+06 landmarks, got"):
            sample_landmarks(world, np.random.default_rng(1))


def test_a_ramp_carries_its_landmarks_on_its_slope_and_below() -> None:
    ramp = Solid(BLOCK, top=1.5, slope=(0.5, 0.0), texture=40.0, lines=2.0)
    points, segments = sample_landmarks(
        World(bounds=BOUNDS, solids=(ramp,), ground_texture=0.0), np.random.default_rng(1)
    )
    heights = 0.5 * (points.xyz[:, 0] - 4.0)
    assert (points.xyz[:, 2] <= heights + HAIR).all()
    inside = shapely.contains_xy(BLOCK.buffer(-HAIR), points.xyz[:, :2])
    np.testing.assert_allclose(points.xyz[inside, 2], heights[inside], atol=HAIR)
    assert inside.sum() == pytest.approx(40.0 * BLOCK.area, rel=0.15)
    ends = segments.xyz.reshape(-1, 3)
    assert (ends[:, 2] <= 0.5 * (ends[:, 0] - 4.0) + HAIR).all()


def test_an_underside_has_points_and_lower_edges_only_if_it_has_a_texture() -> None:
    def sampled(underside: float) -> tuple[Floats, Floats]:
        slab = Solid(BLOCK, bottom=2.0, top=2.1, underside=underside)
        world = World(bounds=BOUNDS, solids=(slab,), ground_texture=0.0)
        points, segments = sample_landmarks(world, np.random.default_rng(1))
        return points.xyz, segments.xyz

    bare, textured = sampled(0.0), sampled(30.0)
    below = textured[0][textured[0][:, 2] < 2.0]
    assert len(below) == pytest.approx(30.0 * BLOCK.area, rel=0.15)
    np.testing.assert_allclose(below[:, 2], 2.0 - OFF)
    assert shapely.contains_xy(BLOCK, below[:, :2]).all()
    np.testing.assert_array_equal(textured[0][: len(bare[0])], bare[0])
    assert not (bare[1][..., 2] < 2.0).any()
    lower = textured[1][(textured[1][..., 2] < 2.0).all(axis=1)]
    assert np.linalg.norm(lower[:, 1] - lower[:, 0], axis=1).sum() == pytest.approx(BLOCK.length)
