"""The motion that fits matched features best, weighted by their covariances."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats, Ints
from groundmap.registration.feature_set import Bins, FeatureSet
from groundmap.registration.kernels.alignment import match_features
from groundmap.registration.kernels.normal_equations import normal_equations

# [rad], uncertainty of bearings that is left in each step
GATES = (0.008, 0.005, 0.003, 0.001, 0.0)
WIDE_GATES = (0.01, 0.006, 0.003, 0.001, 0.0, 0.0)
SCALED_OUTLIER = 25.0  # with covariances that are scaled to the noise
MEDIAN_SQUARE = 2.366  # of the squared Mahalanobis distance in three dimensions
LEAST_SCALE = 0.05  # of the covariances
OUTLIER = 11.3  # squared Mahalanobis distance that 1 % of all true matches exceed
HALF_WEIGHT = 0.35  # share of this distance at which a match has a quarter of the weight
FEWEST = 4  # matches; three leave nothing to check
WRONG_TURN = 0.02  # [rad], of motions that are wrong for certain
SINGULAR = 1e-12  # share of the largest eigenvalue


class Alignment(NamedTuple):
    """A motion from A to B with the matches that it explains."""

    pose: Floats  #: shape (3, 4): ``p_b = pose[:, :3] @ p_a + pose[:, 3]``
    partner: Ints  #: shape (n,), row in B of each feature of A, or -1
    squares: Floats  #: shape (n,), squared Mahalanobis distances of matches
    information: Floats  #: shape (d, d), inverse covariance of the directions
    matches: int  #: number of features with a partner
    support: int  #: number of matches before covariances were scaled; the same for all motions


def align(
    pose: Floats,
    a: FeatureSet,
    b: FeatureSet,
    bins: Bins,
    *,
    directions: Floats,
    gates: tuple[float, ...] = GATES,
    outlier: float = OUTLIER,
) -> Alignment | None:
    """Return the best fit near a motion, by matching and Gauss-Newton steps in turn.

    Parameters
    ----------
    pose : ndarray, shape (3, 4)
        Motion from A to B to start from.
    a, b : FeatureSet
    bins : Bins
        Of `b`.
    directions : ndarray, shape (6, d)
        Small motions in B that are possible: translation [m] and rotation vector [rad].
    gates : tuple of float [rad]
        Uncertainty of the bearings that is left in each step.
    outlier : float
        Largest squared Mahalanobis distance of a match.

    Returns
    -------
    Alignment or None
        None if too few features match, or they do not determine the motion at all.
    """
    match = _Match(a, b)
    pose = np.ascontiguousarray(pose)
    for gate in gates:
        count = match.under(pose, bins, gate, outlier)
        if count < FEWEST:
            return None
        matrix, right = normal_equations(
            pose,
            a.xyz,
            match.partner,
            match.residuals,
            match.weights,
            outlier * HALF_WEIGHT,
            directions,
        )
        values, vectors = eigh(matrix, check_finite=False)
        if not values[0] > SINGULAR * values[-1]:
            return None
        pose = _move(pose, directions @ (vectors @ (vectors.T @ right / values)))
    squares = np.einsum("ni,nij,nj->n", match.residuals, match.weights, match.residuals)
    return Alignment(pose, match.partner, squares, matrix, count, count)


def polish(
    alignment: Alignment, a: FeatureSet, b: FeatureSet, bins: Bins, *, directions: Floats
) -> Alignment:
    """Return the best fit near an alignment, with covariances scaled to the actual noise.

    Matching starts again with a wide gate as long as the number of matches grows.

    Parameters
    ----------
    alignment : Alignment
    a, b : FeatureSet
    bins : Bins
        Of `b`.
    directions : ndarray, shape (6, d)
    """
    best = alignment
    while True:
        again = align(best.pose, a, b, bins, directions=directions, gates=WIDE_GATES)
        if again is None or again.matches <= best.matches:
            break
        best = again
    for _ in range(2):
        outlier = SCALED_OUTLIER * scale_of(best)
        again = align(
            best.pose, a, b, bins, directions=directions, gates=(0.0,) * 3, outlier=outlier
        )
        if again is None:
            break
        best = again._replace(support=best.support)
    return best


def scale_of(alignment: Alignment) -> float:
    """Return the actual noise of matches as a share of their covariances."""
    matched = alignment.squares[alignment.partner >= 0]
    return min(max(float(np.median(matched)) / MEDIAN_SQUARE, LEAST_SCALE), 1.0)


def support_by_chance(alignment: Alignment, a: FeatureSet, b: FeatureSet, bins: Bins) -> float:
    """Return the mean number of features that match under wrong motions near an alignment.

    Parameters
    ----------
    alignment : Alignment
    a, b : FeatureSet
    bins : Bins
        Of `b`.
    """
    counts = []
    for axis, side in product((0, 1), (-2, -1, 1, 2)):
        turn = np.zeros(6)
        turn[3 + axis] = side * WRONG_TURN
        match = _Match(a, b)
        counts.append(match.under(_move(alignment.pose, turn), bins, 0.0, OUTLIER))
    return float(np.mean(counts))


class _Match:
    """Arrays of the matches of two sets of features."""

    def __init__(self, a: FeatureSet, b: FeatureSet) -> None:
        self.a, self.b = a, b
        self.partner = np.empty(len(a.xyz), dtype=np.int64)
        self.residuals = np.zeros((len(a.xyz), 3))
        self.weights = np.zeros((len(a.xyz), 3, 3))

    def under(self, pose: Floats, bins: Bins, gate: float, outlier: float) -> int:
        """Match the features under a motion, and return the number of matches."""
        a, b = self.a, self.b
        return match_features(
            pose,
            a.xyz,
            a.covariance,
            a.labels,
            b.bearings,
            b.bearing_covariance,
            b.labels,
            *bins,
            gate,
            outlier,
            self.partner,
            self.residuals,
            self.weights,
        )


def _move(pose: Floats, step: Floats) -> Floats:
    """Return a motion followed by a small one: translation [m] and rotation vector [rad]."""
    turn = Rotation.from_rotvec(step[3:]).as_matrix()
    moved: Floats = turn @ pose
    moved[:, 3] += step[:3]
    return moved
