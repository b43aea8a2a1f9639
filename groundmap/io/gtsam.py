"""Reader of the visual-odometry text sets of GTSAM.

``VO_calibration.txt``
    ``fx fy skew cx cy baseline`` [px, m], skew 0.
``VO_camera_poses.txt``
    ``id`` and the 16 numbers of camera to world, row by row. The world is optical: x right,
    y down, z forward. Views are sorted by id; the rows may have any order.
``VO_stereo_factors.txt``
    ``pose_id landmark_id uL uR v X Y Z``, in any order.

The sets that GTSAM publishes have a suffix in their names, such as ``VO_camera_poses00s.txt``. The
files of a set have the same one; only the calibration may have none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError, InputError
from groundmap.io.disk_sort import RowsByView
from groundmap.io.log import ViewLog
from groundmap.io.poses import check_unique, poses_by_id, read_gtsam
from groundmap.io.rows import Rows, read_rows, record
from groundmap.view.frames import map_from_world
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View

CALIBRATION, POSES, FACTORS = (
    "VO_calibration.txt",
    "VO_camera_poses.txt",
    "VO_stereo_factors.txt",
)
CALIBRATION_ROW = record([], 6)
FILES = re.compile(r"(VO_calibration|VO_camera_poses|VO_stereo_factors)(.*)\.txt")
# X Y Z are read to check the row, and ignored: they are the same pixels triangulated with the same
# rig, but without the covariance that the pixels give.
FACTOR_ROW = record(["pose", "landmark"], 6)
STORED_ROW = np.dtype([("view", np.int64), ("id", np.int64), ("pixels", np.float64, (3,))])


class GtsamLog(ViewLog):
    """Views of a GTSAM visual-odometry set.

    All files are checked, and the factors sorted on disk, when the log is opened. An iteration then
    reads the rows of one view at a time. Landmark ids become the ids of the points; a pose without
    factors becomes an empty view.

    Raises
    ------
    FileFormatError
        A missing or invalid file, two poses with the same id, a factor of a nonexistent pose.
    """

    looks_for = f"{CALIBRATION}, {POSES} and {FACTORS}"

    def __init__(self, path: Path, *, poses: Path | None = None) -> None:
        super().__init__(path, poses=poses)
        files = _find_files(path)
        self.rig = _read_rig(files.calibration)
        #: Pose ids of the views, shape (n,), ascending.
        self.ids, T_world_camera = _read_sorted_poses(files.poses)
        if poses is not None:
            T_world_camera = poses_by_id(poses, self.ids)
        self._T_map_camera = map_from_world(T_world_camera, "optical")
        factors = _read_factors(files.factors, self.ids)
        self._factors = RowsByView(factors, len(self.ids), STORED_ROW)
        if not len(self._factors):
            raise FileFormatError(files.factors, "at least one factor", "an empty file")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether any of the three files exists; opening reports the missing ones."""
        if path.is_file():
            return FILES.fullmatch(path.name) is not None
        return bool(_suffixes(path))

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.ids)

    def __iter__(self) -> Iterator[View]:
        """Iterate over the views in the order of the pose ids."""
        for index, T_map_camera in enumerate(self._T_map_camera):
            rows = self._factors.of_view(index)
            yield View.from_pixels(
                T_map_camera, self.rig, points_px=rows["pixels"], point_ids=rows["id"]
            )


class _Files(NamedTuple):
    calibration: Path
    poses: Path
    factors: Path


def _suffixes(folder: Path) -> dict[str, set[str]]:
    """Return which of the three files a folder has, by the suffix of their names."""
    found: dict[str, set[str]] = {}
    for entry in sorted(folder.iterdir()):
        match = FILES.fullmatch(entry.name)
        if match:
            found.setdefault(match[2], set()).add(match[1])
    return found


def _find_files(path: Path) -> _Files:
    """Return the files of the only set in a folder, or of the set that a file belongs to."""
    folder = path.parent if path.is_file() else path
    match = FILES.fullmatch(path.name) if path.is_file() else None
    suffixes = _suffixes(folder)
    # A calibration alone is no set: several share one.
    sets = [suffix for suffix, names in suffixes.items() if names != {"VO_calibration"}]
    chosen = [match[2]] if match and match[2] in sets else sets
    if len(chosen) > 1:
        names = " and ".join(f"VO_stereo_factors{suffix}.txt" for suffix in chosen[:2])
        hint = "Give the file with the factors of one."
        raise FileFormatError(path, "the files of one set", f"{names}", hint=hint)
    suffix = chosen[0] if chosen else ""
    own = "VO_calibration" in suffixes.get(suffix, set())
    return _Files(
        folder / f"VO_calibration{suffix if own else ''}.txt",
        folder / f"VO_camera_poses{suffix}.txt",
        folder / f"VO_stereo_factors{suffix}.txt",
    )


def _read_rig(path: Path) -> StereoRig:
    lines = [row for rows in read_rows(path, CALIBRATION_ROW) for row in rows.values["values"]]
    if len(lines) != 1:
        raise FileFormatError(path, "one line: fx fy skew cx cy baseline", f"{len(lines)} lines")
    fx, fy, skew, cx, cy, baseline = lines[0].tolist()
    if skew != 0:
        raise FileFormatError(path, "skew 0", str(skew), hint="Rectify the images first.")
    try:
        return StereoRig(fx=fx, fy=fy, cx=cx, cy=cy, baseline=baseline)
    except InputError as error:
        raise FileFormatError(path, f"{error.name} to be {error.expected}", error.got) from error


def _read_sorted_poses(path: Path) -> tuple[Ints, Floats]:
    poses = read_gtsam(path)
    check_unique(path, poses)
    order = np.argsort(poses.keys)
    return poses.keys[order], poses.transforms[order]


def _read_factors(path: Path, ids: Ints) -> Iterator[npt.NDArray[Any]]:
    for rows in read_rows(path, FACTOR_ROW):
        stored = np.empty(len(rows.values), dtype=STORED_ROW)
        stored["view"] = _views_of(path, rows, ids)
        stored["id"] = rows.values["landmark"]
        stored["pixels"] = rows.values["values"][:, :3]
        yield stored


def _views_of(path: Path, rows: Rows, ids: Ints) -> Ints:
    poses = rows.values["pose"]
    views = np.searchsorted(ids, poses).clip(max=len(ids) - 1)
    unknown = np.flatnonzero(ids[views] != poses)
    if len(unknown):
        raise FileFormatError(
            path,
            f"the id of a pose in {POSES}",
            str(poses[unknown[0]]),
            line=int(rows.lines[unknown[0]]),
        )
    return views
