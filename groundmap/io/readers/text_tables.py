"""Text files of SLAM systems, recognised by the columns of their first rows."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.opening import open_text
from groundmap.io.readers.assembly import poses_from
from groundmap.io.rows import open_rows

TextKind = Literal["tum", "stella", "kitti", "euroc", "points", "sightings"]
SUFFIXES = {".txt", ".csv", ".obj", ".xyz", ".ply", ".pcd", ".tum", ".kitti", ".dat", ""}
SNIFFED_LINES = 40
SNIFFED_CHARACTERS = 200_000
QUATERNION_TOLERANCE = 0.02
NANOSECONDS = 1e14  # a stamp above it is in nanoseconds
MOST_WORDS = 50_000_000


class Trajectory(NamedTuple):
    """The poses of a text file."""

    path: Path
    stamps: Floats | None  #: shape (n,) [s]; None in KITTI's form, which has none
    poses: Floats  #: shape (n, 4, 4), camera or body to world


def first_rows(path: Path) -> list[list[str]]:
    """Return the words of the first lines of a text file, without comments and blank lines."""
    if not path.is_file():
        return []
    try:
        with open_text(path) as stream:
            text = stream.read(SNIFFED_CHARACTERS)
    except (OSError, FileFormatError):
        return []
    if "\0" in text:
        return []
    lines = text.splitlines()
    if len(text) == SNIFFED_CHARACTERS and len(lines) > 1:
        lines = lines[:-1]  # it may be cut
    rows = (_words(line) for line in lines)
    return list(islice((row for row in rows if row), SNIFFED_LINES))


def _words(line: str) -> list[str]:
    return line.partition("#")[0].replace(",", " ").replace(";", " ").split()


def kind_of(path: Path) -> TextKind | None:
    """Return what a text file contains, by the numbers of its first rows; None if unknown."""
    if path.suffix.lower() not in SUFFIXES:
        return None
    rows = first_rows(path)
    if not rows:
        return None
    if rows[0][0].lower() in ("ply", "v", "vn", "o", "g", "mtllib") or path.suffix == ".pcd":
        return "points" if _is_point_file(path, rows) else None
    try:
        table = [list(map(float, row)) for row in rows]
    except ValueError:
        return None
    widths = {len(row) for row in table}
    if widths in ({3}, {6}):
        return "points"
    if len(widths) == 1:
        kind = _pose_kind(np.array(table))
        if kind is not None:
            return kind
    return "sightings" if min(widths) >= 4 and _are_sightings(table) else None


def _pose_kind(table: Floats) -> TextKind | None:
    width = table.shape[1]
    if width == 12:
        rotation = table.reshape(-1, 3, 4)[:, :, :3]
        off = np.abs(rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)).max()
        return "kitti" if off < QUATERNION_TOLERANCE else None
    starts: dict[int, tuple[TextKind, int]] = {8: ("tum", 4), 9: ("stella", 5), 17: ("euroc", 4)}
    if width not in starts:
        return None
    kind, start = starts[width]
    lengths = np.linalg.norm(table[:, start : start + 4], axis=1)
    return kind if np.abs(lengths - 1.0).max() < QUATERNION_TOLERANCE else None


def _are_sightings(table: list[list[float]]) -> bool:
    """Return whether rows are a position and the ascending or whole numbers of its views."""
    stamps = [value for row in table for value in row[3:]]
    return all(value >= 0 for value in stamps)


def _is_point_file(path: Path, rows: list[list[str]]) -> bool:
    return rows[0][0] in ("ply", "v", "vn", "o", "g", "mtllib") or path.suffix == ".pcd"


def read_trajectory(path: Path, kind: TextKind) -> Trajectory:
    """Read the poses of a text file.

    Parameters
    ----------
    path : Path
    kind : {"tum", "stella", "kitti", "euroc"}

    Raises
    ------
    FileFormatError
        A row with another number of columns, or that is not numbers.
    """
    width = {"tum": 8, "stella": 9, "kitti": 12, "euroc": 17}[kind]
    table = _table(path, width)
    if kind == "kitti":
        poses = np.zeros((len(table), 4, 4))
        poses[:, :3] = table.reshape(-1, 3, 4)
        poses[:, 3, 3] = 1.0
        return Trajectory(path, None, poses)
    if kind == "stella":
        table = table[:, 1:]
    scalar_first = kind == "euroc"
    poses = poses_from(path, table[:, 4:8], table[:, 1:4], scalar_first=scalar_first)
    return Trajectory(path, seconds(table[:, 0]), poses)


def seconds(stamps: Floats) -> Floats:
    """Return stamps in seconds; ORB-SLAM3 and EuRoC write nanoseconds."""
    return np.where(np.abs(stamps) > NANOSECONDS, stamps / 1e9, stamps)


def _table(path: Path, width: int) -> Floats:
    numbers, counts, lines = read_words(path)
    wrong = np.flatnonzero(counts != width)
    if len(wrong):
        raise FileFormatError(
            path, f"{width} columns", str(counts[wrong[0]]), line=int(lines[wrong[0]])
        )
    return numbers.reshape(-1, width)


def read_words(path: Path) -> tuple[Floats, Ints, Ints]:
    """Return all numbers of a text file, how many each row has, and the lines of the rows.

    Raises
    ------
    FileFormatError
        A word that is not a number.
    """
    words: list[str] = []
    counts, lines = [], []
    with open_rows(path) as stream:
        for number, line in enumerate(stream, start=1):
            row = _words(line)
            if row:
                words.extend(row)
                counts.append(len(row))
                lines.append(number)
            if len(words) > MOST_WORDS:
                raise FileFormatError(path, f"at most {MOST_WORDS} numbers", "more")
    try:
        numbers = np.array(words, dtype=np.float64)
    except ValueError:
        raise _first_wrong(path, words, counts, lines) from None
    return numbers, np.array(counts, dtype=np.int64), np.array(lines, dtype=np.int64)


def _first_wrong(
    path: Path, words: list[str], counts: list[int], lines: list[int]
) -> FileFormatError:
    ends = np.cumsum(counts)
    for place, word in enumerate(words):
        try:
            np.array([word], dtype=np.float64)
        except ValueError:
            line = lines[int(np.searchsorted(ends, place, side="right"))]
            return FileFormatError(path, "numbers", repr(word[:40]), line=line)
    return FileFormatError(path, "numbers", "something else")
