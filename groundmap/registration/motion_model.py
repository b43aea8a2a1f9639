"""The motions that are possible: all, or those in the ground plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.view.frames import invert
from groundmap.view.view import View


class MotionModel(NamedTuple):
    """Possible motions from the camera of A, moved by a guess, to that of B."""

    directions: Floats  #: shape (6, d), small motions: translation [m], rotation vector [rad], in B
    T_level_a: Floats | None = None  #: shape (4, 4), of level frames on the ground, with z up;
    T_level_b: Floats | None = None  #: None if all motions are possible

    def project(self, poses: Floats) -> Floats:
        """Return the nearest possible motions, shape (h, 3, 4)."""
        if self.T_level_a is None or self.T_level_b is None:
            return poses
        level = self.T_level_b[:3] @ _square(poses) @ invert(self.T_level_a)
        heading = level[:, :, 0]
        yaw = np.arctan2(heading[:, 1], heading[:, 0])
        planar = np.zeros((len(poses), 4, 4))
        planar[:, 0, 0] = planar[:, 1, 1] = np.cos(yaw)
        planar[:, 1, 0] = np.sin(yaw)
        planar[:, 0, 1] = -planar[:, 1, 0]
        planar[:, 2, 2] = planar[:, 3, 3] = 1.0
        planar[:, :2, 3] = level[:, :2, 3]
        projected: Floats = (invert(self.T_level_b) @ planar @ self.T_level_a)[:, :3]
        return np.ascontiguousarray(projected)


def any_motion() -> MotionModel:
    """Return the model of motions with six degrees of freedom."""
    return MotionModel(np.eye(6))


def ground_motion(a: View, b: View, guess: Floats) -> MotionModel:
    """Return the model of motions that leave the ground where it is, with three degrees of freedom.

    The ground is the plane of each view; without one, it is level under ``base_link``.

    Parameters
    ----------
    a, b : View
    guess : ndarray, shape (4, 4)
        Motion from the camera of `a` to that of `b` that was applied to the features of `a`.
    """
    T_level_b = _level_from_camera(b)
    up = T_level_b[2, :3]
    directions = np.zeros((6, 3))
    directions[:3, 0], directions[:3, 1] = T_level_b[0, :3], T_level_b[1, :3]
    directions[3:, 2] = up
    return MotionModel(directions, _level_from_camera(a) @ invert(guess), T_level_b)


def _level_from_camera(view: View) -> Floats:
    """Return the transform from the camera to a level frame on the ground, shape (4, 4)."""
    T_base_camera, plane = view.rig.T_base_camera, view.plane
    normal = view.rig.up if plane is None else plane.normal
    up = T_base_camera[:3, :3].T @ normal
    forward = np.array([0.0, 0.0, 1.0])
    forward = forward - (forward @ up) * up
    forward /= np.linalg.norm(forward)
    T_level_camera = np.eye(4)
    T_level_camera[:3, :3] = np.stack([forward, np.cross(up, forward), up])
    T_level_camera[2, 3] = (0.0 if plane is None else plane.offset) + normal @ T_base_camera[:3, 3]
    return T_level_camera


def _square(poses: Floats) -> Floats:
    bottom = np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(poses), 1, 4))
    return np.concatenate([poses, bottom], axis=1)
