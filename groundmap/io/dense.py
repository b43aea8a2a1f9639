"""Dense arrays of a map, for NumPy: ``.npz``."""

from __future__ import annotations

from os import PathLike
from typing import IO

import numpy as np

from groundmap.archive import write_atomically
from groundmap.errors import InputError
from groundmap.grid import ConfidenceGrid
from groundmap.window import GridWindow


def dense_window(grid: ConfidenceGrid) -> GridWindow:
    """Return the box around all that was seen, dense.

    Raises
    ------
    InputError
        Nothing was seen: an empty array has no place in the map.
    """
    window = grid.window()
    if not window.count.size:
        raise InputError("grid", "a map of something", "an empty one", hint="Map some views first.")
    return window


def write_dense(grid: ConfidenceGrid, path: str | PathLike[str]) -> None:
    """Write the dense arrays of a map, to be read with `numpy.load`.

    ``confidence`` (float32), ``count`` and ``drop_offs`` (uint32) are indexed ``[row, col]``,
    ``[layer, row, col]`` in 3-D; ``resolution`` [m/cell]; ``origin`` (x, y) [m, map] is the outer
    corner of cell (0, 0).

    Raises
    ------
    InputError
        An empty map.
    OSError
        The folder does not exist or can't be written to.
    """
    window = dense_window(grid)

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(
            stream,
            allow_pickle=False,
            confidence=window.confidence,
            count=window.count,
            drop_offs=window.drop_offs,
            resolution=np.float64(window.resolution),
            origin=window.origin,
        )

    write_atomically(path, write)
