"""Slow and obvious twins of the geometric core, in NumPy, scipy and shapely."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from collections.abc import Callable
from itertools import combinations
from typing import TypeAlias

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces
from groundmap.evidence.ground_plane.visibility import SightFan
from groundmap.evidence.triangulation import Mesh

Cell: TypeAlias = tuple[int, int]

FAR = 1e3  # shadows end this many times farther away than what casts them


# Triangulation


def signed_areas(mesh: Mesh) -> Floats:
    """Area of each triangle, positive if counter-clockwise."""
    a, b, c = np.moveaxis(mesh.points[mesh.simplices], 1, 0)
    areas: Floats = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return areas


def sides(mesh: Mesh) -> set[Cell]:
    """Sides of the triangles, as sorted pairs."""
    corners = mesh.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    return set(map(tuple, np.sort(corners, axis=1).tolist()))


def edge_set(mesh: Mesh) -> set[Cell]:
    return set(map(tuple, mesh.edges.tolist()))


def without_chain(mesh: Mesh, points: Floats, segments: Ints, tolerance: float) -> list[int]:
    """Rows of the segments that no chain of constrained edges follows from end to end.

    A chain is a path through constrained edges that stay within `tolerance` of the segment between
    the vertices its ends became.
    """
    edges = mesh.edges[mesh.constrained]
    missing = []
    for row, (first, last) in enumerate(mesh.source[segments].reshape(-1, 2).tolist()):
        if first == last:
            continue
        line = shapely.LineString(mesh.points[[first, last]])
        near = shapely.dwithin(shapely.points(mesh.points), line, tolerance)
        if not _connected(edges[near[edges].all(axis=1)], len(mesh.points), first, last):
            missing.append(row)
    assert len(points) == len(mesh.source)
    return missing


def _connected(edges: Ints, count: int, first: int, last: int) -> bool:
    graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    return bool(group[first] == group[last])


def without_segment(mesh: Mesh, segments: Ints, tolerance: float) -> list[int]:
    """Rows of the constrained edges that lie on no segment."""
    pieces = shapely.linestrings(mesh.points[mesh.edges[mesh.constrained]])
    ends = mesh.source[segments].reshape(-1, 2)
    if len(ends) == 0:
        return list(range(len(pieces)))
    around = shapely.buffer(shapely.linestrings(mesh.points[ends]), 1.01 * tolerance)
    return [row for row, piece in enumerate(pieces) if not shapely.covers(around, piece).any()]


def components(mesh: Mesh) -> int:
    """How many pieces the vertices and all edges form."""
    count = len(mesh.points)
    graph = coo_array((np.ones(len(mesh.edges)), tuple(mesh.edges.T)), shape=(count, count))
    return int(connected_components(graph, directed=False)[0])


def deepest_intrusion(mesh: Mesh) -> float:
    """How far any vertex lies inside any circumcircle, relative to its radius; Delaunay: none."""
    deepest = 0.0
    for corners in mesh.points[mesh.simplices]:
        a, b = corners[1:] - corners[0]
        centre = corners[0] + np.linalg.solve(2.0 * np.array([a, b]), [a @ a, b @ b])
        radius = np.hypot(*(corners[0] - centre))
        nearest = np.hypot(*(mesh.points - centre).T).min()
        deepest = max(deepest, float(1.0 - nearest / radius))
    return deepest


# Sight


def inverse_ranges(ends: Floats, bearings: Floats) -> Floats:
    """1 / range of each edge at each bearing, shape (edges, bearings); -inf where it has none.

    Each ray is intersected with each edge by Cramer's rule.
    """
    ray = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)[None]
    start, edge = ends[:, None, 0], (ends[:, 1] - ends[:, 0])[:, None]
    turn = _cross(ray, edge)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, share = _cross(start, edge) / turn, _cross(start, ray) / turn
    hit = (distance > 0) & (share >= 0) & (share <= 1)
    inverse: Floats = np.where(hit, 1.0 / np.where(hit, distance, 1.0), -np.inf)
    return inverse


def visible_region(surfaces: Floats, chords: Floats) -> shapely.Geometry:
    """Return what a viewpoint at the origin sees: surfaces hide what is behind them.

    Where there is no surface at a bearing, the chords bound the region. Edges seen end-on have no
    area to hide behind, and no valid polygon.
    """
    sine = _cross(surfaces[:, 0], surfaces[:, 1]) / np.prod(np.hypot(*surfaces.T), axis=0)
    surfaces = surfaces[sine > 1e-9]
    seen = shapely.union_all(_wedges(surfaces))
    shadows = shapely.polygons(
        np.stack([surfaces[:, 0], FAR * surfaces[:, 0], FAR * surfaces[:, 1], surfaces[:, 1]], 1)
    )
    seen = shapely.difference(seen, shapely.union_all(shadows))
    ground = shapely.difference(
        shapely.union_all(_wedges(chords)), shapely.union_all(_wedges(FAR * surfaces))
    )
    return shapely.union(seen, ground)


def support_chords(flat: GroundView, width: float, angle: float) -> Floats:
    """Chord of each ground feature: its range, at bearings within min(width / range, angle).

    A chord ends where an image does, but reaches up to its feature in any case.
    """
    chords = []
    for x, y in flat.supports.tolist():
        radius, bearing = np.hypot(x, y), np.arctan2(y, x)
        half = min(width / radius, angle)
        right, left = seen_between(flat, radius)
        low, high = bearing - half, bearing + half
        if low < right:
            low = min(right, bearing)
        if high > left:
            high = max(left, bearing)
        chords.append([(radius * np.cos(t), radius * np.sin(t)) for t in (low, high)])
    return np.array(chords, dtype=np.float64).reshape(-1, 2, 2)


def seen_between(flat: GroundView, radius: float) -> tuple[float, float]:
    """Bearings of the right and the left end of what both images see on a circle.

    On the left that is where the circle meets y + baseline = border x, the right image's border.
    """
    if np.isinf(flat.border):
        return -np.pi / 2, np.pi / 2
    slope, baseline = flat.border, flat.baseline
    inside = max((1 + slope**2) * radius**2 - baseline**2, 0.0)
    x = (slope * baseline + np.sqrt(inside)) / (1 + slope**2)
    return float(np.arctan2(-slope, 1.0)), float(np.arctan2(slope * x - baseline, x))


def gap_chords(bearings: Floats, ranges: Floats, widest: float) -> Floats:
    """Chord of each two lines of sight, neighbours or not: as far as both and the gap let it be."""
    pairs = list(combinations(range(len(bearings)), 2))
    i, j = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    i, j = np.where(bearings[i] < bearings[j], (i, j), (j, i))
    gap = bearings[j] - bearings[i]
    i, j, gap = (values[(gap > 1e-9) & (gap < 1.5)] for values in (i, j, gap))
    reached = np.minimum(np.minimum(ranges[i], ranges[j]), widest / 2 / np.sin(gap / 2))
    both = np.stack([bearings[i], bearings[j]], axis=1)
    chords: Floats = reached[:, None, None] * np.stack([np.cos(both), np.sin(both)], axis=-1)
    return chords


def usual_gap(bearings: Floats, ranges: Floats, least: float, most: float) -> float:
    """Return four times the gap that four in five neighbouring lines leave, within bounds.

    Two lines are neighbours if all lines between them are shorter than both.
    """
    order = np.argsort(bearings, kind="stable")
    bearings, ranges = bearings[order], ranges[order]
    gaps = []
    for i, j in combinations(range(len(bearings)), 2):
        both, angle = min(ranges[i], ranges[j]), bearings[j] - bearings[i]
        if (ranges[i + 1 : j] < both).all() and 1e-9 < angle < 1.5:
            gaps.append(2 * both * np.sin(angle / 2))
    return min(max(4.0 * float(np.quantile(gaps, 0.8)), least), most) if gaps else most


def farthest(chords: Floats, bearings: Floats) -> Floats:
    """Range of the farthest edge at each bearing; 0 where there is none."""
    inverse = inverse_ranges(chords, bearings)
    ranges = np.where(inverse > 0, 1.0 / np.where(inverse > 0, inverse, 1.0), 0.0)
    found: Floats = ranges.max(axis=0, initial=0.0)
    return found


def sight_ranges(walls: Floats, granting: Bools, chords: Floats, bearings: Floats) -> Floats:
    """How far freespace is seen at each bearing; 0 where nothing is.

    The nearest wall ends sight. If it grants nothing, or there is none, the chords do too.
    """
    inverse = inverse_ranges(walls, bearings)
    inverse = np.concatenate([inverse, np.full((1, len(bearings)), 0.0)])
    nearest = inverse.argmax(axis=0)
    walled = nearest < len(walls)
    wall = np.where(walled, 1.0 / np.where(walled, inverse.max(axis=0), 1.0), np.inf)
    granted = np.append(granting, False)[nearest]
    ranges: Floats = np.where(granted, wall, np.minimum(wall, farthest(chords, bearings)))
    return ranges


def counted_against(
    flat: GroundView, surfaces: Surfaces, slack: float
) -> tuple[Floats, list[set[int]]]:
    """For each surface, how many features are seen through it, by their shares; and which ones.

    By `slack`, a share of its length, a surface is taken to be longer (or shorter) at either end.
    What passes less than 0.05 m below a top may have passed over it, unless the surface is
    doubtful; of a lone point no more counts than 0.02 m to either side.
    Surfaces across the seam, behind the camera, and those seen end-on are passed by nothing.
    """
    places = np.concatenate([flat.points, flat.supports]).tolist()
    heights = [*flat.heights.tolist(), *flat.support_heights.tolist()]
    rows = Counter(flat.feature.tolist())
    against, which = np.zeros(len(surfaces.ends)), [set[int]() for _ in surfaces.ends]
    for s, (right, left) in enumerate(surfaces.ends):
        first, last = right, left
        below = 0.0 if surfaces.kind[s] == SurfaceKind.DOUBTFUL else 0.05
        if surfaces.discs[s] > 0.02:
            middle, share = 0.5 * (right + left), 0.02 / surfaces.discs[s]
            first, last = (middle + share * (end - middle) for end in (right, left))
        if np.arctan2(*last[::-1]) - np.arctan2(*first[::-1]) < 1e-9:
            continue
        for (x, y), height, feature in zip(places, heights, flat.feature.tolist(), strict=True):
            sides = np.array([(x, first[0] - last[0]), (y, first[1] - last[1])])
            if np.linalg.det(sides) == 0.0:
                continue
            share, t = np.linalg.solve(sides, first)  # share (x, y) = first + t (last - first)
            if share <= 0 or not -slack <= t <= 1 + slack:
                continue
            reach, top = (
                (1 - t) * pair[0] + t * pair[1] for pair in (surfaces.reach[s], surfaces.tops[s])
            )
            behind = np.hypot(x, y) * (1 - share) > 2 * reach + 0.05
            if behind and (1 - share) * flat.camera_height + share * height < top - below:
                against[s] += 1 / rows[feature]
                which[s].add(feature)
    return against, which


def places_without_ground(flat: GroundView, step: float) -> list[tuple[float, float]]:
    """Places along the lines to features below the ground, from where they go below its level.

    A line that is below it for more than 3 m has none, nor one with ground features beside it
    there: within 0.15 m of it, and as much away from where it goes below and from its end.
    """
    places = []
    for (x, y), height in zip(flat.drop_offs.tolist(), flat.drop_off_heights.tolist(), strict=True):
        begin = flat.camera_height / (flat.camera_height - height)
        length = np.hypot(x, y)
        if (1 - begin) * length > 3.0:
            continue
        line = shapely.LineString([(0.0, 0.0), (x, y)])
        tight = shapely.LineString(
            [
                (x * (begin + 0.15 / length), y * (begin + 0.15 / length)),
                (x * (1 - 0.15 / length), y * (1 - 0.15 / length)),
            ]
        )
        if (1 - begin) * length > 0.3 and any(
            _foot_within(tight, line, shapely.Point(place)) for place in flat.supports.tolist()
        ):
            continue
        count = int(np.ceil((1 - begin) * length / step))
        shares = [begin + (1 - begin) * (number + 0.5) / count for number in range(count)]
        places += [(share * x, share * y) for share in shares]
    return places


def _foot_within(piece: shapely.LineString, line: shapely.LineString, place: shapely.Point) -> bool:
    """Whether a place is within 0.15 m beside a piece of a line, not before or behind it."""
    if line.distance(place) >= 0.15:
        return False
    foot = line.interpolate(line.project(place))
    return bool(piece.distance(foot) < 1e-9)


def triangles_of(fan: SightFan) -> list[shapely.Polygon]:
    """Triangles (viewpoint, start, end) of a fan."""
    return list(_wedges(fan.ends))


def symmetric_difference(a: shapely.Geometry, b: shapely.Geometry) -> float:
    return float(shapely.symmetric_difference(a, b).area)


def _wedges(ends: Floats) -> list[shapely.Polygon]:
    corners = np.concatenate([np.zeros((len(ends), 1, 2)), ends], axis=1)
    return list(shapely.polygons(corners)) if len(ends) else []


def _cross(a: Floats, b: Floats) -> Floats:
    cross: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross


# Raster


def centres(shape: tuple[int, int]) -> Floats:
    """Cell centres (x, y) of a block, shape (rows, cols, 2) [cells]."""
    rows, cols = np.indices(shape)
    return np.stack([cols + 0.5, rows + 0.5], axis=-1)


def cells_inside(geometry: shapely.Geometry, shape: tuple[int, int]) -> Bools:
    """Which cells' centres lie inside."""
    middle = centres(shape)
    inside: Bools = shapely.contains_xy(geometry, middle[..., 0], middle[..., 1])
    return inside


def parity_inside(corners: Floats, shape: tuple[int, int]) -> Bools:
    """Which cells' centres a ray to the left, from the centre, crosses the outline oddly often."""
    x, y = np.moveaxis(centres(shape), -1, 0)
    inside = np.zeros(shape, dtype=np.bool_)
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        spans = (p[1] <= y) != (q[1] <= y)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0])
        inside ^= spans & (crossing <= x)
    return inside


def squares(shape: tuple[int, int]) -> Floats:
    """Cells as shapely boxes, shape (rows, cols)."""
    rows, cols = np.indices(shape)
    boxes: Floats = shapely.box(cols, rows, cols + 1, rows + 1)
    return boxes


def cells_crossed(p: Floats, q: Floats, shape: tuple[int, int]) -> Bools:
    """Which cells a line passes through for some length."""
    line = shapely.LineString([p, q])
    crossed: Bools = shapely.length(shapely.intersection(squares(shape), line)) > 0
    return crossed


def cells_in_disc(centre: Floats, radius: float, shape: tuple[int, int]) -> Bools:
    inside: Bools = np.hypot(*np.moveaxis(centres(shape) - centre, -1, 0)) <= radius
    return inside


# Evidence


def in_map(flat: GroundView, xy: Floats) -> Floats:
    """From the frame of the view to the map."""
    x, y = flat.forward
    places: Floats = flat.viewpoint + xy @ np.array([(x, y), (-y, x)])
    return places


def said(evidence: Evidence) -> dict[Cell, float]:
    """z by cell ``(row, col)`` of the grid."""
    cells = evidence.cells()
    values = evidence.z[tuple((cells - evidence.lower).T)]
    return dict(zip(map(tuple, cells.tolist()), values.tolist(), strict=True))


def shifted(cells: dict[Cell, float], rows: int, cols: int) -> dict[Cell, float]:
    return {(row + rows, col + cols): z for (row, col), z in cells.items()}


def turned(cells: dict[Cell, float]) -> dict[Cell, float]:
    """Evidence after a quarter turn, counter-clockwise, about the map's origin."""
    return {(col, -row - 1): z for (row, col), z in cells.items()}


def cell_boxes(cells: list[Cell], resolution: float) -> Floats:
    """Cells as shapely boxes in the map, shape (n,) [m]."""
    rows, cols = np.array(cells, dtype=np.float64).reshape(-1, 2).T * resolution
    boxes: Floats = shapely.box(cols, rows, cols + resolution, rows + resolution)
    return boxes


def peak_memory(work: Callable[[], object]) -> int:
    """Return how many bytes of NumPy's and Python's `work` holds at most, beyond what is there."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def first_nearby(points: Floats, distance: float) -> list[int]:
    """Return which point each becomes: the first of those kept within a distance, or itself."""
    kept: list[int] = []
    stands_for = []
    for number, place in enumerate(points):
        near = [k for k in kept if ((points[k] - place) ** 2).sum() <= distance**2]
        stands_for.append(near[0] if near else number)
        if not near:
            kept.append(number)
    return stands_for
