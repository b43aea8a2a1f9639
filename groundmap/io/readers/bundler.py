"""Reader of Bundler's ``bundle.out``.

The cameras look along -z with y up, so both axes are reversed. Cameras that were not registered are
listed with a focal length of 0, and indices count them. ``list.txt`` beside the file names the
images.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.io.readers.assembly import compose
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.number_stream import NumberStream
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.io.rows import open_rows
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

HEADER = b"# Bundle file"
FLIP = np.array([1.0, -1.0, -1.0])  # of the axes: y up and z backwards to y down and z forward
NAMES = ("list.txt", "bundle.list.txt", "bundle.out.list.txt")


class BundlerLog(SparseMapLog):
    """Views of a Bundler file."""

    looks_for = "a file that begins with '# Bundle file'"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, has Bundler's first line."""
        return single_file(path, is_bundler) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a file."""
        file = single_file(path, is_bundler) or path
        numbers = NumberStream(file, "a Bundler file")
        listed = numbers.count("cameras", smallest=15)
        points = numbers.count("points", smallest=7)
        cameras = numbers.take(15 * listed, "cameras").reshape(-1, 15)
        places = np.empty((points, 3))
        sightings = []
        for point in range(points):
            places[point] = numbers.take(6, f"point {point}")[:3]
            count = numbers.count("views of a point", smallest=4)
            sightings.append(numbers.take(4 * count, "views of a point").reshape(-1, 4))
        return _assemble(file, numbers, cameras, places, sightings)


def is_bundler(path: Path) -> bool:
    """Return whether a file has Bundler's first line."""
    return head_of(path).startswith(HEADER)


def _assemble(
    path: Path,
    numbers: NumberStream,
    cameras: Floats,
    places: Floats,
    sightings: list[Floats],
) -> SparseMap:
    registered = cameras[:, 0] > 0
    table = np.concatenate([np.empty((0, 4)), *sightings])
    listed = numbers.indices(table[:, 0], "cameras")
    wrong = np.flatnonzero((listed < 0) | (listed >= len(cameras)))
    if len(wrong):
        expected = f"indices of the {len(cameras)} cameras"
        raise FileFormatError(path, expected, str(listed[wrong[0]]))
    known = registered[listed]
    row_of = np.cumsum(registered) - 1
    landmark_of = np.repeat(np.arange(len(places)), [len(rows) for rows in sightings])
    used = cameras[registered]
    rotations = used[:, 3:12].reshape(-1, 3, 3) * FLIP[:, None]
    dropped = {
        "unregistered_views": int((~registered).sum()),
        "sightings_of_unregistered_views": int((~known).sum()),
    }
    names = _names(path, len(cameras))
    return SparseMap(
        system="Bundler",
        T_world_camera=compose(rotations, used[:, 12:] * FLIP, world_to_camera=True),
        landmarks=places,
        view_of=row_of[listed[known]],
        landmark_of=landmark_of[known],
        names=tuple(names[row] for row in np.flatnonzero(registered)),
        cameras=tuple(Camera(model="Bundler", focal_px=float(focal)) for focal in used[:, 0])
        or (Camera(model="none"),),
        camera_of=np.arange(len(used)),
        pixels=table[known, 2:] * FLIP[:2],
        dropped=+Counter(dropped),
    )


def _names(path: Path, count: int) -> list[str]:
    """Return the names of the images, from the list beside the file if it has as many."""
    for name in NAMES:
        beside = path.with_name(name)
        if beside.is_file():
            with open_rows(beside) as stream:
                names = [line.split()[0] for line in stream if line.strip()]
            if len(names) == count:
                return names
    return [str(number) for number in range(count)]
