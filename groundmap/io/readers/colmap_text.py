"""The text files of a model of COLMAP."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.io.readers.colmap_parts import MODELS, Model
from groundmap.io.rows import open_rows

SHOWN = 60  # characters of a line in a message


def read_text(folder: Path) -> Model:
    """Read ``cameras.txt``, ``images.txt`` and ``points3D.txt``."""
    camera_ids, cameras = _cameras(folder / "cameras.txt")
    images = _images(folder / "images.txt")
    return Model(camera_ids, cameras, *images, *_points(folder / "points3D.txt"))


def _lines(stream: TextIO) -> Iterator[tuple[int, str]]:
    """Yield the lines with their number, without comments; blank lines carry meaning."""
    for number, line in enumerate(stream, start=1):
        if not line.startswith("#"):
            yield number, line.strip()


def _cameras(path: Path) -> tuple[Ints, list[tuple[str, int, int, Floats]]]:
    ids, cameras = [], []
    with open_rows(path) as stream:
        for number, line in _lines(stream):
            words = line.split()
            if not words:
                continue
            model = words[1] if len(words) > 1 else ""
            if model not in MODELS:
                raise FileFormatError(
                    path, f"a camera model of {', '.join(MODELS)}", repr(model), line=number
                )
            count = MODELS[model]
            if len(words) != 4 + count:
                expected = f"{4 + count} columns for the model {model}"
                raise FileFormatError(path, expected, f"{len(words)}", line=number)
            params = _floats(path, words[4:], number)
            ids.append(_whole(path, words[0], number))
            size = (_whole(path, words[2], number), _whole(path, words[3], number))
            cameras.append((model, *size, params))
    return np.array(ids, dtype=np.int64), cameras


def _images(path: Path) -> tuple[Ints, Floats, Ints, list[str], Ints, Floats, Ints]:
    ids, poses, cameras, names = [], [], [], []
    keypoints: list[Floats] = []
    with open_rows(path) as stream:
        lines = _lines(stream)
        for number, line in lines:
            if not line:
                continue
            words = line.split(None, 9)
            if len(words) != 10:
                expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"
                raise FileFormatError(path, expected, repr(line[:SHOWN]), line=number)
            ids.append(_whole(path, words[0], number))
            poses.append(_floats(path, words[1:8], number))
            cameras.append(_whole(path, words[8], number))
            names.append(words[9])
            second, points = next(lines, (number + 1, ""))
            keypoints.append(_triples(path, points, second))
    table = np.concatenate([np.empty((0, 3)), *keypoints])
    counts = np.array([len(rows) for rows in keypoints], dtype=np.int64)
    matrix = np.array(poses, dtype=np.float64).reshape(-1, 7)
    return (
        np.array(ids, dtype=np.int64),
        matrix,
        np.array(cameras, dtype=np.int64),
        names,
        counts,
        table[:, :2],
        _as_ids(path, table[:, 2]),
    )


def _points(path: Path) -> tuple[Ints, Floats, Ints, Ints]:
    ids, points, counts = [], [], []
    tracks: list[list[str]] = []
    with open_rows(path) as stream:
        for number, line in _lines(stream):
            words = line.split()
            if not words:
                continue
            if len(words) < 8 or len(words) % 2:
                expected = "POINT3D_ID X Y Z R G B ERROR and pairs of IMAGE_ID POINT2D_IDX"
                raise FileFormatError(path, expected, f"{len(words)} columns", line=number)
            ids.append(_whole(path, words[0], number))
            points.append(words[1:4])
            tracks.append(words[8::2])
            counts.append(len(words[8::2]))
    images = _all_whole(path, [word for track in tracks for word in track])
    xyz = _all_floats(path, points)
    return np.array(ids, dtype=np.int64), xyz, np.array(counts, dtype=np.int64), images


def _triples(path: Path, line: str, number: int) -> Floats:
    values = _floats(path, line.split(), number)
    if len(values) % 3:
        raise FileFormatError(path, "triples X Y POINT3D_ID", f"{len(values)} numbers", line=number)
    return values.reshape(-1, 3)


def _floats(path: Path, words: list[str], number: int) -> Floats:
    try:
        return np.array(words, dtype=np.float64)
    except ValueError as error:
        shown = repr(" ".join(words)[:SHOWN])
        raise FileFormatError(path, "numbers", shown, line=number) from error


def _all_floats(path: Path, rows: list[list[str]]) -> Floats:
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise FileFormatError(path, "numbers X Y Z", f"something else ({error})") from error


def _whole(path: Path, word: str, number: int) -> int:
    try:
        value = int(word)
    except ValueError as error:
        raise FileFormatError(path, "a whole number", repr(word[:SHOWN]), line=number) from error
    if not -(2**53) <= value <= 2**53:
        raise FileFormatError(path, "a whole number up to 2**53", word[:SHOWN], line=number)
    return value


def _all_whole(path: Path, words: list[str]) -> Ints:
    try:
        return np.array(words, dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise FileFormatError(path, "whole numbers in tracks", f"another ({error})") from error


def _as_ids(path: Path, values: Floats) -> Ints:
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~((np.rint(values) == values) & (np.abs(values) <= 2**53)))
    if len(wrong):
        expected = "ids of points that are whole numbers up to 2**53"
        raise FileFormatError(path, expected, f"{values[wrong[0]]:g}")
    return values.astype(np.int64)
