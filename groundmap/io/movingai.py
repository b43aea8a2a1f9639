"""Readers of the maps of the MovingAI benchmark: ``.map``, and ``.3dmap`` for voxels."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np

from groundmap.errors import FileFormatError, InputError
from groundmap.io.map_images import BlockedMap, BlockedVoxels
from groundmap.io.rows import SHOWN_CHARACTERS, open_rows, read_rows, record

PASSABLE, BLOCKED = ".GS", "@OTW"
MOST_VOXELS = 2**27  # their map takes 1 GiB
MOST_DIGITS = 9  # of the length of a side


def read_movingai_map(path: str | PathLike[str], *, resolution: float = 1.0) -> BlockedMap:
    """Read a ``.map`` of the MovingAI benchmark.

    ``.``, ``G`` and ``S`` (swamp) are free; ``@``, ``O``, ``T`` (trees) and ``W`` (water) are
    blocked. The file's first row is row 0, at y = 0: x and y of a query are col and row. A plot
    with y pointing upwards therefore mirrors the map.

    Parameters
    ----------
    path : path
    resolution : float, default 1 [m]
        Side of a cell.

    Raises
    ------
    FileFormatError
        A missing file, a header without sizes, a wrong number of rows, a row of a wrong length, an
        unknown kind of cell.
    InputError
        A resolution that is not positive.
    """
    _check_resolution(resolution)
    path = Path(path)
    with open_rows(path) as stream:
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


def read_movingai_voxels(path: str | PathLike[str], *, resolution: float = 1.0) -> BlockedVoxels:
    """Read a ``.3dmap`` of the MovingAI benchmark.

    The first line is ``voxel X Y Z``, the map's size; each further line holds x, y and z of a
    blocked voxel. They are col, row and layer.

    Parameters
    ----------
    path : path
    resolution : float, default 1 [m]
        Side of a voxel.

    Raises
    ------
    FileFormatError
        A missing file, an invalid first line, a line that is not a voxel of the map.
    InputError
        A resolution that is not positive.
    """
    _check_resolution(resolution)
    path = Path(path)
    size = _voxel_header(path)
    blocked = np.zeros(size[::-1], dtype=np.bool_)
    for rows in read_rows(path, record(["x", "y", "z"], 0), header=True):
        voxels = np.column_stack([rows.values[axis] for axis in "xyz"])
        outside = ((voxels < 0) | (voxels >= size)).any(axis=1)
        if outside.any():
            first = int(np.flatnonzero(outside)[0])
            shown = " ".join(map(str, voxels[first].tolist()))
            expected = f"a voxel from 0 0 0 to {' '.join(str(side - 1) for side in size)}"
            raise FileFormatError(path, expected, repr(shown), line=int(rows.lines[first]))
        blocked[tuple(voxels.T[::-1])] = True
    return BlockedVoxels(blocked, float(resolution), (0.0, 0.0, 0.0))


def _check_resolution(resolution: float) -> None:
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError("resolution", "a number above 0 [m]", str(resolution))


def _voxel_header(path: Path) -> tuple[int, int, int]:
    """Return the size that the first line states: along x, y and z."""
    with open_rows(path) as stream:
        line = stream.readline().strip()
    key, *sides = line.split() or [""]
    if key != "voxel" or len(sides) != 3 or not all(map(str.isdecimal, sides)):
        raise FileFormatError(path, "'voxel X Y Z'", repr(line[:60]), line=1)
    x, y, z = map(_side, sides)
    if not 0 < x * y * z <= MOST_VOXELS:
        expected = f"1 to {MOST_VOXELS} voxels"
        raise FileFormatError(path, expected, " x ".join(sides), line=1)
    return x, y, z


def _side(text: str) -> int:
    """Return the length of a side of a map; 0 if the text is not a length."""
    return int(text) if text.isdecimal() and len(text) <= MOST_DIGITS else 0


def _movingai_header(path: Path, lines: list[str]) -> tuple[int, int, int]:
    """Return the number of lines of the header, and the rows and columns of the map."""
    sizes: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        if line == "map":
            break
        key, _, value = line.partition(" ")
        if key in ("height", "width"):
            sizes[key] = _side(value.strip())
            if not sizes[key]:
                got = repr(line[:SHOWN_CHARACTERS])
                raise FileFormatError(path, f"{key} and a number above 0", got, line=number)
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
