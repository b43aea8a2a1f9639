"""Visibility in a world at one time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import shapely

from groundmap.arrays import Bools, Floats, Ints
from groundmap.simulate.kernels.occlusion import find_hidden
from groundmap.simulate.world import Hole, World

GROUND_LEVEL = 0.0  # [m], height of lines of sight along the ground


class Prisms(NamedTuple):
    """Footprints with heights, as arrays for the kernels."""

    edges: Floats  #: shape (e, 4) [m, map], x0, y0, x1, y1
    starts: Ints  #: shape (p + 1,), first edge of each prism
    #: shape (p, 4) [m, m, m/m, m/m]: bottom; height of the top at x = y = 0, and its rise along x
    #: and y
    heights: Floats


def opaque_prisms(world: World) -> Prisms:
    """Return the opaque solids of a world at rest, as `World.at` returns it.

    Examples
    --------
    >>> from groundmap.simulate.world import Solid
    >>> world = World(bounds=(0, 0, 9, 9), solids=(Solid(shapely.box(4, 4, 5, 5), top=1.0),))
    >>> in_sight(world, np.array([1.0, 4.5, 2.0]), np.array([(8.0, 4.5, 0.0), (8.0, 4.5, 1.5)]))
    array([False,  True])
    """
    solids = [solid for solid in world.solids if not solid.transparent]
    return _prisms(
        [solid.outline for solid in solids],
        [(solid.bottom, *solid.upper_plane) for solid in solids],
    )


def ground_level_prisms(obstacles: shapely.Geometry) -> Prisms:
    """Return prisms that end sight along the ground, from `World.obstacles`."""
    outlines = list(shapely.get_parts(obstacles))
    return _prisms(outlines, [(GROUND_LEVEL - 1.0, GROUND_LEVEL + 1.0, 0.0, 0.0)] * len(outlines))


def edges_of(outline: shapely.Geometry) -> Floats:
    """Return the edges of all rings of polygons, shape (e, 4): x0, y0, x1, y1."""
    rings = shapely.get_rings(shapely.get_parts(outline))
    corners = [shapely.get_coordinates(ring) for ring in rings]
    pieces = [np.hstack([ring[:-1], ring[1:]]) for ring in corners]
    return np.concatenate([np.empty((0, 4)), *pieces])


def find_visible(prisms: Prisms, eye: Floats, targets: Floats) -> Bools:
    """Return which targets are not hidden by a prism, shape (n,).

    Parameters
    ----------
    prisms : Prisms
    eye : ndarray, shape (3,) [m, map]
    targets : ndarray, shape (n, 3) [m, map]
    """
    out = np.empty(len(targets), dtype=np.bool_)
    find_hidden(np.ascontiguousarray(eye), np.ascontiguousarray(targets), *prisms, out)
    return ~out


def in_sight(world: World, eye: Floats, targets: Floats) -> Bools:
    """Return which targets are visible, shape (n,).

    Targets below the ground are visible through the mouth of their hole.

    Parameters
    ----------
    world : World
        At rest, as `World.at` returns it.
    eye : ndarray, shape (3,) [m, map]
    targets : ndarray, shape (n, 3) [m, map]
    """
    seen = find_visible(opaque_prisms(world), eye, targets)
    below = np.flatnonzero(seen & (targets[:, 2] < 0))
    seen[below] = _through_mouths(world.holes, eye, targets[below])
    return seen


def _through_mouths(holes: Iterable[Hole], eye: Floats, targets: Floats) -> Bools:
    """Return which targets below the ground have only a hole above their line of sight."""
    share = eye[2] / (eye[2] - targets[:, 2])  # where sight crosses the level of the ground
    entry = eye[:2] + share[:, None] * (targets[:, :2] - eye[:2])
    lines = shapely.linestrings(np.stack([entry, targets[:, :2]], axis=1))
    seen = np.zeros(len(targets), dtype=np.bool_)
    for hole in holes:
        seen |= shapely.covers(hole.outline, lines)
    return seen


def _prisms(
    outlines: list[shapely.Polygon], heights: list[tuple[float, float, float, float]]
) -> Prisms:
    pieces = [edges_of(outline) for outline in outlines]
    counts = [0, *(len(piece) for piece in pieces)]
    return Prisms(
        np.concatenate([np.empty((0, 4)), *pieces]),
        np.cumsum(counts, dtype=np.int64),
        np.array(heights, dtype=np.float64).reshape(-1, 4),
    )
