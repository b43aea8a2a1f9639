"""Maps that others drew: those of Nav2's map_server, and of the MovingAI benchmark."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from PIL import Image

from groundmap.arrays import Bools, Floats
from groundmap.errors import FileFormatError, InputError
from groundmap.io.rows import opened

ROS_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
PASSABLE, BLOCKED = ".GS", "@OTW"


class BlockedMap(NamedTuple):
    """Which cells of a map are blocked; arrays are indexed ``[row, col]``, row growing along y."""

    blocked: Bools  #: shape (rows, cols)
    unknown: Bools  #: shape (rows, cols); neither blocked nor free
    resolution: float  #: side of a cell [m]
    origin: tuple[float, float]  #: (x, y) of the outer corner of cell (0, 0) [m]


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


def read_movingai_map(path: str | PathLike[str], *, resolution: float = 1.0) -> BlockedMap:
    """Read a ``.map`` of the MovingAI benchmark.

    ``.``, ``G`` and ``S`` (swamp) are free; ``@``, ``O``, ``T`` (trees) and ``W`` (water) are
    blocked. The file's first row is row 0, at y = 0: a query's x and y are col and row. Where y
    points upwards the map therefore shows as in a mirror.

    Parameters
    ----------
    path : path
    resolution : float, default 1 [m]
        Side of a cell.

    Raises
    ------
    FileFormatError
        A file that is missing, a header without sizes, a row too many, too few, too short or too
        long, an unknown kind of cell.
    InputError
        A resolution that is not above 0.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError("resolution", "a number above 0 [m]", str(resolution))
    path = Path(path)
    with opened(path) as stream:
        lines = [line.rstrip() for line in stream]
    first, rows, cols = _movingai_header(path, lines)
    while len(lines) > first and not lines[-1]:
        lines.pop()
    cells = lines[first:]
    for number, line in enumerate(cells[:rows], start=first + 1):
        _check_row(path, line, number, cols)
    if len(cells) != rows:
        hint = "Was the file cut short?" if len(cells) < rows else ""
        raise FileFormatError(path, f"{rows} rows", str(len(cells)), hint=hint)
    kinds = np.frombuffer("".join(cells).encode(), dtype="S1").reshape(rows, cols)
    blocked = np.isin(kinds, np.frombuffer(BLOCKED.encode(), dtype="S1"))
    return BlockedMap(blocked, np.zeros_like(blocked), float(resolution), (0.0, 0.0))


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


def _movingai_header(path: Path, lines: list[str]) -> tuple[int, int, int]:
    """Return how many lines the header has, and the map's rows and columns."""
    sizes: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        if line == "map":
            break
        key, _, value = line.partition(" ")
        if key in ("height", "width"):
            if not (value.strip().isdecimal() and int(value) > 0):
                raise FileFormatError(path, f"{key} and a number above 0", repr(line), line=number)
            sizes[key] = int(value)
        elif key not in ("type", "version"):
            expected = "type, height, width or map"
            raise FileFormatError(path, expected, repr(line[:60]), line=number)
    else:
        raise FileFormatError(path, "a line 'map'", "none")
    for key in ("height", "width"):
        if key not in sizes:
            raise FileFormatError(path, f"{key} before the map", "none", line=number)
    return number, sizes["height"], sizes["width"]


def _check_row(path: Path, line: str, number: int, cols: int) -> None:
    if len(line) != cols:
        raise FileFormatError(path, f"{cols} cells", str(len(line)), line=number)
    strange = line.translate(dict.fromkeys(map(ord, PASSABLE + BLOCKED)))
    if strange:
        expected = f"cells of {' '.join(PASSABLE + BLOCKED)}"
        raise FileFormatError(path, expected, repr(strange[0]), line=number)
