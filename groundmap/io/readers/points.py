"""Reader of a trajectory with points (ORB-SLAM's own files): refused, or visibility is guessed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundmap.errors import FileFormatError
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.orbslam import TRAJECTORIES, chosen, kinds_in
from groundmap.io.readers.point_files import read_points
from groundmap.io.readers.text_tables import TextKind, read_trajectory
from groundmap.sparse.sparse_map import SparseMap

NONE = np.empty(0, dtype=np.int64)
HINT = (
    "ORB-SLAM does not save which keyframe saw which point: docs/sources/orbslam.md has the few "
    "lines that make it. --guess-visibility guesses it."
)


class PointsLog(SparseMapLog):
    """Views of a trajectory and points, where visibility is to be guessed."""

    looks_for = "a trajectory and a file of points (.txt, .obj, .ply, .pcd, .xyz)"
    weak = True

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a trajectory and points lie together, without sightings."""
        kinds = kinds_in(path)
        tracks = any(kind in kinds for kind in TRAJECTORIES)
        return tracks and "points" in kinds and "sightings" not in kinds

    def read_map(self, path: Path) -> SparseMap:
        """Read the points, and the trajectory: that of the keyframes if there are several."""
        kinds = kinds_in(path)
        points = chosen(path, kinds, ("points",), "points")
        track = _trajectory(path, kinds)
        if not self.guess_visibility:
            got = f"a trajectory ({track.name}) and points ({points.name}) without visibility"
            expected = "poses, landmarks, and which view saw which"
            raise FileFormatError(path, expected, got, hint=HINT)
        kind = next(kind for kind, files in kinds.items() if track in files)
        found = read_trajectory(track, kind)
        return SparseMap(
            system="points",
            T_world_camera=found.poses,
            landmarks=read_points(points),
            view_of=NONE,
            landmark_of=NONE,
            timestamps=found.stamps,
        )


def _trajectory(path: Path, kinds: dict[TextKind, list[Path]]) -> Path:
    files = [file for kind in TRAJECTORIES for file in kinds.get(kind, [])]
    keyframes = [file for file in files if file.name.lower().startswith(("keyframe", "kf_"))]
    if len(files) > 1 and len(keyframes) == 1 and path not in files:
        return keyframes[0]
    return chosen(path, kinds, TRAJECTORIES, "a trajectory")
