"""Maps that others drew: blocked cells in memory, and Nav2's map_server files."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from PIL import Image

from groundmap.arrays import Bools, Floats
from groundmap.errors import FileFormatError
from groundmap.grid import ConfidenceGrid
from groundmap.io.rows import opened

ROS_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


class BlockedMap(NamedTuple):
    """Which cells of a map are blocked; arrays are indexed ``[row, col]``, row growing along y."""

    blocked: Bools  #: shape (rows, cols)
    unknown: Bools  #: shape (rows, cols); neither blocked nor free
    resolution: float  #: side of a cell [m]
    origin: tuple[float, float]  #: (x, y) of the outer corner of cell (0, 0) [m]


class BlockedVoxels(NamedTuple):
    """Which cells of a 3-D map are blocked; indexed ``[layer, row, col]``, layers along z."""

    blocked: Bools  #: shape (layers, rows, cols)
    resolution: float  #: side of a voxel [m]
    origin: tuple[float, float, float]  #: (x, y, z) of the outer corner of voxel (0, 0, 0) [m]


def grid_of(found: BlockedMap | BlockedVoxels, *, frame: str = "map") -> ConfidenceGrid:
    """Return a map to plan on: as if one view had seen every cell that is not unknown.

    Blocked cells have confidence 1, free ones -1.

    Examples
    --------
    >>> blocked, unknown = np.array([[True, False, False]]), np.array([[False, False, True]])
    >>> grid = grid_of(BlockedMap(blocked, unknown, 0.5, (1.0, 2.0)))
    >>> xy = [(1.1, 2.1), (1.6, 2.1), (2.1, 2.1)]
    >>> grid.confidence_at(xy).tolist(), grid.count_at(xy).tolist()
    ([1.0, -1.0, 0.0], [1, 1, 0])
    """
    grid = ConfidenceGrid(resolution=found.resolution, origin=found.origin, frame=frame)
    z = np.where(found.blocked, np.float32(1.0), np.float32(-1.0))
    if isinstance(found, BlockedMap):
        z[found.unknown] = 0.0
    grid.fuse(np.zeros(z.ndim, dtype=np.int64), z)
    return grid


def read_ros_map(path: str | PathLike[str]) -> BlockedMap:
    """Read a map of Nav2's map_server, of mode trinary, as map_server reads it.

    A cell is blocked if its darkness is above ``occupied_thresh``, free if it is below
    ``free_thresh``, otherwise unknown. Darkness is (white - grey) / white, or grey / white if
    ``negate`` is 1; grey is the mean of all channels, opacity among them. Row 0 is the smallest
    y: the image's lowest.

    Parameters
    ----------
    path : path
        The ``.yaml`` file. The image that it names is looked for from the folder it lies in.

    Raises
    ------
    FileFormatError
        A file that is missing or can't be read, a key that is missing or not what it should be, a
        map turned against its axes.
    """
    path = Path(path)
    keys = _read_yaml(path)
    resolution = _number(path, keys, "resolution")
    if resolution <= 0:
        raise FileFormatError(path, "resolution above 0 [m]", f"{resolution:g}")
    free, occupied = _number(path, keys, "free_thresh"), _number(path, keys, "occupied_thresh")
    if not 0 <= free <= occupied <= 1:
        got = f"{free:g} and {occupied:g}"
        raise FileFormatError(path, "0 <= free_thresh <= occupied_thresh <= 1", got)
    negate = _number(path, keys, "negate")
    if negate not in (0, 1):
        raise FileFormatError(path, "negate 0 or 1", f"{negate:g}")
    origin = _origin(path, keys["origin"])
    darkness = _read_darkness(path, keys["image"], negate=bool(negate))[::-1]
    blocked = darkness > occupied
    return BlockedMap(blocked, ~blocked & (darkness >= free), resolution, origin)


def image_of(path: Path) -> Path:
    """Return the image that a map of map_server names.

    Raises
    ------
    FileFormatError
        A file that is missing or can't be read, or names no image.
    """
    name = _read_yaml(path)["image"]
    if not isinstance(name, str):
        raise FileFormatError(path, "the name of an image", repr(name))
    return path.parent / name


def _read_yaml(path: Path) -> dict[str, Any]:
    with opened(path) as stream:
        try:
            keys = yaml.safe_load(stream)
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = None if mark is None else mark.line + 1
            raise FileFormatError(path, "YAML", "something else", line=line) from error
    if not isinstance(keys, dict):
        got = "an empty file" if keys is None else f"a {type(keys).__name__}"
        raise FileFormatError(path, "keys and values", got)
    for key in ROS_KEYS:
        if key not in keys:
            raise FileFormatError(path, f"the key {key!r}", "none")
    if keys.get("mode", "trinary") != "trinary":
        raise FileFormatError(path, "mode trinary", repr(keys["mode"]))
    return keys


def _number(path: Path, keys: dict[str, Any], key: str) -> float:
    try:
        number = float(keys[key])  # 1e-05 is text to YAML 1.1, and a number to map_server
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise FileFormatError(path, f"a number for {key!r}", repr(keys[key]))
    return number


def _origin(path: Path, value: Any) -> tuple[float, float]:
    if not (isinstance(value, list) and len(value) == 3):
        raise FileFormatError(path, "an origin of [x, y, yaw]", repr(value))
    x, y, yaw = (_number(path, {"origin": part}, "origin") for part in value)
    if yaw != 0:
        raise FileFormatError(path, "an origin of yaw 0", f"{yaw:g}", hint="Turn the image.")
    return x, y


def _read_darkness(path: Path, name: Any, *, negate: bool) -> Floats:
    """Return how dark the image is that a map names, from 0 (white, black if negated) to 1."""
    if not isinstance(name, str):
        raise FileFormatError(path, "the name of an image", repr(name))
    file = path.parent / name
    try:
        with Image.open(file) as image:
            deep = image.mode.startswith("I")  # 16 bits, of one channel
            channels = "RGBA" if image.has_transparency_data else "RGB"
            pixels = np.atleast_3d(np.asarray(image if deep else image.convert(channels)))
    except FileNotFoundError as error:
        raise FileFormatError(file, f"the image of {path.name}", "no such file") from error
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise FileFormatError(file, "an image", str(error)) from error
    # In whole numbers up to the quotient: grey 205 is the float nearest to 50 / 255, and a
    # threshold that says the same is met exactly.
    white = (65535 if deep else 255) * pixels.shape[-1]
    grey = pixels.sum(axis=-1, dtype=np.int64)
    darkness: Floats = (grey if negate else white - grey) / white
    return darkness
