"""The ideal sensor: features lie on the world, and visibility agrees with shapely."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap.arrays import Bools, Floats
from groundmap.errors import SettingsError
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive, DriveSettings, drive
from groundmap.simulate.scan import SIGMA, ScanSettings, scan
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import Hole, Solid, World
from groundmap.view.view import View
from strategies import rngs

SENSOR = SensorSettings(camera_forward=0.2)
# All ground is in its images' height, so that only width and range decide.
TALL = SensorSettings(camera_forward=0.2, pitch=0.0, height_px=10**6)
SCAN = ScanSettings(bearing=0.7, ground=0.3)
MAPPER = MapperSettings()
HEIGHTS = MAPPER.step_height, MAPPER.robot_height
BOUNDS = (0.0, 0.0, 10.0, 8.0)
RING = shapely.box(*BOUNDS).exterior.buffer(0.1, join_style="mitre")
HALL = Solid(RING, top=2.5)
MARGIN = 1e-6  # [m], nearer than this to an outline, sight may count as either


def driven(*stops: tuple[float, float, float], **options: Any) -> Drive:
    return drive(
        DriveSettings(stops=stops, every=100.0, every_turn=10.0, **options),
        np.random.default_rng(1),
    )


def world_of(*solids: Solid, holes: tuple[Hole, ...] = ()) -> World:
    return World(solids=(HALL, *solids), holes=holes, bounds=BOUNDS)


def random_world(rng: np.random.Generator) -> World:
    """Return boxes on the far side of the hall: one low, one overhead, one of glass."""
    low = rng.uniform((3.0, 0.5), (8.0, 6.0), (5, 2))
    high = low + rng.uniform(0.2, 1.5, (5, 2))
    boxes = [shapely.box(*a, *b) for a, b in zip(low, high, strict=True)]
    return world_of(
        Solid(boxes[0], top=1.0),
        Solid(boxes[1], top=2.0, bottom=0.7),
        Solid(boxes[2], top=0.1),
        Solid(boxes[3], top=3.0, bottom=2.2),
        Solid(boxes[4], top=2.0, transparent=True),
    )


def places(view: View, true: Floats) -> tuple[Floats, Floats]:
    """Return x, y, z of the features on obstacles, and of those on the ground [m, map]."""
    T_map_camera = true @ view.rig.T_base_camera
    xyz = view.points.xyz @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    ground = np.abs(xyz[:, 2]) < 1e-9
    return xyz[~ground], xyz[ground]


def eye_of(true: Floats) -> tuple[Floats, float]:
    """Return the place of the camera and its viewing direction."""
    T_map_camera = true @ SENSOR.rig.T_base_camera
    return T_map_camera[:2, 3], float(np.arctan2(T_map_camera[1, 2], T_map_camera[0, 2]))


def looks(world: World, moves: Drive, settings: ScanSettings = SCAN) -> list[View]:
    return list(scan(world, moves, SENSOR, settings, MAPPER))


def free_line(obstacles: shapely.Geometry, eye: Floats, targets: Floats) -> Bools:
    """Return the places, shape (n, 2), whose line to the eye meets no obstacle."""
    lines = shapely.linestrings(np.stack([np.broadcast_to(eye, targets.shape), targets], axis=1))
    free: Bools = ~shapely.intersects(lines, obstacles)
    return free


@settings(max_examples=15)
@given(rngs())
def test_a_feature_lies_on_the_nearest_outline_at_every_step_of_bearing(
    rng: np.random.Generator,
) -> None:
    world = random_world(rng)
    moves = driven((1.0, 4.0, 0.0), (1.5, 2.0, 50.0))
    obstacles = world.obstacles(*HEIGHTS, opaque=True)
    for view, true in zip(looks(world, moves), moves.true, strict=True):
        walls, _ = places(view, true)
        eye, forward = eye_of(true)
        assert shapely.distance(obstacles.boundary, shapely.points(walls[:, :2])).max() < 1e-6
        half = np.arctan2(SENSOR.width_px / 2.0, SENSOR.fx)
        steps = np.arange(-half, half, np.radians(SCAN.bearing))[1:]  # 0: on the image's edge
        nearest = np.array([first_met(obstacles, eye, forward + step) for step in steps])
        _, inside = TALL.project(true, np.column_stack([nearest, np.zeros(len(nearest))]))
        away = walls[:, :2] - eye
        walls = walls[np.arctan2(away[:, 1], away[:, 0]) - forward > -half + 1e-6]
        np.testing.assert_allclose(walls[:, :2], nearest[inside], atol=1e-6)
        assert len(walls) > 0.75 * len(steps)


def first_met(obstacles: shapely.Geometry, eye: Floats, bearing: float) -> Floats:
    """Return the first intersection of a ray with an outline [m, map]; the hall is closed."""
    end = eye + 99.0 * np.array([np.cos(bearing), np.sin(bearing)])
    met = shapely.intersection(shapely.LineString([eye, end]), obstacles.boundary)
    corners = shapely.get_coordinates(met)
    nearest: Floats = corners[np.argmin(np.hypot(*(corners - eye).T))]
    return nearest


@settings(max_examples=15)
@given(rngs())
def test_ground_features_are_exactly_the_lattice_points_in_sight(
    rng: np.random.Generator,
) -> None:
    world = random_world(rng)
    moves = driven((1.0, 4.0, 0.0), (1.5, 2.0, 50.0))
    obstacles = world.obstacles(*HEIGHTS, opaque=True)
    x, y = (np.arange(low, high, SCAN.ground) for low, high in ((0.0, 10.0), (0.0, 8.0)))
    lattice = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    clear = shapely.distance(obstacles.boundary, shapely.points(lattice)) > MARGIN
    for view, true in zip(looks(world, moves), moves.true, strict=True):
        eye, _ = eye_of(true)
        _, ground = places(view, true)
        _, inside = TALL.project(true, np.column_stack([lattice, np.zeros(len(lattice))]))
        seen = inside & clear & free_line(obstacles, eye, lattice)
        distance = np.hypot(*(ground[:, None, :2] - lattice[seen]).transpose(2, 0, 1))
        assert distance.min(axis=0).max() < 1e-9
        near_outline = shapely.distance(obstacles.boundary, shapely.points(ground[:, :2]))
        strict = near_outline > MARGIN
        assert free_line(obstacles, eye, ground[strict, :2]).all()
        assert (distance.min(axis=1)[strict] < 1e-9).all()


def test_features_on_obstacles_are_halfway_between_the_step_and_the_robots_height() -> None:
    moves = driven((1.0, 4.0, 0.0))
    [view] = looks(world_of(), moves)
    walls, ground = places(view, moves.true[0])
    np.testing.assert_allclose(walls[:, 2], sum(HEIGHTS) / 2.0)
    assert len(walls) + len(ground) == len(view.points)
    assert len(view.segments) == 0


def test_features_are_certain() -> None:
    [view] = looks(world_of(), driven((1.0, 4.0, 0.0)))
    for covariance in view.points.covariance:
        np.testing.assert_array_equal(covariance, SIGMA**2 * np.eye(3))


def test_solids_that_are_not_obstacles_have_no_features() -> None:
    moves = driven((1.0, 4.0, 0.0))
    box = shapely.box(4, 3, 5, 5)
    [bare] = looks(world_of(), moves)
    for solid in (
        Solid(box, top=0.1),
        Solid(box, top=3.0, bottom=2.2),
        Solid(box, top=2.0, transparent=True),
    ):
        [view] = looks(world_of(solid), moves)
        np.testing.assert_array_equal(view.points.xyz, bare.points.xyz)


def test_there_is_no_ground_where_a_hole_is() -> None:
    moves = driven((1.0, 4.0, 0.0))
    hole = Hole(shapely.box(4.05, 3.05, 5.05, 5.05), depth=0.5)
    [bare], [view] = looks(world_of(), moves), looks(world_of(holes=(hole,)), moves)
    (_, before), (_, after) = places(bare, moves.true[0]), places(view, moves.true[0])
    inside = shapely.contains_xy(hole.outline, before[:, :2])
    assert inside.sum() > 10
    np.testing.assert_allclose(after, before[~inside])


def test_a_moving_obstacle_is_seen_at_its_current_place() -> None:
    car = Solid(shapely.box(4, 3, 5, 5), top=1.0, velocity=(0.5, 0.0))
    moves = driven(*[(1.0, 4.0, 0.0)] * 4)
    for view, true in zip(looks(world_of(car), moves), moves.true, strict=True):
        walls, ground = places(view, true)
        front = 4.0 + 0.5 * (view.timestamp or 0.0)
        ahead = walls[np.abs(walls[:, 1] - 4.0) < 0.4]
        np.testing.assert_allclose(ahead[:, 0], front, atol=1e-9)
        beside = ground[np.abs(ground[:, 1] - 4.0) < 0.2]
        assert front - SCAN.ground <= beside[:, 0].max() <= front + 1e-9


def test_an_obstacle_is_seen_from_when_it_appears_until_it_vanishes() -> None:
    crate = Solid(shapely.box(4, 3, 5, 5), top=1.0, present=(1.0, 3.0))
    moves = driven(*[(1.0, 4.0, 0.0)] * 4)
    fronts = []
    for view, true in zip(looks(world_of(crate), moves), moves.true, strict=True):
        walls, _ = places(view, true)
        fronts.append(round(float(walls[np.abs(walls[:, 1] - 4.0) < 0.4, 0].max()), 6))
    assert moves.times.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert fronts == [9.9, 4.0, 4.0, 9.9]


def test_nothing_is_seen_beyond_the_sensors_range() -> None:
    near = SensorSettings(camera_forward=0.2, max_range=4.0)
    moves = driven((1.0, 4.0, 0.0))
    [view] = scan(world_of(), moves, near, SCAN, MAPPER)
    eye, _ = eye_of(moves.true[0])
    walls, ground = places(view, moves.true[0])
    assert np.hypot(*(np.concatenate([walls, ground])[:, :2] - eye).T).max() <= 4.0
    assert len(ground) > 0


def test_denser_settings_give_more_features() -> None:
    moves = driven((1.0, 4.0, 0.0))
    counts = []
    for factor in (1.0, 0.5):
        denser = ScanSettings(bearing=SCAN.bearing * factor, ground=SCAN.ground * factor)
        [view] = looks(world_of(), moves, denser)
        counts.append([len(part) for part in places(view, moves.true[0])])
    (walls, ground), (more_walls, more_ground) = counts
    assert more_walls == pytest.approx(2 * walls, abs=2)
    assert more_ground == pytest.approx(4 * ground, rel=0.15)


def test_views_have_the_poses_and_the_times_of_the_log() -> None:
    moves = driven((1.0, 4.0, 0.0), (3.0, 4.0, 0.0), drift=0.1)
    views = looks(world_of(), moves)
    np.testing.assert_array_equal([view.T_map_base for view in views], moves.logged)
    assert [view.timestamp for view in views] == moves.times.tolist()
    walls, _ = places(views[1], moves.true[1])  # by the true pose
    outline = world_of().obstacles(*HEIGHTS).boundary
    assert shapely.distance(outline, shapely.points(walls[:, :2])).max() < 1e-6


def test_an_empty_world_is_all_ground() -> None:
    world = replace(world_of(), solids=())
    moves = driven((1.0, 4.0, 0.0))
    [view] = looks(world, moves)
    walls, ground = places(view, moves.true[0])
    assert len(walls) == 0
    assert len(ground) > 100


@pytest.mark.parametrize("key", ["bearing", "ground"])
def test_steps_that_are_not_positive_are_refused(key: str) -> None:
    with pytest.raises(SettingsError, match=rf"^{key}: expected greater than 0, got 0\.0\.$"):
        ScanSettings(**{key: 0.0})
