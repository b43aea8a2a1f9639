"""Surfaces that bound freespace in one view: segments, links and discs of lone points."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.intervals import inside_circle
from groundmap.evidence.ground_plane.kernels.crossings import blend_crossings
from groundmap.evidence.triangulation import Mesh
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings

RADIAL = 1e-9  # [rad], an edge with a smaller angle is seen end-on
FRONTIER = 255  # kind of edges that are not surfaces
JUST_BEHIND = 1e-6  # share of its range by which a possible continuation lies behind its feature
SHARE_OF_FOOTPRINT = 0.8  # largest length of a link, as a share of the narrowest footprint


class SurfaceKind(IntEnum):
    """Origin of a surface."""

    SEGMENT = 0
    LINK = 1
    LONE = 2
    DOUBTFUL = 3  #: a link of up to `doubt` times the length limit, or a possible continuation


class Surfaces(NamedTuple):
    """Surfaces of one view, each a straight piece; shape (s, ...)."""

    ends: Floats  #: shape (s, 2, 2) [m, view], counter-clockwise around the viewpoint
    cores: Floats  #: shape (s, 2, 2) [m, view], origin of the spread: ends, or a lone point's core
    reach: Floats  #: shape (s, 2) [m], distance from the surface at which freespace ends
    bottoms: Floats  #: shape (s, 2) [m] above the ground
    tops: Floats  #: shape (s, 2) [m] above the ground
    kind: Bytes  #: shape (s,), `SurfaceKind`
    discs: Floats  #: shape (s,) [m], radius of a lone point's disc; 0 for the others
    frontiers: Floats  #: shape (f, 2, 2) [m, view], edges that are neither segments nor links
    through_viewpoint: int  #: number of edges and lone points dropped within `min_range`


class _Vertices(NamedTuple):
    """Mesh vertices or points on edges, with heights and uncertainty; shape (n, ...)."""

    xy: Floats
    low: Floats
    high: Floats
    sigma: Floats  # [m], by the uncertainty model


class _Pieces(NamedTuple):
    """Pieces of edges: vertex numbers, shape (k, 2), and interval on the edge, 0 to 1."""

    edges: Ints
    span: Floats

    def at(self, vertices: _Vertices) -> _Vertices:
        """Interpolate between the edge's vertices; fields get the shape (k, 2, ...)."""

        def blend(values: Floats) -> Floats:
            weight = self.span.reshape(*self.span.shape, *(1,) * (values.ndim - 1))
            first, last = values[self.edges[:, :1]], values[self.edges[:, 1:]]
            # At 0 and 1 this gives the vertex itself, without rounding.
            blended: Floats = first * (1.0 - weight) + last * weight
            return blended

        return _Vertices(*(blend(values) for values in vertices))


def find_surfaces(ground_view: GroundView, mesh: Mesh, settings: MapperSettings) -> Surfaces:
    """Return the surfaces among the edges of the triangulation.

    Segments are surfaces. Links between neighbouring features are surfaces up to a length of
    min(max(link_length, link_angle r), 0.8 narrowest_footprint), with r the range of the nearer
    end, if the height bands of the features overlap. A lone point (a vertex without surface) is a
    disc with the radius max(cell / 2, sigma), but not larger than the length limit of a link.

    Links up to `doubt` times longer than the limit are doubtful, as is the space within `halo`
    beside a feature, into which its surface may continue. Doubtful surfaces end lines of sight
    unless features are seen through them, grant no freespace, and are not drawn. All other edges
    have no effect.

    Parameters
    ----------
    ground_view : GroundView
    mesh : Mesh
        Triangulation of the points and segments of the view.
    settings : MapperSettings
    """
    vertices = _vertices(ground_view, mesh, settings)
    kinds = _kinds(vertices, mesh, settings)
    firm = kinds < SurfaceKind.DOUBTFUL
    bounding = kinds <= SurfaceKind.DOUBTFUL
    pieces, kinds, blocked = _away_from_viewpoint(
        vertices.xy, mesh.edges[bounding], kinds[bounding], settings.min_range
    )
    ends = pieces.at(vertices)
    lone = np.ones(len(vertices.xy), dtype=np.bool_)
    lone[mesh.edges[firm]] = False
    near = np.hypot(vertices.xy[:, 0], vertices.xy[:, 1]) < settings.min_range
    blocked += int((lone & near).sum())
    drawn = kinds < SurfaceKind.DOUBTFUL
    discs = _discs(vertices, lone & ~near, _Vertices(*(values[drawn] for values in ends)))
    # A disc hides at most as much as a link to a neighbour would.
    bound = _longest_link(np.hypot(discs.xy[:, 0], discs.xy[:, 1]), settings)
    radius = np.maximum(0.5 * settings.resolution, np.minimum(discs.sigma, bound))
    beside = _beside(vertices, ~near & (settings.halo > 0), settings)
    ends = _Vertices(*(np.concatenate(pair) for pair in zip(ends, beside, strict=True)))
    kinds = np.concatenate([kinds, np.full(len(beside.xy), SurfaceKind.DOUBTFUL)])
    everything = np.concatenate([ends.xy, _silhouettes(discs.xy, radius)])
    core = np.full(len(radius), MODELS[settings.uncertainty].core_radius(settings.resolution))
    cores = np.concatenate([ends.xy, _silhouettes(discs.xy, core)])
    sigma = np.concatenate([ends.sigma, _twice(discs.sigma)])
    # The range of features bounds the spread, which a large sigma would exceed.
    reach = np.minimum(settings.spread_sigmas * sigma, settings.max_range)
    bottoms = np.concatenate([ends.low, _twice(discs.low)])
    tops = np.concatenate([ends.high, _twice(discs.high)])
    kind = np.concatenate([kinds, np.full(len(radius), SurfaceKind.LONE)])
    clockwise = _cross(everything[:, 0], everything[:, 1]) < 0
    for pairs in (everything, cores, reach, bottoms, tops):
        pairs[clockwise] = pairs[clockwise, ::-1]
    return Surfaces(
        ends=everything,
        cores=cores,
        reach=reach,
        bottoms=bottoms,
        tops=tops,
        kind=kind.astype(np.uint8),
        discs=np.concatenate([np.zeros(len(ends.xy)), radius]),
        frontiers=vertices.xy[mesh.edges[~firm]],
        through_viewpoint=blocked,
    )


def _vertices(ground_view: GroundView, mesh: Mesh, settings: MapperSettings) -> _Vertices:
    """Return the vertices of the mesh with the heights and covariances of their features.

    A vertex of several features gets the height band that spans them and the largest covariance. A
    crossing gets the values of the segments at this point.
    """
    count = len(mesh.points)
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, mesh.source, ground_view.heights)
    np.maximum.at(high, mesh.source, ground_view.heights)
    covariance = np.zeros((count, 2, 2))
    widest = np.argsort(np.trace(ground_view.covariance, axis1=1, axis2=2), kind="stable")
    covariance[mesh.source[widest]] = ground_view.covariance[widest]
    blend_crossings(mesh.crossings, mesh.points, low, high, covariance)
    sigma = MODELS[settings.uncertainty].sigma(mesh.points, covariance)
    return _Vertices(mesh.points, low, high, sigma)


def _kinds(vertices: _Vertices, mesh: Mesh, settings: MapperSettings) -> Bytes:
    """Return the `SurfaceKind` of each edge, or `FRONTIER`."""
    a, b = mesh.edges[:, 0], mesh.edges[:, 1]
    length = np.hypot(*(vertices.xy[b] - vertices.xy[a]).T)
    longest = _longest_link(np.hypot(*vertices.xy.T)[mesh.edges].min(axis=1), settings)
    apart = np.maximum(vertices.low[a], vertices.low[b]) - np.minimum(
        vertices.high[a], vertices.high[b]
    )
    kinds = np.full(len(mesh.edges), FRONTIER, dtype=np.uint8)
    kinds[length <= settings.doubt * longest] = SurfaceKind.DOUBTFUL
    kinds[(length <= longest) & (apart <= settings.link_height)] = SurfaceKind.LINK
    kinds[mesh.constrained] = SurfaceKind.SEGMENT
    return kinds


def _longest_link(radius: Floats, settings: MapperSettings) -> Floats:
    """Return the length limit of links [m] by distance from the viewpoint [m]."""
    longest: Floats = np.minimum(
        np.maximum(settings.link_length, settings.link_angle * radius),
        SHARE_OF_FOOTPRINT * settings.narrowest_footprint,
    )
    return longest


def _away_from_viewpoint(
    xy: Floats, edges: Ints, kinds: Bytes, min_range: float
) -> tuple[_Pieces, Bytes, int]:
    """Clip edges to the outside of the circle of `min_range`; count the firm edges inside."""
    inside = inside_circle(xy[edges[:, 0]], xy[edges[:, 1]], min_range)
    whole = inside.start >= inside.stop  # a tangent circle does not clip the edge
    before, after = ~whole & (inside.start > 0), ~whole & (inside.stop < 1)
    zero, one = np.zeros(len(edges)), np.ones(len(edges))
    spans = ((whole, zero, one), (before, zero, inside.start), (after, inside.stop, one))
    number = np.concatenate([np.flatnonzero(rows) for rows, _, _ in spans])
    span = np.concatenate([np.stack([t0, t1], axis=1)[rows] for rows, t0, t1 in spans])
    inside_it = ~whole & ~before & ~after
    blocked = int((inside_it & (kinds < SurfaceKind.DOUBTFUL)).sum())
    return _Pieces(edges[number], span), kinds[number], blocked


def _beside(vertices: _Vertices, which: Bools, settings: MapperSettings) -> _Vertices:
    """Return the possible continuations of surfaces, to both sides across the line of sight.

    They lie just behind their feature, and thus behind the disc of a lone point.
    """
    some = _Vertices(*(values[which] for values in vertices))
    half = np.full(len(some.xy), settings.halo)
    left, right = np.moveaxis(_silhouettes(some.xy, half), 1, 0)
    halves = np.concatenate([np.stack([left, some.xy], axis=1), np.stack([some.xy, right], axis=1)])
    others = (np.concatenate([_twice(values)] * 2) for values in some[1:])
    return _Vertices((1.0 + JUST_BEHIND) * halves, *others)


def _discs(vertices: _Vertices, lone: Bools, ends: _Vertices) -> _Vertices:
    """Return the lone vertices, and the nearer ends of edges that are seen end-on.

    An edge seen end-on covers no bearing, so its nearer end replaces it.
    """
    first, last = ends.xy[:, 0], ends.xy[:, 1]
    angle = np.arctan2(np.abs(_cross(first, last)), (first * last).sum(axis=1))
    radial = np.flatnonzero(angle < RADIAL)
    nearer = np.hypot(*np.moveaxis(ends.xy[radial], -1, 0)).argmin(axis=1)
    return _Vertices(
        *(
            np.concatenate([values[lone], pairs[radial, nearer]])
            for values, pairs in zip(vertices, ends, strict=True)
        )
    )


def _silhouettes(xy: Floats, radius: Floats) -> Floats:
    """Return the diameters of discs across the line of sight, shape (n, 2, 2)."""
    ray = xy / np.hypot(xy[:, 0], xy[:, 1])[:, None]
    side = np.stack([-ray[:, 1], ray[:, 0]], axis=1) * radius[:, None]
    return np.stack([xy - side, xy + side], axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    cross: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return cross


def _twice(values: Floats) -> Floats:
    return np.stack([values, values], axis=1)
