"""Surfaces that are contradicted by features behind them, and their confidence."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import count_contradicting
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces

BELOW = 0.05  # [m], depth below a top up to which a line of sight may have passed over it
BEHIND = 0.05  # [m], distance behind a surface up to which a feature is on it
THIN = 0.02  # [m], half-width of the thinnest pole, by which a lone point blocks sight
# Number of features of a surface; if more contradict it, it does not end sight.
MADE_OF = {
    SurfaceKind.SEGMENT: 2.0,
    SurfaceKind.LINK: 2.0,
    SurfaceKind.LONE: 1.0,
    SurfaceKind.DOUBTFUL: 1.0,
}


class Contradictions(NamedTuple):
    """Features seen through surfaces, and the resulting confidence in the surfaces."""

    against: Floats  #: shape (s,), number of features behind it that are seen below its top
    belief: Floats  #: shape (s,), 1, or the share of the surface's own features if outnumbered
    features: int  #: number of features seen through any surface

    @property
    def hiding(self) -> Bools:
        """Which surfaces end lines of sight, shape (s,)."""
        hiding: Bools = self.belief == 1.0
        return hiding


def contradictions(ground_view: GroundView, surfaces: Surfaces) -> Contradictions:
    """Return, for each surface, the number of features seen through it.

    A feature behind a surface contradicts it if its line of sight passes below the top of the
    surface. A surface that is contradicted by more features than it consists of is most likely due
    to a false match.

    Parameters
    ----------
    ground_view : GroundView
    surfaces : Surfaces
    """
    points = np.concatenate([ground_view.points, ground_view.supports])
    heights = np.concatenate([ground_view.heights, ground_view.support_heights])
    bearings = np.arctan2(points[:, 1], points[:, 0])
    order = np.argsort(bearings, kind="stable")
    feature = ground_view.feature[order]
    shares = 1.0 / np.bincount(feature)[feature]  # the ends of a segment are one feature
    bearings, points, heights = bearings[order], points[order], heights[order]
    ends = _solid_ends(surfaces)

    def count(which: Bools, below: float) -> tuple[Floats, Bools]:
        against, passes = np.zeros(int(which.sum())), np.zeros(len(order), dtype=np.bool_)
        count_contradicting(
            ends[which],
            surfaces.reach[which],
            surfaces.tops[which],
            bearings,
            points,
            heights,
            shares,
            ground_view.camera_height,
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
    return Contradictions(against, belief, int(np.count_nonzero(np.bincount(feature[passes]))))


def _solid_ends(surfaces: Surfaces) -> Floats:
    """Return the ends of surfaces; lone points are at most as wide as the thinnest pole."""
    middle = surfaces.ends.mean(axis=1, keepdims=True)
    lone = surfaces.discs > 0
    share = np.where(lone, np.minimum(THIN / np.where(lone, surfaces.discs, 1.0), 1.0), 1.0)
    ends: Floats = middle + share[:, None, None] * (surfaces.ends - middle)
    return ends
