"""Reader of the maps of stella_vslam and OpenVSLAM, in msgpack or SQLite.

Keyframes have the pose of world to camera, and for each keypoint the id of a landmark or -1.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import msgpack
import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.databases import MAGIC
from groundmap.files.opening import read_file
from groundmap.io.readers.assembly import find_ids, poses_from
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.fields import Fields, as_index
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.io.readers.stella_parts import StellaMap, camera_of
from groundmap.io.readers.stella_sqlite import is_stella_database, read_database
from groundmap.sparse.sparse_map import SparseMap

EXPECTED = "a map of stella_vslam or OpenVSLAM"
MOST_BYTES = 2**30
MAPS = {*range(0x81, 0x90), 0xDE, 0xDF}  # first bytes of msgpack's dictionaries
FIRST_KEYS = (b"\xa7cameras", b"\xadframe_next_id", b"\xb0keyframe_next_id", b"\xa9keyframes")
FARTHEST = 1e4  # [unit]; landmarks beyond it, and in the camera, are remains of depth cameras


class StellaLog(SparseMapLog):
    """Views of the keyframes of stella_vslam."""

    looks_for = "a map of stella_vslam or OpenVSLAM (msgpack, sqlite3)"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins as a map does."""
        return single_file(path, is_stella) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a map."""
        file = single_file(path, is_stella) or path
        if head_of(file).startswith(MAGIC):
            found = read_database(file)
        else:
            found = _read_msgpack(file)
        return _assemble(file, found)


def is_stella(path: Path) -> bool:
    """Return whether a file is a map in msgpack or SQLite."""
    head = head_of(path)
    if head.startswith(MAGIC):
        return is_stella_database(path)
    return head[:1] != b"" and head[0] in MAPS and any(key in head[:64] for key in FIRST_KEYS)


def _read_msgpack(path: Path) -> StellaMap:
    data = read_file(path, EXPECTED, most=MOST_BYTES)
    try:
        content: Any = msgpack.unpackb(data, strict_map_key=False, unicode_errors="replace")
    except (ValueError, TypeError, RecursionError, msgpack.exceptions.UnpackException) as error:
        got = f"damaged msgpack ({error or type(error).__name__})"
        raise FileFormatError(path, EXPECTED, got, hint="Was the file cut short?") from error
    document = Fields(path, content)
    found = StellaMap()
    for name, fields in document.fields("cameras").items():
        found.cameras[name] = camera_of(fields)
    for key, fields in document.fields("landmarks").items():
        found.landmark_ids.append(as_index(path, key, "landmark"))
        found.landmarks.append(fields.array("pos_w", 3))
    for key, fields in document.fields("keyframes").items():
        _add_keyframe(found, as_index(path, key, "keyframe"), fields)
    return found


def _add_keyframe(found: StellaMap, number: int, fields: Fields) -> None:
    pose = poses_from(
        fields.path,
        fields.array("rot_cw", 4)[None],
        fields.array("trans_cw", 3)[None],
        world_to_camera=True,
    )[0]
    ids = fields.array("lm_ids", -1)
    if not (np.rint(ids) == ids).all():
        raise FileFormatError(fields.path, f"{fields.place}.lm_ids to be whole numbers", "others")
    points = fields.list("undist_keypts") or fields.list("keypts")
    seen = np.flatnonzero(ids >= 0)
    pixels = np.full((len(seen), 2), np.nan)
    for row, place in enumerate(seen.tolist()):
        if place < len(points):
            point = Fields(fields.path, points[place], f"{fields.place}.keypts")
            pixels[row] = point.array("pt", 2)
    found.add_keyframe(
        number,
        timestamp=fields.number("ts"),
        camera=fields.text("cam"),
        pose=pose,
        seen=ids[seen].astype(np.int64),
        pixels=pixels,
    )


def _assemble(path: Path, found: StellaMap) -> SparseMap:
    order = np.argsort(found.keyframe_ids, kind="stable")
    names = list(found.cameras)
    unknown = [name for name in found.camera_names if name not in found.cameras]
    if unknown:
        raise FileFormatError(path, "keyframes of the listed cameras", repr(unknown[0]))
    landmarks = np.array(found.landmarks).reshape(-1, 3)
    dropped: Counter[str] = Counter()
    views, rows, pixels = _sightings(found, order, dropped)
    poses = np.array(found.poses).reshape(-1, 4, 4)[order]
    keep = _plausible(landmarks, poses, views, rows, dropped)
    times = np.array(found.timestamps)[order]
    cameras = tuple(camera for camera, _ in found.cameras.values())
    return SparseMap(
        system="stella_vslam",
        T_world_camera=poses,
        landmarks=landmarks,
        view_of=views[keep],
        landmark_of=rows[keep],
        ids=np.array(found.landmark_ids, dtype=np.int64),
        names=tuple(str(found.keyframe_ids[row]) for row in order),
        timestamps=times if len(np.unique(times)) == len(times) else None,
        cameras=cameras,
        camera_of=np.array([names.index(found.camera_names[row]) for row in order], dtype=np.int64),
        pixels=pixels[keep],
        metric=bool(cameras) and all(metric for _, metric in found.cameras.values()),
        dropped=+dropped,
    )


def _sightings(found: StellaMap, order: Ints, dropped: Counter[str]) -> tuple[Ints, Ints, Floats]:
    ids = [found.seen[row] for row in order]
    views = np.repeat(np.arange(len(ids)), [len(seen) for seen in ids])
    wanted = np.concatenate([np.empty(0, dtype=np.int64), *ids])
    pixels = np.concatenate([np.empty((0, 2)), *(found.pixels[row] for row in order)])
    rows, known = find_ids(np.array(found.landmark_ids, dtype=np.int64), wanted)
    dropped["sightings_of_missing_landmarks"] += int((~known).sum())
    return views[known], rows[known], pixels[known]


def _plausible(
    landmarks: Floats, poses: Floats, views: Ints, rows: Ints, dropped: Counter[str]
) -> Any:
    """Return which sightings are of landmarks neither in their camera nor at infinity."""
    if not len(views):
        return np.zeros(0, dtype=np.bool_)
    with np.errstate(over="ignore", invalid="ignore"):
        apart = np.linalg.norm(landmarks[rows] - poses[views, :3, 3], axis=1)
        near, far = apart < 1e-6, ~(apart < FARTHEST)
    dropped["sightings_in_the_camera"] += int(near.sum())
    dropped["sightings_too_far"] += int(far.sum())
    return ~(near | far)
