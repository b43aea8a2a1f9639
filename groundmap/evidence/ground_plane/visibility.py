"""Visible freespace of one view at ground level, as a fan of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.ground_plane.free_support import Supports, support_chords
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.envelope import join_envelopes, upper_envelope
from groundmap.evidence.ground_plane.see_through import Contradictions, contradictions
from groundmap.evidence.ground_plane.surfaces import RADIAL, SurfaceKind, Surfaces
from groundmap.settings import MapperSettings

NO_SURFACE = -1


class SightFan(NamedTuple):
    """Triangles (viewpoint, start, end), ordered by bearing relative to the optical axis."""

    bearings: Floats  #: shape (k, 2) [rad, view], ascending, in -pi..pi; the seam is behind
    ends: Floats  #: shape (k, 2, 2) [m, view], ends of sight
    surface: Ints  #: shape (k,), row of the surface at the end; -1 for ground support
    free: Floats  #: shape (k, 2, 2) [m, view], ends of freespace, the reach before the surface
    bottoms: Floats  #: shape (k, 2) [m], bottom of the surface at the ends; 0 for ground support
    joined: Bools  #: shape (k,), whether the next triangle (cyclic) begins at its end
    contradictions: Contradictions  #: surfaces that features are seen through
    supports: Supports  #: chords that bound sight at ground level

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
    row: Ints  # row of the input; an edge across the seam has two entries

    def at(self, bearings: Floats, number: Ints) -> Floats:
        """Return the points of edges at bearings; exact at the ends of edges."""
        cos, sin = np.cos(bearings), np.sin(bearings)
        radius = 1.0 / (self.a[number] * cos + self.b[number] * sin)
        points = np.stack([radius * cos, radius * sin], axis=-1)
        for side, own in enumerate((self.t0, self.t1)):
            exact = bearings == own[number]
            points[exact] = self.ends[number[exact], side]
        return points


def visible_freespace(
    ground_view: GroundView, surfaces: Surfaces, settings: MapperSettings
) -> SightFan:
    """Return the freespace up to the nearest surface, or up to the ground support.

    Contradicted surfaces (`Contradictions.hiding`) are ignored. A doubtful surface, or one whose
    bottom is above `grant_height`, ends sight but grants no freespace: there, and at bearings
    without a surface, freespace reaches to the ground support (`support_chords`). Bearings with
    neither are not in the fan.

    Parameters
    ----------
    ground_view : GroundView
    surfaces : Surfaces
    settings : MapperSettings
    """
    doubts = contradictions(ground_view, surfaces)
    hiding = np.flatnonzero(doubts.hiding)
    walls = _by_bearing(surfaces.ends[hiding])
    walls = walls._replace(row=hiding[walls.row])
    supports = support_chords(ground_view, settings)
    grounds = _by_bearing(supports.chords)
    nearest = upper_envelope(walls.t0, walls.t1, walls.a, walls.b)
    farthest = upper_envelope(grounds.t0, grounds.t1, -grounds.a, -grounds.b)
    lowest = surfaces.bottoms[walls.row].min(axis=1)
    granting = lowest <= settings.grant_height * ground_view.camera_height
    granting &= surfaces.kind[walls.row] != SurfaceKind.DOUBTFUL
    low, high, number, supported = join_envelopes(
        *nearest, granting, walls.a, walls.b, *farthest, grounds.a, grounds.b
    )
    ends = np.empty((len(low), 2, 2))
    surface = np.full(len(low), NO_SURFACE, dtype=np.int64)
    for edges, rows in ((walls, ~supported), (grounds, supported)):
        ends[rows, 0] = edges.at(low[rows], number[rows])
        ends[rows, 1] = edges.at(high[rows], number[rows])
    surface[~supported] = walls.row[number[~supported]]
    following = np.roll(low, -1)
    if len(following):
        following[-1] += 2 * np.pi
    free, bottoms = _before_surfaces(ends, surface, surfaces)
    return SightFan(
        bearings=np.stack([low, high], axis=1),
        ends=ends,
        surface=surface,
        free=free,
        bottoms=bottoms,
        joined=np.isclose(following, high, rtol=0.0, atol=1e-15),
        contradictions=doubts,
        supports=supports,
    )


def _by_bearing(ends: Floats) -> _Edges:
    """Sort counter-clockwise edges by bearing; edges across the seam are split."""
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


def _before_surfaces(ends: Floats, surface: Ints, surfaces: Surfaces) -> tuple[Floats, Floats]:
    """Return the ends of sight moved towards the viewpoint by the reach, and the bottoms there."""
    free, bottoms = ends.copy(), np.zeros(ends.shape[:2])
    rows = np.flatnonzero(surface != NO_SURFACE)
    first, last = surfaces.ends[surface[rows], 0], surfaces.ends[surface[rows], 1]
    edge = last - first
    length = (edge**2).sum(axis=1)[:, None]
    t = np.clip(((ends[rows] - first[:, None]) * edge[:, None]).sum(axis=2) / length, 0.0, 1.0)
    reach, low = surfaces.reach[surface[rows]], surfaces.bottoms[surface[rows]]
    before = (1 - t) * reach[:, :1] + t * reach[:, 1:]
    bottoms[rows] = (1 - t) * low[:, :1] + t * low[:, 1:]
    radius = np.hypot(ends[rows, :, 0], ends[rows, :, 1])
    free[rows] *= (np.maximum(radius - before, 0.0) / radius)[:, :, None]
    return free, bottoms


def _cross(a: Floats, b: Floats) -> Floats:
    cross: Floats = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return cross
