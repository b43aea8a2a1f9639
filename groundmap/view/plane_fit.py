"""A plane through the features that may be ground: Hough transform and refinement."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.settings import GroundSettings

TILTS = np.stack(
    np.meshgrid(
        np.tan(np.radians(np.arange(-10.0, 11.0, 2.0))), np.tan(np.radians((-6, -3, 0, 3, 6)))
    ),
    axis=-1,
).reshape(-1, 2)
LEAST_TILT = 0.04  # slopes that are tried in any case
BIN = 0.1  # [m], height bins of the Hough transform
TOLERANCES = (0.4, 0.3, 0.2, 0.15, 0.15, 0.15)  # [m], one per refinement step
WORST_CONDITION = 1e12  # of the information matrix; above it, all features are on one line


class Cloud(NamedTuple):
    """Features of a window that may be ground, relative to the camera and the track."""

    points: Floats  # (n, 3) [m], forward, left and up of the camera, along the track
    sigmas: Floats  # (n,) [m]
    weights: Floats  # (n,) [1/m²]
    votes: Floats  # (n,), weights for the search of a first plane


class PlaneFit(NamedTuple):
    """A plane: up = a forward + b left + c."""

    plane: Floats  #: shape (3,), a, b and c [m]
    sigma_tilt: float  #: [rad], standard deviation of the tilt
    support: int  #: number of features on it


def fit_plane(cloud: Cloud, sigma_slope: float, options: GroundSettings) -> PlaneFit | None:
    """Return the plane that has most features on it and few below it; None if there is none.

    Parameters
    ----------
    cloud : Cloud
    sigma_slope : float
        Standard deviation of the slope `a` around 0, as known from the track.
    options : GroundSettings
    """
    if len(cloud.points) < options.min_support:
        return None
    plane = _search(cloud.points, cloud.votes, sigma_slope, options)
    if plane is None:
        return None
    for tolerance in TOLERANCES:
        refined = _refine(cloud, plane, tolerance, sigma_slope, options.min_support)
        if refined is None:
            return None
        plane, information, support = refined
    tilt = np.sqrt(np.diag(np.linalg.inv(information))[:2].sum())
    return PlaneFit(plane, float(tilt), support)


def _refine(
    cloud: Cloud, plane: Floats, tolerance: float, sigma_slope: float, min_support: int
) -> tuple[Floats, Floats, int] | None:
    """Return a refined plane (a, b, c: up = a forward + b left + c), its information and support.

    One step of iteratively reweighted least squares with Tukey's biweight. None if fewer than
    `min_support` features lie on the plane, or all of them lie on one line.
    """
    x, y, z = cloud.points.T
    design = np.column_stack([x, y, np.ones(len(x))])
    residual = z - design @ plane
    scale = np.sqrt(tolerance**2 + (2 * cloud.sigmas) ** 2)
    weights = cloud.weights * np.maximum(0.0, 1.0 - (residual / scale) ** 2) ** 2
    support = int((weights > 0).sum())
    information = (design * weights[:, None]).T @ design
    information[0, 0] += sigma_slope**-2
    if support < min_support or np.linalg.cond(information) > WORST_CONDITION:
        return None
    return np.linalg.solve(information, design.T @ (weights * z)), information, support


def _search(
    points: Floats, weights: Floats, sigma_slope: float, options: GroundSettings
) -> Floats | None:
    """Return the plane (a, b, c) that has most features on it and few below it.

    A deterministic Hough transform over pitch, roll and height. None if no candidate is between
    ``lowest_camera`` and ``highest_camera`` below the camera.
    """
    tilts = TILTS[np.abs(TILTS[:, 0]) <= max(3.0 * sigma_slope, LEAST_TILT)]
    bins = np.floor((points[:, 2] - tilts @ points[:, :2].T) / BIN).astype(np.int64)
    lowest = int(bins.min())
    columns = int(bins.max()) - lowest + 1
    rows = np.arange(len(tilts))[:, None] * columns
    votes = np.bincount(
        (bins - lowest + rows).ravel(),
        weights=np.broadcast_to(weights, bins.shape).ravel(),
        minlength=len(tilts) * columns,
    ).reshape(len(tilts), columns)
    # Votes of a bin and both neighbours count for a plane, those below it against it, by half.
    padded = np.pad(votes, ((0, 0), (2, 1)))
    near = votes + padded[:, 1:-2] + padded[:, 3:]
    below = np.cumsum(padded, axis=1)[:, :columns]
    intercepts = (lowest + np.arange(columns) + 0.5) * BIN
    camera_heights = -intercepts / np.sqrt(1.0 + (tilts**2).sum(axis=1))[:, None]
    allowed = (camera_heights >= options.lowest_camera) & (camera_heights <= options.highest_camera)
    if not allowed.any():
        return None
    score = np.where(allowed, near - 0.5 * below, -np.inf)
    tilt, column = np.unravel_index(int(np.argmax(score)), votes.shape)
    return np.array([*tilts[tilt], intercepts[column]])
