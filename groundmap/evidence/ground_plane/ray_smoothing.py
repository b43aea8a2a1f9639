"""Smoothing of features that may lie on one surface.

The range of a feature is as noisy as its disparity, and the nearest feature of a surface bounds
freespace. Without smoothing, walls with more features would appear nearer.
"""

from __future__ import annotations

import numpy as np

from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.smooth import smooth_along_rays
from groundmap.settings import MapperSettings

GATE = 2.0  # standard deviations of the difference, between features of one surface
SUREST = 0.5  # least ratio of new to old standard deviation, as surfaces are not exactly straight
LEAST_SIGMA = 1e-9  # [1/m]


def smooth_features(ground_view: GroundView, settings: MapperSettings) -> GroundView:
    """Return the view with obstacle features smoothed along their lines of sight.

    Around each feature, a straight surface is fitted to the features within `smoothing` metres
    across the line of sight and two standard deviations along it. Groups of fewer than three
    features do not move. The covariance shrinks accordingly, at most to a quarter. Ground features
    do not change.

    Parameters
    ----------
    ground_view : GroundView
    settings : MapperSettings
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
    stretch[order] = 1.0 / (inverse * radius[order])  # ratio of the new range to the old
    shrink[order] = np.clip(deviation / sigma, SUREST, 1.0)
    return ground_view._replace(
        points=ground_view.points * stretch[:, None],
        covariance=ground_view.covariance * (shrink**2)[:, None, None],
        heights=ground_view.camera_height
        + (ground_view.heights - ground_view.camera_height) * stretch,
    )
