"""Reader of the queries of the MovingAI benchmark: ``.scen`` and ``.3dscen``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from groundmap.errors import FileFormatError
from groundmap.io.rows import SHOWN_CHARACTERS, open_rows

MOST, MOST_DIGITS = 2**31, 20  # of a whole number
COLUMNS = "bucket, map, width, height, start x, y, goal x, y, length"
VOXEL_COLUMNS = "start x, y, z, goal x, y, z, length, ratio"


class MovingAIQuery(NamedTuple):
    """One row: start, goal, and the published length of the shortest path."""

    map_file: Path  #: beside the file of queries, whose own folders are ignored
    shape: tuple[int, ...]  #: rows and columns that the map must have; empty for voxels
    start: tuple[int, ...]  #: cell ``[row, col]``, or voxel ``[layer, row, col]``
    goal: tuple[int, ...]  #: likewise
    length: float  #: of the shortest path over moves between neighbouring cells [cells]
    line: int  #: one-based line of the file

    @property
    def solvable(self) -> bool:
        """Whether a path exists; some files state length 0 if there is none."""
        return self.length > 0 or self.start == self.goal


def read_movingai_scen(path: str | PathLike[str]) -> list[MovingAIQuery]:
    r"""Read the queries of a ``.scen``, or of a ``.3dscen``.

    Columns are separated by any white space, and lines may end in any way. Files name maps by their
    path in the benchmark; here a map is the file of the same base name beside the queries.

    Parameters
    ----------
    path : path
        Queries on voxels if it ends in ``.3dscen``.

    Raises
    ------
    FileFormatError
        A missing file, a version other than 1, or a row that is not a query.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "arena.map.scen"
    ...     _ = path.write_text("version 1\n0 maps/dao/arena.map 49 49 1 11 3 12 2.41421\n")
    ...     [query] = read_movingai_scen(path)
    >>> query.map_file.name, query.start, query.goal, query.length, query.solvable
    ('arena.map', (11, 1), (12, 3), 2.41421, True)
    """
    path = Path(path)
    with open_rows(path) as stream:
        lines = ((number, line.strip()) for number, line in enumerate(stream, start=1))
        filled = ((number, line) for number, line in lines if line)
        _check_version(path, filled)
        if path.suffix.lower() == ".3dscen":
            return _voxel_queries(path, filled)
        return [_query(path, number, line) for number, line in filled]


def _check_version(path: Path, lines: Iterator[tuple[int, str]]) -> None:
    number, line = next(lines, (1, ""))
    key, *numbers = line.split() or [""]
    if key != "version" or numbers not in (["1"], ["1.0"]):
        raise FileFormatError(path, "'version 1'", repr(line[:SHOWN_CHARACTERS]), line=number)


def _query(path: Path, number: int, line: str) -> MovingAIQuery:
    # Split from both sides: the name of a map may contain spaces.
    bucket, _, rest = line.replace("\t", " ").partition(" ")
    words = rest.rsplit(maxsplit=7)
    if len(words) != 8:
        raise _offence(path, number, line, COLUMNS)
    try:
        _whole(bucket)
        cols, rows, *ends = map(_whole, words[1:7])
        length = float(words[7])
    except ValueError as error:
        raise _offence(path, number, line, COLUMNS) from error
    start, goal = (ends[1], ends[0]), (ends[3], ends[2])
    for place, (row, col) in (("start", start), ("goal", goal)):
        if not (0 <= row < rows and 0 <= col < cols):
            expected = f"a {place} on the map of {cols} x {rows} cells"
            raise FileFormatError(path, expected, f"{col}, {row}", line=number)
    _check_length(path, number, length)
    return MovingAIQuery(_beside(path, words[0]), (rows, cols), start, goal, length, number)


def _voxel_queries(path: Path, lines: Iterator[tuple[int, str]]) -> list[MovingAIQuery]:
    number, name = next(lines, (2, ""))
    if not name:
        raise FileFormatError(path, "the name of a map", "none", line=number)
    map_file = _beside(path, name)
    return [_voxel_query(path, number, line, map_file) for number, line in lines]


def _voxel_query(path: Path, number: int, line: str, map_file: Path) -> MovingAIQuery:
    words = line.split()
    try:
        ends = [_whole(word) for word in words[:6]]
        length, _ = map(float, words[6:])
    except ValueError as error:
        raise _offence(path, number, line, VOXEL_COLUMNS) from error
    if min(ends) < 0:
        raise FileFormatError(path, "voxels from 0 0 0 on", repr(line), line=number)
    _check_length(path, number, length)
    start, goal = (tuple(ends[i : i + 3][::-1]) for i in (0, 3))
    return MovingAIQuery(map_file, (), start, goal, length, number)


def _whole(word: str) -> int:
    """Return a whole number of 32 bits.

    Raises
    ------
    ValueError
    """
    number = int(word) if len(word) <= MOST_DIGITS else MOST
    if not -MOST < number < MOST:
        raise ValueError(word)
    return number


def _check_length(path: Path, number: int, length: float) -> None:
    if not (math.isfinite(length) and length >= 0):
        raise FileFormatError(path, "a length of 0 or more", f"{length:g}", line=number)


def _beside(path: Path, name: str) -> Path:
    return path.with_name(PurePosixPath(name.replace("\\", "/")).name)


def _offence(path: Path, number: int, line: str, columns: str) -> FileFormatError:
    return FileFormatError(path, columns, repr(line[:SHOWN_CHARACTERS]), line=number)
