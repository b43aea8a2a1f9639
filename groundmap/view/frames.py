"""Rigid transforms and coordinate frames.

``T_map_camera`` transforms camera coordinates to map coordinates, ``p_map = T_map_camera @
p_camera``, so that adjacent names cancel in a product. ``map`` and ``base_link`` are x forward, y
left, z up (REP-103); the optical frame of the camera is x right, y down, z forward.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import CameraError, InputError

WorldConvention = Literal["optical", "rep103"]

# Columns are the optical axes in a REP-103 frame: x right = -y, y down = -z, z forward = x.
T_REP103_OPTICAL: Floats = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
ORTHONORMAL_TOLERANCE = 1e-4
LENGTH_TOLERANCE = 1e-3  # of a quaternion: programs print as few as three decimals


def check_transform(name: str, matrix: npt.ArrayLike) -> Floats:
    """Return a read-only copy of a matrix that is a rigid transform.

    Parameters
    ----------
    name : str
        Name of the matrix, for error messages.
    matrix : array_like, shape (4, 4)

    Returns
    -------
    ndarray, shape (4, 4)

    Raises
    ------
    CameraError
        The rotation part is not orthonormal or is a reflection, or the last row is not 0 0 0 1.
    InputError
        The shape is not (4, 4), or an entry is NaN or infinite.
    """
    transform = as_floats(name, matrix, (4, 4)).copy()  # the caller may change `matrix` later
    check_finite(name, transform)
    rotation = transform[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if not deviation <= ORTHONORMAL_TOLERANCE:
        raise CameraError(
            name,
            "a rotation with orthonormal rows",
            f"rows off by {deviation:.3g}",
            hint="Check the order of the numbers: row-major, camera to world.",
        )
    if np.linalg.det(rotation) < 0:
        raise CameraError(name, "a rotation", "a reflection (determinant -1)")
    if not np.allclose(transform[3], (0.0, 0.0, 0.0, 1.0)):
        raise CameraError(name, "a last row of 0 0 0 1", str(transform[3]))
    transform.flags.writeable = False
    return transform


def invert(transform: Floats) -> Floats:
    """Return the inverse of a rigid transform, shape (4, 4)."""
    rotation = transform[:3, :3]
    inverse = np.eye(4)
    inverse[:3, :3] = rotation.T
    inverse[:3, 3] = -rotation.T @ transform[:3, 3]
    return inverse


def map_from_world(T_world: Floats, world: WorldConvention) -> Floats:
    """Return poses in the ``map`` frame from poses in the world frame of a log.

    Parameters
    ----------
    T_world : ndarray, shape (..., 4, 4) [m, world]
    world : {"optical", "rep103"}
        Axes of the world frame: x right, y down, z forward; or x forward, y left, z up.

    Returns
    -------
    ndarray, shape (..., 4, 4) [m, map]

    Raises
    ------
    InputError
        `world` is neither "optical" nor "rep103".

    Examples
    --------
    >>> pose = np.eye(4)
    >>> pose[:3, 3] = 1.0, 2.0, 3.0  # right, down, forward
    >>> map_from_world(pose, "optical")[:3, 3]
    array([ 3., -1., -2.])
    """
    if world not in get_args(WorldConvention):
        raise InputError("world", "'optical' or 'rep103'", repr(world))
    return T_REP103_OPTICAL @ T_world if world == "optical" else T_world


def from_quaternion(translation: Floats, quaternion: Floats) -> Floats:
    """Return the rigid transform of a translation and a quaternion.

    Parameters
    ----------
    translation : ndarray, shape (3,) [m]
    quaternion : ndarray, shape (4,)
        In the order x, y, z, w.

    Returns
    -------
    ndarray, shape (4, 4)

    Raises
    ------
    CameraError
        The length of the quaternion differs from 1 by more than 1e-3.

    Examples
    --------
    >>> from_quaternion(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))[:3, :3]
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    with np.errstate(over="ignore"):
        length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= LENGTH_TOLERANCE:
        raise CameraError("quaternion", "length 1 (order x y z w)", f"length {length:.4g}")
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    transform[:3, 3] = translation
    return transform


def to_quaternion(transform: Floats) -> Floats:
    """Return the unit quaternion (x, y, z, w), w >= 0, of the rotation of a rigid transform.

    Examples
    --------
    >>> to_quaternion(np.eye(4))
    array([0., 0., 0., 1.])
    """
    quaternion: Floats = Rotation.from_matrix(transform[:3, :3]).as_quat(canonical=True)
    return quaternion + 0.0  # no negative zeros
