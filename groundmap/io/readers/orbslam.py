"""Reader of ORB-SLAM's text files: a trajectory, and the map points with their keyframes.

The trajectory has rows in TUM form (``t x y z qx qy qz qw``, camera to world). ORB-SLAM2 and 3 do
not save which keyframe saw which point; common forks write a row ``x y z t1 t2 ...`` for each
point, with the stamps of its keyframes, or the indices of rows of the trajectory.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.text_tables import (
    TextKind,
    Trajectory,
    kind_of,
    read_trajectory,
    read_words,
    seconds,
)
from groundmap.sparse.sparse_map import SparseMap

STAMP_TOLERANCE = 5e-4  # [s]; keyframes are at least 30 ms apart
MOST_FILES = 200  # of a folder that are looked at
TRAJECTORIES: tuple[TextKind, ...] = ("tum", "stella", "euroc", "kitti")


class OrbSlamLog(SparseMapLog):
    """Views of ORB-SLAM's keyframes and map points."""

    looks_for = "a trajectory (t x y z qx qy qz qw) and map points with stamps (x y z t1 t2 ...)"

    weak = True

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a text file of a trajectory and one of sightings lie together."""
        kinds = kinds_in(path)
        return "sightings" in kinds and any(kind in kinds for kind in TRAJECTORIES)

    def read_map(self, path: Path) -> SparseMap:
        """Read the points, and the trajectory to which most of their stamps belong."""
        kinds = kinds_in(path)
        points = chosen(path, kinds, ("sightings",), "map points with stamps: x y z t1 t2 ...")
        sightings = _read_sightings(points)
        candidates = [file for kind in TRAJECTORIES[:3] for file in kinds.get(kind, [])]
        if path.is_file() and path in candidates:
            candidates = [path]
        if not candidates:
            expected = "a trajectory with stamps beside it: t x y z qx qy qz qw"
            raise FileFormatError(points, expected, "none")
        tracks = [read_trajectory(file, _kind(kinds, file)) for file in candidates]
        matches = [_match(track, sightings) for track in tracks]
        best = int(np.argmax([match.known.sum() for match in matches]))
        return _assemble(tracks[best], sightings, matches[best])


def kinds_in(path: Path) -> dict[TextKind, list[Path]]:
    """Return the text files of a folder, or around a file, by what they contain."""
    folder = path if path.is_dir() else path.parent
    found: dict[TextKind, list[Path]] = {}
    if path.is_file() and kind_of(path) is None:
        return found
    files = sorted(file for file in folder.iterdir() if file.is_file())
    for file in files[:MOST_FILES]:
        kind = kind_of(file)
        if kind is not None:
            found.setdefault(kind, []).append(file)
    return found


def chosen(
    path: Path, kinds: dict[TextKind, list[Path]], wanted: tuple[TextKind, ...], expected: str
) -> Path:
    """Return the file of a kind, the given one if it is of that kind.

    Parameters
    ----------
    path : Path
        The file or folder that was given.
    kinds : dict
        Result of `kinds_in`.
    wanted : tuple of str
        Kinds.
    expected : str
        For error messages.

    Raises
    ------
    FileFormatError
        No such file, or several, of which none was given.
    """
    files = [file for kind in wanted for file in kinds.get(kind, [])]
    if path in files:
        return path
    if len(files) != 1:
        got = f"{len(files)}: {', '.join(file.name for file in files[:5])}" if files else "none"
        hint = "Give one of the files." if files else ""
        raise FileFormatError(path, f"one file with {expected}", got, hint=hint)
    return files[0]


def _kind(kinds: dict[TextKind, list[Path]], file: Path) -> TextKind:
    return next(kind for kind, files in kinds.items() if file in files)


class _Sightings(NamedTuple):
    path: Path
    points: Floats  # (m, 3) [world]
    point_of: Ints  # (k,)
    views: Floats  # (k,), stamps [s] or indices


class _Match(NamedTuple):
    view_of: Ints  # (k,)
    known: Bools  # (k,)


def _read_sightings(path: Path) -> _Sightings:
    numbers, counts, lines = read_words(path)
    short = np.flatnonzero(counts < 3)
    if len(short):
        expected = "x y z and the stamps of the keyframes"
        line = int(lines[short[0]])
        raise FileFormatError(path, expected, f"{counts[short[0]]} numbers", line=line)
    starts = np.cumsum(counts) - counts
    points = numbers[starts[:, None] + np.arange(3)]
    is_position = np.zeros(len(numbers), dtype=np.bool_)
    is_position[(starts[:, None] + np.arange(3)).ravel()] = True
    owner = np.repeat(np.arange(len(counts)), counts - 3)
    return _Sightings(path, points, owner, seconds(numbers[~is_position]))


def _match(track: Trajectory, sightings: _Sightings) -> _Match:
    """Return the view of each sighting, by its stamp, or as the index of a pose."""
    assert track.stamps is not None
    order = np.argsort(track.stamps, kind="stable")
    stamps = track.stamps[order]
    place = np.searchsorted(stamps, sightings.views).clip(1, max(len(stamps) - 1, 1))
    place = np.minimum(place, len(stamps) - 1)
    earlier = np.maximum(place - 1, 0)
    with np.errstate(invalid="ignore"):
        nearer = np.abs(stamps[earlier] - sightings.views) < np.abs(stamps[place] - sightings.views)
        place = np.where(nearer, earlier, place)
        known = np.abs(stamps[place] - sightings.views) <= STAMP_TOLERANCE
    if known.any() or not len(sightings.views):
        return _Match(order[place], known)
    whole = np.isfinite(sightings.views) & (np.rint(sightings.views) == sightings.views)
    listed = whole & (sightings.views < len(stamps)) & (sightings.views >= 0)
    return _Match(np.where(listed, sightings.views, 0).astype(np.int64), listed)


def _assemble(track: Trajectory, sightings: _Sightings, match: _Match) -> SparseMap:
    unknown = sightings.views[~match.known]
    orphans = len(np.unique(unknown))
    if not match.known.any():
        raise FileFormatError(
            sightings.path,
            f"stamps of the poses in {track.path.name}",
            f"none within {STAMP_TOLERANCE:g} s of any",
            hint="The files may be of different runs.",
        )
    notes = []
    if orphans:
        notes.append(
            f"{len(unknown):,} sightings have the stamps of {orphans} keyframes that are not in "
            f"{track.path.name} (ORB-SLAM culls keyframes)"
        )
    return SparseMap(
        system="ORB-SLAM",
        T_world_camera=track.poses,
        landmarks=sightings.points,
        view_of=match.view_of[match.known],
        landmark_of=sightings.point_of[match.known],
        timestamps=track.stamps,
        dropped=Counter({"sightings_of_unknown_views": len(unknown)}),
        notes=tuple(notes),
    )
