"""Reader of COLMAP's sparse models, text or binary.

A model is a folder of ``cameras``, ``images`` and ``points3D``, all ``.txt`` or all ``.bin``.
``rigs`` and ``frames`` of COLMAP 3.12 and later repeat the poses that ``images`` contains. The
world has no unit, and any attitude. The points that images list are the sightings; where images
list none, those of the tracks of the points.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.io.readers.assembly import check_distinct, find_ids, poses_from
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.colmap_binary import read_binary
from groundmap.io.readers.colmap_parts import SINGLE_FOCAL, Model
from groundmap.io.readers.colmap_text import read_text
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

PARTS = ("cameras", "images", "points3D")
READERS = {".bin": read_binary, ".txt": read_text}
PLACES = (".", "sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", "distorted/sparse/0", "0")
FISHEYE = ("FISHEYE", "FOV")


class ColmapLog(SparseMapLog):
    """Views of a sparse model of COLMAP."""

    looks_for = "cameras, images and points3D, all .bin or .txt"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a model lies in the folder, in ``sparse/0`` in it, or around the file."""
        return _find(path) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a model."""
        found = _find(path)
        if found is None:
            expected = f"a folder with {self.looks_for}"
            raise FileFormatError(path, expected, "none")
        missing = [
            f"{part}{found.suffix}"
            for part in PARTS
            if not (found.folder / f"{part}{found.suffix}").is_file()
        ]
        if missing:
            names = ", ".join(part + found.suffix for part in PARTS)
            raise FileFormatError(found.folder, names, f"no {missing[0]}")
        model = READERS[found.suffix](found.folder)
        return _assemble(found.folder, model)


class _Place(NamedTuple):
    folder: Path
    suffix: str


def _find(path: Path) -> _Place | None:
    """Return the folder of a model and the suffix of its files; binary files come first."""
    if path.is_file():
        if path.stem in PARTS and path.suffix in READERS and path.stem != "cameras":
            return _Place(path.parent, path.suffix)
        beside = path.with_name(f"images{path.suffix}")
        if path.stem == "cameras" and path.suffix in READERS and beside.is_file():
            return _Place(path.parent, path.suffix)
        return None
    for place in PLACES:
        for suffix in READERS:
            if (path / place / f"images{suffix}").is_file():
                return _Place(path / place, suffix)
            if (path / place / f"points3D{suffix}").is_file():
                return _Place(path / place, suffix)
    return None


def _assemble(folder: Path, model: Model) -> SparseMap:
    check_distinct(folder, model.camera_ids, "camera")
    check_distinct(folder, model.image_ids, "image")
    check_distinct(folder, model.point_ids, "point")
    cameras = tuple(_camera(folder, *values) for values in model.cameras)
    camera_of, known = find_ids(model.camera_ids, model.image_cameras)
    if not known.all():
        unknown = model.image_cameras[~known][0]
        raise FileFormatError(folder, "images of the listed cameras", f"camera {unknown}")
    views, landmarks, pixels, lost = _sightings(model)
    dropped = Counter({"sightings_of_missing_landmarks": lost})
    return SparseMap(
        system="COLMAP",
        T_world_camera=poses_from(
            folder,
            model.image_poses[:, :4],
            model.image_poses[:, 4:],
            scalar_first=True,
            world_to_camera=True,
        ),
        landmarks=model.points,
        view_of=views,
        landmark_of=landmarks,
        ids=model.point_ids,
        names=tuple(model.names),
        cameras=cameras or (Camera(model="none"),),
        camera_of=camera_of,
        pixels=pixels,
        dropped=+dropped,
    )


def _sightings(model: Model) -> tuple[Ints, Ints, Floats | None, int]:
    """Return views, landmarks and pixels of the sightings, and how many lead nowhere."""
    seen = model.keypoint_points >= 0
    if seen.any():
        landmarks, known = find_ids(model.point_ids, model.keypoint_points[seen])
        views = np.repeat(np.arange(len(model.image_ids)), model.keypoint_counts)[seen]
        return views[known], landmarks[known], model.keypoints[seen][known], int((~known).sum())
    views, known = find_ids(model.image_ids, model.track_images)
    landmarks = np.repeat(np.arange(len(model.point_ids)), model.track_counts)
    return views[known], landmarks[known], None, int((~known).sum())


def _camera(folder: Path, model: str, width: int, height: int, params: Floats) -> Camera:
    """Return a camera; all models of COLMAP begin with f, cx, cy or fx, fy, cx, cy."""
    if model in SINGLE_FOCAL:
        focal, cx = params[0], params[1]
    else:
        focal, cx = 0.5 * (params[0] + params[1]), params[2]
    projection = "fisheye" if any(name in model for name in FISHEYE) else "perspective"
    return Camera(
        model=model,
        projection=projection,  # type: ignore[arg-type]
        focal_px=float(focal),
        width=width,
        height=height,
        cx=float(cx),
    )
