"""The ground truth of a world: its free cells, and which of them a drive could see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import binary_dilation

from groundmap.arrays import Bools, Floats
from groundmap.grid.window import CellFrame, GridWindow, cells_of, centres_of
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive
from groundmap.simulate.known_map import KnownMap
from groundmap.simulate.occlusion import (
    GROUND_LEVEL,
    Prisms,
    edges_of,
    find_visible,
    ground_level_prisms,
)
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world import World

HAIR = 1e-6  # [m], distance of samples from their surface; a cell that is touched by less is free
SAME_PLACE = 1e-3  # [m], largest distance between samples of the same surface at two times


@dataclass(frozen=True, eq=False)
class Truth(KnownMap):
    """The correct 2-D map of a world.

    Cells are visible along the ground, with only free ground between.

    Attributes
    ----------
    obstacles : shapely.Geometry [m, map]
        Obstacles to the robot at the end of the drive.
    """

    obstacles: shapely.Geometry

    def to_obstacles(self, points: Floats) -> Floats:
        """Return the distance of points to the nearest obstacle [m]; 0 inside, inf without any."""
        return _distances(points, self.obstacles)

    def clearances(self, line: Floats) -> Floats:
        """Return the distance of a line to each part of the obstacles, shape (k,) [m]."""
        parts = shapely.get_parts(self.obstacles)
        distances: Floats = shapely.distance(shapely.LineString(line), parts)
        return distances

    def nonfree_on(self, box: CellFrame) -> Bools:
        """Return which cells of another box overlap an obstacle, shape (rows, cols)."""
        return touched_cells(self.obstacles, box.origin, box.resolution, box.shape)

    def to_borders(self, points: Floats) -> Floats:
        """Return the distance of points to the nearest outline of an obstacle [m]."""
        # Without obstacles, shapely has no boundary.
        outlines = self.obstacles if self.obstacles.is_empty else self.obstacles.boundary
        return _distances(points, outlines)


def _distances(points: Floats, geometry: shapely.Geometry) -> Floats:
    if geometry.is_empty:
        return np.full(len(points), np.inf)
    shapely.prepare(geometry)
    distances: Floats = shapely.distance(shapely.points(points), geometry)
    return distances


def truth_of(
    world: World,
    moves: Drive,
    sensor: SensorSettings,
    window: GridWindow,
    settings: MapperSettings,
) -> Truth:
    """Return the ground truth of a world for a drive.

    Parameters
    ----------
    world : World
    moves : Drive
    sensor : SensorSettings
    window : GridWindow
        The cells of the truth.
    settings : MapperSettings
        Heights of obstacles and range of the map: ``step_height``, ``robot_height``, ``max_range``.
    """
    heights = settings.step_height, settings.robot_height
    at_end = world.at(float(moves.times[-1])).obstacles(*heights)
    samples = along_outlines(at_end, 0.5 * window.resolution)
    shape = window.count.shape
    centres = window.cell_to_world(np.argwhere(np.ones(shape, dtype=np.bool_)))
    sight = _Sight(centres, samples)
    reach = min(sensor.max_range, settings.max_range)
    eyes = moves.true @ sensor.rig.T_base_camera
    for T_map_camera, time in zip(eyes, moves.times, strict=True):
        now = world.at(float(time))
        prisms = ground_level_prisms(now.obstacles(*heights, opaque=True))
        sight.look(prisms, T_map_camera, sensor, reach, _still_there(samples, now, heights))
    return Truth(
        obstacles=at_end,
        nonfree=touched_cells(at_end, window.origin, window.resolution, shape),
        visible=(sight.visible & _within(world.bounds, centres)).reshape(shape),
        in_line=sight.in_line.reshape(shape),
        surfaces=samples[sight.surfaces_seen],
        viewpoints=eyes[:, :2, 3],
    )


def _within(bounds: tuple[float, float, float, float], places: Floats) -> Bools:
    within = (places >= bounds[:2]) & (places <= bounds[2:])
    inside: Bools = np.logical_and.reduce(within, axis=1)
    return inside


class _Sight:
    """The cells and samples seen so far; those are not tested again."""

    def __init__(self, centres: Floats, samples: Floats) -> None:
        self.centres, self.samples = centres, samples
        self.visible = np.zeros(len(centres), dtype=np.bool_)
        self.in_line = np.zeros(len(centres), dtype=np.bool_)
        self.surfaces_seen = np.zeros(len(samples), dtype=np.bool_)

    def look(
        self, prisms: Prisms, T_map_camera: Floats, sensor: SensorSettings, reach: float,
        there: Bools,
    ) -> None:  # fmt: skip
        """Add one view.

        Parameters
        ----------
        prisms : Prisms
        T_map_camera : ndarray, shape (4, 4) [m]
        sensor : SensorSettings
        reach : float [m]
            Largest range.
        there : ndarray of bool, shape (n,)
            Samples that are on a surface at the time of the view.
        """
        eye = T_map_camera[:2, 3]
        ahead = in_images(self.centres, T_map_camera, sensor, reach) & ~self.visible
        self.visible[_clear(prisms, eye, self.centres, ahead)] = True
        self.in_line[self.visible] = True
        self.in_line[_clear(prisms, eye, self.centres, ~self.in_line)] = True
        ahead = in_images(self.samples, T_map_camera, sensor, reach) & ~self.surfaces_seen
        self.surfaces_seen |= _clear(prisms, eye, self.samples, ahead & there)


def in_images(places: Floats, T_map_camera: Floats, sensor: SensorSettings, reach: float) -> Bools:
    """Return which places have a column in both images, regardless of their height.

    Parameters
    ----------
    places : ndarray, shape (n, 2) [m, map]
    T_map_camera : ndarray, shape (4, 4) [m]
    sensor : SensorSettings
    reach : float [m]
        Largest range.
    """
    axis = T_map_camera[:2, 2] / np.hypot(*T_map_camera[:2, 2])
    away = places - T_map_camera[:2, 3]
    depth, left = away @ axis, away @ np.array([-axis[1], axis[0]])
    rig = sensor.rig
    with np.errstate(divide="ignore", invalid="ignore"):
        column = rig.cx - rig.fx * left / depth
        other = column - rig.fx * rig.baseline / depth
    near = np.hypot(away[:, 0], away[:, 1]) <= reach
    inside: Bools = (depth > 0) & near & (other >= 0) & (column <= sensor.width_px)
    return inside


def seen_along_ground(
    obstacles: shapely.Geometry, places: Floats, T_map_camera: Floats, sensor: SensorSettings
) -> Bools:
    """Return which places on the ground one view sees, in the range of the sensor.

    Parameters
    ----------
    obstacles : shapely.Geometry [m, map]
    places : ndarray, shape (n, 2) [m, map]
    T_map_camera : ndarray, shape (4, 4) [m]
    sensor : SensorSettings
    """
    ahead = in_images(places, T_map_camera, sensor, sensor.max_range)
    return _clear(ground_level_prisms(obstacles), T_map_camera[:2, 3], places, ahead)


def _clear(prisms: Prisms, eye: Floats, places: Floats, rows: Bools) -> Bools:
    """Return which places among `rows` are visible along the ground."""
    clear = np.zeros(len(places), dtype=np.bool_)
    targets = np.column_stack([places[rows], np.full(rows.sum(), GROUND_LEVEL)])
    clear[rows] = find_visible(prisms, np.array([*eye, GROUND_LEVEL]), targets)
    return clear


def _still_there(samples: Floats, now: World, heights: tuple[float, float]) -> Bools:
    """Return which samples of the obstacles at the end lie on an outline at another time."""
    outlines = now.obstacles(*heights).boundary
    shapely.prepare(outlines)
    there: Bools = shapely.dwithin(shapely.points(samples), outlines, SAME_PLACE)
    return there


def along_outlines(obstacles: shapely.Geometry, step: float) -> Floats:
    """Return points `HAIR` in front of all edges, shape (n, 2) [m].

    Parameters
    ----------
    obstacles : shapely.Geometry [m, map]
        One or more polygons.
    step : float [m]
        Largest distance between points of an edge.
    """
    pieces = [np.empty((0, 2))]
    for edge in edges_of(shapely.orient_polygons(obstacles)):
        start, along = edge[:2], edge[2:] - edge[:2]
        length = float(np.hypot(*along))
        count = int(np.ceil(length / step))
        outwards = HAIR * np.array([along[1], -along[0]]) / length
        shares = (np.arange(count) + 0.5) / count
        pieces.append(start + outwards + shares[:, None] * along)
    return np.concatenate(pieces)


def touched_cells(
    obstacles: shapely.Geometry, origin: Floats, resolution: float, shape: tuple[int, ...]
) -> Bools:
    """Return which cells overlap an obstacle by more than `HAIR`, (rows, cols).

    Cells far from all outlines are classified by their centre; the others are tested exactly.

    Parameters
    ----------
    obstacles : shapely.Geometry [m, map]
    origin : ndarray, shape (2,) [m, map]
        Outer corner of cell (0, 0).
    resolution : float [m]
    shape : tuple of int
        Rows and columns.
    """
    shapely.prepare(obstacles)
    cells = np.argwhere(np.ones(shape, dtype=np.bool_))
    centres = centres_of(cells, origin, resolution)
    touched: Bools = shapely.contains_xy(obstacles, centres)
    on_outline = np.zeros(np.add(shape, 2), dtype=np.bool_)  # with a rim of one cell
    samples = 1 + cells_of(along_outlines(obstacles, 0.5 * resolution), origin, resolution)
    inside = ((samples >= 0) & (samples < on_outline.shape)).all(axis=1)
    on_outline[tuple(samples[inside].T)] = True
    beside = binary_dilation(on_outline, structure=np.ones((3, 3)))
    near = np.flatnonzero(beside[1:-1, 1:-1])
    half = 0.5 * resolution - HAIR
    x, y = centres[near].T
    boxes = shapely.box(x - half, y - half, x + half, y + half)
    touched[near] = shapely.intersects(boxes, obstacles)
    return touched.reshape(shape)
