"""Maps of blocked cells, and the reader of Nav2's map_server files."""

from __future__ import annotations

import math
import re
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Bools
from groundmap.errors import FileFormatError
from groundmap.files.documents import read_yaml
from groundmap.grid.grid import ConfidenceGrid
from groundmap.io.greys import read_greys
from groundmap.printable import format_value

ROS_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
NEGATE = {"0": False, "false": False, "no": False, "off": False,
          "1": True, "true": True, "yes": True, "on": True}  # fmt: skip
MOST_TURN = 1e-9  # [rad]: 0.001 cells over a million cells


class BlockedMap(NamedTuple):
    """Blocked cells of a map; arrays are indexed ``[row, col]``, row growing along y."""

    blocked: Bools  #: shape (rows, cols)
    unknown: Bools  #: shape (rows, cols); neither blocked nor free
    resolution: float  #: side of a cell [m]
    origin: tuple[float, float]  #: (x, y) of the outer corner of cell (0, 0) [m]


class BlockedVoxels(NamedTuple):
    """Blocked cells of a 3-D map; indexed ``[layer, row, col]``, layers along z."""

    blocked: Bools  #: shape (layers, rows, cols)
    resolution: float  #: side of a voxel [m]
    origin: tuple[float, float, float]  #: (x, y, z) of the outer corner of voxel (0, 0, 0) [m]


def grid_of(found: BlockedMap | BlockedVoxels, *, frame: str = "map") -> ConfidenceGrid:
    """Return the confidence grid of a map of blocked cells.

    Blocked cells have confidence 1, free cells -1, and a count of one view each.

    Parameters
    ----------
    found : BlockedMap or BlockedVoxels
    frame : str, default "map"
        Name of the grid's frame.

    Examples
    --------
    >>> blocked, unknown = np.array([[True, False, False]]), np.array([[False, False, True]])
    >>> grid = grid_of(BlockedMap(blocked, unknown, 0.5, (1.0, 2.0)))
    >>> xy = [(1.1, 2.1), (1.6, 2.1), (2.1, 2.1)]
    >>> grid.confidence_at(xy).tolist(), grid.count_at(xy).tolist()
    ([1.0, -1.0, 0.0], [1, 1, 0])
    """
    grid = ConfidenceGrid(resolution=found.resolution, origin=found.origin, frame=frame)
    side = grid.tile_shape[0]
    for first in range(0, len(found.blocked), side):  # one row or layer of tiles at a time
        part = slice(first, first + side)
        z = np.where(found.blocked[part], np.float32(1.0), np.float32(-1.0))
        if isinstance(found, BlockedMap):
            z[found.unknown[part]] = 0.0
        grid.fuse(np.array([first] + [0] * (z.ndim - 1)), z)
    return grid


def read_ros_map(path: str | PathLike[str]) -> BlockedMap:
    """Read a map of Nav2's map_server as map_server does; its mode must be trinary.

    A cell is blocked if its darkness is above ``occupied_thresh``, free if it is below
    ``free_thresh``, otherwise unknown. Darkness is (white - grey) / white, or grey / white if
    ``negate`` is 1; grey is the mean of all channels, including opacity. Row 0 has the smallest y:
    it is the lowest row of the image.

    Parameters
    ----------
    path : path
        The ``.yaml`` file. The path of its image is relative to its folder.

    Raises
    ------
    FileFormatError
        A file that is missing or not readable, a key that is missing or invalid, an origin with a
        yaw.
    """
    path = Path(path)
    keys = _read_keys(path)
    resolution = _number(path, keys["resolution"], "resolution")
    if resolution <= 0:
        raise FileFormatError(path, "resolution above 0 [m]", f"{resolution:g}")
    free, occupied = (_number(path, keys[key], key) for key in ("free_thresh", "occupied_thresh"))
    if not 0 <= free <= occupied <= 1:
        got = f"{free:g} and {occupied:g}"
        raise FileFormatError(path, "0 <= free_thresh <= occupied_thresh <= 1", got)
    negate = _negate(path, keys["negate"])
    origin = _origin(path, keys["origin"])
    grey, white = read_greys(path.parent / _image(path, keys), f"the image of {path.name}")
    levels = np.arange(white + 1)
    # Whole numbers up to the quotient: grey 205 is the float nearest to 50 / 255, which compares
    # exactly with a threshold of the same value.
    darkness = (levels if negate else white - levels) / white
    blocked = darkness > occupied
    unknown = ~blocked & (darkness >= free)
    return BlockedMap(blocked[grey[::-1]], unknown[grey[::-1]], resolution, origin)


def image_of(path: Path) -> Path:
    """Return the image that a map of map_server names.

    Raises
    ------
    FileFormatError
        A file that is missing or not readable, or names no image.
    """
    return path.parent / _image(path, _read_keys(path))


def _image(path: Path, keys: dict[str, Any]) -> str:
    name = keys["image"]
    if not isinstance(name, str) or not name:
        raise FileFormatError(path, "the name of an image", format_value(name))
    return name


def _read_keys(path: Path) -> dict[str, Any]:
    keys = read_yaml(path)
    if not isinstance(keys, dict):
        got = "a list" if isinstance(keys, list) else "text" if keys else "an empty file"
        raise FileFormatError(path, "keys and values", got)
    for key in ROS_KEYS:
        if key not in keys:
            raise FileFormatError(path, f"the key {key!r}", "none")
    mode = keys.get("mode", "trinary")
    if not isinstance(mode, str) or mode.lower() != "trinary":
        raise FileFormatError(path, "mode trinary", format_value(mode))
    return keys


def _number(path: Path, text: Any, key: str) -> float:
    number = float(text) if isinstance(text, str) and NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise FileFormatError(path, f"a number for {key!r}", format_value(text))
    return number


def _negate(path: Path, text: Any) -> bool:
    if not isinstance(text, str) or text.lower() not in NEGATE:
        raise FileFormatError(path, "negate 0 or 1", format_value(text))
    return NEGATE[text.lower()]


def _origin(path: Path, value: Any) -> tuple[float, float]:
    if not (isinstance(value, list) and len(value) == 3):
        raise FileFormatError(path, "an origin of [x, y, yaw]", format_value(value))
    x, y, yaw = (_number(path, part, "origin") for part in value)
    if abs(math.remainder(yaw, math.tau)) > MOST_TURN:
        raise FileFormatError(path, "an origin of yaw 0", f"{yaw:g}", hint="Rotate the image.")
    return x, y
