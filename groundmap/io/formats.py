"""The formats of logs by name, and `read_views`, which recognises them."""

from __future__ import annotations

from difflib import SequenceMatcher
from os import PathLike
from pathlib import Path

from groundmap.errors import FileFormatError, InputError
from groundmap.files.opening import check_name
from groundmap.io.folder import FolderLog
from groundmap.io.gtsam import GtsamLog
from groundmap.io.log import ViewLog
from groundmap.io.readers.bal import BalLog
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.bundler import BundlerLog
from groundmap.io.readers.colmap import ColmapLog
from groundmap.io.readers.meshroom import MeshroomLog
from groundmap.io.readers.nvm import NvmLog
from groundmap.io.readers.openmvg import OpenMvgLog
from groundmap.io.readers.openmvs import OpenMvsLog
from groundmap.io.readers.opensfm import OpenSfmLog
from groundmap.io.readers.orbslam import OrbSlamLog
from groundmap.io.readers.points import PointsLog
from groundmap.io.readers.refused import refusal_of
from groundmap.io.readers.rosbag import RosbagLog
from groundmap.io.readers.rtabmap import RtabmapLog
from groundmap.io.readers.stella import StellaLog

FORMATS: dict[str, type[ViewLog]] = {
    "gtsam": GtsamLog,
    "folder": FolderLog,
    "bal": BalLog,
    "bundler": BundlerLog,
    "colmap": ColmapLog,
    "meshroom": MeshroomLog,
    "nvm": NvmLog,
    "openmvg": OpenMvgLog,
    "openmvs": OpenMvsLog,
    "opensfm": OpenSfmLog,
    "orbslam": OrbSlamLog,
    "points": PointsLog,
    "rosbag": RosbagLog,
    "rtabmap": RtabmapLog,
    "stella": StellaLog,
}

SHOWN_NAMES = 5  # of the files of an unknown folder


def read_views(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    poses: str | PathLike[str] | None = None,
    point_noise: float | None = None,
    guess_visibility: bool = False,
) -> ViewLog:
    """Open a log of views, or the sparse map of a SLAM or structure-from-motion system.

    Parameters
    ----------
    path : path
        The folder or file that holds the log.
    format : str, optional
        A key of `FORMATS`; default: recognised by the contents of the files.
    poses : path, optional
        A file whose poses replace the log's, in the same world: rows of ``timestamp tx ty tz
        qx qy qz qw``, or of an id and the 16 numbers of the transform. A GTSAM log finds them by
        id (timestamps are taken as ids); a folder uses them row by row, and their timestamps must
        be those of the log (ids are taken as indices of views).
    point_noise : float, optional [unit of the log]
        Standard deviation of the landmarks of a sparse map; default: that of their triangulation.
    guess_visibility : bool, default False
        Whether to guess which view saw which landmark, where the files do not contain it.

    Returns
    -------
    ViewLog
        Sized and re-iterable; it creates one view at a time.

    Raises
    ------
    InputError
        An unknown format; the error lists the known ones, the nearest first.
    FileFormatError
        Nothing of that name, no known format, two formats, or invalid files.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from groundmap import StereoRig, View
    >>> from groundmap.io import write_views
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> seen = View.from_pixels(np.eye(4), rig, points_px=[(355.0, 320.0, 275.0)])
    >>> with TemporaryDirectory() as folder:
    ...     write_views([seen, seen], folder)
    ...     views = read_views(folder)
    ...     print(len(views), *(view.points.xyz for view in views))
    2 [[ 0.5  0.5 10. ]] [[ 0.5  0.5 10. ]]
    """
    source = Path(path)
    if format is not None and format not in FORMATS:
        raise InputError("format", f"one of {', '.join(_nearest_first(format))}", repr(format))
    check_name(source, "a log of views")
    if not source.exists():
        raise FileFormatError(source, "a folder or file of views", "nothing of that name")
    if not (source.is_file() or source.is_dir()):
        raise FileFormatError(source, "a folder or file of views", "a device, pipe or socket")
    log = FORMATS[format] if format is not None else _recognise(source)
    replaced = None if poses is None else Path(poses)
    if issubclass(log, SparseMapLog):
        return log(
            source, poses=replaced, point_noise=point_noise, guess_visibility=guess_visibility
        )
    if point_noise is not None or guess_visibility:
        name = "point_noise" if point_noise is not None else "guess_visibility"
        raise InputError(name, "a sparse map, which has landmarks", f"a log of {source}")
    return log(source, poses=replaced)


def _recognise(source: Path) -> type[ViewLog]:
    certain = _found(source, weak=False) or _found(source, weak=True)
    if len(certain) > 1:
        hint = f"Choose one: --format {certain[0]}, or --format {certain[1]}."
        raise FileFormatError(source, "one log", f"files of {' and '.join(certain)}", hint=hint)
    if certain:
        return FORMATS[certain[0]]
    refusal = refusal_of(source)
    if refusal is not None:
        raise refusal
    formats = "; ".join(f"{name}: {log.looks_for}" for name, log in FORMATS.items())
    raise FileFormatError(source, f"the files of a known format ({formats})", _contents(source))


def _found(source: Path, *, weak: bool) -> list[str]:
    return [name for name, log in FORMATS.items() if log.weak == weak and log.recognises(source)]


def _contents(source: Path) -> str:
    """Return what a source contains that no format has, for error messages."""
    if source.is_file():
        return "another file"
    names = sorted(entry.name + "/" * entry.is_dir() for entry in source.iterdir())
    if not names:
        return "an empty folder"
    more = f" and {len(names) - SHOWN_NAMES} more" if len(names) > SHOWN_NAMES else ""
    return f"none of them, but {', '.join(names[:SHOWN_NAMES])}{more}"


def _nearest_first(name: str) -> list[str]:
    return sorted(FORMATS, key=lambda known: -SequenceMatcher(None, name, known).ratio())
