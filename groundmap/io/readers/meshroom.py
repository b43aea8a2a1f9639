"""Reader of Meshroom's (AliceVision's) scenes with structure, in JSON.

All numbers may be texts. Rotations are those of camera to world, row by row; a view is
reconstructed if its pose is listed. Sightings refer to views by their id.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.documents import read_json
from groundmap.io.readers.assembly import compose, find_ids
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.fields import MOST_JSON, Fields, as_index
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.sparse.cameras import Camera, Projection, equirectangular
from groundmap.sparse.sparse_map import SparseMap

EXPECTED = "a scene of Meshroom"
USUAL_SENSOR = 36.0  # [mm], width, of an image that does not state it


class MeshroomLog(SparseMapLog):
    """Views of a scene of Meshroom that has structure."""

    looks_for = "a scene of Meshroom (.sfm, .json)"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins as a scene does."""
        return single_file(path, is_scene) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a scene."""
        file = single_file(path, is_scene) or path
        scene = Fields(file, read_json(file, EXPECTED, most=MOST_JSON))
        landmarks = scene.list("structure")
        if not landmarks:
            raise FileFormatError(
                file,
                "poses, landmarks, and which view saw which",
                "cameras of Meshroom without structure",
                hint="Give the scene with 'structure': the .abc of the StructureFromMotion node, "
                "converted by aliceVision_convertSfMFormat to .sfm with --structure 1 and "
                "--observations 1.",
            )
        return _assemble(file, scene, landmarks)


def is_scene(path: Path) -> bool:
    """Return whether a file begins as a scene of Meshroom does."""
    if path.suffix.lower() not in {".sfm", ".json"}:
        return False
    head = head_of(path)
    return head.lstrip().startswith(b"{") and b'"viewId"' in head and b'"poseId"' in head


def _numbers(fields: Fields, key: str, count: int) -> Floats:
    """Return numbers that may be written as texts."""
    values = fields.list(key)
    try:
        numbers = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if len(numbers) != count:
        place = f"{fields.place}.{key}"
        raise FileFormatError(fields.path, f"{place} to be {count} numbers", repr(values)[:60])
    return numbers


def _index(fields: Fields, key: str) -> int:
    """Return an id, which may be written as a text; ids have up to 32 bits."""
    return as_index(fields.path, str(fields.get(key)), key)


def _number(fields: Fields, key: str, default: float) -> float:
    value = fields.content.get(key, default)
    try:
        return float(value)
    except (TypeError, ValueError):
        place = f"{fields.place}.{key}"
        raise FileFormatError(fields.path, f"{place} to be a number", repr(value)[:60]) from None


def _entries(scene: Fields, key: str) -> list[Fields]:
    return [Fields(scene.path, entry, f"{key}[{row}]") for row, entry in enumerate(scene.list(key))]


def _camera(fields: Fields) -> Camera:
    kind = str(fields.content.get("type", "pinhole"))
    width, height = (int(_number(fields, name, 0.0)) for name in ("width", "height"))
    if "equirectangular" in kind:
        return equirectangular(kind, width, height)
    focal_px = _number(fields, "pxFocalLength", 0.0) if _is_scalar(fields) else 0.0
    if not focal_px:
        sensor = _number(fields, "sensorWidth", USUAL_SENSOR) or USUAL_SENSOR
        focal_px = _number(fields, "focalLength", 0.0) / sensor * width
    projection: Projection = "fisheye" if "fisheye" in kind else "perspective"
    return Camera(model=kind, projection=projection, focal_px=focal_px, width=width, height=height)


def _is_scalar(fields: Fields) -> bool:
    return isinstance(fields.content.get("pxFocalLength"), (str, int, float))


def _poses(scene: Fields) -> dict[int, tuple[Floats, Floats]]:
    poses = {}
    for fields in _entries(scene, "poses"):
        transform = fields.fields("pose").fields("transform")
        rotation = _numbers(transform, "rotation", 9).reshape(3, 3)
        poses[_index(fields, "poseId")] = (rotation, _numbers(transform, "center", 3))
    return poses


def _assemble(path: Path, scene: Fields, landmarks: list[Any]) -> SparseMap:
    cameras = {
        _index(entry, "intrinsicId"): _camera(entry) for entry in _entries(scene, "intrinsics")
    }
    poses = _poses(scene)
    views = _entries(scene, "views")
    posed = [view for view in views if _index(view, "poseId") in poses]
    chosen = [poses[_index(view, "poseId")] for view in posed]
    intrinsics = [_index(view, "intrinsicId") for view in posed]
    unknown = [number for number in intrinsics if number not in cameras]
    if unknown:
        raise FileFormatError(path, "views of the listed intrinsics", str(unknown[0]))
    places, ids, keys, owners = _structure(scene, landmarks)
    numbers = np.array([_index(view, "viewId") for view in posed], dtype=np.int64)
    rows, known = find_ids(numbers, keys)
    kinds = list(cameras)
    dropped = {
        "unregistered_views": len(views) - len(posed),
        "sightings_of_unregistered_views": int((~known).sum()),
    }
    rotations = np.array([rotation for rotation, _ in chosen]).reshape(-1, 3, 3)
    centres = np.array([centre for _, centre in chosen]).reshape(-1, 3)
    return SparseMap(
        system="Meshroom",
        T_world_camera=compose(rotations, centres),
        landmarks=places,
        view_of=rows[known],
        landmark_of=owners[known],
        ids=ids,
        names=tuple(str(view.content.get("path", number)) for number, view in enumerate(posed)),
        cameras=tuple(cameras.values()) or (Camera(model="none"),),
        camera_of=np.array([kinds.index(number) for number in intrinsics], dtype=np.int64),
        dropped=+Counter(dropped),
    )


def _structure(scene: Fields, landmarks: list[Any]) -> tuple[Floats, Ints, Ints, Ints]:
    """Return places and ids of the landmarks; views and landmarks of their sightings."""
    places, ids, keys, owners = [], [], [], []
    for row, entry in enumerate(landmarks):
        fields = Fields(scene.path, entry, f"structure[{row}]")
        ids.append(_index(fields, "landmarkId"))
        places.append(_numbers(fields, "X", 3))
        for seen in fields.list("observations"):
            keys.append(_index(Fields(scene.path, seen, "observations"), "observationId"))
            owners.append(row)
    return (
        np.array(places).reshape(-1, 3),
        np.array(ids, dtype=np.int64),
        np.array(keys, dtype=np.int64),
        np.array(owners, dtype=np.int64),
    )
