"""Covariance of landmarks whose file states none: that of their triangulation."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import InputError
from groundmap.sparse.sparse_map import SparseMap

PIXEL_NOISE_PX = 1.0  # of a keypoint of a SLAM or SfM system; half of them are on coarser levels
# Standard deviation of the depth that a single bearing leaves open, as a share of the distance.
# Views drop features whose deviation exceeds their range.
UNKNOWN_DEPTH = 10.0
SMALLEST = 1e-12  # squared distance
UPPER = np.triu_indices(3)
SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


def landmark_covariance(sparse: SparseMap, *, point_noise: float | None = None) -> Floats:
    """Return the covariance of each landmark, shape (m, 3, 3) [world].

    Without `point_noise`, and unless the file states it, it is the inverse of the information of
    the bearings that the observing views give: (I - d dᵀ) / (r σ)² for a view at distance r in
    direction d, σ the angle of one pixel. A short baseline leaves the depth uncertain.

    Parameters
    ----------
    sparse : SparseMap
    point_noise : float, optional [unit of the file]
        Standard deviation of the position of each landmark, in all directions.

    Raises
    ------
    InputError
        `point_noise` is not above 0.
    """
    if point_noise is not None:
        if not 0 < point_noise < np.inf:
            raise InputError("point_noise", "a number above 0", str(point_noise))
        shape = (len(sparse.landmarks), 3, 3)
        return np.broadcast_to(point_noise**2 * np.eye(3), shape).copy()
    if sparse.covariance is not None:
        return sparse.covariance
    return _of_bearings(sparse)


def _of_bearings(sparse: SparseMap) -> Floats:
    assert sparse.ids is not None
    assert sparse.camera_of is not None
    offsets = sparse.offsets_from_cameras()
    noise = np.array([camera.bearing_noise for camera in sparse.cameras])
    upper = bearing_information(offsets, noise[sparse.camera_of[sparse.view_of]])
    groups, group_of = _groups(sparse.ids)
    owner = group_of[sparse.landmark_of]
    sums = [np.bincount(owner, weights=column, minlength=groups) for column in upper.T]
    information = np.stack(sums, axis=1).astype(np.float64)  # integers if there are no sightings
    nearest = np.full(groups, np.inf)
    np.minimum.at(nearest, owner, np.einsum("ki,ki->k", offsets, offsets))
    return invert_information(information, nearest)[group_of]


def bearing_information(offsets: Floats, noise: Floats | float) -> Floats:
    """Return the information of single bearings about a position, shape (k, 6) [1/unit²].

    Parameters
    ----------
    offsets : ndarray, shape (k, 3)
        From the cameras to the landmarks.
    noise : ndarray, shape (k,), or float [rad]
        Angle of one pixel.

    Returns
    -------
    ndarray, shape (k, 6)
        The upper halves of the symmetric matrices.
    """
    squared = np.maximum(np.einsum("ki,ki->k", offsets, offsets), SMALLEST)
    weight = 1.0 / (squared * (PIXEL_NOISE_PX * np.asarray(noise)) ** 2)
    upper: Floats = -weight[:, None] * offsets[:, UPPER[0]] * offsets[:, UPPER[1]]
    upper /= squared[:, None]
    upper[:, [0, 3, 5]] += weight[:, None]
    return upper


def invert_information(information: Floats, nearest: Floats) -> Floats:
    """Return covariances from sums of `bearing_information`, shape (m, 3, 3).

    Parameters
    ----------
    information : ndarray, shape (m, 6)
    nearest : ndarray, shape (m,)
        Squared distance from the nearest camera; infinite for a landmark that none saw.
    """
    # The depth is bounded, so that every landmark has a covariance.
    distance = np.where(np.isfinite(nearest), np.maximum(nearest, SMALLEST), 1.0)
    prior = 1.0 / (UNKNOWN_DEPTH**2 * distance)
    inverse = np.linalg.inv(information[:, SYMMETRIC] + prior[:, None, None] * np.eye(3))
    symmetric: Floats = np.asarray(0.5 * (inverse + np.swapaxes(inverse, 1, 2)), np.float64)
    return symmetric


def _groups(ids: Ints) -> tuple[int, Ints]:
    """Return the number of landmarks and, for each row, which one it measures."""
    distinct = ids.copy()
    unnamed = ids < 0
    # A row without an id is a landmark of its own.
    distinct[unnamed] = -1 - np.arange(int(unnamed.sum()))
    values, group_of = np.unique(distinct, return_inverse=True)
    return len(values), group_of.reshape(-1)
