"""The ground truth of a world in 3-D: its free voxels, and which of them a drive could see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from groundmap.arrays import Bools, Floats, Ints
from groundmap.grid.window import CellFrame
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive
from groundmap.simulate.known_map import KnownMap
from groundmap.simulate.occlusion import in_sight
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.truth import HAIR, SAME_PLACE, along_outlines, touched_cells
from groundmap.simulate.world import Solid, World


@dataclass(frozen=True, eq=False)
class VoxelTruth(KnownMap):
    """The correct 3-D map of a world, on the voxels of a box.

    Voxels that overlap the ground are non-free, too, but the ground is no obstacle that distances
    are measured to.

    Attributes
    ----------
    solids : tuple of Solid
        Obstacles: the solids at the end of the drive, at rest.
    """

    solids: tuple[Solid, ...]

    def to_obstacles(self, points: Floats) -> Floats:
        """Return the distance of points to the nearest solid [m]; 0 inside, inf without solids."""
        return np.maximum(_distances(self.solids, points), 0.0)

    def to_borders(self, points: Floats) -> Floats:
        """Return the distance of points to the surface of the nearest solid [m]."""
        return np.abs(_distances(self.solids, points))


def voxel_truth_of(
    world: World, moves: Drive, sensor: SensorSettings, box: CellFrame, settings: MapperSettings
) -> VoxelTruth:
    """Return the ground truth of a world in 3-D for a drive.

    Parameters
    ----------
    world : World
    moves : Drive
    sensor : SensorSettings
    box : CellBox or GridWindow
        The voxels of the truth.
    settings : MapperSettings
        Of these, ``max_range`` counts: the mapper ignores what is farther.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from groundmap.simulate.drive import DriveSettings, drive
    >>> lamp = Solid(shapely.box(3, 1, 4, 2), bottom=2.0, top=2.5)
    >>> world = World(bounds=(0, 0, 6, 3), solids=(lamp,))
    >>> moves = drive(DriveSettings(stops=((0.5, 1.5, 0),)), np.random.default_rng(1))
    >>> box = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0)).box((0, 0, 0, 6, 3, 3))
    >>> truth = voxel_truth_of(world, moves, SensorSettings(pitch=0), box, MapperSettings())
    >>> truth.nonfree.sum(axis=(1, 2)).tolist(), truth.in_line.sum(axis=(1, 2)).tolist()
    ([0, 0, 0, 0, 4, 0], [72, 72, 72, 72, 64, 56])
    """
    at_end = world.at(float(moves.times[-1]))
    centres = box.cell_to_world(np.argwhere(np.ones(box.shape, dtype=np.bool_)))
    samples = _on_surfaces(at_end.solids, 0.5 * box.resolution)
    samples = samples[box.contains(box.world_to_cell(samples))]
    visible, in_line = np.zeros((2, len(centres)), dtype=np.bool_)
    seen = np.zeros(len(samples), dtype=np.bool_)
    eyes = (moves.true @ sensor.rig.T_base_camera)[:, :3, 3]
    for pose, eye, time in zip(moves.true, eyes, moves.times, strict=True):
        now = world.at(float(time))
        ahead = _in_images(centres, pose, eye, sensor, settings.max_range)
        _look(now, eye, centres, ahead, visible)
        in_line |= visible
        _look(now, eye, centres, np.ones_like(in_line), in_line)
        ahead = _in_images(samples, pose, eye, sensor, settings.max_range)
        _look(now, eye, samples, ahead & _still_there(samples, now), seen)
    xmin, ymin, xmax, ymax = world.bounds
    x, y = centres[:, :2].T
    visible &= (xmin <= x) & (x <= xmax) & (ymin <= y) & (y <= ymax)
    return VoxelTruth(
        nonfree=touched_voxels(at_end, box),
        visible=visible.reshape(box.shape),
        in_line=in_line.reshape(box.shape),
        surfaces=samples[seen],
        viewpoints=eyes,
        solids=at_end.solids,
    )


def touched_voxels(world: World, box: CellFrame) -> Bools:
    """Return which voxels overlap a solid or the ground by more than `HAIR`.

    Parameters
    ----------
    world : World
        At rest, as `World.at` returns it.
    box : CellBox or GridWindow

    Returns
    -------
    ndarray of bool, shape (layers, rows, cols)
    """
    touched = np.zeros(box.shape, dtype=np.bool_)
    lower = box.origin[2] + np.arange(box.shape[0]) * box.resolution + HAIR
    upper = lower + box.resolution - 2.0 * HAIR
    place = box.origin[:2], box.resolution, box.shape[1:]
    for solid in world.solids:
        over = touched_cells(solid.outline, *place)
        layers = np.flatnonzero((lower < solid.top) & (upper > solid.bottom))
        touched[layers] |= over & (lower[layers, None, None] < _highest(solid, *place))
    floor = np.zeros(box.shape[1:])
    for hole in world.holes:  # a cell that is only partly over a hole overlaps the ground beside it
        beside = hole.outline.buffer(2.0 * box.resolution).difference(hole.outline)
        over = touched_cells(hole.outline, *place) & ~touched_cells(beside, *place)
        floor[over] = -hole.depth
    touched |= lower[:, None, None] < floor
    return touched


def _highest(solid: Solid, origin: Floats, resolution: float, shape: tuple[int, ...]) -> Floats:
    """Return the highest point of a solid's upper side over each cell, shape (rows, cols) [m]."""
    level, along_x, along_y = solid.upper_plane
    x, y = (origin[axis] + np.arange(shape[1 - axis]) * resolution for axis in range(2))
    rise_x = np.maximum(along_x * x, along_x * (x + resolution))
    rise_y = np.maximum(along_y * y, along_y * (y + resolution))
    heights: Floats = np.minimum(level + rise_x + rise_y[:, None], solid.top)
    return heights


def _in_images(
    places: Floats, pose: Floats, eye: Floats, sensor: SensorSettings, reach: float
) -> Bools:
    """Return which places are in both images and in range."""
    _, inside = sensor.project(pose, places)
    inside &= np.hypot(*(places[:, :2] - eye[:2]).T) <= reach
    return inside


def _look(now: World, eye: Floats, places: Floats, ahead: Bools, seen: Bools) -> None:
    """Set which places, among those ahead, are in sight; those seen before are not tested again."""
    rows: Ints = np.flatnonzero(ahead & ~seen)
    seen[rows] = in_sight(now, eye, places[rows])


def _still_there(samples: Floats, now: World) -> Bools:
    """Return which samples of the solids at the end lie on a solid at another time."""
    there: Bools = np.abs(_distances(now.solids, samples)) <= SAME_PLACE
    return there


def _on_surfaces(solids: tuple[Solid, ...], step: float) -> Floats:
    """Return points `HAIR` in front of the surfaces of solids, `step` apart, shape (n, 3) [m]."""
    pieces = [np.empty((0, 3))]
    for solid in solids:
        count = int(np.ceil((solid.top - solid.bottom) / step))
        shares = (np.arange(count) + 0.5) / count
        sides = along_outlines(solid.outline, step)
        tops = solid.top_at(sides)
        for z in (solid.bottom + shares * (solid.top - solid.bottom)).tolist():
            at = sides[tops >= z]
            pieces.append(np.column_stack([at, np.full(len(at), z)]))
        inner = _inside(solid.outline, step)
        for heights in (np.full(len(inner), solid.bottom - HAIR), solid.top_at(inner) + HAIR):
            pieces.append(np.column_stack([inner, heights]))
    return np.concatenate(pieces)


def _inside(outline: shapely.Polygon, step: float) -> Floats:
    """Return points of a lattice inside an outline, `step` apart, shape (n, 2) [m]."""
    xmin, ymin, xmax, ymax = outline.bounds
    x, y = np.meshgrid(
        np.arange(xmin + 0.5 * step, xmax, step), np.arange(ymin + 0.5 * step, ymax, step)
    )
    places = np.column_stack([x.ravel(), y.ravel()])
    shapely.prepare(outline)
    inner: Floats = places[shapely.contains_xy(outline, places)]
    return inner


def _distances(solids: tuple[Solid, ...], points: Floats) -> Floats:
    """Return the distances of points to the nearest solid [m]; inside, minus the depth.

    The upper side of a solid with a slope is taken for a plane without borders.
    """
    nearest = np.full(len(points), np.inf)
    marks, z = shapely.points(points[:, :2]), points[:, 2]
    for solid in solids:
        shapely.prepare(solid.outline)
        aside = shapely.distance(solid.outline.boundary, marks)
        aside[shapely.contains_xy(solid.outline, points[:, :2])] *= -1.0
        steepness = float(np.hypot(1.0, np.hypot(*solid.slope)))
        above = np.maximum(solid.bottom - z, (z - solid.top_at(points[:, :2])) / steepness)
        outside = np.hypot(np.maximum(aside, 0.0), np.maximum(above, 0.0))
        inside = np.minimum(np.maximum(aside, above), 0.0)
        nearest = np.minimum(nearest, outside + inside)
    return nearest
