"""OpenMVG's ``sfm_data.bin``: cereal's portable binary archive, little-endian."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from groundmap.errors import FileFormatError
from groundmap.files.binary import U32, BinaryFile
from groundmap.io.readers.openmvg_parts import SfmData, camera_of
from groundmap.io.readers.sniffing import head_of

EXPECTED = "sfm_data of OpenMVG"
START = re.compile(rb"\x01[\x01-\x0a]\x00{7}(\d+\.\d+)")  # endianness, and the version as text
VERSIONS = ("0.2", "0.3")
NEW = 0x80000000  # of an id: what it refers to follows
PRIORS = b"\x01" + (3).to_bytes(8, "little")  # a flag, and the first of two counted vectors
VECTORS = {
    "pinhole": 0,
    "pinhole_radial_k1": 1,
    "pinhole_radial_k3": 3,
    "pinhole_brown_t2": 5,
    "fisheye": 4,
}
SIGHTING = np.dtype([("view", "<u4"), ("feature", "<u4"), ("size", "<u8"), ("x", "<f8", (2,))])


def is_binary(path: Path) -> bool:
    """Return whether a file begins as sfm_data in binary form does."""
    return START.match(head_of(path)) is not None


def read_binary(path: Path) -> SfmData:
    """Read a file.

    Raises
    ------
    FileFormatError
        A file that was cut short, of another version, or with an unknown camera model.
    """
    file = BinaryFile(path, EXPECTED)
    file.value("u1", "endianness")
    version = file.text(file.count("bytes of the version", smallest=1), "version")
    if version not in VERSIONS:
        raise FileFormatError(path, f"{EXPECTED} of version {' or '.join(VERSIONS)}", version)
    file.text(file.count("bytes of the root path", smallest=1), "root path")
    data = SfmData()
    _views(file, data, polymorphic=version != "0.2")
    _intrinsics(file, data)
    for _ in range(file.count("poses", smallest=4 + 3 * 32 + 32)):
        key = int(file.value(U32, "key of a pose"))
        file.count("rows of a rotation", smallest=8)
        rows = [_vector(file, 3, "row of a rotation") for _ in range(3)]
        data.poses[key] = (np.array(rows), _vector(file, 3, "centre"))
    for _ in range(file.count("landmarks", smallest=4 + 32 + 8)):
        key = int(file.value(U32, "id of a landmark"))
        place = _vector(file, 3, "landmark")
        count = file.count("sightings", smallest=SIGHTING.itemsize)
        seen = file.records(SIGHTING, count, "sightings")
        if (seen["size"] != 2).any():
            raise file.error("pixels of two coordinates", "another number")
        data.add_landmark(key, place, seen["view"].astype(np.int64), seen["x"])
    return data


def _vector(
    file: BinaryFile, length: int, what: str
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    count = file.count(f"numbers of a {what}", smallest=8)
    if count != length:
        raise file.error(f"{length} numbers of a {what}", f"{count}")
    return file.records("<f8", count, what)


def _views(file: BinaryFile, data: SfmData, *, polymorphic: bool) -> None:
    kinds: dict[int, str] = {}
    for _ in range(file.count("views", smallest=4 + 4 + 8 + 8 + 20)):
        key = int(file.value(U32, "key of a view"))
        if polymorphic:
            _kind(file, kinds, "view")
        file.value(U32, "pointer of a view")
        path = file.text(file.count("bytes of a path", smallest=1), "path")
        name = file.text(file.count("bytes of a file name", smallest=1), "file name")
        _, _, _, intrinsic, pose = file.records(U32, 5, "numbers of a view").tolist()
        if file.content.startswith(PRIORS, file.place):
            file.value("u1", "flag of a view")
            _vector(file, 3, "weight of a view")
            _vector(file, 3, "position of a view")
        data.views.append((key, path + name, pose, intrinsic))


def _kind(file: BinaryFile, kinds: dict[int, str], what: str) -> str:
    """Return the name of the class of an object; it follows where the class is new."""
    number = int(file.value(U32, f"class of a {what}"))
    if number & NEW:
        name = file.text(file.count("bytes of a class", smallest=1), "class")
        kinds[number & ~NEW] = name
        return name
    return kinds.get(number, what)


def _intrinsics(file: BinaryFile, data: SfmData) -> None:
    kinds: dict[int, str] = {}
    for _ in range(file.count("intrinsics", smallest=4 + 4 + 4 + 8)):
        key = int(file.value(U32, "key of intrinsics"))
        model = _kind(file, kinds, "camera")
        file.value(U32, "pointer of intrinsics")
        width, height = file.records(U32, 2, "size of an image").tolist()
        if model == "spherical":
            data.intrinsics[key] = camera_of(model, width, height, 1.0)
            continue
        if model not in VECTORS:
            known = ", ".join([*VECTORS, "spherical"])
            raise FileFormatError(file.path, f"a camera model of {known}", repr(model))
        focal = float(file.value("<f8", "focal length"))
        centre = _vector(file, 2, "principal point")
        if VECTORS[model]:
            _vector(file, VECTORS[model], "distortion")
        data.intrinsics[key] = camera_of(model, width, height, focal, float(centre[0]))
