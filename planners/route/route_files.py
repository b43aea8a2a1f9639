"""Routes as text: GeoJSON, CSV and ROS paths in YAML."""

from __future__ import annotations

import json
import math
from os import PathLike
from pathlib import Path
from typing import IO, Any, Literal, TypeAlias

import numpy as np
import yaml

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.files.archive import write_atomically

Format: TypeAlias = Literal["geojson", "csv", "path"]

FORMATS: dict[str, Format] = {
    ".geojson": "geojson",
    ".json": "geojson",
    ".csv": "csv",
    ".yaml": "path",
    ".yml": "path",
}


def format_of(path: str | PathLike[str]) -> Format:
    """Return the format of a route file, given by the suffix of its name.

    Raises
    ------
    InputError
        A suffix that `FORMATS` does not have.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        expected = f"a name that ends in {', '.join(FORMATS)}"
        raise InputError("path", expected, repr(str(path)))
    return FORMATS[suffix]


def csv_table(waypoints: Floats, headings: Floats) -> str:
    """Return a line per waypoint: x, y (and z) [m], yaw [rad], distance along the route [m].

    Parameters
    ----------
    waypoints : ndarray, shape (n, 2) or (n, 3) [m, map]
    headings : ndarray, shape (n,) [rad, map]
    """
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(steps))
    table = np.column_stack([waypoints, headings, along])
    lines = [",".join(map(repr, row)) for row in table.tolist()]
    axes = ",".join("xyz"[: waypoints.shape[1]])
    return "\n".join([f"{axes},yaw,distance", *lines, ""])


def path_message(frame: str, waypoints: Floats, headings: Floats) -> dict[str, Any]:
    """Return a dict with the structure of ROS's nav_msgs/Path: poses with quaternions.

    Parameters
    ----------
    frame : str
    waypoints : ndarray, shape (n, 2) or (n, 3) [m, map]
    headings : ndarray, shape (n,) [rad, map]
    """
    header = {"frame_id": frame, "stamp": {"sec": 0, "nanosec": 0}}
    poses = [
        {
            "header": header,
            "pose": {
                "position": dict(zip("xyz", [*place, 0.0], strict=False)),
                "orientation": _quaternion(yaw),
            },
        }
        for place, yaw in zip(waypoints.tolist(), headings.tolist(), strict=True)
    ]
    return {"header": header, "poses": poses}


def dump_json(document: dict[str, Any]) -> str:
    """Return a document as JSON."""
    return json.dumps(document, indent=2) + "\n"


def dump_yaml(document: dict[str, Any]) -> str:
    """Return a document as YAML."""
    return yaml.dump(document, Dumper=_PlainDumper, sort_keys=False)


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a file, all or nothing.

    Parameters
    ----------
    path : str or PathLike
    text : str

    Raises
    ------
    OSError
        The folder does not exist or can't be written to.
    """

    def write(stream: IO[bytes]) -> None:
        stream.write(text.encode())

    write_atomically(path, write)


class _PlainDumper(yaml.SafeDumper):
    """Writes repeated values in full, as not every reader supports YAML's references."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _quaternion(yaw: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)}
