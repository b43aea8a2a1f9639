"""Steps that readers of sparse maps share: quaternions, indices, text tables."""

from __future__ import annotations

from os import PathLike

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import FileFormatError

LENGTH_TOLERANCE = 1e-2  # of a quaternion, which is normalised


def poses_from(
    path: str | PathLike[str],
    quaternions: Floats,
    translations: Floats,
    *,
    scalar_first: bool = False,
    world_to_camera: bool = False,
) -> Floats:
    """Return poses, camera to world, from quaternions and translations, shape (n, 4, 4).

    Parameters
    ----------
    path : path
        For error messages.
    quaternions : ndarray, shape (n, 4)
    translations : ndarray, shape (n, 3)
    scalar_first : bool, default False
        Whether the order is w x y z instead of x y z w.
    world_to_camera : bool, default False
        Whether the transforms are those of world to camera, which are inverted.

    Raises
    ------
    FileFormatError
        A quaternion whose length is not 1.
    """
    poses = np.zeros((len(quaternions), 4, 4))
    poses[:, 3, 3] = 1.0
    if not len(quaternions):
        return poses
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.sqrt((quaternions**2).sum(axis=1))
        wrong = np.flatnonzero(~(np.abs(lengths - 1.0) <= LENGTH_TOLERANCE))
    if len(wrong):
        expected, got = "quaternions of length 1", f"length {lengths[wrong[0]]:.4g}"
        raise FileFormatError(path, expected, f"{got} in pose {wrong[0]}")
    rotations = Rotation.from_quat(quaternions, scalar_first=scalar_first).as_matrix()
    return compose(rotations, translations, world_to_camera=world_to_camera)


def compose(rotations: Floats, translations: Floats, *, world_to_camera: bool = False) -> Floats:
    """Return poses, camera to world, from rotations and translations, shape (n, 4, 4).

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
    translations : ndarray, shape (n, 3)
    world_to_camera : bool, default False
        Whether the transforms are those of world to camera, which are inverted.
    """
    poses = np.zeros((len(rotations), 4, 4))
    poses[:, 3, 3] = 1.0
    if world_to_camera:
        rotations = np.swapaxes(rotations, 1, 2)
        with np.errstate(over="ignore", invalid="ignore"):
            translations = -np.einsum("nij,nj->ni", rotations, translations)
    poses[:, :3, :3], poses[:, :3, 3] = rotations, translations
    return poses


def find_ids(ids: Ints, wanted: Ints) -> tuple[Ints, Bools]:
    """Return the row of each wanted id, and whether there is one.

    Parameters
    ----------
    ids : ndarray of int, shape (n,)
    wanted : ndarray of int, shape (k,)
    """
    if not len(ids):
        return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=np.bool_)
    order = np.argsort(ids, kind="stable")
    place = np.searchsorted(ids, wanted, sorter=order).clip(max=len(ids) - 1)
    rows = order[place]
    return rows, ids[rows] == wanted


def check_distinct(path: str | PathLike[str], ids: Ints, what: str) -> None:
    """Raise `FileFormatError` if an id occurs twice.

    Parameters
    ----------
    path : path
    ids : ndarray of int, shape (n,)
    what : str
        What the ids are of, for error messages.
    """
    values, counts = np.unique(ids, return_counts=True)
    repeated = values[counts > 1]
    if len(repeated):
        raise FileFormatError(path, f"one {what} per id", f"two with the id {repeated[0]}")
