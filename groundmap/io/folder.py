"""A folder of views: a plain-text format that is easy to write from any program.

``rig.toml``
    ``world = "optical"`` (x right, y down, z forward) or ``"rep103"`` (z up), ``fx``, ``fy``,
    ``cx``, ``cy`` [px], ``baseline`` [m]; optional ``pixel_noise_px`` and ``T_base_camera``, the
    camera in ``base_link`` as four lists of four numbers (default: the identity). Without features
    in pixels, ``world`` is enough: the borders of the image are then those of the features.
``poses.txt``
    One row per view, the pose of ``base_link`` in the world: ``timestamp tx ty tz qx qy qz qw``.
``points.csv``
    With the header ``view,id,uL,uR,v``, or ``view,id,x,y,z,cxx,cxy,cxz,cyy,cyz,czz`` (camera
    frame), or ``view,id,x,y,z``, with the covariance that the rig gives, or the bearings of the
    views that saw a landmark. ``view`` is the zero-based row of ``poses.txt``, ascending; id -1
    means no id.
``segments.csv``
    The same with both ends: ``view,id,uL0,uR0,v0,uL1,uR1,v1``, or ``view,id,x0,...,czz0,x1,...``.
    Either of the two tables may be missing.
``features.npz``
    Instead of both tables, and read into memory: ``points`` and/or ``segments``, 2-D arrays of the
    same columns, and ``points_columns`` and ``segments_columns``, the names of the columns.

Blank lines and comments from ``#`` to the end of the line are ignored in the text files; the first
line of a table is its header.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from groundmap.errors import FileFormatError
from groundmap.io.columns import KINDS, Kind
from groundmap.io.feature_tables import CsvTable, FeatureTable, read_npz
from groundmap.io.log import ViewLog
from groundmap.io.poses import poses_by_time, read_tum
from groundmap.io.positions import rig_and_noise
from groundmap.io.rig import read_rig
from groundmap.view.frames import map_from_world
from groundmap.view.view import View

RIG, POSES, ARCHIVE = "rig.toml", "poses.txt", "features.npz"
TABLES: dict[Kind, str] = {"points": "points.csv", "segments": "segments.csv"}


class FolderLog(ViewLog):
    """Views of a folder in the format that `groundmap.io.folder` describes.

    Rig, poses and headers are read when the log is opened. Every iteration streams and checks the
    rows of the csv tables again.

    Raises
    ------
    FileFormatError
        A missing or invalid file; no file with features, or both csv tables and an archive.
    """

    looks_for = f"{RIG}, or one of {', '.join(TABLES.values())} and {ARCHIVE}"

    def __init__(self, path: Path, *, poses: Path | None = None) -> None:
        path = path.parent if path.is_file() else path
        super().__init__(path, poses=poses)
        given = read_rig(path / RIG)
        own = read_tum(path / POSES)
        T_world_base = own.transforms if poses is None else poses_by_time(poses, own.keys)
        self._timestamps = own.keys.tolist()
        self._T_map_base = map_from_world(T_world_base, given.world)
        self._tables = _find_tables(path)
        T_map_camera = self._T_map_base @ given.T_base_camera
        self.rig, self._noise = rig_and_noise(path / RIG, given, self._tables, T_map_camera)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a rig or a table of features exists; other formats have poses, too."""
        if path.is_file():
            return path.name in {RIG, POSES, ARCHIVE, *TABLES.values()} and cls.recognises(
                path.parent
            )
        return any((path / name).is_file() for name in (RIG, ARCHIVE, *TABLES.values()))

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self._timestamps)

    def __iter__(self) -> Iterator[View]:
        """Iterate over the views in the order of the poses."""
        tables = (self._tables[kind].by_view(len(self), self.rig, self._noise) for kind in KINDS)
        poses = zip(self._T_map_base, self._timestamps, strict=True)
        for (T_map_base, timestamp), points, segments in zip(poses, *tables, strict=True):
            yield View(
                T_map_base=T_map_base,
                rig=self.rig,
                points=points.features,
                segments=segments.features,
                timestamp=timestamp,
                dropped=points.dropped + segments.dropped,
            )


def _find_tables(path: Path) -> dict[Kind, FeatureTable]:
    tables = [name for name in TABLES.values() if (path / name).exists()]
    archive = (path / ARCHIVE).exists()
    if archive and tables:
        raise FileFormatError(path, f"{ARCHIVE} or csv tables", f"both {ARCHIVE} and {tables[0]}")
    if archive:
        return read_npz(path / ARCHIVE)
    if not tables:
        names = ", ".join(TABLES.values())
        raise FileFormatError(path, f"one of {names} and {ARCHIVE}", "none of them")
    return {kind: CsvTable(path / name, kind) for kind, name in TABLES.items()}
