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
    offsets = sparse.offsets_from_cameras()
    squared = np.einsum("ki,ki->k", offsets, offsets)
    squared = np.maximum(squared, np.finfo(np.float64).tiny ** 0.25)
    noise = np.array([camera.bearing_noise for camera in sparse.cameras])
    assert sparse.camera_of is not None
    sigma = PIXEL_NOISE_PX * noise[sparse.camera_of[sparse.view_of]]
    weight = 1.0 / (squared * sigma**2)
    upper = -weight[:, None] * offsets[:, UPPER[0]] * offsets[:, UPPER[1]] / squared[:, None]
    upper[:, [0, 3, 5]] += weight[:, None]
    groups, group_of = _groups(sparse.ids)
    owner = group_of[sparse.landmark_of]
    information = np.stack(
        [np.bincount(owner, weights=column, minlength=groups) for column in upper.T], axis=1
    )
    # The depth is bounded, so that every landmark has a covariance.
    nearest = np.full(groups, np.inf)
    np.minimum.at(nearest, owner, squared)
    seen = np.isfinite(nearest)
    prior = np.where(seen, 1.0 / (UNKNOWN_DEPTH**2 * np.where(seen, nearest, 1.0)), 1.0)
    matrices = information[:, SYMMETRIC] + prior[:, None, None] * np.eye(3)
    inverse = np.linalg.inv(matrices)[group_of]
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
