"""Constrained Delaunay triangulation with segments as chains of edges."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pythoncdt as cdt
import shapely
from scipy.spatial import KDTree

from groundmap.arrays import Bools, Floats, Ints, as_cells, as_floats, check_finite
from groundmap.errors import InputError

MERGE_DISTANCE = 1e-3  # [m], nearer points are one vertex
FARTHEST = 1e12  # [m] from the origin
NINE_SQUARES = [(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)]
NODING_GRID = 1e-3  # [m], lattice for crossings that the library does not resolve


class Mesh(NamedTuple):
    """A constrained Delaunay triangulation, counter-clockwise, with -1 for no neighbour."""

    points: Floats  #: shape (v, 2) [m], vertices: merged inputs, then crossings
    simplices: Ints  #: shape (t, 3)
    neighbors: Ints  #: shape (t, 3), triangle opposite to each corner
    edges: Ints  #: shape (e, 2), each edge once
    constrained: Bools  #: shape (e,), edges that are pieces of segments
    source: Ints  #: shape (n,), vertex of each input point
    crossings: (
        Ints  #: shape (c, 3), (vertex, a, b): the vertex lies inside the segment of vertices a, b
    )


def triangulate(
    points: npt.ArrayLike, segments: npt.ArrayLike = (), *, merge_distance: float = MERGE_DISTANCE
) -> Mesh:
    """Return the triangulation of points in which every segment is a chain of edges.

    Parameters
    ----------
    points : array_like, shape (n, 2) [m]
        In metres, or in another unit, such as pixels.
    segments : array_like of int, shape (m, 2)
        Rows of `points`. Crossing segments are split at the crossing; overlapping segments share
        edges; segments whose ends are one vertex are dropped.
    merge_distance : float, default 0.001
        Points within this distance of each other become one vertex.

    Raises
    ------
    InputError
        A coordinate is NaN, infinite or beyond 1e12 m, or a segment names no point.

    Notes
    -----
    Paper, section 3, with the ground plane in place of the image plane (section 7). Fewer than
    three points, or points on one line, have no triangles; their edges link neighbours along the
    line.

    Examples
    --------
    >>> mesh = triangulate([(0, 0), (2, 2), (0, 2), (2, 0)], [(0, 1), (2, 3)])
    >>> len(mesh.points), int(mesh.constrained.sum())
    (5, 4)
    """
    xy = as_floats("points", points, (None, 2))
    # The library does not return for infinite coordinates or products that overflow.
    check_finite("points", xy)
    far = np.abs(xy) > FARTHEST
    if far.any():
        row = int(np.argwhere(far)[0, 0])
        expected = f"coordinates within {FARTHEST:g} m"
        raise InputError("points", expected, str(xy[row].tolist()), where=f"row {row}")
    pairs = as_cells("segments", segments, 2)
    outside = (pairs < 0) | (pairs >= len(xy))
    if outside.any():
        row = int(np.argwhere(outside)[0, 0])
        raise InputError(
            "segments",
            f"rows of the {len(xy)} points",
            str(pairs[row].tolist()),
            where=f"row {row}",
        )
    if len(xy) == 0:
        return _nothing()
    vertices, source = _merge_duplicates(xy, merge_distance)
    constraints = np.sort(source[pairs], axis=1)
    constraints = np.unique(constraints[constraints[:, 0] != constraints[:, 1]], axis=0)
    try:
        return _insert(vertices, constraints, source)
    except RuntimeError:  # a crossing that coincides with a vertex up to rounding
        return _node_segments(vertices, constraints, source)


def _nothing() -> Mesh:
    no_pairs, no_triangles = np.empty((0, 2), dtype=np.int64), np.empty((0, 3), dtype=np.int64)
    return Mesh(
        points=np.empty((0, 2)),
        simplices=no_triangles,
        neighbors=no_triangles,
        edges=no_pairs,
        constrained=np.empty(0, dtype=np.bool_),
        source=np.empty(0, dtype=np.int64),
        crossings=no_triangles,
    )


def _merge_duplicates(xy: Floats, merge_distance: float) -> tuple[Floats, Ints]:
    """Return the vertices and, for each point, the number of its vertex.

    The first of a group of near points replaces those within `merge_distance` of it. No point
    moves farther, even in long chains of near points.
    """
    _, first, group = np.unique(xy, axis=0, return_index=True, return_inverse=True)
    distinct = np.sort(first)
    stands_for = np.arange(len(xy))
    stands_for[distinct] = distinct[_first_nearby(xy[distinct], merge_distance)]
    stands_for = stands_for[first[group.reshape(-1)]]
    kept = np.unique(stands_for)
    return xy[kept], np.searchsorted(kept, stands_for)


def _first_nearby(xy: Floats, merge_distance: float) -> Ints:
    """Return, for each of distinct points, the first kept point nearby, or itself.

    A point is kept if no earlier point within `merge_distance` is kept.
    """
    stands_for = np.arange(len(xy))
    # Twice the distance, as the search excludes points on its bound.
    apart, _ = KDTree(xy).query(xy, k=[2], distance_upper_bound=2 * merge_distance)
    crowded = np.flatnonzero(np.isfinite(apart[:, 0]))
    # A square of that side holds at most four kept points, which bounds the work per point.
    squares = np.floor(xy[crowded] / merge_distance).tolist()
    kept: dict[tuple[float, float], list[tuple[int, float, float]]] = {}
    for point, (x, y), (col, row) in zip(
        crowded.tolist(), xy[crowded].tolist(), squares, strict=True
    ):
        near = [
            number
            for i, j in NINE_SQUARES
            for number, a, b in kept.get((col + i, row + j), ())
            if (a - x) ** 2 + (b - y) ** 2 <= merge_distance**2
        ]
        if near:
            stands_for[point] = min(near)
        else:
            kept.setdefault((col, row), []).append((point, x, y))
    return stands_for


def _insert(vertices: Floats, constraints: Ints, source: Ints) -> Mesh:
    library = cdt.Triangulation(
        cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.TRY_RESOLVE, 0.0
    )
    corners: Any = np.ascontiguousarray(vertices)  # Any: the stubs expect a Buffer
    library.insert_vertices(corners)
    pairs: Any = np.ascontiguousarray(constraints, dtype=np.uintc)
    library.insert_edges(pairs)
    library.erase_super_triangle()
    nodes = library.vertices_array()
    points = np.column_stack([nodes["x"], nodes["y"]])
    triangles = library.triangles_array()
    simplices = triangles["vertices"].astype(np.int64).reshape(-1, 3)
    across = triangles["neighbors"].astype(np.int64).reshape(-1, 3)
    across[across == cdt.NO_NEIGHBOR] = -1
    # The library stores the neighbour across edge (i, i + 1), scipy the one opposite corner i.
    neighbors = across[:, [1, 2, 0]]
    fixed = np.array([(e.v1, e.v2) for e in library.fixed_edges_iter()], dtype=np.int64)
    fixed = np.sort(fixed.reshape(-1, 2), axis=1)
    edges, constrained = _edges(points, simplices, across, fixed)
    crossings = _crossings(library) if library.piece_to_originals_count() else []
    return Mesh(
        points,
        simplices,
        neighbors,
        edges,
        constrained,
        source,
        np.array(crossings, dtype=np.int64).reshape(-1, 3),
    )


def _edges(points: Floats, simplices: Ints, across: Ints, fixed: Ints) -> tuple[Ints, Bools]:
    """Return each edge once, and which edges are pieces of segments."""
    if len(simplices) == 0:
        edges = np.concatenate([_along_line(points), fixed])
    else:
        # An edge between two triangles is taken from the triangle with the higher number.
        own = across < np.arange(len(simplices))[:, None]
        edges = np.stack([simplices, simplices[:, [1, 2, 0]]], axis=-1)[own]
        edges = np.concatenate([np.sort(edges, axis=1), fixed])
    keys = edges[:, 0] * len(points) + edges[:, 1]
    fixed_keys = fixed[:, 0] * len(points) + fixed[:, 1]
    keys, first = np.unique(keys, return_index=True)
    return edges[first], np.isin(keys, fixed_keys)


def _along_line(points: Floats) -> Ints:
    """Return the pairs of neighbours of points on one line."""
    if len(points) < 2:
        return np.empty((0, 2), dtype=np.int64)
    spread = points - points.mean(axis=0)
    along = spread @ spread[np.argmax((spread**2).sum(axis=1))]
    order = np.argsort(along, kind="stable")
    return np.sort(np.stack([order[:-1], order[1:]], axis=1), axis=1)


def _crossings(library: cdt.Triangulation) -> list[tuple[int, int, int]]:
    """Return (vertex, a, b) for crossings and points inside a segment a-b."""
    return sorted(
        {
            (vertex, original.v1, original.v2)
            for piece, originals in library.piece_to_originals_iter()
            for vertex in (piece.v1, piece.v2)
            for original in originals
            if vertex not in (original.v1, original.v2)
        }
    )


def _node_segments(vertices: Floats, constraints: Ints, source: Ints) -> Mesh:
    """Triangulate on a millimetre lattice, with segments split by shapely where they meet."""
    lattice = np.round(vertices / NODING_GRID)
    lines = shapely.linestrings(lattice[constraints])
    lines = lines[shapely.length(lines) > 0]
    pieces = shapely.get_parts(shapely.union_all(lines, grid_size=1.0))
    corners, part = shapely.get_coordinates(pieces, return_index=True)
    everything = np.concatenate([lattice, corners])
    _, first, group = np.unique(everything, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # inputs precede crossings
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    vertex = rank[group.reshape(-1)]
    ends = vertex[len(lattice) :]
    edges = np.sort(np.stack([ends[:-1], ends[1:]], axis=1)[part[:-1] == part[1:]], axis=1)
    mesh = _insert(everything[first[order]], np.unique(edges, axis=0), vertex[source])
    on, a, b = _segments_through(mesh.points, lattice, constraints).T
    a, b = vertex[a], vertex[b]
    inside = (on != a) & (on != b) & (a != b)  # ends may coincide on the lattice
    crossings = np.stack([on, a, b], axis=1)[inside]
    return mesh._replace(points=mesh.points * NODING_GRID, crossings=crossings)


def _segments_through(points: Floats, lattice: Floats, constraints: Ints) -> Ints:
    """Return (point, a, b) for every segment a-b within one unit of a lattice point."""
    lines = shapely.STRtree(shapely.linestrings(lattice[constraints]))
    point, line = lines.query(shapely.points(points), predicate="dwithin", distance=1.0)
    order = np.lexsort((line, point))
    point, line = point[order], line[order]
    return np.column_stack([point, constraints[line]]).astype(np.int64)
