"""Checks of the arguments of a grid."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Floats32, as_floats, check_finite, is_number
from groundmap.errors import InputError, MergeError
from groundmap.grid.kernels.fuse import beyond_one
from groundmap.grid.tiles import TILE_SHAPES
from groundmap.printable import format_value, is_plain

SMALLEST, LARGEST, FARTHEST = 1e-9, 1e9, 1e100  # [m] cells and origin; areas are then numbers


def check_frame(frame: object) -> None:
    """Check the name of a coordinate frame.

    Raises
    ------
    InputError
        It is not a string, or contains NUL or unpaired surrogates.
    """
    if not isinstance(frame, str):
        raise InputError("frame", "a name", format_value(frame))
    if not is_plain(frame):
        raise InputError("frame", "a name without NUL and unpaired surrogates", format_value(frame))


def as_resolution(resolution: Any) -> float:
    """Return the size of a cell [m].

    Raises
    ------
    InputError
        It is not a number above 0, or out of range.
    """
    if not (is_number(resolution) and resolution > 0):
        raise InputError("resolution", "a number above 0 [m]", format_value(resolution))
    if not SMALLEST <= resolution <= LARGEST:
        raise InputError("resolution", f"{SMALLEST:g} to {LARGEST:g} m", str(resolution))
    return float(resolution)


def as_origin(origin: npt.ArrayLike) -> Floats:
    """Return the outer corner of cell (0, 0), shape (d,) [m, map].

    Raises
    ------
    InputError
        It is not finite, not 2-D or 3-D, or out of range.
    """
    corner = as_floats("origin", origin, (None,))
    if len(corner) not in TILE_SHAPES:
        raise InputError("origin", "2 or 3 numbers [m]", f"{len(corner)}")
    check_finite("origin", corner)
    if (np.abs(corner) > FARTHEST).any():
        raise InputError("origin", f"numbers up to {FARTHEST:g} m", str(corner.tolist()))
    return corner


def as_evidence(z: npt.ArrayLike, ndim: int) -> Floats32:
    """Return the evidence of a block of cells as an array of numbers in [-1, 1].

    Parameters
    ----------
    z : array_like
    ndim : int
        Dimension of the grid.

    Raises
    ------
    InputError
        The array has another dimension, is not numeric, or has values that are NaN or outside
        [-1, 1].
    """
    expected = f"evidence in {ndim} dimensions"
    try:
        block = np.asarray(z)
    except ValueError as error:  # rows of different lengths
        raise InputError("z", expected, format_value(z)) from error
    if block.ndim != ndim or block.dtype.kind not in "biuf":
        raise InputError("z", expected, f"{block.dtype} of shape {block.shape}")
    # Before the conversion, which would round numbers just beyond 1.
    wide = block if block.dtype == np.float32 else block.astype(np.float64)
    if beyond_one(wide.reshape(-1)):
        raise InputError("z", "evidence in [-1, 1]", "NaN or numbers beyond")
    return np.ascontiguousarray(block, dtype=np.float32)


def check_merge(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> None:
    """Check that two grids can be merged.

    Parameters
    ----------
    ours, theirs : mapping of str to object
        Settings of both grids.

    Raises
    ------
    MergeError
        A setting differs, or the rule depends on the order of the views.
    """
    for name in ("resolution", "frame", "rule", "origin", "heights"):
        if not np.array_equal(ours[name], theirs[name]):
            raise MergeError(
                f"maps add up only with one {name}: expected {ours[name]}, got {theirs[name]}"
            )
    rule = ours["rule"]
    if not rule.mergeable:
        raise MergeError(
            f"the rule {rule.name!r} depends on the order of the views, so its maps don't add up. "
            "Map with fusion='average', or integrate all views in one mapper."
        )
