"""Dense arrays of a map, for NumPy: ``.npz``."""

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
    """Return a box of a map, or the box around all that was seen, dense.

    Raises
    ------
    InputError
        Nothing was seen: an empty array has no place in the map. Bounds that are no box, or a box
        with too many cells.
    """
    window = grid.window(bounds)
    if not window.count.size:
        raise InputError("grid", "a map of something", "an empty one", hint="Map some views first.")
    return window


def write_dense(
    grid: ConfidenceGrid, path: str | PathLike[str], *, bounds: npt.ArrayLike | None = None
) -> None:
    """Write the dense arrays of a map, to be read with `numpy.load`.

    ``confidence`` (float32), ``count`` and ``drop_offs`` (uint32) are indexed ``[row, col]``,
    ``[layer, row, col]`` in 3-D; ``resolution`` [m/cell]; ``origin`` (x, y) [m, map] is the outer
    corner of cell (0, 0).

    Parameters
    ----------
    grid : ConfidenceGrid
    path : path
    bounds : array_like, shape (2 d,), optional
        Part to write, lower then upper corner [m, map]; all that was seen unless told.

    Raises
    ------
    InputError
        An empty map, bounds that are no box, or a box with too many cells.
    OSError
        The folder does not exist or can't be written to.
    """
    window = dense_window(grid, bounds)

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
