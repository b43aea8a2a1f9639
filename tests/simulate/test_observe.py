"""Views of a simulated world: exact without noise, complete, never through a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap import View
from groundmap.arrays import Bools, Floats
from groundmap.simulate.drive import Drive, DriveSettings, drive
from groundmap.simulate.landmarks import Landmarks, LandmarkSet, sample_landmarks
from groundmap.simulate.observe import observe
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import Solid, World
from strategies import rngs

PERFECT = {"pixel_noise_px": 0.0, "missing": 0.0, "false_matches": 0.0}
MOST = 100_000
NO_POINTS = LandmarkSet(np.empty((0, 3)), np.empty(0, dtype=np.int64))


def sensor_of(**options: Any) -> SensorSettings:
    return SensorSettings(**{**PERFECT, "max_points": MOST, "max_segments": MOST, **options})


def random_world(rng: np.random.Generator) -> World:
    """Draw boxes ahead of the origin; some are overhead, of glass, or moving."""
    solids = []
    for _ in range(rng.integers(1, 6)):
        x, y = rng.uniform((3.0, -4.0), (9.0, 4.0))
        bottom = rng.choice([0.0, 0.8])
        outline = shapely.box(x, y, x + rng.uniform(0.3, 3.0), y + rng.uniform(0.3, 3.0))
        top = bottom + rng.uniform(0.3, 1.5)
        glass, moves = rng.random() < 0.2, (0.0, rng.choice([0.0, 0.7, -0.7]))
        solids.append(Solid(outline, bottom=bottom, top=top, transparent=glass, velocity=moves))
    return World(bounds=(0, -6, 14, 6), solids=tuple(solids), ground_texture=3.0, ground_lines=0.3)


def moves_of(*stops: tuple[float, float, float], **options: Any) -> Drive:
    return drive(DriveSettings(stops=stops, **options), np.random.default_rng(1))


STRAIGHT = moves_of((0, 0, 0), (2, 0.5, 10))
STILL = Drive(np.tile(np.eye(4), (2, 1, 1)), np.tile(np.eye(4), (2, 1, 1)), np.array([0.0, 1.0]))


def in_map(view: View, true: Floats) -> tuple[Floats, Floats]:
    """Return points and ends of segments in the map, by the true pose."""
    T_map_camera = true @ view.rig.T_base_camera
    turn, place = T_map_camera[:3, :3].T, T_map_camera[:3, 3]
    return view.points.xyz @ turn + place, view.segments.xyz @ turn + place


def at(marks: LandmarkSet, world: World, view: View) -> Floats:
    """Return the places of landmarks at the time of a view."""
    speed = np.array([(0.0, 0.0, 0.0), *((*solid.velocity, 0.0) for solid in world.solids)])
    shift = speed[marks.owner + 1] * (view.timestamp or 0.0)
    return marks.xyz + (shift if marks.xyz.ndim == 2 else shift[:, None])


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
    landmarks = sample_landmarks(world, rng)
    views = list(observe(world, landmarks, STRAIGHT, sensor_of(), seed=1))
    assert sum(len(view.points) for view in views) > 0
    for view, true in zip(views, STRAIGHT.true, strict=True):
        points, ends = in_map(view, true)
        wanted = at(landmarks.points, world, view)[view.points.ids]
        np.testing.assert_allclose(points, wanted, atol=1e-6, rtol=0)
        whole = at(landmarks.segments, world, view)[view.segments.ids - len(landmarks.points)]
        assert off_segments(ends, whole).max(initial=0.0) < 1e-6
        assert not view.dropped


def off_segments(ends: Floats, whole: Floats) -> Floats:
    """Return the distances of both ends of pieces from their segments, (n, 2)."""
    first, way = whole[:, :1], whole[:, 1:] - whole[:, :1]
    share = ((ends - first) * way).sum(axis=2) / (way**2).sum(axis=2)
    nearest = first + np.clip(share, 0.0, 1.0)[..., None] * way
    distance: Floats = np.linalg.norm(ends - nearest, axis=2)
    return distance


@settings(max_examples=25)
@given(rngs())
def test_exactly_the_unhidden_landmarks_are_seen(rng: np.random.Generator) -> None:
    world, sensor = random_world(rng), sensor_of()
    landmarks = sample_landmarks(world, rng)
    views = observe(world, landmarks, STRAIGHT, sensor, seed=1)
    for view, true in zip(views, STRAIGHT.true, strict=True):
        eye = (true @ sensor.rig.T_base_camera)[:3, 3]
        places, now = at(landmarks.points, world, view), world.at(view.timestamp or 0.0)
        _, inside = sensor.project(true, places)
        seen = np.zeros(len(places), dtype=np.bool_)
        seen[view.points.ids] = True
        assert len(set(view.points.ids.tolist())) == seen.sum() == len(view.points)
        assert not (seen & ~inside).any()
        assert not (seen & crossed(now, eye, places, -1e-5)).any()
        assert not (~seen & inside & ~crossed(now, eye, places, 1e-7)).any()
        for end in np.moveaxis(in_map(view, true)[1], 1, 0):
            assert not crossed(now, eye, end, -1e-5).any()


def test_views_have_random_numbers_of_their_own() -> None:
    world = World(bounds=(0, -6, 14, 6), ground_lines=0.3)
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    noisy = sensor_of(pixel_noise_px=0.5, missing=0.2, fragments=0.3)
    whole = list(observe(world, landmarks, STRAIGHT, noisy, seed=7))
    part = list(observe(world, landmarks, Drive(*(a[:2] for a in STRAIGHT)), noisy, seed=7))
    other = list(observe(world, landmarks, STRAIGHT, noisy, seed=8))
    assert (len(whole), len(part)) == (len(STRAIGHT.times), 2)
    for one, same in zip(whole[:2], part, strict=True):
        for mine, its in ((one.points, same.points), (one.segments, same.segments)):
            np.testing.assert_array_equal(mine.xyz, its.xyz)
            np.testing.assert_array_equal(mine.ids, its.ids)
    assert not np.array_equal(whole[0].points.ids, other[0].points.ids)
    one, next_one = observe(world, landmarks, STILL, noisy, seed=7)
    assert not np.array_equal(one.points.ids, next_one.points.ids)


def test_views_have_the_logged_poses_and_times() -> None:
    moves = moves_of((0, 0, 0), (3, 0, 30), position_noise=0.5, yaw_noise=0.1, seconds_per_view=0.5)
    world = World(bounds=(0, -6, 14, 6))
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    views = list(observe(world, landmarks, moves, sensor_of(), seed=1))
    np.testing.assert_array_equal([view.T_map_base for view in views], moves.logged)
    assert [view.timestamp for view in views] == moves.times.tolist()
    points, _ = in_map(views[-1], moves.true[-1])
    np.testing.assert_allclose(points, landmarks.points.xyz[views[-1].points.ids], atol=1e-6)


@pytest.mark.parametrize("most", [0, 1, 30])
def test_no_more_features_are_matched_than_the_settings_allow(most: int) -> None:
    rng = np.random.default_rng(1)
    world = random_world(rng)
    landmarks, one = sample_landmarks(world, rng), Drive(*(a[:1] for a in STRAIGHT))
    (every,) = observe(world, landmarks, one, sensor_of(), seed=1)
    (some,) = observe(world, landmarks, one, sensor_of(max_points=most, max_segments=most), seed=1)
    for all_of, picked in ((every.points, some.points), (every.segments, some.segments)):
        assert len(picked) == min(most, len(all_of))
        assert set(picked.ids.tolist()) <= set(all_of.ids.tolist())


def test_of_a_segment_half_behind_a_box_the_other_half_is_seen() -> None:
    # From the origin, a box from y = 0.2 on at x = 2 to 2.2 hides y > 0.46 at x = 5 (0.2 / 2.2).
    world = World(bounds=(0, -6, 14, 6), solids=(Solid(shapely.box(2, 0.2, 2.2, 3), top=3.0),))
    whole = LandmarkSet(np.array([[(5.0, -2.0, 1.0), (5.0, 2.0, 1.0)]]), np.array([-1]))
    (view,) = observe(world, Landmarks(NO_POINTS, whole), moves_of((0, 0, 0)), sensor_of(), seed=1)
    assert view.segments.ids.tolist() == [0]
    _, ends = in_map(view, np.eye(4))
    np.testing.assert_allclose(ends[0, 0], (5.0, -2.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(ends[0, 1, [0, 2]], (5.0, 1.0), atol=1e-6)
    assert 0.46 - 0.5 <= ends[0, 1, 1] <= 0.46  # places are 0.5 m apart


def test_a_vanished_solid_is_not_seen_and_hides_nothing() -> None:
    car = Solid(shapely.box(4, -2, 6, 2), top=1.5, present=(0.0, 0.5))
    world = World(bounds=(0, -6, 14, 6), solids=(car,))
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    views = observe(world, landmarks, STILL, sensor_of(), seed=1)
    there, gone = (set(view.points.ids.tolist()) for view in views)
    of_car = set(np.flatnonzero(landmarks.points.owner == 0).tolist())
    assert (there & of_car) > (gone & of_car) == set()
    assert len(gone - there) > 50


def test_ids_tell_points_from_segments() -> None:
    rng = np.random.default_rng(1)
    world = random_world(rng)
    landmarks = sample_landmarks(world, rng)
    split, whole = len(landmarks.points), len(landmarks.points) + len(landmarks.segments)
    for view in observe(world, landmarks, STRAIGHT, sensor_of(fragments=1.0), seed=1):
        lines = view.segments.ids
        assert (view.points.ids < split).all()
        assert ((split <= lines) & (lines < whole)).all()
        assert (np.unique(lines, return_counts=True)[1] == 2).all()  # both pieces have its id
