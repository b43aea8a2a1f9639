"""Reader of OpenSfM: ``reconstruction.json``, and ``tracks.csv`` for what each image saw.

Rotations are vectors of world to camera, z of the world points up. The unit is the metre only if
positions of a satellite receiver were used.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.documents import read_json
from groundmap.io.readers.assembly import compose
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.fields import MOST_JSON, Fields
from groundmap.io.readers.sniffing import head_of
from groundmap.io.rows import open_rows
from groundmap.sparse.cameras import Camera, Projection, equirectangular
from groundmap.sparse.sparse_map import SparseMap

RECONSTRUCTIONS = ("reconstruction.json", "reconstruction.meshed.json")
TRACKS = "tracks.csv"
VERSION = "OPENSFM_TRACKS_VERSION"
SPHERICAL = {"spherical", "equirectangular"}
USABLE_DOP = 1e4  # [m], dilution of precision above which there is no position
MOST_TRACKS = 2**31


class OpenSfmLog(SparseMapLog):
    """Views of the largest reconstruction of OpenSfM."""

    looks_for = "reconstruction.json and tracks.csv of OpenSfM"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a JSON file, or one in the folder, begins as a reconstruction does."""
        return _find(path) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read the largest reconstruction."""
        file = _find(path) or path
        content = read_json(file, "a reconstruction of OpenSfM", most=MOST_JSON)
        if not isinstance(content, list) or not content:
            raise FileFormatError(file, "a list of reconstructions", "something else")
        all_parts = [Fields(file, part, f"[{number}]") for number, part in enumerate(content)]
        sizes = [len(part.fields("shots").content) for part in all_parts]
        best = int(np.argmax(sizes))
        notes: tuple[str, ...] = ()
        if len(sizes) > 1:
            counts = ", ".join(map(str, sizes))
            notes = (f"the file contains reconstructions of {counts} views; the largest is used",)
        return _assemble(file, all_parts[best], notes)


def _find(path: Path) -> Path | None:
    """Return the file of reconstructions: the path, or one in the folder."""
    candidates = [path] if path.is_file() else [path / name for name in RECONSTRUCTIONS]
    for file in candidates:
        head = head_of(file).lstrip()
        if head.startswith(b"[") and (b'"cameras"' in head or b'"shots"' in head):
            return file
    return None


class _Shots(NamedTuple):
    names: list[str]
    poses: Floats
    cameras: list[str]
    timestamps: Floats
    located: bool


def _assemble(path: Path, part: Fields, notes: tuple[str, ...]) -> SparseMap:
    names = [name for name, _ in part.fields("cameras").items()]
    cameras = tuple(_camera(fields) for _, fields in part.fields("cameras").items())
    shots = _shots(part)
    points = part.fields("points").items()
    places = np.array([fields.array("coordinates", 3) for _, fields in points]).reshape(-1, 3)
    tracks = path.with_name(TRACKS)
    if not tracks.is_file():
        raise FileFormatError(
            path,
            "poses, landmarks, and which view saw which",
            f"no {TRACKS} beside it",
            hint=f"OpenSfM writes {TRACKS} into the same folder: copy it here.",
        )
    rows = {name: row for row, (name, _) in enumerate(points)}
    views, landmarks, pixels, unused = _sightings(tracks, shots.names, rows)
    unknown = [name for name in shots.cameras if name not in names]
    if unknown:
        raise FileFormatError(path, "shots of the listed cameras", repr(unknown[0]))
    reference = part.content.get("reference_lla")
    located = shots.located and isinstance(reference, dict) and any(reference.values())
    return SparseMap(
        system="OpenSfM",
        T_world_camera=shots.poses,
        landmarks=places,
        view_of=views,
        landmark_of=landmarks,
        names=tuple(shots.names),
        timestamps=shots.timestamps if (shots.timestamps > 0).all() else None,
        cameras=cameras or (Camera(model="none"),),
        camera_of=np.array([names.index(name) for name in shots.cameras], dtype=np.int64),
        pixels=pixels,
        metric=located,
        up=np.array([0.0, 0.0, 1.0]),
        dropped=+Counter(track_rows_without_landmark_or_view=unused),
        notes=notes,
    )


def _camera(fields: Fields) -> Camera:
    kind = fields.text("projection_type", "perspective")
    width, height = fields.index("width", 0), fields.index("height", 0)
    if kind in SPHERICAL:
        return equirectangular(kind, width, height)
    focal = fields.content.get("focal", fields.content.get("focal_x"))
    size = max(width, height)
    if focal is None or size <= 0:
        return Camera(model=kind)
    key = "focal" if "focal" in fields.content else "focal_x"
    projection: Projection = "fisheye" if "fisheye" in kind else "perspective"
    centre = width / 2 + size * fields.number("c_x", 0.0)
    return Camera(
        model=kind,
        projection=projection,
        focal_px=size * fields.number(key),
        width=width,
        height=height,
        cx=centre,
    )


def _shots(part: Fields) -> _Shots:
    shots = part.fields("shots").items()
    vectors = np.array([fields.array("rotation", 3) for _, fields in shots]).reshape(-1, 3)
    moves = np.array([fields.array("translation", 3) for _, fields in shots]).reshape(-1, 3)
    if not np.isfinite(vectors).all():
        raise FileFormatError(part.path, "finite rotations of the shots", "another")
    rotations = Rotation.from_rotvec(vectors).as_matrix() if len(shots) else np.empty((0, 3, 3))
    return _Shots(
        [name for name, _ in shots],
        compose(rotations, moves, world_to_camera=True),
        [fields.text("camera") for _, fields in shots],
        np.array([fields.number("capture_time", 0.0) for _, fields in shots]),
        any(fields.number("gps_dop", np.inf) < USABLE_DOP for _, fields in shots),
    )


def _sightings(
    path: Path, names: list[str], rows: dict[str, int]
) -> tuple[Ints, Ints, Floats, int]:
    """Return views, landmarks and coordinates of the tracks, and the number of unused rows."""
    view_of = {name: view for view, name in enumerate(names)}
    found: list[tuple[int, int]] = []
    places: list[tuple[str, str]] = []
    unused = 0
    with open_rows(path) as stream:
        for number, line in enumerate(stream, start=1):
            words = line.rstrip("\r\n").split("\t")
            if words[0].startswith(VERSION) or words == [""]:
                continue
            if len(words) < 5:
                expected = "columns image, track, feature, x, y, separated by tabs"
                raise FileFormatError(path, expected, repr(line[:60]), line=number)
            view, row = view_of.get(words[0]), rows.get(words[1])
            if view is None or row is None:
                unused += 1
                continue
            found.append((view, row))
            places.append((words[3], words[4]))
    try:
        pixels = np.array(places, dtype=np.float64).reshape(-1, 2)
    except ValueError as error:
        raise FileFormatError(path, "numbers as x and y", f"something else ({error})") from error
    pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1], pixels, unused
