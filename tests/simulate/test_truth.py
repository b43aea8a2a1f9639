"""The ground truth of a world, compared with shapely's lines of sight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap.arrays import Bools, Floats
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import GridWindow
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive, to_transforms
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.truth import Truth, truth_of
from groundmap.simulate.world import Hole, Solid, World
from strategies import rngs

BOUNDS = (0.0, 0.0, 10.0, 8.0)
MARGIN = 1e-4  # [m]: nearer than this to an outline, a line may count as either
SENSOR = SensorSettings(max_range=7.0, baseline=0.4)


def window_of(resolution: float = 0.25) -> GridWindow:
    return ConfidenceGrid(resolution=resolution).window(BOUNDS)


def moves_of(*poses: tuple[float, float, float]) -> Drive:
    transforms = to_transforms(poses)
    return Drive(transforms, transforms, np.arange(len(poses), dtype=np.float64))


def truth(world: World, *poses: tuple[float, float, float], **options: Any) -> Truth:
    settings = MapperSettings(**options)
    return truth_of(world, moves_of(*poses), SENSOR, window_of(), settings)


def block(x0: float, y0: float, x1: float, y1: float, **options: Any) -> Solid:
    return Solid(shapely.box(x0, y0, x1, y1), **{"top": 1.0, **options})


def cell_at(layer: Bools, x: float, y: float) -> bool:
    row, col = window_of().world_to_cell((x, y))[0]
    return bool(layer[row, col])


def centres() -> Floats:
    return window_of().cell_to_world(np.argwhere(np.ones((32, 40), dtype=np.bool_)))


def random_world(rng: np.random.Generator) -> World:
    solids, holes = [], []
    for _ in range(rng.integers(0, 7)):
        x, y = rng.uniform((2.0, 0.0), (9.0, 7.0))
        outline = shapely.box(x, y, x + rng.uniform(0.2, 2.0), y + rng.uniform(0.2, 2.0))
        kind = rng.choice(["block", "glass", "hole", "lamp", "kerb"], p=[0.6, 0.1, 0.1, 0.1, 0.1])
        if kind == "hole":
            holes.append(Hole(outline, depth=1.0))
        else:
            bottom, top = {"lamp": (2.1, 2.5), "kerb": (0.0, 0.1)}.get(kind, (0.0, 1.5))
            solids.append(Solid(outline, bottom=bottom, top=top, transparent=kind == "glass"))
    return World(bounds=BOUNDS, solids=tuple(solids), holes=tuple(holes))


def brute_force(world: World, pose: tuple[float, float, float]) -> tuple[Bools, Bools, Bools]:
    """Return which centres are in line, which are in both images, and which are hard to tell."""
    eye = np.array(pose[:2])
    opaque = [
        solid.outline for solid in world.solids
        if solid.top > 0.15 and solid.bottom < 2.0 and not solid.transparent
    ]  # fmt: skip
    lines = shapely.linestrings(np.stack([np.tile(eye, (1280, 1)), centres()], axis=1))
    solid = shapely.union_all(opaque)
    surely = shapely.intersects(lines, solid.buffer(-MARGIN, join_style="mitre"))
    perhaps = shapely.intersects(lines, solid.buffer(MARGIN, join_style="mitre"))
    half = np.arctan(SENSOR.width_px / 2 / SENSOR.fx)
    right_eye = eye + SENSOR.baseline * np.array([np.sin(pose[2]), -np.cos(pose[2])])
    from_left = np.angle(np.exp(1j * (bearings(eye) - pose[2])))  # left is above 0
    from_right = np.angle(np.exp(1j * (bearings(right_eye) - pose[2])))
    distance = np.hypot(*(centres() - eye).T)
    inside = (from_left >= -half) & (from_right <= half) & (np.abs(from_left) < np.pi / 2)
    inside &= (np.abs(from_right) < np.pi / 2) & (distance <= SENSOR.max_range)
    rims = np.stack([from_left + half, from_right - half, distance - SENSOR.max_range])
    return ~surely, inside, (surely != perhaps) | (np.abs(rims).min(axis=0) < 1e-6)


def bearings(eye: Floats) -> Floats:
    away = centres() - eye
    return np.arctan2(away[:, 1], away[:, 0])


@settings(max_examples=40)
@given(rngs())
def test_cells_are_visible_that_a_line_in_both_images_reaches(rng: np.random.Generator) -> None:
    world = random_world(rng)
    poses = [(float(x), 4.0 + float(y), float(t)) for x, y, t in rng.normal(0, 0.3, (3, 3))]
    poses = [(min(x, 0.9), y, 3.0 * turn) for x, y, turn in poses]
    found = truth(world, *poses)
    views = [brute_force(world, pose) for pose in poses]
    sure = ~np.any([hard for _, _, hard in views], axis=0)
    in_line = np.any([line for line, _, _ in views], axis=0)
    visible = np.any([line & inside for line, inside, _ in views], axis=0)
    np.testing.assert_array_equal(found.in_line.ravel()[sure], in_line[sure])
    np.testing.assert_array_equal(found.visible.ravel()[sure], visible[sure])
    assert not (found.visible & ~found.in_line).any()


@settings(max_examples=40)
@given(rngs())
def test_cells_are_nonfree_that_an_obstacle_reaches_into(rng: np.random.Generator) -> None:
    world = random_world(rng)
    found = truth(world, (0.0, 4.0, 0.0))
    solids = [solid for solid in world.solids if solid.top > 0.15 and solid.bottom < 2.0]
    outlines = [one.outline for one in solids] + [hole.outline for hole in world.holes]
    boxes = np.array([outline.bounds for outline in outlines]).reshape(-1, 4)
    x, y = centres().T[:, :, None]
    xmin, ymin, xmax, ymax = boxes.T[:, None]
    deep = np.minimum(np.minimum(x - xmin, xmax - x), np.minimum(y - ymin, ymax - y)) + 0.125
    touched = (deep > 0).any(axis=1)
    sure = (np.abs(deep) > 1e-5).all(axis=1)
    np.testing.assert_array_equal(found.nonfree.ravel()[sure], touched[sure])


@pytest.mark.parametrize("size", [0.01, 0.03, 0.2])
def test_an_obstacle_that_reaches_into_the_window_from_outside_is_nonfree(size: float) -> None:
    found = truth(World(bounds=BOUNDS, solids=(block(-1, -1, size, size),)), (0.5, 4.0, 0.0))
    assert np.argwhere(found.nonfree).tolist() == [[0, 0]]


def test_a_cell_that_an_obstacle_ends_at_is_free() -> None:
    found = truth(World(bounds=BOUNDS, solids=(block(4, 3, 5, 5),)), (0.0, 4.0, 0.0))
    assert found.nonfree.sum() == 4 * 8


def test_nothing_is_in_line_in_a_wall_or_behind_it() -> None:
    found = truth(World(bounds=BOUNDS, solids=(block(4, 0, 4.4, 8),)), (0.0, 4.0, 0.0))
    beyond = centres()[:, 0].reshape(32, 40) > 4.0
    np.testing.assert_array_equal(found.in_line, ~beyond)
    assert not found.visible[beyond].any()


def test_glass_and_holes_are_nonfree_but_seen_through() -> None:
    pane, pit = block(4, 0, 4.4, 8, transparent=True), Hole(shapely.box(5, 3, 6, 5), depth=1.0)
    found = truth(World(bounds=BOUNDS, solids=(pane,), holes=(pit,)), (0.0, 4.0, 0.0))
    assert found.in_line.all()
    for x in (4.1, 5.5):
        assert cell_at(found.nonfree, x, 4.1)
        assert cell_at(found.visible, x, 4.1)
    assert cell_at(found.visible, 6.5, 4.1)


def test_a_table_hides_the_ground_below_it_and_a_lamp_does_not() -> None:
    for bottom, in_the_way in ((0.7, True), (2.0, False)):
        top = block(4, 3, 5, 5, bottom=bottom, top=bottom + 0.1)
        found = truth(World(bounds=BOUNDS, solids=(top,)), (0.0, 4.0, 0.0))
        assert cell_at(found.nonfree, 4.6, 4.1) == in_the_way
        assert cell_at(found.in_line, 4.6, 4.1) != in_the_way


def test_the_place_of_what_is_gone_is_visible_only_afterwards() -> None:
    world = World(bounds=BOUNDS, solids=(block(4, 3, 5, 5, present=(0.0, 1.5)),))
    still = (0.0, 4.0, 0.0)
    before, after = truth(world, still, still), truth(world, still, still, still)
    for place in ((4.5, 4.1), (6.0, 4.1)):
        assert not cell_at(before.visible, *place)
        assert cell_at(after.visible, *place)
    assert cell_at(before.nonfree, 4.5, 4.1)
    assert not after.nonfree.any()
    assert after.obstacles.is_empty
    assert after.surfaces.shape == (0, 2)


def test_what_comes_later_is_a_surface_once_it_is_there() -> None:
    world = World(bounds=BOUNDS, solids=(block(4, 3, 5, 5, present=(0.5, 9.0)),))
    away, towards = (0.0, 4.0, np.pi), (0.0, 4.0, 0.0)
    assert len(truth(world, towards, away).surfaces) == 0
    assert len(truth(world, away, towards).surfaces) == 16


@pytest.mark.parametrize("yaw", [0.0, np.pi])
def test_surfaces_lie_on_the_outlines_that_face_the_camera(yaw: float) -> None:
    x = 0.0 if yaw == 0.0 else 9.0
    found = truth(World(bounds=BOUNDS, solids=(block(4, 3, 5, 5),)), (x, 4.0, yaw))
    face = 4.0 if yaw == 0.0 else 5.0
    np.testing.assert_allclose(found.surfaces[:, 0], face, atol=1e-5)
    y = np.sort(found.surfaces[:, 1])
    assert np.diff(y).max() <= 0.125 + 1e-9  # half a cell
    assert (y[0], y[-1]) == (pytest.approx(3.0625), pytest.approx(4.9375))


def test_no_farther_than_the_shorter_range_is_visible_but_lines_have_no_end() -> None:
    for reach, wanted in ((3.0, 3.0), (20.0, SENSOR.max_range)):
        found = truth(World(bounds=BOUNDS), (0.0, 4.0, 0.0), max_range=reach)
        distance = np.hypot(*(centres() - (0.0, 4.0)).T)[found.visible.ravel()]
        assert wanted - 0.3 < distance.max() <= wanted
        assert found.in_line.all()
