"""Landmarks: the features of a world, on its surfaces, edges and ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import InputError
from groundmap.simulate.occlusion import edges_of
from groundmap.simulate.world import Hole, Solid, World

GROUND = -1  # owner of the landmarks of the ground and its holes
OFF = 1e-6  # [m], distance of landmarks from their surface, so that it does not hide them
MOST = 1e6  # landmarks of a world; more indicates a size or a density in a wrong unit
SHORTEST, LONGEST = 0.3, 1.2  # [m], lengths of segments


class LandmarkSet(NamedTuple):
    """Landmarks of one kind, at their places at time 0."""

    xyz: Floats  #: shape (n, 3) [m, map] of points, (n, 2, 3) of segments
    owner: Ints  #: shape (n,), the solid that carries it; -1 for the ground and its holes

    def __len__(self) -> int:
        return len(self.owner)


class Landmarks(NamedTuple):
    """All landmarks of a world."""

    points: LandmarkSet
    segments: LandmarkSet


class _Face(NamedTuple):
    """An upright rectangle: a corner and two sides, all shape (3,) [m, map]."""

    corner: Floats
    along: Floats
    up: Floats

    @property
    def area(self) -> float:
        return float(np.linalg.norm(self.along) * np.linalg.norm(self.up))


def sample_landmarks(world: World, rng: np.random.Generator) -> Landmarks:
    """Sample the landmarks of a world, in the densities of its solids and its ground.

    Points are sampled uniformly on upright faces, on tops, on undersides with a texture and on the
    ground. Segments are sampled on upright faces and on the ground, and placed along the upper and
    upright edges of the solids that have `edges` (and the lower edges, if their underside has a
    texture), in pieces of at most 1.2 m.

    Parameters
    ----------
    world : World
        Landmarks are also placed on moving and temporary solids; see `present_at`.
    rng : numpy Generator

    Raises
    ------
    InputError
        More than a million landmarks.

    Examples
    --------
    >>> world = World(bounds=(0, 0, 10, 10), solids=(Solid(shapely.box(4, 4, 5, 5), top=1.0),))
    >>> landmarks = sample_landmarks(world, np.random.default_rng(1))
    >>> len(landmarks.points), len(landmarks.segments)
    (641, 8)
    """
    _check_number(world)
    points, segments = [_on_ground(world, rng)], [_lines_on_ground(world, rng)]
    for solid in world.solids:
        parts = [_on_faces(solid, rng), _on_top(solid, rng), _on_underside(solid, rng)]
        points.append(np.concatenate(parts))
        segments.append(np.concatenate([_lines_on_faces(solid, rng), _edges(solid)]))
    return Landmarks(_join(points), _join(segments))


def _check_number(world: World) -> None:
    count = (world.ground_texture + world.ground_lines) * _ground_area(world)
    for hole in world.holes:
        count += world.ground_texture * hole.outline.length * hole.depth
    for solid in world.solids:
        sides = solid.outline.length * (solid.top - solid.bottom)
        count += (solid.texture + 2.0 * solid.lines) * sides + (
            solid.texture + solid.underside
        ) * solid.outline.area
        count += solid.outline.length / LONGEST if solid.edges else 0.0
    if count > MOST:
        raise InputError(
            "world",
            f"at most {MOST:g} landmarks",
            f"{count:.3g}",
            hint="Give smaller bounds [m], or less texture [1/m²].",
        )


def _join(parts: list[Floats]) -> LandmarkSet:
    """Join the landmarks of the ground, which come first, and those of each solid."""
    owners = np.repeat(np.arange(len(parts)) + GROUND, [len(part) for part in parts])
    return LandmarkSet(np.concatenate(parts), owners)


def present_at(marks: LandmarkSet, world: World, time: float) -> tuple[Floats, Bools]:
    """Return the places of landmarks at a time, and which of them exist then.

    Parameters
    ----------
    marks : LandmarkSet
    world : World
    time : float [s]

    Returns
    -------
    xyz : ndarray, shape of ``marks.xyz`` [m, map]
    present : ndarray of bool, shape (n,)
    """
    shifts = np.array([(0.0, 0.0), *(solid.shift(time) for solid in world.solids)])
    present = np.array([True, *(solid.is_there(time) for solid in world.solids)])
    row = marks.owner + 1  # the ground comes first
    xyz = marks.xyz.copy()
    xyz[..., :2] += shifts[row].reshape(-1, *(1,) * (xyz.ndim - 2), 2)
    return xyz, present[row]


def _on_ground(world: World, rng: np.random.Generator) -> Floats:
    count = rng.poisson(world.ground_texture * _ground_area(world))
    places = _in_bounds(world, count, rng)
    points = np.column_stack([places, np.zeros(count)])
    walls = []
    for hole in world.holes:
        points[shapely.contains_xy(hole.outline, places), 2] = -hole.depth
        walls += [_spots(face, world.ground_texture, rng) for face in _hole_faces(hole)]
    return np.concatenate([points, *walls])


def _hole_faces(hole: Hole) -> Iterator[_Face]:
    """Yield the walls of a hole; they face inwards."""
    for edge in edges_of(hole.outline):
        along = np.array([*(edge[2:] - edge[:2]), 0.0])
        inwards = OFF * np.array([-along[1], along[0], 0.0]) / np.linalg.norm(along)
        corner = np.array([*edge[:2], -hole.depth]) + inwards
        yield _Face(corner, along, np.array([0.0, 0.0, hole.depth]))


def _lines_on_ground(world: World, rng: np.random.Generator) -> Floats:
    count = rng.poisson(world.ground_lines * _ground_area(world))
    middle, turn = _in_bounds(world, count, rng), rng.uniform(0.0, np.pi, count)
    half = 0.5 * rng.uniform(SHORTEST, LONGEST, count)[:, None]
    way = half * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ends = np.zeros((count, 2, 3))
    ends[:, :, :2] = np.stack([middle - way, middle + way], axis=1)
    holes = shapely.union_all([hole.outline for hole in world.holes])
    off_holes: Floats = ends[~shapely.intersects(shapely.linestrings(ends[:, :, :2]), holes)]
    return off_holes


def _ground_area(world: World) -> float:
    xmin, ymin, xmax, ymax = world.bounds
    return (xmax - xmin) * (ymax - ymin)


def _in_bounds(world: World, count: int, rng: np.random.Generator) -> Floats:
    xmin, ymin, xmax, ymax = world.bounds
    return rng.uniform((xmin, ymin), (xmax, ymax), (count, 2))


def _faces(solid: Solid) -> Iterator[_Face]:
    """Yield the upright faces of a solid, moved `OFF` outwards.

    The exterior runs counter-clockwise and holes clockwise: the outside is always on the right.
    """
    up = np.array([0.0, 0.0, solid.top - solid.bottom])
    for edge in edges_of(solid.outline):
        along = np.array([*(edge[2:] - edge[:2]), 0.0])
        outwards = OFF * np.array([along[1], -along[0], 0.0]) / np.linalg.norm(along)
        yield _Face(np.array([*edge[:2], solid.bottom]) + outwards, along, up)


def _on_faces(solid: Solid, rng: np.random.Generator) -> Floats:
    spots = [_spots(face, solid.texture, rng) for face in _faces(solid)]
    return _below_top(solid, np.concatenate([np.empty((0, 3)), *spots]))


def _below_top(solid: Solid, places: Floats) -> Floats:
    """Return the points, or segments, that are not above the upper side of a solid with a slope."""
    if solid.slope == (0.0, 0.0):
        return places
    heights = solid.top_at(places.reshape(-1, 3)[:, :2]).reshape(places.shape[:-1])
    below = places[..., 2] <= heights
    kept: Floats = places[below if below.ndim == 1 else below.all(axis=1)]
    return kept


def _spots(face: _Face, density: float, rng: np.random.Generator) -> Floats:
    shares = rng.random((rng.poisson(density * face.area), 2))
    spots: Floats = face.corner + shares @ np.stack([face.along, face.up])
    return spots


def _on_top(solid: Solid, rng: np.random.Generator) -> Floats:
    on_top = _over_outline(solid, solid.texture, rng)
    return np.column_stack([on_top, solid.top_at(on_top) + OFF])


def _on_underside(solid: Solid, rng: np.random.Generator) -> Floats:
    if solid.underside == 0.0:  # without a draw, which would change the landmarks that follow
        return np.empty((0, 3))
    below = _over_outline(solid, solid.underside, rng)
    return np.column_stack([below, np.full(len(below), solid.bottom - OFF)])


def _over_outline(solid: Solid, density: float, rng: np.random.Generator) -> Floats:
    """Sample places in the outline of a solid, shape (n, 2)."""
    xmin, ymin, xmax, ymax = solid.outline.bounds
    count = rng.poisson(density * (xmax - xmin) * (ymax - ymin))
    places = rng.uniform((xmin, ymin), (xmax, ymax), (count, 2))
    inside: Floats = places[shapely.contains_xy(solid.outline, places)]
    return inside


def _lines_on_faces(solid: Solid, rng: np.random.Generator) -> Floats:
    strokes = [np.empty((0, 2, 3))]
    for face in _faces(solid):
        strokes += [
            _strokes(face.corner, face.along, face.up, solid.lines * face.area, rng),
            _strokes(face.corner, face.up, face.along, solid.lines * face.area, rng),
        ]
    return _below_top(solid, np.concatenate(strokes))


def _strokes(
    corner: Floats, way: Floats, across: Floats, mean: float, rng: np.random.Generator
) -> Floats:
    """Sample segments in the direction `way` on a face."""
    count = rng.poisson(mean)
    length = rng.uniform(SHORTEST, LONGEST, count)
    share = np.minimum(length / np.linalg.norm(way), 1.0)
    begin = corner + np.outer(rng.random(count) * (1.0 - share), way)
    begin += np.outer(rng.random(count), across)
    return np.stack([begin, begin + np.outer(share, way)], axis=1)


def _edges(solid: Solid) -> Floats:
    """Return the upper and the upright edges of a solid, each cut into equal pieces.

    The lower edges follow if its underside has a texture.
    """
    if not solid.edges:
        return np.empty((0, 2, 3))
    faces = list(_faces(solid))
    ways = [_upper_edge(solid, face) for face in faces]
    ways += [(face.corner, _upper_edge(solid, face)[0] - face.corner) for face in faces]
    if solid.underside > 0.0:
        ways += [(face.corner - (0.0, 0.0, OFF), face.along) for face in faces]
    return np.concatenate([_cut(start, way) for start, way in ways if way.any()])


def _upper_edge(solid: Solid, face: _Face) -> tuple[Floats, Floats]:
    """Return the start of a face's upper edge, and the way to its end."""
    if solid.slope == (0.0, 0.0):
        return face.corner + face.up, face.along
    ends = np.stack([face.corner, face.corner + face.along])
    ends[:, 2] = np.maximum(solid.top_at(ends[:, :2]), solid.bottom)
    return ends[0], ends[1] - ends[0]


def _cut(start: Floats, way: Floats) -> Floats:
    count = int(np.ceil(np.linalg.norm(way) / LONGEST))
    cuts = start + np.outer(np.arange(count + 1) / count, way)
    return np.stack([cuts[:-1], cuts[1:]], axis=1)
