"""Smoothing: features that may lie on one surface tell each other where it is.

Each feature's range is as noisy as its disparity, and the nearest of many noisy features bounds
what is seen: a wall would come the nearer, the more features it has.
"""

from __future__ import annotations

import numpy as np

from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.smooth import smooth_along_rays
from groundmap.settings import MapperSettings

GATE = 2.0  # standard deviations of the difference: what is farther apart is two surfaces
SUREST = 0.5  # of its own standard deviation: a real surface is not quite straight
LEAST_SIGMA = 1e-9  # [1/m]


def smooth_features(ground_view: GroundView, settings: MapperSettings) -> GroundView:
    """Move obstacle features along their lines of sight to where their neighbours agree.

    Around each feature a straight surface is fitted to those within `smoothing` metres across the
    line of sight and two standard deviations along it; alone or in pairs, features stay where
    they are. Their covariance shrinks accordingly, to a quarter at most. Ground features are left
    alone.
    """
    radius = np.hypot(ground_view.points[:, 0], ground_view.points[:, 1])
    bearings = np.arctan2(ground_view.points[:, 1], ground_view.points[:, 0])
    order = np.argsort(bearings, kind="stable")
    order = order[radius[order] >= settings.min_range]  # segments may begin below the camera
    if settings.smoothing == 0 or len(order) == 0:
        return ground_view
    ray = ground_view.points[order] / radius[order, None]
    along = np.einsum("ni,nij,nj->n", ray, ground_view.covariance[order], ray)
    sigma = np.maximum(np.sqrt(along) / radius[order] ** 2, LEAST_SIGMA)
    inverse, deviation = np.empty(len(order)), np.empty(len(order))
    smooth_along_rays(
        bearings[order],
        1.0 / radius[order],
        sigma,
        settings.smoothing,
        GATE,
        inverse,
        deviation,
    )
    stretch, shrink = np.ones(len(radius)), np.ones(len(radius))
    stretch[order] = 1.0 / (inverse * radius[order])  # new range / old one
    shrink[order] = np.clip(deviation / sigma, SUREST, 1.0)
    return ground_view._replace(
        points=ground_view.points * stretch[:, None],
        covariance=ground_view.covariance * (shrink**2)[:, None, None],
        heights=ground_view.camera_height
        + (ground_view.heights - ground_view.camera_height) * stretch,
    )
