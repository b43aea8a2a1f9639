"""`register`: the motion between two views, from their features alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.registration.best_motion import covariance_of, find_motion
from groundmap.registration.feature_set import FeatureSet, feature_set
from groundmap.registration.matching import Bounds
from groundmap.registration.motion_model import any_motion, ground_motion
from groundmap.registration.settings import RegistrationSettings
from groundmap.view.frames import check_transform, invert
from groundmap.view.view import View

NO_LABEL = -1


@dataclass(frozen=True, kw_only=True, eq=False)
class Registration:
    """The motion between two views, as `groundmap.register` determines it.

    Parameters
    ----------
    T_a_b : ndarray, shape (4, 4) [m, base_link of a]
        Pose of the second view in ``base_link`` of the first.
    covariance : ndarray, shape (6, 6)
        Of this pose: translation [m], then rotation vector [rad], in ``base_link`` of the second.
    inliers : ndarray, shape (n, 2)
        Rows of the point features of both views that match.
    """

    T_a_b: Floats
    covariance: Floats
    inliers: Ints


def register(
    view_a: View, view_b: View, *, guess: npt.ArrayLike | None = None, **settings: Any
) -> Registration:
    """Return the motion between two views of the same place, from their point features.

    Features correspond if distances between them agree in both views, and if one motion moves all
    of them onto their partners. The motion fits their bearings and inverse depths best, weighted
    by the covariances (paper, section 6.2; Grimson and Lozano-Perez 1987). The poses of the views
    are not used.

    Parameters
    ----------
    view_a, view_b : View
    guess : array_like, shape (4, 4), optional [m, base_link of a]
        Rough pose of `view_b` in ``base_link`` of `view_a`; default: no motion.
    **settings
        Fields of `groundmap.RegistrationSettings`: ``max_translation`` [m] and ``max_rotation``
        [rad] from the guess, ``planar``, ``use_ids``, ...

    Returns
    -------
    Registration

    Raises
    ------
    RegistrationError
        Too few features agree, two motions explain them alike, or the matches leave a direction
        open, as when all features lie on one line.
    SettingsError
        A setting is unknown or out of range.
    CameraError
        The guess is not a rigid transform.

    Examples
    --------
    >>> from groundmap import Features, StereoRig
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> corners = np.random.default_rng(0).uniform((-4, -1, 5), (4, 2, 12), (60, 3))
    >>> noise = np.tile(1e-4 * np.eye(3), (60, 1, 1))
    >>> a, b = (
    ...     View(T_map_base=np.eye(4), rig=rig, points=Features.points(corners - shift, noise))
    ...     for shift in (0.0, (0.1, 0.0, 0.7))
    ... )
    >>> register(a, b).T_a_b[:3, 3].round(6)
    array([0.1, 0. , 0.7])
    """
    options = RegistrationSettings(**settings)
    T_a_b = np.eye(4) if guess is None else check_transform("guess", guess)
    T_camera_a, T_camera_b = view_a.rig.T_base_camera, view_b.rig.T_base_camera
    T_guess = invert(T_camera_b) @ invert(T_a_b) @ T_camera_a
    a, b = features_of(view_a, options), features_of(view_b, options)
    model = ground_motion(view_a, view_b, T_guess) if options.planar else any_motion()
    bounds = Bounds(options.max_translation, options.max_rotation)
    best = find_motion(move(a, T_guess), b, bounds, model, options)
    T_b_a = np.eye(4)
    T_b_a[:3] = best.pose @ T_guess
    matched = np.flatnonzero(best.partner >= 0)
    return Registration(
        T_a_b=T_camera_a @ invert(T_b_a) @ invert(T_camera_b),
        covariance=covariance_in_base(covariance_of(best, model), T_camera_b),
        inliers=np.stack([matched, best.partner[matched]], axis=1),
    )


def features_of(view: View, options: RegistrationSettings) -> FeatureSet:
    """Return the point features of a view, prepared for matching.

    Parameters
    ----------
    view : View
    options : RegistrationSettings
    """
    ids = view.points.ids
    labels = np.where(ids >= 0, ids, NO_LABEL) if options.use_ids else np.full_like(ids, NO_LABEL)
    return feature_set(view.points, labels)


def move(features: FeatureSet, transform: Floats) -> FeatureSet:
    """Return features in another frame; those behind the camera stay, and match nothing.

    Parameters
    ----------
    features : FeatureSet
    transform : ndarray, shape (4, 4)
    """
    if np.array_equal(transform, np.eye(4)):
        return features
    rotation = transform[:3, :3]
    xyz = features.xyz @ rotation.T + transform[:3, 3]
    covariance = rotation @ features.covariance @ rotation.T
    return features._replace(xyz=xyz, covariance=covariance)


def covariance_in_base(covariance: Floats, T_base_camera: Floats) -> Floats:
    """Return the covariance of a small motion in the base, from that in the camera.

    Parameters
    ----------
    covariance : ndarray, shape (6, 6)
        Translation [m], then rotation vector [rad], in the camera.
    T_base_camera : ndarray, shape (4, 4)
    """
    rotation = T_base_camera[:3, :3]
    x, y, z = T_base_camera[:3, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    adjoint = np.block([[rotation, cross @ rotation], [np.zeros((3, 3)), rotation]])
    moved: Floats = adjoint @ covariance @ adjoint.T
    return moved
