"""Reader of OpenMVS's scenes (``.mvs``).

A camera belongs to a platform, on which it has a pose; the platform has a pose for each image. The
file has no pixels.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.binary import U32, BinaryFile
from groundmap.io.readers.assembly import compose, find_ids
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

EXPECTED = "a scene of OpenMVS"
MAGIC = b"MVSI"
NEWEST = 8
NONE = 0xFFFFFFFF
POSE = np.dtype([("rotation", "<f8", (3, 3)), ("centre", "<f8", (3,))])
SIGHTING = np.dtype([("image", "<u4"), ("confidence", "<f4")])


class OpenMvsLog(SparseMapLog):
    """Views of a scene of OpenMVS."""

    looks_for = "a scene of OpenMVS (MVSI)"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins with MVSI."""
        return single_file(path, is_scene) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a scene."""
        file = BinaryFile(single_file(path, is_scene) or path, EXPECTED)
        magic = file.records("u1", 4, "magic").tobytes()
        if magic != MAGIC:
            raise FileFormatError(file.path, f"{EXPECTED}, which begins with MVSI", repr(magic))
        version, compression = file.records(U32, 2, "version").tolist()
        if not 0 <= version <= NEWEST:
            raise FileFormatError(file.path, f"{EXPECTED} of version 0 to {NEWEST}", str(version))
        if compression & 0xFF:
            hint = "Save it with --archive-type 0 (uncompressed)."
            raise FileFormatError(file.path, EXPECTED, "a compressed one", hint=hint)
        platforms = _platforms(file, version)
        images = _images(file, version)
        return _assemble(Path(file.path), platforms, images, _vertices(file))


def is_scene(path: Path) -> bool:
    """Return whether a file begins with MVSI."""
    return head_of(path).startswith(MAGIC)


class _Platform(NamedTuple):
    cameras: list[tuple[Camera, Floats, Floats]]  # with rotation and centre on the platform
    rotations: Floats
    centres: Floats


class _Image(NamedTuple):
    name: str
    platform: int
    camera: int
    pose: int
    number: int


def _text(file: BinaryFile, what: str) -> str:
    return file.text(file.count(f"bytes of a {what}", smallest=1), what)


def _platforms(file: BinaryFile, version: int) -> list[_Platform]:
    platforms = []
    for _ in range(file.count("platforms", smallest=24)):
        _text(file, "platform")
        cameras = []
        for _ in range(file.count("cameras", smallest=8 + 168)):
            _text(file, "camera")
            if version > 3:
                _text(file, "band")
            width, height = file.records(U32, 2, "size").tolist() if version > 0 else (0, 0)
            focal, _, cx = file.records("<f8", 9, "calibration")[:3].tolist()
            pose = file.records(POSE, 1, "pose of a camera")[0]
            # In some files, the calibration is divided by the larger side of the image.
            unit = float(max(width, height, 1)) if focal < 10.0 else 1.0
            camera = Camera(
                model="OpenMVS",
                focal_px=unit * focal,
                width=width,
                height=height,
                cx=unit * cx,
            )
            cameras.append((camera, pose["rotation"], pose["centre"]))
        count = file.count("poses", smallest=POSE.itemsize)
        poses = file.records(POSE, count, "poses")
        platforms.append(_Platform(cameras, poses["rotation"], poses["centre"]))
    return platforms


def _images(file: BinaryFile, version: int) -> list[_Image]:
    images = []
    for row in range(file.count("images", smallest=20)):
        name = _text(file, "image")
        if version > 4:
            _text(file, "mask")
        platform, camera, pose = file.records(U32, 3, "numbers of an image").tolist()
        number = int(file.value(U32, "id of an image")) if version > 2 else row
        if version > 6:
            file.records("<f4", 3, "depths of an image")
            file.records("u1", 28 * file.count("scores", smallest=28), "scores")
        images.append(_Image(name, platform, camera, pose, number))
    return images


class _Vertices(NamedTuple):
    points: Floats
    views: Ints  # of the sightings
    landmarks: Ints


def _vertices(file: BinaryFile) -> _Vertices:
    count = file.count("vertices", smallest=20)
    points, seen = np.empty((count, 3)), []
    for vertex in range(count):
        with np.errstate(invalid="ignore"):  # not a number, of a kind that signals
            points[vertex] = file.records("<f4", 3, "vertex")
        views = file.count("views of a vertex", smallest=SIGHTING.itemsize)
        seen.append(file.records(SIGHTING, views, "views of a vertex")["image"])
    views_of = np.concatenate([np.empty(0, dtype=np.int64), *seen]).astype(np.int64)
    return _Vertices(points, views_of, np.repeat(np.arange(count), [len(part) for part in seen]))


def _assemble(
    path: Path, platforms: list[_Platform], images: list[_Image], vertices: _Vertices
) -> SparseMap:
    rotations, centres, kept, cameras = [], [], [], []
    for row, image in enumerate(images):
        if image.pose == NONE:
            continue
        if image.platform >= len(platforms):
            expected = f"one of {len(platforms)} platforms for image {row}"
            raise FileFormatError(path, expected, str(image.platform))
        platform = platforms[image.platform]
        if image.camera >= len(platform.cameras) or image.pose >= len(platform.centres):
            counts = f"{len(platform.cameras)} cameras and {len(platform.centres)} poses"
            got = f"camera {image.camera} and pose {image.pose}"
            raise FileFormatError(path, f"one of {counts} for image {row}", got)
        camera, turn, offset = platform.cameras[image.camera]
        of_platform = platform.rotations[image.pose]
        rotations.append(turn @ of_platform)
        centres.append(of_platform.T @ offset + platform.centres[image.pose])
        cameras.append(camera)
        kept.append(row)
    rows, known = find_ids(np.array(kept, dtype=np.int64), vertices.views)
    wrong = np.flatnonzero(vertices.views >= len(images))
    if len(wrong):
        raise FileFormatError(path, f"one of {len(images)} images", str(vertices.views[wrong[0]]))
    dropped = {
        "unregistered_views": len(images) - len(kept),
        "sightings_of_unregistered_views": int((~known).sum()),
    }
    matrices = np.array(rotations).reshape(-1, 3, 3)
    return SparseMap(
        system="OpenMVS",
        T_world_camera=compose(np.swapaxes(matrices, 1, 2), np.array(centres).reshape(-1, 3)),
        landmarks=vertices.points,
        view_of=rows[known],
        landmark_of=vertices.landmarks[known],
        names=tuple(images[row].name for row in kept),
        cameras=tuple(cameras) or (Camera(model="none"),),
        camera_of=np.arange(len(kept)),
        dropped=+Counter(dropped),
    )
