"""How far freespace reaches on bearings without a surface: supported by ground features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import SAME_BEARING, gap_chords
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings

USUAL_GAPS = 0.8  # share of the gaps between lines of sight that are no wider than usual
UNUSUAL = 4.0  # times the usual width: where features are dense, such a gap is empty for a reason


class Supports(NamedTuple):
    """Chords that freespace reaches to where no surface is."""

    chords: Floats  #: shape (k, 2, 2) [m, view], counter-clockwise
    heights: Floats  #: shape (k, 2) [m], of the lines of sight above the ground at their ends


def support_chords(ground_view: GroundView, settings: MapperSettings) -> Supports:
    """Return the chords that freespace reaches to where no surface is.

    Each ground feature at range r vouches for the bearings within min(support_width / r,
    support_angle), out to r. Two lines of sight vouch for what is between them as far as both
    reach and no more than `sight_gap` lies between: nothing wider fits in unseen. Lines to
    obstacles count as far as before the obstacle, if they come down low enough.
    """
    single = _single_chords(ground_view, settings)
    chords, heights = _gaps(ground_view, settings)
    return Supports(
        np.concatenate([single, chords]), np.concatenate([np.zeros((len(single), 2)), heights])
    )


def _single_chords(ground_view: GroundView, settings: MapperSettings) -> Floats:
    radius = np.hypot(ground_view.supports[:, 0], ground_view.supports[:, 1])
    bearing = np.arctan2(ground_view.supports[:, 1], ground_view.supports[:, 0])
    half = np.minimum(settings.support_width / radius, settings.support_angle)
    right, left = _borders(ground_view, radius)
    ends = np.stack(
        [
            np.maximum(bearing - half, np.minimum(right, bearing)),
            np.minimum(bearing + half, np.maximum(left, bearing)),
        ],
        axis=1,
    )
    chords: Floats = radius[:, None, None] * np.stack([np.cos(ends), np.sin(ends)], axis=-1)
    return chords


def _borders(ground_view: GroundView, radius: Floats) -> tuple[Floats, Floats]:
    """Return between which bearings both images see, at ranges, shape (n,) [rad].

    The left image ends on both sides as far from its axis; the right one, a baseline to the right,
    ends before it on the left.
    """
    border = np.arctan(ground_view.border)
    blind = np.arcsin(np.minimum(ground_view.baseline * np.cos(border) / radius, 1.0))
    return np.full(len(radius), -border), border - blind


def _gaps(ground_view: GroundView, settings: MapperSettings) -> tuple[Floats, Floats]:
    low = ground_view.heights <= settings.grant_height * ground_view.camera_height
    points = np.concatenate([ground_view.supports, ground_view.points[low]])
    full = np.hypot(points[:, 0], points[:, 1])
    heights = np.concatenate([np.zeros(len(ground_view.supports)), ground_view.heights[low]])
    ranges = full.copy()
    model = MODELS[settings.uncertainty]
    ranges[len(ground_view.supports) :] -= settings.spread_sigmas * model.sigma(
        ground_view.points[low], ground_view.covariance[low]
    )
    share = ranges / np.where(full > 0, full, 1.0)
    heights = ground_view.camera_height + (heights - ground_view.camera_height) * share
    order, bearings = _by_bearing(np.arctan2(points[:, 1], points[:, 0]), ranges)
    kept = ranges[order] > settings.min_range
    order, bearings = order[kept], bearings[kept]
    lines = (bearings, ranges[order], heights[order], ground_view.camera_height)
    chords, _ = gap_chords(*lines, np.inf)
    return gap_chords(*lines, widest_gap(chords, settings))


def _by_bearing(bearings: Floats, ranges: Floats) -> tuple[Ints, Floats]:
    """Return the order of lines by bearing, those of one bearing by range, and their bearings.

    Bearings that differ by rounding are one: the order of such lines must not depend on it.

    Parameters
    ----------
    bearings, ranges : ndarray, shape (n,)
    """
    order = np.argsort(bearings, kind="stable")
    turned = bearings[order]
    group = np.concatenate([[0], np.cumsum(np.diff(turned) > SAME_BEARING)])[: len(order)]
    first = np.searchsorted(group, group)
    return order[np.lexsort([ranges[order], group])], turned[first]


def widest_gap(chords: Floats, settings: MapperSettings) -> float:
    """Return which gap between lines of sight counts as seen [m].

    Four times what the view's features usually leave between neighbouring lines of sight, whose
    `chords` have the shape (k, 2, 2) [m, view].
    """
    if len(chords) == 0:
        return settings.sight_gap
    width = np.sort(np.hypot(*(chords[:, 1] - chords[:, 0]).T))
    usual = float(np.interp(USUAL_GAPS * (len(width) - 1), np.arange(len(width)), width))
    return min(max(UNUSUAL * usual, settings.support_width), settings.sight_gap)
