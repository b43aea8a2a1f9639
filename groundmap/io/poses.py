"""Readers of pose files, in the two forms that logs use.

TUM
    ``timestamp tx ty tz qx qy qz qw`` [s, m], as written by most SLAM programs.
GTSAM
    ``id`` and the 16 numbers of the transform, row by row.

Both give the pose of the body in the world of the log: ``p_world = T_world_body @ p_body``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError, InputError
from groundmap.io.rows import Rows, open_rows, read_rows, record
from groundmap.view.frames import check_transform, from_quaternion

TUM_ROW, GTSAM_ROW = record([], 8), record(["id"], 16)
KITTI_COLUMNS = 12
# Programs print time stamps with as few as three decimals.
TIMESTAMP_TOLERANCE = 1e-3


class Poses(NamedTuple):
    """The rows of a pose file, in the order of the file."""

    keys: npt.NDArray[Any]  #: shape (n,): timestamps [s] as float64, or ids as int64
    transforms: Floats  #: shape (n, 4, 4) [m, world]
    lines: Ints  #: shape (n,), the one-based line of each pose


def read_tum(path: Path) -> Poses:
    """Read poses in TUM form.

    Raises
    ------
    FileFormatError
        No pose, a timestamp that is not finite, a quaternion whose length is not 1.
    """
    if len(_first_row(path)) == KITTI_COLUMNS:
        raise FileFormatError(
            path,
            "8 columns, timestamp tx ty tz qx qy qz qw",
            f"{KITTI_COLUMNS}",
            hint="Rows of 12 numbers are KITTI's 3 x 4 matrices: write each as a timestamp, "
            "translation and quaternion.",
        )
    rows = _all_rows(path, TUM_ROW)
    values = rows.values["values"]
    for line, timestamp in zip(rows.lines, values[:, 0], strict=True):
        if not np.isfinite(timestamp):
            raise FileFormatError(path, "a finite timestamp", str(timestamp), line=int(line))
    transforms = _transforms(path, rows, lambda row: from_quaternion(row[1:4], row[4:]))
    return Poses(values[:, 0], transforms, rows.lines)


def read_gtsam(path: Path) -> Poses:
    """Read poses in GTSAM form.

    Raises
    ------
    FileFormatError
        No pose, or a matrix that is not a rigid transform.
    """
    rows = _all_rows(path, GTSAM_ROW)
    transforms = _transforms(path, rows, lambda row: row.reshape(4, 4))
    return Poses(rows.values["id"], transforms, rows.lines)


def read_poses(path: Path) -> Poses:
    """Read poses in either form, which the number of columns determines."""
    return read_gtsam(path) if len(_first_row(path)) == 1 + 16 else read_tum(path)


def _first_row(path: Path) -> list[str]:
    with open_rows(path) as stream:
        return next((text for line in stream if (text := line.partition("#")[0].split())), [])


def check_unique(path: Path, poses: Poses) -> None:
    """Raise `FileFormatError` at the first pose with a repeated key.

    Parameters
    ----------
    path : Path
        For the error message.
    poses : Poses
    """
    _, first, inverse = np.unique(poses.keys, return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[inverse] != np.arange(len(poses.keys)))
    if len(repeated):
        again = int(repeated[0])
        got = f"another pose {poses.keys[again]}"
        raise FileFormatError(path, "one pose per id", got, line=int(poses.lines[again]))


def poses_by_id(path: Path, ids: Ints) -> Floats:
    """Return the poses of given ids, shape (n, 4, 4); in TUM form timestamps are the ids.

    Parameters
    ----------
    path : Path
    ids : ndarray of int, shape (n,)

    Raises
    ------
    FileFormatError
        An id without a pose, or with two.
    """
    poses = read_poses(path)
    check_unique(path, poses)
    order = np.argsort(poses.keys)
    place = np.searchsorted(poses.keys, ids, sorter=order).clip(max=len(order) - 1)
    missing = ids[poses.keys[order[place]] != ids]
    if len(missing):
        raise FileFormatError(path, f"a pose for view {missing[0]}", "none with that id")
    found: Floats = poses.transforms[order[place]]
    return found


def poses_by_time(path: Path, timestamps: Floats) -> Floats:
    """Return the poses of views in order, shape (n, 4, 4); in GTSAM form ids are view indices.

    Parameters
    ----------
    path : Path
    timestamps : ndarray, shape (n,) [s]
        Of the views.

    Raises
    ------
    FileFormatError
        A number of poses other than that of the views, or a timestamp off by more than 1 ms.
    """
    poses = read_poses(path)
    if poses.keys.dtype.kind == "i":
        return poses_by_id(path, np.arange(len(timestamps)))
    if len(poses.keys) != len(timestamps):
        raise FileFormatError(path, f"{len(timestamps)} poses, one per view", f"{len(poses.keys)}")
    off = np.flatnonzero(np.abs(poses.keys - timestamps) > TIMESTAMP_TOLERANCE)
    if len(off):
        raise FileFormatError(
            path,
            f"the timestamp of view {off[0]}, {timestamps[off[0]]:.17g}",
            f"{poses.keys[off[0]]:.17g}",
            line=int(poses.lines[off[0]]),
        )
    return poses.transforms


def _all_rows(path: Path, row: np.dtype[Any]) -> Rows:
    chunks = list(read_rows(path, row))
    if not chunks:
        raise FileFormatError(path, "at least one pose", "an empty file")
    return Rows(
        np.concatenate([chunk.values for chunk in chunks]),
        np.concatenate([chunk.lines for chunk in chunks]),
    )


def _transforms(path: Path, rows: Rows, convert: Callable[[Floats], Floats]) -> Floats:
    transforms = np.empty((len(rows.lines), 4, 4))
    for index, (row, line) in enumerate(zip(rows.values["values"], rows.lines, strict=True)):
        try:
            transforms[index] = check_transform("pose", convert(row))
        except InputError as error:
            raise FileFormatError(
                path, error.expected, error.got, line=int(line), hint=error.hint
            ) from error
    return transforms
