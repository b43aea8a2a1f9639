"""Export of a map as dense NumPy arrays: ``.npz``."""

from __future__ import annotations

from os import PathLike
from typing import IO

import numpy as np
import numpy.typing as npt

from groundmap.errors import InputError
from groundmap.files.archive import write_atomically
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import GridWindow


def dense_window(grid: ConfidenceGrid, bounds: npt.ArrayLike | None = None) -> GridWindow:
    """Return a part of a map as dense arrays.

    Parameters
    ----------
    grid : ConfidenceGrid
    bounds : array_like, shape (2 d,), optional
        Lower, then upper corner of the part [m, map]; default: all observed cells.

    Raises
    ------
    InputError
        An empty map, since an empty array has no place in the map; invalid bounds; a box with too
        many cells.
    """
    window = grid.window(bounds)
    if not window.count.size:
        raise InputError(
            "grid", "a map with known cells", "an empty one", hint="Map some views first."
        )
    return window


def write_dense(
    grid: ConfidenceGrid, path: str | PathLike[str], *, bounds: npt.ArrayLike | None = None
) -> None:
    """Write the dense arrays of a map to a file for `numpy.load`.

    ``confidence`` (float32) and ``count`` (uint32) are indexed ``[row, col]``,
    ``[layer, row, col]`` in 3-D; ``resolution`` [m/cell]; ``origin`` (x, y) [m, map] is the outer
    corner of cell (0, 0).

    Parameters
    ----------
    grid : ConfidenceGrid
    path : path
    bounds : array_like, shape (2 d,), optional
        Part to write, lower, then upper corner [m, map]; default: all observed cells.

    Raises
    ------
    InputError
        An empty map, invalid bounds, or a box with too many cells.
    OSError
        The folder does not exist or is not writable.
    """
    window = dense_window(grid, bounds)

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(
            stream,
            allow_pickle=False,
            confidence=window.confidence,
            count=window.count,
            resolution=np.float64(window.resolution),
            origin=window.origin,
        )

    write_atomically(path, write)
