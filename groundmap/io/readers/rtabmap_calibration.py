"""Calibrations in RTAB-Map's databases: of one camera or several, or of a stereo pair."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.sparse.cameras import Camera

MONO, STEREO = 0, 1
HEADER = 11  # numbers before the matrices of a camera
STEREO_HEADER = 10
# Versions before 0.11.10 wrote fx, fy, cx, cy, [baseline or width, height,] and the transform.
OLD_SIZES = {16: 4, 18: 6, 17: 5}


class Calibration(NamedTuple):
    """The first camera of a node."""

    camera: Camera
    T_base_camera: Floats  #: shape (4, 4)


def read_calibration(path: Path, blob: object) -> Calibration:
    """Return the first, or left, camera of a calibration.

    Parameters
    ----------
    path : Path
        For error messages.
    blob : bytes
        A value of the column ``calibration``.

    Raises
    ------
    FileFormatError
        Another layout.
    """
    if not isinstance(blob, bytes):
        raise FileFormatError(path, "bytes as calibration", repr(blob)[:60])
    if len(blob) >= 4 * HEADER:
        head = np.frombuffer(blob, "<i4", HEADER).tolist()
        if head[0] in (0, 1) and head[3] == MONO:
            return _mono(path, blob, 0)
        if head[0] in (0, 1) and head[3] == STEREO:
            matrices = 8 * sum(head[4:8])
            return _mono(path, blob, 4 * STEREO_HEADER + matrices)
    if len(blob) % 4 == 0 and len(blob) // 4 in OLD_SIZES:
        return _old(path, np.frombuffer(blob, "<f4").astype(np.float64))
    raise FileFormatError(path, "a calibration of RTAB-Map", f"{len(blob)} bytes of another layout")


def _mono(path: Path, blob: bytes, start: int) -> Calibration:
    if start < 0 or len(blob) < start + 4 * HEADER:
        raise FileFormatError(path, "a calibration of RTAB-Map", f"{len(blob)} bytes, too few")
    head = np.frombuffer(blob, "<i4", HEADER, start).tolist()
    width, height = head[4:6]
    sizes = head[6:10]
    matrices = start + 4 * HEADER
    end = matrices + 8 * sum(sizes)
    if min(sizes) < 0 or head[10] not in (0, 12) or len(blob) < end + 4 * head[10]:
        raise FileFormatError(path, "a calibration of RTAB-Map", f"{len(blob)} bytes, too few")
    if sizes[0] == 9:
        matrix = np.frombuffer(blob, "<f8", 9, matrices)
    elif sizes[3] == 12:  # the projection matrix of a rectified camera
        matrix = np.frombuffer(blob, "<f8", 12, end - 8 * 12).reshape(3, 4)[:, :3].reshape(-1)
    else:
        raise FileFormatError(path, "a calibration with a camera matrix", "none")
    transform = np.eye(4)
    if head[10]:
        transform[:3] = np.frombuffer(blob, "<f4", 12, end).astype(np.float64).reshape(3, 4)
    model = "RTAB-Map"
    camera = Camera(
        model=model, focal_px=float(matrix[0]), width=width, height=height, cx=float(matrix[2])
    )
    return Calibration(camera, transform)


def _old(path: Path, values: Floats) -> Calibration:
    count = OLD_SIZES[len(values)]
    width, height = values[4:6].tolist() if count == 6 else (0.0, 0.0)
    if not (np.isfinite(values).all() and abs(width) < 1e6 and abs(height) < 1e6):
        raise FileFormatError(path, "finite numbers of a calibration", "others")
    camera = Camera(
        model="RTAB-Map",
        focal_px=float(values[0]),
        width=int(width),
        height=int(height),
        cx=float(values[2]),
    )
    transform = np.eye(4)
    transform[:3] = values[count:].reshape(3, 4)
    return Calibration(camera, transform)
