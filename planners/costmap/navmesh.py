"""The traversable region as a mesh of convex polygons, for any-angle search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pythoncdt as cdt

from groundmap.arrays import Bools, Bytes, Floats, Ints
from planners.costmap.kernels.navmesh import CORNER, GATE, PINCH, PLAIN, around, exits, merge

BAND = 8  # [cells] height of the strips in which polygons are looked up
BORDER_TOLERANCE = 1e-10  # [cells²] a point this near to a border lies on both sides of it


@dataclass(frozen=True, eq=False)
class NavigationMesh:
    """Convex polygons whose union is the squares between four traversable cells.

    Coordinates are those of cell centres: column and row, integers. The sides of polygon p are
    the rows `first[p]` to `first[p + 1]` of `corners` and `twins`, counter-clockwise. Parts of the
    region without area, segments between the centres of two neighbours, are `spurs`.

    Attributes
    ----------
    squares : ndarray of bool, shape (rows - 1, cols - 1)
        Squares between four cell centres; the polygons cover them exactly.
    cells : ndarray of int64, shape (v,)
        Cells on whose centres the vertices are, counted row by row, in ascending order.
    points : ndarray, shape (v, 2) [cells]
        The vertices x, y.
    kinds : ndarray of uint8, shape (v,)
        `CORNER`: shortest routes may turn here, around the missing one of four squares.
        `GATE`: spurs begin or end here. `PINCH`: two squares meet only in this point.
    first : ndarray of int64, shape (p + 1,)
    corners, twins, owner : ndarray of int64, shape (s,)
        The first vertex of each side; the side of the adjacent polygon on the same segment, or
        -1; the polygon of the side.
    exits : ndarray of int64, shape (p,)
        The only side that leads out of a dead end; -1 for other polygons.
    around_first, around : ndarray of int64, shape (v + 1,) and (s,)
        The polygons at each vertex v: `around[around_first[v] : around_first[v + 1]]`.
    spurs : ndarray of int64, shape (v, 4)
        Vertices one cell to the east, north, west and south along a spur, or -1.
    boxes : ndarray of int64, shape (p, 4)
        Least x, y and largest x, y of each polygon.
    band_first, bands : ndarray of int64
        The polygons that overlap each strip of `BAND` rows of cells.

    Examples
    --------
    >>> mesh = NavigationMesh.of(np.ones((5, 9), dtype=np.bool_))
    >>> mesh.points.tolist(), mesh.first.tolist(), mesh.twins.tolist()
    ([[0.0, 0.0], [8.0, 0.0], [0.0, 4.0], [8.0, 4.0]], [0, 4], [-1, -1, -1, -1])
    """

    squares: Bools
    cells: Ints
    points: Floats
    kinds: Bytes
    first: Ints
    corners: Ints
    twins: Ints
    owner: Ints
    exits: Ints
    around_first: Ints
    around: Ints
    spurs: Ints
    boxes: Ints
    band_first: Ints
    bands: Ints

    @classmethod
    def of(cls, traversable: Bools) -> NavigationMesh:
        """Return the mesh of a mask of traversable cells, shape (rows, cols)."""
        lines = _lines(traversable)
        cells = np.flatnonzero(lines.kinds >= 0)
        kinds = lines.kinds.ravel()[cells].astype(np.uint8)
        points = np.column_stack(np.divmod(cells, traversable.shape[1])[::-1]).astype(np.float64)
        corners, twins = _triangles(points, _outlines(lines, cells), lines.squares)
        first, corners, twins = merge(points, corners, twins, _longest_first(points, corners))
        owner = np.repeat(np.arange(len(first) - 1), np.diff(first))
        through = np.zeros(len(first) - 1, dtype=np.bool_)
        through[owner[kinds[corners] >= GATE]] = True
        boxes = _boxes(points, first, corners)
        band_first, bands = _bands(boxes, traversable.shape[0])
        by_corner = np.argsort(corners, kind="stable")
        return cls(
            squares=lines.squares,
            cells=cells,
            points=points,
            kinds=kinds,
            first=first,
            corners=corners,
            twins=twins,
            owner=owner,
            exits=exits(first, twins, owner, through),
            around_first=np.searchsorted(corners[by_corner], np.arange(len(points) + 1)),
            around=owner[by_corner],
            spurs=_spurs(lines, cells),
            boxes=boxes,
            band_first=band_first,
            bands=bands,
        )

    def holds(self, x: float, y: float) -> bool:
        """Whether a point lies in one of the squares or on its border.

        Parameters
        ----------
        x, y : float [cells]
        """
        rows, cols = self.squares.shape
        return any(
            bool(self.squares[row, col])
            for row in range(int(np.ceil(y)) - 1, int(np.floor(y)) + 1)
            for col in range(int(np.ceil(x)) - 1, int(np.floor(x)) + 1)
            if 0 <= row < rows and 0 <= col < cols
        )

    def vertex_at(self, x: float, y: float) -> int:
        """Return the vertex at a point, or -1.

        Parameters
        ----------
        x, y : float [cells]
        """
        if x != int(x) or y != int(y):
            return -1
        cell = int(y) * (self.squares.shape[1] + 1) + int(x)
        place = int(np.searchsorted(self.cells, cell))
        return place if place < len(self.cells) and self.cells[place] == cell else -1

    def polygons_at(self, x: float, y: float) -> Ints:
        """Return the polygons that contain a point, borders included.

        Parameters
        ----------
        x, y : float [cells]
        """
        band = int(y) // BAND
        nearby = self.bands[self.band_first[band] : self.band_first[band + 1]]
        return around(
            self.points, self.first, self.corners, self.boxes, nearby, x, y, BORDER_TOLERANCE
        )


class _Lines(NamedTuple):
    """Segments between neighbouring cell centres, and vertices, each of shape (rows, cols)."""

    squares: Bools  #: shape (rows - 1, cols - 1), squares between four cells
    kinds: npt.NDArray[np.int8]  #: of vertices; -1 where there is none
    outline_east: Bools  #: the border of squares leads to the next centre
    outline_north: Bools
    spur_east: Bools  #: a spur leads to the next centre
    spur_north: Bools


def _lines(traversable: Bools) -> _Lines:
    squares = (
        traversable[:-1, :-1] & traversable[:-1, 1:] & traversable[1:, :-1] & traversable[1:, 1:]
    )
    ringed = np.pad(squares, 1)
    southwest, southeast = ringed[:-1, :-1], ringed[:-1, 1:]
    northwest, northeast = ringed[1:, :-1], ringed[1:, 1:]
    spur_east, spur_north = np.zeros_like(traversable), np.zeros_like(traversable)
    spur_east[:, :-1] = traversable[:, :-1] & traversable[:, 1:]
    spur_north[:-1] = traversable[:-1] & traversable[1:]
    spur_east &= ~(northeast | southeast)
    spur_north &= ~(northeast | northwest)
    gates = spur_east | spur_north
    gates[:, 1:] |= spur_east[:, :-1]
    gates[1:] |= spur_north[:-1]
    count = southwest.astype(np.int8) + southeast + northwest + northeast
    kinds = np.full(traversable.shape, -1, dtype=np.int8)
    kinds[count == 1] = PLAIN
    kinds[count == 3] = CORNER
    kinds[(count == 2) & (southwest == northeast)] = PINCH
    kinds[gates] = GATE  # beside a spur, no two squares meet in a corner, and no three
    return _Lines(
        squares, kinds, southeast != northeast, northwest != northeast, spur_east, spur_north
    )


def _outlines(lines: _Lines, cells: Ints) -> Ints:
    """Return the segments of the borders of squares between consecutive vertices, shape (n, 2)."""
    along_row = np.flatnonzero(lines.outline_east.ravel()[cells])
    rows, cols = np.divmod(cells, lines.kinds.shape[1])
    by_column = np.lexsort((rows, cols))
    along_column = np.flatnonzero(lines.outline_north.ravel()[cells[by_column]])
    pairs = [
        np.column_stack([along_row, along_row + 1]),
        np.column_stack([by_column[along_column], by_column[along_column + 1]]),
    ]
    return np.concatenate(pairs)


def _triangles(points: Floats, outlines: Ints, squares: Bools) -> tuple[Ints, Ints]:
    """Return the sides of the triangles within the squares, three to each: corners and twins.

    All points are on a lattice, and outlines meet only in vertices, so that the treatment of nearly
    coincident points and crossing segments in `groundmap.evidence.triangulation` is not needed.
    """
    if len(outlines) == 0:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    on_outline = np.zeros(len(points), dtype=np.bool_)
    on_outline[outlines] = True
    inner = np.flatnonzero(on_outline)
    library = cdt.Triangulation(
        cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    vertices: Any = np.ascontiguousarray(points[inner])  # Any: its stubs expect a Buffer
    pairs: Any = (np.cumsum(on_outline) - 1)[outlines].astype(np.uintc)
    library.insert_vertices(vertices)
    library.insert_edges(pairs)
    library.erase_super_triangle()
    triangles = library.triangles_array()
    corners = inner[triangles["vertices"].astype(np.int64)]
    beyond = triangles["neighbors"].astype(np.int64)  # across the side that begins at a corner
    beyond[beyond == cdt.NO_NEIGHBOR] = -1
    # A triangle lies either within squares or outside all of them, and so does its centroid.
    cols, rows = (points[corners].sum(axis=1).astype(np.int64) // 3).T
    inside = squares[rows, cols]
    beyond[~inside[beyond]] = -1
    triangle, side = np.nonzero(beyond >= 0)
    other = beyond[triangle, side]
    twins = np.full(beyond.shape, -1)
    back = (beyond[other] == triangle[:, None]).argmax(axis=1)
    number = np.cumsum(inside) - 1
    twins[triangle, side] = 3 * number[other] + back
    return corners[inside].ravel(), twins[inside].ravel()


def _longest_first(points: Floats, corners: Ints) -> Ints:
    """Return the sides of triangles in the order in which merging across them is tried."""
    triangles = points[corners.reshape(-1, 3)]
    squared = ((np.roll(triangles, -1, axis=1) - triangles) ** 2).sum(axis=2)
    return np.argsort(-squared.ravel(), kind="stable")


def _spurs(lines: _Lines, cells: Ints) -> Ints:
    """Return the vertices at the other end of spurs: east, north, west, south."""
    spurs = np.full((len(cells), 4), -1)
    width = lines.kinds.shape[1]
    for k, (spur, step) in enumerate(((lines.spur_east, 1), (lines.spur_north, width))):
        here = np.flatnonzero(spur.ravel()[cells])
        there = np.searchsorted(cells, cells[here] + step)
        spurs[here, k], spurs[there, k + 2] = there, here
    return spurs


def _boxes(points: Floats, first: Ints, corners: Ints) -> Ints:
    if len(corners) == 0:
        return np.empty((0, 4), dtype=np.int64)
    xy = points[corners].astype(np.int64)
    low = np.minimum.reduceat(xy, first[:-1])
    return np.column_stack([low, np.maximum.reduceat(xy, first[:-1])])


def _bands(boxes: Ints, rows: int) -> tuple[Ints, Ints]:
    """Return where the polygons of each strip begin, and the polygons, strip by strip."""
    lowest, highest = boxes[:, 1] // BAND, boxes[:, 3] // BAND
    count = highest - lowest + 1
    polygons = np.repeat(np.arange(len(boxes)), count)
    band = np.arange(len(polygons)) - np.repeat(np.cumsum(count) - count - lowest, count)
    order = np.argsort(band, kind="stable")
    return np.searchsorted(band[order], np.arange(rows // BAND + 2)), polygons[order]
