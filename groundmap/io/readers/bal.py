"""Reader of problems of "Bundle Adjustment in the Large" (BAL).

Counts of cameras, points and observations; the observations (camera, point, x, y); nine numbers a
camera (rotation vector and translation of world to camera, f, k1, k2); the points. The cameras look
along -z with y up, as Bundler's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.errors import FileFormatError
from groundmap.io.readers.assembly import compose
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.number_stream import NumberStream
from groundmap.io.readers.sniffing import single_file
from groundmap.io.readers.text_tables import first_rows
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

FLIP = np.array([1.0, -1.0, -1.0])


class BalLog(SparseMapLog):
    """Views of a BAL problem."""

    looks_for = "a text file of counts, observations, cameras and points"
    weak = True

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, begins as a problem does."""
        return single_file(path, is_bal) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a problem."""
        file = single_file(path, is_bal) or path
        numbers = NumberStream(file, "a BAL problem")
        views = numbers.count("cameras", smallest=9)
        points = numbers.count("points", smallest=3)
        observed = numbers.count("observations", smallest=4)
        needed = 4 * observed + 9 * views + 3 * points
        if needed != len(numbers.numbers) - 3:
            got = f"{len(numbers.numbers) - 3}"
            raise FileFormatError(
                file,
                f"a BAL problem: {needed} numbers for {observed} observations, {views} cameras and "
                f"{points} points",
                got,
                hint="Was the file cut short?",
            )
        table = numbers.take(4 * observed, "observations").reshape(-1, 4)
        cameras = numbers.take(9 * views, "cameras").reshape(-1, 9)
        places = numbers.take(3 * points, "points").reshape(-1, 3)
        finite = np.flatnonzero(~np.isfinite(cameras).all(axis=1))
        if len(finite):
            raise FileFormatError(file, "finite cameras", f"another as camera {finite[0]}")
        rotations = Rotation.from_rotvec(cameras[:, :3]).as_matrix() * FLIP[:, None]
        return SparseMap(
            system="BAL",
            T_world_camera=compose(rotations, cameras[:, 3:6] * FLIP, world_to_camera=True),
            landmarks=places,
            view_of=numbers.indices(table[:, 0], "cameras"),
            landmark_of=numbers.indices(table[:, 1], "points"),
            cameras=tuple(Camera(model="BAL", focal_px=float(row[6])) for row in cameras)
            or (Camera(model="none"),),
            camera_of=np.arange(views),
            pixels=table[:, 2:] * FLIP[:2],
        )


def is_bal(path: Path) -> bool:
    """Return whether a text file begins with three counts and rows of two indices and two numbers.

    The rows are sniffed; the counts are checked when the file is read.
    """
    rows = first_rows(path) if path.suffix.lower() in {".txt", ".bal", ""} else []
    if len(rows) < 2 or len(rows[0]) != 3 or not all(word.isdigit() for word in rows[0]):
        return False
    first = rows[1 : 1 + min(int(rows[0][2][:9]), len(rows) - 1)]
    return all(len(row) == 4 and row[0].isdigit() and row[1].isdigit() for row in first)
