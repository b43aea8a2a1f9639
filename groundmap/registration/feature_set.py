"""The point features of a view or a map, prepared for matching."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.registration.kernels.bins import fill_bins
from groundmap.view.view import Features

BIN_SIGMAS = 6.0
SMALLEST_BIN, LARGEST_BIN = 0.02, 0.2  # [rad]


class FeatureSet(NamedTuple):
    """Point features in the frame of a camera, and in bearing coordinates (x/z, y/z, 1/z)."""

    xyz: Floats  #: shape (n, 3) [m, camera]
    covariance: Floats  #: shape (n, 3, 3) [m², camera]
    labels: Ints  #: shape (n,); only features with equal labels match
    bearings: Floats  #: shape (n, 3)
    bearing_covariance: Floats  #: shape (n, 3, 3)

    def select(self, rows: Ints) -> FeatureSet:
        """Return the features of some rows."""
        return FeatureSet(
            self.xyz[rows],
            self.covariance[rows],
            self.labels[rows],
            self.bearings[rows],
            self.bearing_covariance[rows],
        )

    @property
    def inverse_depth_noise(self) -> Floats:
        """Standard deviation of the inverse depths, shape (n,) [1/m]."""
        noise: Floats = np.sqrt(self.bearing_covariance[:, 2, 2])
        return noise

    @property
    def spread(self) -> Floats:
        """Bound of the standard deviation in any direction, shape (n,) [m]."""
        spread: Floats = np.sqrt(np.trace(self.covariance, axis1=1, axis2=2))
        return spread


class Bins(NamedTuple):
    """Features by bins of their bearing."""

    start: Ints
    rows: Ints
    size: float  #: side of a bin [rad]


def feature_set(features: Features, labels: Ints) -> FeatureSet:
    """Return the point features of a view, prepared for matching.

    Parameters
    ----------
    features : Features
        Points in front of the camera.
    labels : ndarray, shape (n,)
    """
    bearings, by_position = bearings_of(features.xyz)
    covariance = by_position @ features.covariance @ np.swapaxes(by_position, 1, 2)
    return FeatureSet(features.xyz, features.covariance, labels, bearings, covariance)


def bearings_of(xyz: Floats) -> tuple[Floats, Floats]:
    """Return bearing coordinates, shape (n, 3), and their derivatives, shape (n, 3, 3)."""
    inverse = 1.0 / xyz[:, 2]
    bearings = np.stack([xyz[:, 0] * inverse, xyz[:, 1] * inverse, inverse], axis=1)
    derivatives = np.zeros((len(xyz), 3, 3))
    derivatives[:, 0, 0] = derivatives[:, 1, 1] = inverse
    derivatives[:, :, 2] = -bearings * inverse[:, None]
    return bearings, derivatives


def bins_of(features: FeatureSet) -> Bins:
    """Return the features by bins that are as wide as the typical noise asks for."""
    noise = np.sqrt(features.bearing_covariance[:, 0, 0] + features.bearing_covariance[:, 1, 1])
    typical = float(np.median(noise)) if len(noise) else 0.0
    size = min(max(BIN_SIGMAS * typical, SMALLEST_BIN), LARGEST_BIN)
    return Bins(*fill_bins(features.bearings, size), size)
