"""Views of a known world: exact without noise, complete, and never through a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap import View
from groundmap.arrays import Bools, Floats, Ints
from groundmap.simulate.drive import Drive, DriveSettings, drive
from groundmap.simulate.landmarks import Landmarks, Marks, strew
from groundmap.simulate.observe import observe
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import Solid, World
from strategies import rngs

PERFECT: dict[str, Any] = {
    "pixel_noise_px": 0.0, "missing": 0.0, "false_matches": 0.0,
    "max_points": 100_000, "max_segments": 100_000,
}  # fmt: skip
NO_POINTS = Marks(np.empty((0, 3)), np.empty(0, dtype=np.int64))


def sensor_of(**options: Any) -> SensorSettings:
    return SensorSettings(**{**PERFECT, **options})


def random_world(rng: np.random.Generator) -> World:
    """Boxes ahead of the origin, some of them overhead, some of glass."""
    solids = []
    for _ in range(rng.integers(1, 6)):
        x, y = rng.uniform((3.0, -4.0), (9.0, 4.0))
        bottom = rng.choice([0.0, 0.8])
        outline = shapely.box(x, y, x + rng.uniform(0.3, 3.0), y + rng.uniform(0.3, 3.0))
        top = bottom + rng.uniform(0.3, 1.5)
        solids.append(Solid(outline, bottom=bottom, top=top, transparent=rng.random() < 0.2))
    return World(bounds=(0, -6, 14, 6), solids=tuple(solids), ground_texture=3.0, ground_lines=0.3)


def moves_of(*stops: tuple[float, float, float], **options: float) -> Drive:
    return drive(DriveSettings(stops=stops, **options), np.random.default_rng(1))


STRAIGHT = moves_of((0, 0, 0), (2, 0.5, 10))


def in_map(view: View, true: Floats) -> tuple[Floats, Floats]:
    """Return where points and ends of segments are in the map, by the true pose."""
    T_map_camera = true @ view.rig.T_base_camera
    turn, place = T_map_camera[:3, :3].T, T_map_camera[:3, 3]
    return view.points.xyz @ turn + place, view.segments.xyz @ turn + place


def crossed(world: World, eye: Floats, targets: Floats, grown: float) -> Bools:
    """Return which lines of sight run through a box, by slabs."""
    blocked = np.zeros(len(targets), dtype=np.bool_)
    for solid in world.solids:
        if solid.transparent:
            continue
        xmin, ymin, xmax, ymax = solid.outline.bounds
        low = np.array([xmin, ymin, solid.bottom]) - grown
        high = np.array([xmax, ymax, solid.top]) + grown
        way = targets - eye
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.stack([(low - eye) / way, (high - eye) / way])
        enter, leave = shares.min(axis=0).max(axis=1), shares.max(axis=0).min(axis=1)
        blocked |= np.maximum(enter, 0.0) < np.minimum(leave, 1.0)
    return blocked


@settings(max_examples=15)
@given(rngs())
def test_every_feature_triangulates_back_to_its_landmark(rng: np.random.Generator) -> None:
    world = random_world(rng)
    landmarks = strew(world, rng)
    views = list(observe(world, landmarks, STRAIGHT, sensor_of(), seed=1))
    assert sum(len(view.points) for view in views) > 0
    for view, true in zip(views, STRAIGHT.true, strict=True):
        points, ends = in_map(view, true)
        wanted = landmarks.points.xyz[view.points.ids]
        np.testing.assert_allclose(points, wanted, atol=1e-6, rtol=0)
        whole = landmarks.segments.xyz[view.segments.ids - len(landmarks.points)]
        assert off_segments(ends, whole).max(initial=0.0) < 1e-6
        assert not view.dropped


def off_segments(ends: Floats, whole: Floats) -> Floats:
    """Return how far both ends are from the segments that they are pieces of, (n, 2)."""
    first, way = whole[:, :1], whole[:, 1:] - whole[:, :1]
    share = ((ends - first) * way).sum(axis=2) / (way**2).sum(axis=2)
    nearest = first + np.clip(share, 0.0, 1.0)[..., None] * way
    distance: Floats = np.linalg.norm(ends - nearest, axis=2)
    return distance


@settings(max_examples=25)
@given(rngs())
def test_all_that_nothing_hides_is_seen_and_nothing_else(rng: np.random.Generator) -> None:
    world, sensor = random_world(rng), sensor_of()
    landmarks = strew(world, rng)
    views = observe(world, landmarks, STRAIGHT, sensor, seed=1)
    for view, true in zip(views, STRAIGHT.true, strict=True):
        eye = (true @ sensor.rig.T_base_camera)[:3, 3]
        places = landmarks.points.xyz
        _, inside = sensor.project(true, places)
        seen = np.zeros(len(places), dtype=np.bool_)
        seen[view.points.ids] = True
        assert len(set(view.points.ids.tolist())) == seen.sum() == len(view.points)
        assert not (seen & ~inside).any()
        assert not (seen & crossed(world, eye, places, -1e-5)).any()
        assert not (~seen & inside & ~crossed(world, eye, places, 1e-7)).any()
        for end in np.moveaxis(in_map(view, true)[1], 1, 0):
            assert not crossed(world, eye, end, -1e-5).any()


def test_views_do_not_depend_on_each_other() -> None:
    rng = np.random.default_rng(1)
    world = random_world(rng)
    landmarks, noisy = strew(world, rng), sensor_of(pixel_noise_px=0.5, missing=0.2, fragments=0.3)
    whole = list(observe(world, landmarks, STRAIGHT, noisy, seed=7))
    part = list(observe(world, landmarks, Drive(*(a[:2] for a in STRAIGHT)), noisy, seed=7))
    other = list(observe(world, landmarks, STRAIGHT, noisy, seed=8))
    assert (len(whole), len(part)) == (len(STRAIGHT.times), 2)
    for one, same in zip(whole[:2], part, strict=True):
        for mine, its in ((one.points, same.points), (one.segments, same.segments)):
            np.testing.assert_array_equal(mine.xyz, its.xyz)
            np.testing.assert_array_equal(mine.ids, its.ids)
    assert not np.array_equal(whole[0].points.ids, other[0].points.ids)


def test_views_have_the_poses_that_the_log_has_and_its_times() -> None:
    moves = moves_of((0, 0, 0), (3, 0, 30), position_noise=0.5, yaw_noise=0.1, seconds_per_view=0.5)
    world = World(bounds=(0, -6, 14, 6))
    landmarks = strew(world, np.random.default_rng(1))
    views = list(observe(world, landmarks, moves, sensor_of(), seed=1))
    for view, true, logged, time in zip(views, *moves, strict=True):
        np.testing.assert_array_equal(view.T_map_base, logged)
        assert view.timestamp == time
        points, _ = in_map(view, true)
        np.testing.assert_allclose(points, landmarks.points.xyz[view.points.ids], atol=1e-6)


@pytest.mark.parametrize("most", [0, 1, 30])
def test_no_more_is_matched_than_told(most: int) -> None:
    rng = np.random.default_rng(1)
    world = random_world(rng)
    landmarks, one = strew(world, rng), Drive(*(a[:1] for a in STRAIGHT))
    (every,) = observe(world, landmarks, one, sensor_of(), seed=1)
    (some,) = observe(world, landmarks, one, sensor_of(max_points=most, max_segments=most), seed=1)
    for all_of, picked in ((every.points, some.points), (every.segments, some.segments)):
        assert len(picked) == min(most, len(all_of))
        assert set(picked.ids.tolist()) <= set(all_of.ids.tolist())


def test_of_a_segment_half_behind_a_box_the_other_half_is_seen() -> None:
    # From the origin, a box from y = 0.2 on at x = 2 to 2.2 hides y > 0.46 at x = 5 (0.2 / 2.2).
    world = World(bounds=(0, -6, 14, 6), solids=(Solid(shapely.box(2, 0.2, 2.2, 3), top=3.0),))
    ground = np.array([-1], dtype=np.int64)
    whole = Marks(np.array([[(5.0, -2.0, 1.0), (5.0, 2.0, 1.0)]]), ground)
    (view,) = observe(world, Landmarks(NO_POINTS, whole), moves_of((0, 0, 0)), sensor_of(), seed=1)
    assert view.segments.ids.tolist() == [0]
    _, ends = in_map(view, np.eye(4))
    np.testing.assert_allclose(ends[0, 0], (5.0, -2.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(ends[0, 1, [0, 2]], (5.0, 1.0), atol=1e-6)
    hidden_from = 5.0 * 0.2 / 2.2
    assert hidden_from - 0.5 <= ends[0, 1, 1] <= hidden_from  # places are 0.5 m apart


def test_of_a_segment_across_a_pole_the_longer_piece_is_seen() -> None:
    world = World(bounds=(0, -6, 14, 6), solids=(Solid(shapely.box(2, 0.2, 2.2, 0.5), top=3.0),))
    whole = Marks(np.array([[(5.0, -2.0, 1.0), (5.0, 2.0, 1.0)]]), np.array([-1], dtype=np.int64))
    (view,) = observe(world, Landmarks(NO_POINTS, whole), moves_of((0, 0, 0)), sensor_of(), seed=1)
    _, ends = in_map(view, np.eye(4))
    assert ends[:, :, 1].tolist() == [[pytest.approx(-2.0), pytest.approx(0.0)]]


def test_what_moves_is_seen_where_it_is_then() -> None:
    car = Solid(shapely.box(4, -2, 6, -1), top=1.0, velocity=(0.0, 1.0), present=(0.0, 2.5))
    world = World(bounds=(0, -6, 14, 6), solids=(car,), ground_texture=0.0)
    landmarks, still = strew(world, np.random.default_rng(1)), np.tile(np.eye(4), (4, 1, 1))
    moves = Drive(still, still, np.arange(4.0))
    views = list(observe(world, landmarks, moves, sensor_of(), seed=1))
    for time, view in enumerate(views[:3]):
        points, _ = in_map(view, np.eye(4))
        assert len(points) > 0
        moved = landmarks.points.xyz[view.points.ids] + (0.0, float(time), 0.0)
        np.testing.assert_allclose(points, moved, atol=1e-6)
    assert len(views[3].points) == len(views[3].segments) == 0


def test_ids_tell_points_from_segments() -> None:
    rng = np.random.default_rng(1)
    world = random_world(rng)
    landmarks = strew(world, rng)
    split, whole = len(landmarks.points), len(landmarks.points) + len(landmarks.segments)
    for view in observe(world, landmarks, STRAIGHT, sensor_of(fragments=1.0), seed=1):
        lines: Ints = view.segments.ids
        assert (view.points.ids < split).all()
        assert ((split <= lines) & (lines < whole)).all()
        assert (np.unique(lines, return_counts=True)[1] == 2).all()  # both pieces bear its id
