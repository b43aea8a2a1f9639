"""What one view sees at ground level: the fan of triangles that partitions visible freespace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.heights import FlatView
from groundmap.kernels.envelope import fill_gaps, upper_envelope
from groundmap.settings import MapperSettings
from groundmap.surfaces import RADIAL, Surfaces

NO_SURFACE = -1


class SightFan(NamedTuple):
    """Triangles (viewpoint, start, end) in the order of bearings, relative to the optical axis."""

    bearings: Floats  #: shape (k, 2) [rad, view], ascending, in -pi..pi: the seam is behind
    ends: Floats  #: shape (k, 2, 2) [m, view], where sight ends
    surface: Ints  #: shape (k,), row of the surfaces; -1 where ground support ends it
    free: Floats  #: shape (k, 2, 2) [m, view], where freespace ends: a reach before the surface
    joined: Bools  #: shape (k,), the next triangle (after the last the first) begins where it ends

    @property
    def area(self) -> float:
        """Area of the visible region [m²]."""
        return float(0.5 * _cross(self.ends[:, 0], self.ends[:, 1]).sum())


class _Edges(NamedTuple):
    """Edges by bearing: inverse range at bearing t is a cos t + b sin t."""

    t0: Floats
    t1: Floats
    a: Floats
    b: Floats
    ends: Floats
    row: Ints  # of the edges given: those across the seam are two here

    def at(self, bearings: Floats, number: Ints) -> Floats:
        """Return the points of edges at bearings; exact where a bearing is an edge's end."""
        cos, sin = np.cos(bearings), np.sin(bearings)
        radius = 1.0 / (self.a[number] * cos + self.b[number] * sin)
        points = np.stack([radius * cos, radius * sin], axis=-1)
        for side, own in enumerate((self.t0, self.t1)):
            exact = bearings == own[number]
            points[exact] = self.ends[number[exact], side]
        return points


def visible_freespace(flat: FlatView, surfaces: Surfaces, settings: MapperSettings) -> SightFan:
    """Sweep the bearings: the nearest surface ends sight; where there is none, ground support.

    A ground feature at range r supports the bearings within min(support_width / r,
    support_angle), out to r. Bearings with neither surface nor support are not in the fan.
    """
    walls = _by_bearing(surfaces.ends)
    grounds = _by_bearing(_support_chords(flat.supports, settings))
    nearest = upper_envelope(walls.t0, walls.t1, walls.a, walls.b)
    farthest = upper_envelope(grounds.t0, grounds.t1, -grounds.a, -grounds.b)
    low, high, number, supported = fill_gaps(*nearest, *farthest)
    ends = np.empty((len(low), 2, 2))
    surface = np.full(len(low), NO_SURFACE, dtype=np.int64)
    for edges, rows in ((walls, ~supported), (grounds, supported)):
        ends[rows, 0] = edges.at(low[rows], number[rows])
        ends[rows, 1] = edges.at(high[rows], number[rows])
    surface[~supported] = walls.row[number[~supported]]
    following = np.roll(low, -1)
    if len(following):
        following[-1] += 2 * np.pi
    return SightFan(
        bearings=np.stack([low, high], axis=1),
        ends=ends,
        surface=surface,
        free=_before_surfaces(ends, surface, surfaces),
        joined=np.isclose(following, high, rtol=0.0, atol=1e-15),
    )


def seen_through(flat: FlatView, fan: SightFan, surfaces: Surfaces) -> int:
    """Count the features whose line of sight passes below the top of a surface in front of them.

    Features that are seen over a surface are behind it, as they should be; these contradict it.
    """
    points = np.concatenate([flat.points, flat.supports])
    heights = np.concatenate([flat.heights, flat.support_heights])
    bearing = np.arctan2(points[:, 1], points[:, 0])
    piece = np.searchsorted(fan.bearings[:, 0], bearing, side="right") - 1
    piece = np.maximum(piece, 0)
    covered = np.zeros(len(points), dtype=np.bool_)
    if len(fan.surface):
        covered = (bearing >= fan.bearings[piece, 0]) & (bearing <= fan.bearings[piece, 1])
        covered &= fan.surface[piece] != NO_SURFACE
    points, heights, piece = points[covered], heights[covered], piece[covered]
    feature = flat.feature[covered]
    row = fan.surface[piece]
    ends = surfaces.ends[row]
    edge = ends[:, 1] - ends[:, 0]
    share = _cross(ends[:, 0], edge) / _cross(points, edge)  # range of the surface / of the point
    hit = points * share[:, None] - ends[:, 0]
    t = np.clip((hit * edge).sum(axis=1) / (edge**2).sum(axis=1), 0.0, 1.0)
    reach = (1 - t) * surfaces.reach[row, 0] + t * surfaces.reach[row, 1]
    top = (1 - t) * surfaces.tops[row, 0] + t * surfaces.tops[row, 1]
    behind = (1.0 - share) * np.hypot(points[:, 0], points[:, 1]) > 2 * reach + 0.05
    sight = flat.camera_height + (heights - flat.camera_height) * share
    return len(np.unique(feature[behind & (sight < top)]))


def _support_chords(supports: Floats, settings: MapperSettings) -> Floats:
    """Return the chord that each ground feature supports, shape (k, 2, 2) [m, view]."""
    radius = np.hypot(supports[:, 0], supports[:, 1])
    half = np.minimum(settings.support_width / radius, settings.support_angle)
    ray = supports / radius[:, None]
    cos, sin = np.cos(half)[:, None], np.sin(half)[:, None]
    side = np.stack([-ray[:, 1], ray[:, 0]], axis=1)
    return radius[:, None, None] * np.stack(
        [ray * cos - side * sin, ray * cos + side * sin], axis=1
    )


def _by_bearing(ends: Floats) -> _Edges:
    """Sort edges, counter-clockwise ones, by bearing; those across the seam become two."""
    start, end = ends[:, 0], ends[:, 1]
    t0, t1 = np.arctan2(start[:, 1], start[:, 0]), np.arctan2(end[:, 1], end[:, 0])
    t1 = np.where((t1 == -np.pi) & (t0 > 0), np.pi, t1)
    t0 = np.where((t0 == np.pi) & (t1 < 0), -np.pi, t0)
    area = _cross(start, end)
    width = np.arctan2(area, (start * end).sum(axis=1))
    rows = np.flatnonzero(width >= RADIAL)
    across = rows[t1[rows] < t0[rows]]
    whole = rows[t1[rows] >= t0[rows]]
    along = end - start
    seam = start - along * (start[:, 1] / np.where(along[:, 1] == 0, 1.0, along[:, 1]))[:, None]
    seam[:, 1] = 0.0
    half_turn = np.full(len(across), np.pi)
    row = np.concatenate([whole, across, across])
    lower = np.concatenate([t0[whole], t0[across], -half_turn])
    upper = np.concatenate([t1[whole], half_turn, t1[across]])
    pairs = np.concatenate(
        [
            ends[whole],
            np.stack([start[across], seam[across]], axis=1),
            np.stack([seam[across], end[across]], axis=1),
        ]
    )
    order = np.argsort(lower, kind="stable")
    order = order[lower[order] < upper[order]]
    row = row[order]
    return _Edges(
        lower[order],
        upper[order],
        along[row, 1] / area[row],
        -along[row, 0] / area[row],
        pairs[order],
        row,
    )


def _before_surfaces(ends: Floats, surface: Ints, surfaces: Surfaces) -> Floats:
    """Pull the ends of sight towards the viewpoint by the surfaces' reach."""
    free = ends.copy()
    rows = np.flatnonzero(surface != NO_SURFACE)
    first, last = surfaces.ends[surface[rows], 0], surfaces.ends[surface[rows], 1]
    edge = last - first
    length = (edge**2).sum(axis=1)[:, None]
    t = np.clip(((ends[rows] - first[:, None]) * edge[:, None]).sum(axis=2) / length, 0.0, 1.0)
    reach = surfaces.reach[surface[rows]]
    before = (1 - t) * reach[:, :1] + t * reach[:, 1:]
    radius = np.hypot(ends[rows, :, 0], ends[rows, :, 1])
    free[rows] *= (np.maximum(radius - before, 0.0) / radius)[:, :, None]
    return free


def _cross(a: Floats, b: Floats) -> Floats:
    cross: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return cross
