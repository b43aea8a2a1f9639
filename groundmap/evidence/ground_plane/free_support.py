"""How far freespace reaches on bearings without a surface: supported by ground features."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import (
    gap_chords,
)
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings


def support_chords(ground_view: GroundView, settings: MapperSettings) -> Floats:
    """Return the chords that freespace reaches to where no surface is, shape (k, 2, 2) [m, view].

    Each ground feature at range r vouches for the bearings within min(support_width / r,
    support_angle), out to r. Two lines of sight vouch for what is between them as far as both
    reach and no more than `sight_gap` lies between: nothing wider fits in unseen. Lines to
    obstacles count as far as before the obstacle, if they come down low enough.
    """
    return np.concatenate([_single_chords(ground_view, settings), _gaps(ground_view, settings)])


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


def _gaps(ground_view: GroundView, settings: MapperSettings) -> Floats:
    low = ground_view.heights <= settings.grant_height * ground_view.camera_height
    points = np.concatenate([ground_view.supports, ground_view.points[low]])
    ranges = np.hypot(points[:, 0], points[:, 1])
    model = MODELS[settings.uncertainty]
    ranges[len(ground_view.supports) :] -= settings.spread_sigmas * model.sigma(
        ground_view.points[low], ground_view.covariance[low]
    )
    bearings = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(bearings, kind="stable")
    order = order[ranges[order] > settings.min_range]
    return gap_chords(bearings[order], ranges[order], settings.sight_gap)
