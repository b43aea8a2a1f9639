"""The SQLite form of maps of stella_vslam (0.4 and later)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.errors import FileFormatError
from groundmap.files.databases import Database, has_tables, open_database
from groundmap.files.documents import WrongDocumentError, parse_json
from groundmap.io.readers.assembly import compose
from groundmap.io.readers.fields import Fields
from groundmap.io.readers.stella_parts import StellaMap, camera_of

EXPECTED = "a map of stella_vslam (sqlite3)"
TABLES = {"keyframes", "landmarks", "associations"}
KEYPOINT = np.dtype([("pt", "<f4", (2,)), ("rest", "<f4", (5,))])  # OpenCV's KeyPoint


def is_stella_database(path: Path) -> bool:
    """Return whether a database has the tables of a map."""
    return has_tables(path, TABLES)


def read_database(path: Path) -> StellaMap:
    """Read a map.

    Raises
    ------
    FileFormatError
        A missing table or column, or a value of another kind.
    """
    found = StellaMap()
    with open_database(path, EXPECTED) as database:
        tables = database.tables()
        missing = sorted((TABLES | {"cameras"}) - set(tables))
        if missing:
            raise FileFormatError(path, f"{EXPECTED} with a table {missing[0]}", "none")
        for values in _records(database, tables, "cameras"):
            _add_camera(found, path, values)
        for values in _records(database, tables, "landmarks"):
            found.landmark_ids.append(_whole(path, values, "id"))
            found.landmarks.append(_blob(path, values, "pos_w", "<f8", 3))
        seen = {
            _whole(path, values, "id"): _blob(path, values, "lm_ids", "<i4").astype(np.int64)
            for values in _records(database, tables, "associations")
        }
        for values in _records(database, tables, "keyframes"):
            _add_keyframe(found, path, values, seen)
    return found


def _records(database: Database, tables: dict[str, list[str]], table: str) -> list[dict[str, Any]]:
    names = tables[table]
    rows = database.rows(f'SELECT * FROM "{table}"')
    return [dict(zip(names, row, strict=True)) for row in rows]


def _value(path: Path, values: dict[str, Any], name: str) -> Any:
    if name not in values:
        raise FileFormatError(path, f"{EXPECTED} with a column {name}", "none")
    return values[name]


def _whole(path: Path, values: dict[str, Any], name: str) -> int:
    value = _value(path, values, name)
    if not isinstance(value, int):
        raise FileFormatError(path, f"whole numbers in the column {name}", repr(value)[:60])
    return value


def _text(path: Path, values: dict[str, Any], name: str) -> str:
    value = _value(path, values, name)
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if not isinstance(value, str):
        raise FileFormatError(path, f"texts in the column {name}", repr(value)[:60])
    return value


def _blob(
    path: Path, values: dict[str, Any], name: str, dtype: npt.DTypeLike, count: int | None = None
) -> npt.NDArray[Any]:
    value, row = _value(path, values, name), np.dtype(dtype)
    fits = isinstance(value, bytes) and len(value) % row.itemsize == 0
    if not fits or (count is not None and len(value) != count * row.itemsize):
        size = f"{count or 'n'} values of {row.itemsize} bytes"
        got = f"{len(value)} bytes" if isinstance(value, bytes) else repr(value)[:60]
        raise FileFormatError(path, f"{size} in the column {name}", got)
    return np.frombuffer(value, row)


def _add_camera(found: StellaMap, path: Path, values: dict[str, Any]) -> None:
    content = {key: value for key, value in values.items() if not isinstance(value, bytes)}
    for key, value in values.items():
        if isinstance(value, bytes) and key != "id":
            text = value.decode("utf-8", "replace")
            content[key] = text
            if text.startswith("{"):  # all values of a camera as JSON
                try:
                    content |= parse_json(text)
                except WrongDocumentError as error:
                    raise FileFormatError(path, "a camera in JSON", str(error)) from error
    name = content.get("name", content.get("id"))
    found.cameras[str(name)] = camera_of(Fields(path, content, "cameras"))


def _add_keyframe(
    found: StellaMap, path: Path, values: dict[str, Any], seen: dict[int, Any]
) -> None:
    number = _whole(path, values, "id")
    # Eigen stores matrices by columns.
    pose_cw = _blob(path, values, "pose_cw", "<f8", 16).reshape(4, 4).T
    keypoints = _blob(path, values, "undist_keypts", KEYPOINT)["pt"].astype(np.float64)
    ids = seen.get(number, np.empty(0, dtype=np.int64))
    if len(ids) > len(keypoints):
        expected = f"at most {len(keypoints)} landmarks of keyframe {number}"
        raise FileFormatError(path, expected, str(len(ids)))
    chosen = np.flatnonzero(ids >= 0)
    pose = compose(pose_cw[None, :3, :3], pose_cw[None, :3, 3], world_to_camera=True)[0]
    timestamp = _value(path, values, "ts")
    if not isinstance(timestamp, (int, float)):
        raise FileFormatError(path, "numbers in the column ts", repr(timestamp)[:60])
    found.add_keyframe(
        number,
        timestamp=float(timestamp),
        camera=_text(path, values, "cam"),
        pose=pose,
        seen=ids[chosen],
        pixels=keypoints[chosen],
    )
