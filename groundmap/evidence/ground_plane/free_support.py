"""Extent of freespace at bearings without a surface, from ground features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import SAME_BEARING, gap_chords
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings

USUAL_GAPS = 0.8  # quantile of the gaps between lines of sight: the usual width
UNUSUAL = 4.0  # times the usual width: a wider gap among dense features is not observed


class Supports(NamedTuple):
    """Chords that bound freespace at bearings without a surface."""

    chords: Floats  #: shape (k, 2, 2) [m, view], counter-clockwise
    heights: Floats  #: shape (k, 2) [m], of the lines of sight above the ground at their ends


def support_chords(ground_view: GroundView, settings: MapperSettings) -> Supports:
    """Return the chords that bound freespace at bearings without a surface.

    A ground feature at range r supports freespace up to r, at bearings within
    min(support_width / r, support_angle) of its own. Two neighbouring lines of sight support
    freespace between them, up to the range of the shorter one and where they are at most
    `widest_gap` apart. Lines of sight to obstacles end before the obstacle; they count if they end
    below `grant_height` times the height of the camera.

    Parameters
    ----------
    ground_view : GroundView
    settings : MapperSettings
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
    """Return the bearings between which both images see, by range, shape (n,) each [rad].

    The borders of the left image are symmetric. The right camera is a baseline to the right, which
    moves the left border inwards.
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
    """Return the largest gap between lines of sight that counts as observed [m].

    It is four times the usual gap in the view, bounded by `support_width` and `sight_gap`.

    Parameters
    ----------
    chords : ndarray, shape (k, 2, 2) [m, view]
        Chords between neighbouring lines of sight.
    settings : MapperSettings
    """
    if len(chords) == 0:
        return settings.sight_gap
    width = np.sort(np.hypot(*(chords[:, 1] - chords[:, 0]).T))
    usual = float(np.interp(USUAL_GAPS * (len(width) - 1), np.arange(len(width)), width))
    return min(max(UNUSUAL * usual, settings.support_width), settings.sight_gap)
