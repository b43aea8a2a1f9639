"""Maps for other programs, by the suffix of the file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from groundmap.errors import InputError
from groundmap.grid import ConfidenceGrid
from groundmap.io.dense import write_dense
from groundmap.io.ros_map import write_ros_map

EXPORTERS: dict[str, Callable[[ConfidenceGrid, str | PathLike[str]], None]] = {
    ".npz": write_dense,
    ".yaml": write_ros_map,
}


def export(grid: ConfidenceGrid, path: str | PathLike[str]) -> None:
    """Write a map in the form that the file's suffix names, a key of `EXPORTERS`.

    Raises
    ------
    InputError
        Another suffix, an empty map, or one that the form can't hold.
    OSError
        The folder does not exist or can't be written to.

    Examples
    --------
    >>> export(ConfidenceGrid(), "map.png")
    Traceback (most recent call last):
        ...
    groundmap.errors.InputError: path: expected a file that ends in .npz or .yaml, got 'map.png'.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in EXPORTERS:
        known = " or ".join(EXPORTERS)
        raise InputError("path", f"a file that ends in {known}", repr(Path(path).name))
    EXPORTERS[suffix](grid, path)
