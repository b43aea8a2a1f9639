"""Loading of maps, by the suffix of the file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from groundmap.errors import InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.io.map_images import grid_of, image_of, read_ros_map
from groundmap.io.movingai import read_movingai_map, read_movingai_voxels

IMAGES = {".bmp", ".gif", ".jpeg", ".jpg", ".pgm", ".png", ".tif", ".tiff"}

LOADERS: dict[str, Callable[[Path], ConfidenceGrid]] = {
    ".npz": ConfidenceGrid.load,
    ".yaml": lambda path: grid_of(read_ros_map(path)),
    ".yml": lambda path: grid_of(read_ros_map(path)),
    ".map": lambda path: grid_of(read_movingai_map(path)),
    ".3dmap": lambda path: grid_of(read_movingai_voxels(path)),
}


def load_map(path: str | PathLike[str]) -> ConfidenceGrid:
    """Return the map in a file of any supported format.

    ``.npz``: a grid that `ConfidenceGrid.save` wrote; ``.yaml`` or ``.yml``: a map of Nav2's
    map_server, with its image; ``.map`` and ``.3dmap``: maps of the MovingAI benchmark, with cells
    of 1 m. Files with other suffixes are read as ``.npz``.

    Raises
    ------
    FileFormatError
        A file that is missing, or violates its format.
    InputError
        An image, which defines neither the size of its cells nor their place.

    Examples
    --------
    >>> load_map("maps/depot.pgm")
    Traceback (most recent call last):
        ...
    groundmap.errors.InputError: maps/depot.pgm: expected a map, got an image. Give the .yaml that \
names it, with its resolution, origin and thresholds.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in IMAGES:
        hint = "Give the .yaml that names it, with its resolution, origin and thresholds."
        raise InputError(str(path), "a map", "an image", hint=hint)
    return LOADERS.get(suffix, ConfidenceGrid.load)(path)


def files_of(path: str | PathLike[str]) -> list[Path]:
    """Return the files that `load_map` reads: the map's, and the image that a ``.yaml`` names.

    Raises
    ------
    FileFormatError
        A ``.yaml`` or ``.yml`` that is missing, or names no image.
    """
    path = Path(path)
    return [path, image_of(path)] if path.suffix.lower() in (".yaml", ".yml") else [path]
