"""The binary files of a model of COLMAP."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.binary import BinaryFile
from groundmap.io.readers.colmap_parts import MODELS, Model

CAMERA = np.dtype([("id", "<u4"), ("model", "<i4"), ("width", "<u8"), ("height", "<u8")])
IMAGE = np.dtype([("id", "<u4"), ("pose", "<f8", (7,)), ("camera", "<u4")])
KEYPOINT = np.dtype([("xy", "<f8", (2,)), ("point", "<i8")])
POINT = np.dtype(
    [("id", "<u8"), ("xyz", "<f8", (3,)), ("rgb", "u1", (3,)), ("error", "<f8"), ("track", "<u8")]
)
ELEMENT = np.dtype([("image", "<u4"), ("keypoint", "<u4")])
TRACK_AT = POINT.itemsize - 8  # byte of a point at which the length of its track is
LARGEST_ID = 2**62


def read_binary(folder: Path) -> Model:
    """Read ``cameras.bin``, ``images.bin`` and ``points3D.bin``."""
    camera_ids, cameras = _cameras(folder / "cameras.bin")
    images = _images(folder / "images.bin")
    return Model(camera_ids, cameras, *images, *_points(folder / "points3D.bin"))


def _cameras(path: Path) -> tuple[Ints, list[tuple[str, int, int, Floats]]]:
    file = BinaryFile(path, "cameras of COLMAP")
    ids, cameras = [], []
    names = list(MODELS)
    for _ in range(file.count("cameras", smallest=CAMERA.itemsize)):
        row = file.records(CAMERA, 1, "cameras")[0]
        number = int(row["model"])
        if not 0 <= number < len(names):
            known = ", ".join(f"{index} {name}" for index, name in enumerate(names))
            raise FileFormatError(path, f"a camera model of {known}", f"{number}")
        params = file.records("<f8", MODELS[names[number]], "parameters of a camera")
        ids.append(int(row["id"]))
        cameras.append((names[number], int(row["width"]), int(row["height"]), params))
    return np.array(ids, dtype=np.int64), cameras


def _images(path: Path) -> tuple[Ints, Floats, Ints, list[str], Ints, Floats, Ints]:
    file = BinaryFile(path, "images of COLMAP")
    count = file.count("images", smallest=IMAGE.itemsize + 9)
    heads = np.empty(count, dtype=IMAGE)
    names, counts, keypoints = [], np.zeros(count, dtype=np.int64), []
    for number in range(count):
        heads[number] = file.records(IMAGE, 1, "images")[0]
        names.append(file.text_to_nul("image name"))
        counts[number] = file.count("keypoints", smallest=KEYPOINT.itemsize)
        keypoints.append(file.records(KEYPOINT, int(counts[number]), "keypoints"))
    rows = np.concatenate([np.empty(0, dtype=KEYPOINT), *keypoints])
    ids, cameras = heads["id"].astype(np.int64), heads["camera"].astype(np.int64)
    return ids, heads["pose"], cameras, names, counts, rows["xy"], rows["point"]


def _points(path: Path) -> tuple[Ints, Floats, Ints, Ints]:
    file = BinaryFile(path, "points of COLMAP")
    count = file.count("points", smallest=POINT.itemsize)
    starts, counts = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    place, content, length = file.place, file.content, len(file.content)
    for number in range(count):
        after = place + POINT.itemsize
        track = int.from_bytes(content[place + TRACK_AT : after], "little")
        if after > length or track * ELEMENT.itemsize > length - after:
            file.place = place
            raise file.error(f"point {number} of {count}", f"{length - place} bytes left")
        starts[number], counts[number] = place, track
        place = after + track * ELEMENT.itemsize
    data = np.frombuffer(content, np.uint8)
    heads = data[starts[:, None] + np.arange(POINT.itemsize)].view(POINT).reshape(-1)
    if (heads["id"] > LARGEST_ID).any():
        raise FileFormatError(path, f"ids of points up to {LARGEST_ID}", str(heads["id"].max()))
    first = np.cumsum(counts) - counts
    within = np.arange(int(counts.sum())) - np.repeat(first, counts)
    elements = np.repeat(starts + POINT.itemsize, counts) + within * ELEMENT.itemsize
    images = data[elements[:, None] + np.arange(4)].view("<u4").reshape(-1)
    return heads["id"].astype(np.int64), heads["xyz"], counts, images.astype(np.int64)
