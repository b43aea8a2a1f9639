"""Conversion of grid files of older versions to the newest."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from groundmap.errors import InputError
from groundmap.grid.height_layers import SIGHT_HEIGHTS
from groundmap.grid.tiles import TILE_SHAPES

DROP_OFF_VIEWS = 3  # views of a drop-off from which version 1 set its cell to non-free

Header: TypeAlias = dict[str, Any]
Arrays: TypeAlias = dict[str, npt.NDArray[Any]]


def upgrade(header: Header, arrays: Arrays) -> tuple[Header, Arrays]:
    """Return header and arrays in the format of the newest version.

    Version 1 has, per cell, the number of views of a drop-off. Where a drop-off made the cell
    non-free, it becomes evidence of the lowest layer, which preserves the state of the cell.

    Parameters
    ----------
    header : dict
    arrays : dict of str to ndarray

    Raises
    ------
    InputError
        The counts have another type or shape.
    KeyError
        A part of the file is missing.
    """
    if header["version"] != 1:
        return header, arrays
    indices, views = arrays["tiles"], arrays["drop_offs"]
    shape = (len(indices), *TILE_SHAPES[len(header["origin"])])
    if views.dtype != np.uint32 or views.shape != shape:
        got = f"{views.dtype} of shape {views.shape}"
        raise InputError("drop_offs", f"uint32 of shape {shape}", got)
    count = np.where(views < DROP_OFF_VIEWS, 0, views).astype(np.uint32)
    unseen = (arrays["count"] == 0) & (count > 0)
    some = count.reshape(len(count), -1).any(axis=1)
    upgraded = {
        **arrays,
        "confidence": np.where(unseen, np.float32(1.0), arrays["confidence"]),
        "count": np.where(unseen, count, arrays["count"]),
        "tiles_0": indices[some],
        "confidence_0": (count[some] > 0).astype(np.float32),
        "count_0": count[some],
        "recent": indices[:0],
    }
    for number in range(1, len(SIGHT_HEIGHTS)):
        upgraded[f"tiles_{number}"] = indices[:0]
        upgraded[f"confidence_{number}"] = np.zeros((0, *shape[1:]), dtype=np.float32)
        upgraded[f"count_{number}"] = count[:0]
    return {**header, "heights": SIGHT_HEIGHTS}, upgraded
