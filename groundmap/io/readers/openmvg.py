"""Reader of OpenMVG's ``sfm_data``, as JSON or in cereal's portable binary form.

Poses are a rotation of world to camera and the centre. A view is reconstructed if its pose is
among the extrinsics; sightings refer to views by their key.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from groundmap.errors import FileFormatError
from groundmap.files.documents import read_json
from groundmap.io.readers.assembly import compose, find_ids
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.fields import MOST_JSON, Fields
from groundmap.io.readers.openmvg_binary import is_binary, read_binary
from groundmap.io.readers.openmvg_parts import SfmData, camera_of
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap


class OpenMvgLog(SparseMapLog):
    """Views of a reconstruction of OpenMVG."""

    looks_for = "sfm_data of OpenMVG, .json or .bin"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins as sfm_data does."""
        return single_file(path, _is_sfm_data) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a reconstruction."""
        file = single_file(path, _is_sfm_data) or path
        data = read_binary(file) if is_binary(file) else _read_json(file)
        if not data.poses:
            raise FileFormatError(
                file,
                "poses, landmarks, and which view saw which",
                f"{len(data.views)} views without poses",
                hint="This is the list of images before the reconstruction: give the sfm_data.bin "
                "that openMVG_main_SfM writes.",
            )
        return _assemble(file, data)


def _is_sfm_data(path: Path) -> bool:
    return b'"sfm_data_version"' in head_of(path) or is_binary(path)


def _read_json(path: Path) -> SfmData:
    content = Fields(path, read_json(path, "sfm_data of OpenMVG", most=MOST_JSON))
    data = SfmData()
    for key, value in _entries(content, "views"):
        view = _object(value)
        name = view.text("local_path") + view.text("filename")
        data.views.append((key, name, view.index("id_pose"), view.index("id_intrinsic")))
    names: dict[int, str] = {}
    for key, value in _entries(content, "intrinsics"):
        kind = value.index("polymorphic_id", 0) & 0x7FFFFFFF
        names.setdefault(kind, value.text("polymorphic_name", "pinhole"))
        camera = _object(value)
        centre = camera.content.get("principal_point")
        data.intrinsics[key] = camera_of(
            names[kind],
            camera.index("width"),
            camera.index("height"),
            camera.number("focal_length", 1.0),
            camera.array("principal_point", 2)[0] if centre is not None else None,
        )
    for key, value in _entries(content, "extrinsics"):
        data.poses[key] = (value.array("rotation", 3, 3), value.array("center", 3))
    for key, value in _entries(content, "structure"):
        seen = [Fields(path, entry, "observations") for entry in value.list("observations")]
        data.add_landmark(
            key,
            value.array("X", 3),
            np.array([entry.index("key") for entry in seen], dtype=np.int64),
            np.array([entry.fields("value").array("x", 2) for entry in seen]).reshape(-1, 2),
        )
    return data


def _entries(content: Fields, name: str) -> list[tuple[int, Fields]]:
    """Return the keys and values of a map, which cereal writes as a list of pairs."""
    pairs = [Fields(content.path, pair, name) for pair in content.list(name)]
    return [(pair.index("key"), pair.fields("value")) for pair in pairs]


def _object(value: Fields) -> Fields:
    """Return the fields of an object behind a pointer; those of its base class may be apart."""
    data = value.fields("ptr_wrapper").fields("data")
    base = data.content.get("value0")
    if isinstance(base, dict):
        return Fields(data.path, {**base, **data.content}, data.place)
    return data


def _assemble(path: Path, data: SfmData) -> SparseMap:
    posed = [view for view in data.views if view[2] in data.poses]
    rotations = np.array([data.poses[view[2]][0] for view in posed]).reshape(-1, 3, 3)
    centres = np.array([data.poses[view[2]][1] for view in posed]).reshape(-1, 3)
    kinds = list(data.intrinsics)
    unknown = [view[3] for view in posed if view[3] not in data.intrinsics]
    if unknown:
        raise FileFormatError(path, "views of the listed intrinsics", str(unknown[0]))
    keys, landmarks, pixels = data.sightings()
    views, known = find_ids(np.array([view[0] for view in posed], dtype=np.int64), keys)
    dropped = {
        "unregistered_views": len(data.views) - len(posed),
        "sightings_of_unregistered_views": int((~known).sum()),
    }
    return SparseMap(
        system="OpenMVG",
        T_world_camera=compose(np.swapaxes(rotations, 1, 2), centres),
        landmarks=np.array(data.landmarks).reshape(-1, 3),
        view_of=views[known],
        landmark_of=landmarks[known],
        ids=np.array(data.landmark_ids, dtype=np.int64),
        names=tuple(view[1] for view in posed),
        cameras=tuple(data.intrinsics.values()) or (Camera(model="none"),),
        camera_of=np.array([kinds.index(view[3]) for view in posed], dtype=np.int64),
        pixels=pixels[known],
        dropped=+Counter(dropped),
    )
