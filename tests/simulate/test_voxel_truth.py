"""The truth in 3-D: voxels, sight and distances against boxes computed by NumPy; its measures."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings

from groundmap.arrays import Bools, Floats
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellBox, GridWindow
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive, to_transforms
from groundmap.simulate.measures import measure
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.voxel_truth import VoxelTruth, touched_voxels, voxel_truth_of
from groundmap.simulate.world import Hole, Solid, World
from strategies import rngs

BOUNDS = (0.0, 0.0, 6.0, 5.0)
BAND = (0.0, 0.0, 0.2, 6.0, 5.0, 2.2)
SENSOR = SensorSettings(max_range=12.0, pitch=0.0, baseline=0.1)
POSES = [(0.5, 2.5, 0.0), (1.0, 1.0, 0.6)]


def voxels(resolution: float = 0.25) -> CellBox:
    return ConfidenceGrid(resolution=resolution, origin=(0, 0, -0.05)).box(BAND)


def boxes(rng: np.random.Generator) -> Floats:
    """Draw boxes, shape (n, 6): lower and upper corners; some of them hang in the air."""
    lower = rng.uniform((2.0, 0.0, 0.0), (5.0, 4.0, 1.5), (rng.integers(1, 5), 3))
    lower[rng.random(len(lower)) < 0.5, 2] = 0.0
    return np.hstack([lower, lower + rng.uniform(0.1, 1.5, lower.shape)])


def world_of(corners: Floats) -> World:
    solids = tuple(
        Solid(shapely.box(x0, y0, x1, y1), bottom=z0, top=z1)
        for x0, y0, z0, x1, y1, z1 in corners.tolist()
    )
    return World(bounds=BOUNDS, solids=solids)


def truth(world: World, box: CellBox) -> VoxelTruth:
    poses = to_transforms(POSES)
    moves = Drive(poses, poses, np.arange(len(poses), dtype=np.float64))
    return voxel_truth_of(world, moves, SENSOR, box, MapperSettings())


def hits(eye: Floats, places: Floats, corners: Floats) -> Bools:
    """Return whether the line from the eye to each place enters a box, by the slab method."""
    hit = np.zeros(len(places), dtype=np.bool_)
    for low, high in zip(corners[:, :3], corners[:, 3:], strict=True):
        ends = np.stack([(low - eye) / (places - eye), (high - eye) / (places - eye)])
        first, last = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        hit |= np.minimum(last, 1.0) - np.maximum(first, 0.0) > 1e-9
    return hit


@given(rngs())
@settings(max_examples=15)
def test_voxels_and_sight_are_those_of_boxes(rng: np.random.Generator) -> None:
    corners, box = boxes(rng), voxels()
    known = truth(world_of(corners), box)
    centres = box.cell_to_world(np.argwhere(np.ones(box.shape, dtype=bool)))
    half = 0.5 * box.resolution
    overlap = (centres[:, None] + half > corners[:, :3]) & (
        centres[:, None] - half < corners[:, 3:]
    )
    overlaps = np.logical_and.reduce(overlap, axis=2).any(axis=1)
    np.testing.assert_array_equal(known.nonfree.ravel(), overlaps)
    eyes = [np.array([x, y, SENSOR.camera_height]) for x, y, _ in POSES]
    in_line = ~np.all([hits(eye, centres, corners) for eye in eyes], axis=0)
    np.testing.assert_array_equal(known.in_line.ravel(), in_line)
    assert not (known.visible & ~known.in_line).any()


@given(rngs())
@settings(max_examples=15)
def test_distances_are_those_to_boxes(rng: np.random.Generator) -> None:
    corners, points = boxes(rng), rng.uniform(-1.0, 7.0, (50, 3))
    known = truth(world_of(corners), voxels(1.0))
    low, high = corners[:, :3], corners[:, 3:]
    gaps = np.maximum(low - points[:, None], points[:, None] - high)
    outside = np.linalg.norm(np.maximum(gaps, 0.0), axis=2)
    signed = (outside + np.minimum(gaps.max(axis=2), 0.0)).min(axis=1)
    np.testing.assert_allclose(known.to_obstacles(points), np.maximum(signed, 0.0), atol=1e-9)
    np.testing.assert_allclose(known.to_borders(points), np.abs(signed), atol=1e-9)


@given(rngs())
@settings(max_examples=15)
def test_surfaces_in_sight_lie_in_front_of_solids(rng: np.random.Generator) -> None:
    corners = boxes(rng)
    known = truth(world_of(corners), voxels())
    np.testing.assert_allclose(known.to_borders(known.surfaces), 0.0, atol=1e-5)
    eyes = [np.array([x, y, SENSOR.camera_height]) for x, y, _ in POSES]
    hidden = np.all([hits(eye, known.surfaces, corners) for eye in eyes], axis=0)
    assert not hidden.any()


def test_the_underside_of_a_table_is_seen_from_below_and_its_top_is_not() -> None:
    slab = Solid(shapely.box(2.0, 1.0, 4.0, 4.0), bottom=1.5, top=1.6)
    known = truth(World(bounds=BOUNDS, solids=(slab,)), voxels())
    inner = known.surfaces[(np.abs(known.surfaces[:, :2] - (3.0, 2.5)) < (0.9, 1.4)).all(axis=1)]
    assert len(inner) > 100
    assert (inner[:, 2] < 1.5).all()


def test_the_ground_is_non_free_except_over_holes() -> None:
    box = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0)).box((0, 0, -1, 6, 5, 1))
    pit = Hole(shapely.box(1.9, 1.0, 4.0, 3.0), depth=0.5)
    touched = touched_voxels(World(bounds=BOUNDS, holes=(pit,)), box)
    open_cells = np.zeros((10, 12), dtype=bool)
    open_cells[2:6, 4:8] = True  # the column of cells from x = 1.5 on is partly beside the pit
    expected = [np.ones_like(open_cells), ~open_cells, *np.zeros((2, 10, 12), dtype=bool)]
    np.testing.assert_array_equal(touched, expected)


def mapped(free: Bools, nonfree: Bools, box: CellBox) -> GridWindow:
    z = np.where(nonfree, 1.0, np.where(free, -1.0, 0.0)).astype(np.float32)
    grid = ConfidenceGrid(resolution=box.resolution, origin=(0, 0, -0.05))
    grid.fuse(box.lower, z)
    return grid.read(box)


def test_the_truth_scores_best() -> None:
    box = voxels()
    known = truth(world_of(boxes(np.random.default_rng(5))), box)
    found = measure(mapped(known.visible & ~known.nonfree, known.nonfree, box), known)
    assert (found.free_recall, found.free_precision, found.nonfree_recall) == (1.0, 1.0, 1.0)
    assert (found.nonfree_precision, found.false_free, found.unknown) == (1.0, 0.0, 0.0)
    assert "visible_m2" not in found.to_dict()
    volume = (known.visible & ~known.nonfree).sum() * box.resolution**3
    assert found.to_dict()["visible_m3"] == pytest.approx(volume)


def test_a_free_voxel_deep_in_a_solid_and_a_non_free_one_in_the_air_are_found() -> None:
    box = voxels(0.2)
    known = truth(world_of(np.array([(3.0, 1.0, 0.0, 5.0, 4.0, 2.5)])), box)
    free, nonfree = known.visible & ~known.nonfree, known.nonfree.copy()
    deep = tuple(box.world_to_cell((3.9, 2.5, 1.2))[0])
    free[deep], nonfree[deep] = True, False
    air = tuple(box.world_to_cell((2.0, 2.5, 1.2))[0])
    assert free[air]
    free[air], nonfree[air] = False, True
    found = measure(mapped(free, nonfree, box), known)
    count = int(free.sum())
    assert found.false_free_beyond == pytest.approx(1 / count)
    assert found.false_free_depth == pytest.approx(0.9)
    judged = (nonfree & known.visible).sum()
    assert found.nonfree_precision is not None
    assert 1 - found.nonfree_precision <= 1 / judged
    assert found.nonfree_precision < 1.0


def test_voxels_below_a_slope_are_non_free() -> None:
    box = ConfidenceGrid(resolution=0.25, origin=(0, 0, 0)).box((0, 0, 0, 4, 1, 2))
    ramp = Solid(shapely.box(0.0, 0.0, 4.0, 1.0), top=2.0, slope=(0.5, 0.0))
    touched = touched_voxels(World(bounds=BOUNDS, solids=(ramp,)), box)
    highest = 0.5 * 0.25 * np.arange(1, 17)  # at the right border of each column
    expected = 0.25 * np.arange(8)[:, None, None] < np.broadcast_to(highest, (4, 16)) - 1e-5
    np.testing.assert_array_equal(touched, expected)


def test_the_surface_of_a_ramp_is_its_slope() -> None:
    ramp = Solid(shapely.box(2.0, 0.0, 5.0, 5.0), top=1.5, slope=(0.5, 0.0))
    known = truth(World(bounds=BOUNDS, solids=(ramp,)), voxels())
    np.testing.assert_allclose(known.to_borders(known.surfaces), 0.0, atol=1e-5)
    x, _, z = known.surfaces.T
    on_slope = x > 2.01
    np.testing.assert_allclose(z[on_slope], 0.5 * (x[on_slope] - 2.0), atol=1e-5)
    assert on_slope.sum() > 100
    place = np.array([(3.0, 2.5, 0.5 + np.sqrt(1.25))])
    assert known.to_obstacles(place)[0] == pytest.approx(1.0)
