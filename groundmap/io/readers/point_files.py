"""Files of points without anything else: OBJ, PLY, PCD, and columns x y z."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.files.opening import read_file
from groundmap.io.readers.text_tables import read_words
from groundmap.io.rows import open_rows

MOST_BYTES = 2**31
MOST_HEADER = 100_000  # bytes
PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
PCD_TYPES = {"F": "f", "I": "i", "U": "u"}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read_points(path: Path) -> Floats:
    """Return the points of a file, shape (n, 3), by its first bytes.

    Raises
    ------
    FileFormatError
        A damaged file, or one of another layout.
    """
    data = read_file(path, "a file of points", most=MOST_BYTES)
    if data.startswith(b"ply"):
        return _ply(path, data)
    if b"FIELDS" in data[:MOST_HEADER] and b"\nDATA " in data[:MOST_HEADER]:
        return _pcd(path, data)
    if path.suffix.lower() == ".obj" or data.lstrip().startswith((b"v ", b"o ", b"g ", b"mtllib")):
        return _obj(path)
    return _columns(path)


def _columns(path: Path) -> Floats:
    numbers, counts, lines = read_words(path)
    wrong = np.flatnonzero(counts != counts[0]) if len(counts) else counts
    if not len(counts) or counts[0] < 3 or len(wrong):
        line = int(lines[wrong[0]]) if len(wrong) else 1
        raise FileFormatError(path, "rows of x y z", "other rows", line=line)
    return numbers.reshape(len(counts), -1)[:, :3]


def _obj(path: Path) -> Floats:
    points = []
    with open_rows(path) as stream:
        for number, line in enumerate(stream, start=1):
            words = line.split()
            if words[:1] == ["v"]:
                try:
                    points.append([float(word) for word in words[1:4]])
                except ValueError:
                    points.append([])
                if len(points[-1]) != 3:
                    shown = repr(line[:40])
                    raise FileFormatError(path, "vertices v x y z", shown, line=number)
    return np.array(points, dtype=np.float64).reshape(-1, 3)


def _ply(path: Path, data: bytes) -> Floats:
    end = data.find(b"end_header", 0, MOST_HEADER)
    if end < 0:
        raise FileFormatError(path, "a PLY header with end_header", "none")
    start = data.find(b"\n", end) + 1
    lines = [line.split() for line in data[:end].decode("ascii", "replace").splitlines()]
    form = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "")
    count, fields = _vertex(path, lines)
    if form == "ascii":
        rows = data[start:].decode("ascii", "replace").splitlines()[:count]
        return _text_rows(path, rows, count, [name for name, _ in fields])
    if form not in ORDERS:
        expected = f"the format ascii, {' or '.join(ORDERS)}"
        raise FileFormatError(path, expected, repr(form))
    dtype = np.dtype([(name, ORDERS[form] + kind) for name, kind in fields])
    return _binary_rows(path, data[start:], count, dtype)


def _vertex(path: Path, lines: list[list[str]]) -> tuple[int, list[tuple[str, str]]]:
    """Return the number of vertices, which must come first, and their fields."""
    elements = [row for row, line in enumerate(lines) if line[:1] == ["element"]]
    first = lines[elements[0]] if elements else []
    if len(first) != 3 or first[1] != "vertex" or not first[2].isdigit():
        raise FileFormatError(path, "vertices as the first element", " ".join(first) or "none")
    rest = lines[elements[0] + 1 : elements[1] if len(elements) > 1 else None]
    fields = []
    for line in rest:
        if line[:1] == ["property"]:
            if len(line) != 3 or line[1] not in PLY_TYPES:
                raise FileFormatError(path, "plain properties of vertices", " ".join(line)[:60])
            fields.append((line[2], PLY_TYPES[line[1]]))
    return int(first[2][:18]), fields


def _pcd(path: Path, data: bytes) -> Floats:
    place = data.find(b"\nDATA ", 0, MOST_HEADER) + 1
    start = data.find(b"\n", place) + 1
    head = {}
    for line in data[:start].decode("ascii", "replace").splitlines():
        words = line.split()
        if words and not words[0].startswith("#"):
            head[words[0]] = words[1:]
    names, form = head.get("FIELDS", []), (head.get("DATA") or [""])[0]
    points = (head.get("POINTS") or ["0"])[0]
    if not points.isdigit():
        raise FileFormatError(path, "a number of POINTS", repr(points))
    count = int(points[:18])
    if form == "ascii":
        rows = data[start:].decode("ascii", "replace").splitlines()[:count]
        return _text_rows(path, rows, count, names)
    if form != "binary":
        hint = "Convert it: pcl_convert_pcd_ascii_binary in.pcd out.pcd 1"
        raise FileFormatError(path, "DATA ascii or binary", repr(form), hint=hint)
    kinds, sizes = head.get("TYPE", []), head.get("SIZE", [])
    counts = head.get("COUNT", ["1"] * len(names))
    try:
        dtype = np.dtype(
            [
                (f"{name}{row}" if name == "_" else name, f"<{PCD_TYPES[kind]}{size}", int(number))
                for row, (name, kind, size, number) in enumerate(
                    zip(names, kinds, sizes, counts, strict=True)
                )
            ]
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(path, "TYPE, SIZE and COUNT of each field", str(error)) from error
    return _binary_rows(path, data[start:], count, dtype)


def _text_rows(path: Path, rows: list[str], count: int, names: list[str]) -> Floats:
    if len(rows) < count:
        raise FileFormatError(path, f"{count} points", f"{len(rows)}", hint="Was it cut short?")
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise FileFormatError(path, "points with x, y and z", f"no {missing[0]}")
    columns = [names.index(name) for name in "xyz"]
    try:
        chosen = [[row.split()[column] for column in columns] for row in rows]
        return np.array(chosen, dtype=np.float64).reshape(-1, 3)
    except (IndexError, ValueError) as error:
        raise FileFormatError(path, "numbers x y z", f"something else ({error})") from error


def _binary_rows(path: Path, data: bytes, count: int, dtype: np.dtype[np.void]) -> Floats:
    names = dtype.names or ()
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise FileFormatError(path, "points with x, y and z", f"no {missing[0]}")
    if count * dtype.itemsize > len(data):
        got = f"{len(data)} bytes"
        expected = f"{count} points of {dtype.itemsize} bytes"
        raise FileFormatError(path, expected, got, hint="Was it cut short?")
    rows = np.frombuffer(data, dtype, count)
    columns = [rows[name].reshape(count, -1)[:, 0].astype(np.float64) for name in "xyz"]
    return np.stack(columns, axis=-1).reshape(-1, 3)
