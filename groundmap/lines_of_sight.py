"""What the lines of sight to features say: of surfaces that they pass, of the ground below them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.heights import FlatView
from groundmap.kernels.lines import features_beside, gap_chords, passed_through
from groundmap.settings import MapperSettings
from groundmap.surfaces import SurfaceKind, Surfaces
from groundmap.uncertainty import MODELS

DEEPEST_SIGHT = 3.0  # [m], along the ground: longer lines below it are mostly false matches
BESIDE = 0.15  # [m], a ground feature this near to a line of sight is beside it
BELOW = 0.05  # [m], sight that passes this little below a top may have passed over it
BEHIND = 0.05  # [m], a feature this little behind a surface is on it
THIN = 0.02  # [m], half-width of the thinnest pole: beside it, one sees past a lone point
# How many features make up a surface; if more are seen through it, it hides nothing.
MADE_OF = {
    SurfaceKind.SEGMENT: 2.0,
    SurfaceKind.LINK: 2.0,
    SurfaceKind.LONE: 1.0,
    SurfaceKind.DOUBTFUL: 1.0,
}


class Contradictions(NamedTuple):
    """Surfaces against the features that are seen through them."""

    against: Floats  #: shape (s,), features behind it that are seen below its top
    belief: Floats  #: shape (s,), 1, or for an outnumbered surface the share of those who make it
    features: int  #: that are seen through any surface

    @property
    def hiding(self) -> Bools:
        """Which surfaces hide what is behind them, shape (s,): those that are not outnumbered."""
        hiding: Bools = self.belief == 1.0
        return hiding


def contradictions(flat: FlatView, surfaces: Surfaces) -> Contradictions:
    """Count, for each surface, the features that are seen through it.

    A feature that is seen *over* a surface is behind it, as it should be; one whose line of sight
    passes below its top contradicts it. A surface that more features contradict than make it up
    is most likely the ghost of a false match.
    """
    points = np.concatenate([flat.points, flat.supports])
    heights = np.concatenate([flat.heights, flat.support_heights])
    bearings = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(bearings, kind="stable")
    feature = flat.feature[order]
    _, number, rows = np.unique(feature, return_inverse=True, return_counts=True)
    shares = 1.0 / rows[number]  # the ends of a segment are one feature
    bearings, points, heights = bearings[order], points[order], heights[order]
    ends = _solid_ends(surfaces)

    def count(which: Bools, below: float) -> tuple[Floats, Bools]:
        against, passes = np.zeros(int(which.sum())), np.zeros(len(order), dtype=np.bool_)
        passed_through(
            ends[which],
            surfaces.reach[which],
            surfaces.tops[which],
            bearings,
            points,
            heights,
            shares,
            flat.camera_height,
            BEHIND,
            below,
            against,
            passes,
        )
        return against, passes

    firm = surfaces.kind != SurfaceKind.DOUBTFUL
    against = np.zeros(len(firm))
    against[firm], passes = count(firm, BELOW)
    against[~firm], _ = count(~firm, 0.0)
    made_of = np.array([MADE_OF[kind] for kind in SurfaceKind])[surfaces.kind]
    belief = np.where(against > made_of, made_of / (made_of + against), 1.0)
    return Contradictions(against, belief, len(np.unique(feature[passes])))


def _solid_ends(surfaces: Surfaces) -> Floats:
    """Return the ends of surfaces, a lone point's as near to it as the thinnest pole's."""
    middle = surfaces.ends.mean(axis=1, keepdims=True)
    lone = surfaces.discs > 0
    share = np.where(lone, np.minimum(THIN / np.where(lone, surfaces.discs, 1.0), 1.0), 1.0)
    ends: Floats = middle + share[:, None, None] * (surfaces.ends - middle)
    return ends


def support_chords(flat: FlatView, settings: MapperSettings) -> Floats:
    """Return the chords that freespace reaches to where no surface is, shape (k, 2, 2) [m, view].

    Each ground feature at range r vouches for the bearings within min(support_width / r,
    support_angle), out to r. Two lines of sight vouch for what is between them as far as both
    reach and no more than `sight_gap` lies between: nothing wider fits in unseen. Lines to
    obstacles count as far as before the obstacle, if they come down low enough.
    """
    return np.concatenate([_single_chords(flat, settings), _gaps(flat, settings)])


def _single_chords(flat: FlatView, settings: MapperSettings) -> Floats:
    radius = np.hypot(flat.supports[:, 0], flat.supports[:, 1])
    bearing = np.arctan2(flat.supports[:, 1], flat.supports[:, 0])
    half = np.minimum(settings.support_width / radius, settings.support_angle)
    right, left = _borders(flat, radius)
    ends = np.stack(
        [
            np.maximum(bearing - half, np.minimum(right, bearing)),
            np.minimum(bearing + half, np.maximum(left, bearing)),
        ],
        axis=1,
    )
    chords: Floats = radius[:, None, None] * np.stack([np.cos(ends), np.sin(ends)], axis=-1)
    return chords


def _borders(flat: FlatView, radius: Floats) -> tuple[Floats, Floats]:
    """Return between which bearings both images see, at ranges, shape (n,) [rad].

    The left image ends on both sides as far from its axis; the right one, a baseline to the right,
    ends before it on the left.
    """
    border = np.arctan(flat.border)
    blind = np.arcsin(np.minimum(flat.baseline * np.cos(border) / radius, 1.0))
    return np.full(len(radius), -border), border - blind


def _gaps(flat: FlatView, settings: MapperSettings) -> Floats:
    low = flat.heights <= settings.grant_height * flat.camera_height
    points = np.concatenate([flat.supports, flat.points[low]])
    ranges = np.hypot(points[:, 0], points[:, 1])
    model = MODELS[settings.uncertainty]
    ranges[len(flat.supports) :] -= settings.spread_sigmas * model.sigma(
        flat.points[low], flat.covariance[low]
    )
    bearings = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(bearings, kind="stable")
    order = order[ranges[order] > settings.min_range]
    return gap_chords(bearings[order], ranges[order], settings.sight_gap)


def missing_ground(flat: FlatView, step: float) -> Floats:
    """Return places, `step` [m] apart, that lines of sight to features below the ground pass over.

    From where they go below the ground's level up to the feature, shape (n, 2) [m, view]. A line
    that ground features lie beside there is that of a false match, and is left out.
    """
    range_at_end = np.hypot(flat.drop_offs[:, 0], flat.drop_offs[:, 1])
    entry = flat.camera_height / (flat.camera_height - flat.drop_off_heights)
    gap = range_at_end * (1.0 - entry)
    rows = np.flatnonzero(gap <= DEEPEST_SIGHT)
    rows = rows[~_beside_ground(flat, rows, (entry * range_at_end)[rows])]
    counts = np.ceil(gap[rows] / step).astype(np.int64)
    line = np.repeat(rows, counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = entry[line] + (1.0 - entry[line]) * (number + 0.5) / np.repeat(counts, counts)
    places: Floats = flat.drop_offs[line] * share[:, None]
    return places


def _beside_ground(flat: FlatView, rows: Ints, entry: Floats) -> Bools:
    """Return which of these drop-offs' lines have ground beside them beyond `entry` [m]."""
    ends = flat.drop_offs[rows]
    rays = ends / np.hypot(ends[:, 0], ends[:, 1])[:, None]
    end = (rays * ends).sum(axis=1)
    beside = np.empty(len(rows), dtype=np.bool_)
    features_beside(rays, entry + BESIDE, end - BESIDE, flat.supports, BESIDE, beside)
    return beside
