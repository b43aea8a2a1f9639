"""Point clouds of ROS: positions, and ids where the cloud has them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints

TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
ID_FIELDS = ("id", "point_id", "landmark_id", "feature_id", "track_id")
MOST_POINT_BYTES = 10_000


class WrongCloudError(ValueError):
    """A cloud whose layout contradicts its data; the message describes it."""


class Cloud(NamedTuple):
    """The points of a message."""

    positions: Floats  #: shape (n, 3) [frame of the cloud]
    ids: Ints | None  #: shape (n,)


def id_field(message: Any) -> str | None:
    """Return the name of the field with ids, or None."""
    names = [str(field.name) for field in message.fields]
    return next((name for name in ID_FIELDS if name in names), None)


def read_cloud(message: Any) -> Cloud:
    """Return the points of a PointCloud2 message, as far as they are finite or not.

    Raises
    ------
    WrongCloudError
        No x, y and z; a field outside of the points; less data than the size states.
    """
    fields = {str(field.name): field for field in message.fields}
    missing = [name for name in ("x", "y", "z") if name not in fields]
    if missing:
        raise WrongCloudError(f"a cloud without the field {missing[0]}")
    step, width, height = int(message.point_step), int(message.width), int(message.height)
    order = ">" if message.is_bigendian else "<"
    wanted = ["x", "y", "z"]
    named = id_field(message)
    if named is not None:
        wanted.append(named)
    kinds = []
    for name in wanted:
        kind = TYPES.get(int(fields[name].datatype))
        offset = int(fields[name].offset)
        if kind is None or not 0 <= offset <= step - int(kind[1]):
            raise WrongCloudError(f"the field {name} at byte {offset} of points of {step} bytes")
        kinds.append(order + kind)
    row = int(message.row_step) if height > 1 else step * width
    data = np.asarray(message.data, dtype=np.uint8).reshape(-1)
    if not (0 < step <= MOST_POINT_BYTES and row >= step * width and height >= 0 and width >= 0):
        raise WrongCloudError(f"rows of {row} bytes for {width} points of {step}")
    if len(data) < row * height:
        raise WrongCloudError(f"{len(data)} bytes for {height} rows of {row}")
    offsets = [int(fields[name].offset) for name in wanted]
    dtype = np.dtype({"names": wanted, "formats": kinds, "offsets": offsets, "itemsize": step})
    rows = data[: row * height].reshape(height, row)[:, : step * width]
    points = np.ascontiguousarray(rows).reshape(-1).view(dtype)
    positions = np.stack([points[name].astype(np.float64) for name in "xyz"], axis=-1)
    if named is None:
        return Cloud(positions, None)
    with np.errstate(invalid="ignore"):
        return Cloud(positions, points[named].astype(np.int64))
