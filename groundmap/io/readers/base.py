"""The base of the readers of sparse maps: from a `SparseMap` to the log of its views."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from groundmap.errors import FileFormatError, InputError
from groundmap.io.log import ViewLog
from groundmap.io.poses import poses_by_id, poses_by_time, read_poses
from groundmap.sparse.sparse_map import SparseMap
from groundmap.sparse.views import SparseViews
from groundmap.sparse.visibility import guess_visibility as guess_sightings
from groundmap.view.view import View


class SparseMapLog(ViewLog):
    """The views of the sparse map of a SLAM or SfM system, which is read when it is opened.

    Parameters
    ----------
    path : Path
        A file, or the folder of several.
    poses : Path, optional
        A file whose poses replace those of the cameras, in the world of the landmarks.
    point_noise : float, optional
        Standard deviation of the positions of landmarks; default: that of their triangulation.
    guess_visibility : bool, default False
        Whether to guess which view saw which landmark, if the files do not contain it.

    Raises
    ------
    FileFormatError
        Invalid files, or files that lack something: the error names it, and where it is found.
    """

    def __init__(
        self,
        path: Path,
        *,
        poses: Path | None = None,
        point_noise: float | None = None,
        guess_visibility: bool = False,
    ) -> None:
        super().__init__(path, poses=poses)
        self.guess_visibility = guess_visibility
        with named_by(path):
            sparse = self.read_map(path)
            if poses is not None:
                sparse = _with_poses(sparse, poses)
            if guess_visibility and not sparse.sightings:
                sparse = guess_sightings(sparse)
            check_usable(path, sparse)
            self.sparse = sparse
            self._views = SparseViews(sparse, point_noise=point_noise)

    @abstractmethod
    def read_map(self, path: Path) -> SparseMap:
        """Read the files."""

    @property
    def split_views(self) -> int:
        """Number of wide views, each of which is split into flat ones."""
        return self._views.split

    def __len__(self) -> int:
        """Return the number of views; a wide one counts as four."""
        return len(self._views)

    def __iter__(self) -> Iterator[View]:
        """Iterate over the views in the order of the file."""
        return iter(self._views)


@contextmanager
def named_by(path: Path) -> Iterator[None]:
    """Turn errors about the content of a map into errors that name its file."""
    try:
        yield
    except FileFormatError:
        raise
    except InputError as error:
        where = f"{error.name}{f' of {error.where}' if error.where else ''}"
        raise FileFormatError(
            path, f"{where} to be {error.expected}", error.got, hint=error.hint
        ) from error


def check_usable(path: Path, sparse: SparseMap) -> None:
    """Check that a map has views, landmarks, and sightings.

    Parameters
    ----------
    path : Path
    sparse : SparseMap

    Raises
    ------
    FileFormatError
        One of them is missing.
    """
    counts = {"poses": len(sparse), "landmarks": len(sparse.landmarks), "sightings": 0}
    counts["sightings"] = sparse.sightings
    empty = [name for name, count in counts.items() if not count]
    if empty:
        found = ", ".join(f"{count:,} {name}" for name, count in counts.items())
        raise FileFormatError(
            path,
            f"a map of {sparse.system} with poses, landmarks, and which view saw which",
            f"no {empty[0]} ({found})",
            hint=MISSING[empty[0]],
        )


MISSING = {
    "poses": "No image was registered: map the folder of a complete reconstruction.",
    "landmarks": "Cameras alone do not show where free space is: export the points as well.",
    "sightings": "Without them no line of sight is known: export the tracks of the points.",
}


def _with_poses(sparse: SparseMap, path: Path) -> SparseMap:
    """Return the map with the poses of a file, by timestamp or by index of the view."""
    by_time = sparse.timestamps is not None and read_poses(path).keys.dtype.kind != "i"
    if by_time:
        assert sparse.timestamps is not None
        transforms = poses_by_time(path, sparse.timestamps)
    else:
        transforms = poses_by_id(path, np.arange(len(sparse)))
    return replace(sparse, T_world_camera=transforms)
