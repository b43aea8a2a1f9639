"""Export of maps for other programs, by the suffix of the file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Protocol

import numpy.typing as npt

from groundmap.errors import InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.io.dense import write_dense
from groundmap.io.ros_map import write_ros_map


class Exporter(Protocol):
    """Writes the part of a map within bounds to a file; default: the whole map."""

    def __call__(
        self,
        grid: ConfidenceGrid,
        path: str | PathLike[str],
        *,
        bounds: npt.ArrayLike | None = None,
    ) -> None:
        """Write the map.

        Parameters
        ----------
        grid : ConfidenceGrid
        path : path
        bounds : array_like, shape (2 d,), optional
            As for `export`.
        """


EXPORTERS: dict[str, Exporter] = {
    ".npz": write_dense,
    ".yaml": write_ros_map,
}


def files_written(path: str | PathLike[str]) -> list[Path]:
    """Return the files that `export` writes: `path`, and the image beside a ``.yaml``.

    Raises
    ------
    InputError
        A suffix that is not in `EXPORTERS`.

    Examples
    --------
    >>> [file.name for file in files_written("maps/depot.yaml")]
    ['depot.yaml', 'depot.pgm']
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in EXPORTERS:
        known = " or ".join(EXPORTERS)
        raise InputError("path", f"a file that ends in {known}", repr(path.name))
    return [path, path.with_suffix(".pgm")] if suffix == ".yaml" else [path]


def export(
    grid: ConfidenceGrid, path: str | PathLike[str], *, bounds: npt.ArrayLike | None = None
) -> None:
    """Write a map in the format of the file's suffix, a key of `EXPORTERS`.

    Parameters
    ----------
    grid : ConfidenceGrid
    path : path
    bounds : array_like, shape (2 d,), optional
        Part to write, lower, then upper corner [m, map]; default: all observed cells.

    Raises
    ------
    InputError
        An unknown suffix, an empty map, a map that the format does not support, invalid bounds, or
        a box with more cells than `ConfidenceGrid.window` returns.
    OSError
        The folder does not exist or is not writable.

    Examples
    --------
    >>> export(ConfidenceGrid(), "map.png")
    Traceback (most recent call last):
        ...
    groundmap.errors.InputError: path: expected a file that ends in .npz or .yaml, got 'map.png'.
    """
    files_written(path)
    EXPORTERS[Path(path).suffix.lower()](grid, path, bounds=bounds)
