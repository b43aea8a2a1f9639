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

FORMATS: dict[str, type[ViewLog]] = {"gtsam": GtsamLog, "folder": FolderLog}


def read_views(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    poses: str | PathLike[str] | None = None,
) -> ViewLog:
    """Open a log of views.

    Parameters
    ----------
    path : path
        The folder that holds the log.
    format : str, optional
        A key of `FORMATS`; default: recognised by the folder's files.
    poses : path, optional
        A file whose poses replace the log's, in the same world: rows of ``timestamp tx ty tz
        qx qy qz qw``, or of an id and the 16 numbers of the transform. A GTSAM log finds them by
        id (timestamps are taken as ids); a folder uses them row by row, and their timestamps must
        be those of the log (ids are taken as indices of views).

    Returns
    -------
    ViewLog
        Sized and re-iterable; it creates one view at a time.

    Raises
    ------
    InputError
        An unknown format; the error lists the known ones, the nearest first.
    FileFormatError
        Not a folder, a folder of no known format, or invalid files.

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
    folder = Path(path)
    if format is not None and format not in FORMATS:
        raise InputError("format", f"one of {', '.join(_nearest_first(format))}", repr(format))
    check_name(folder, "a folder of views")
    if not folder.is_dir():
        if folder.exists():
            hint = "Give the folder that contains it."
            raise FileFormatError(folder, "a folder of views", "a file", hint=hint)
        raise FileFormatError(folder, "a folder of views", "nothing of that name")
    log = FORMATS[format] if format is not None else _recognise(folder)
    return log(folder, poses=None if poses is None else Path(poses))


def _recognise(folder: Path) -> type[ViewLog]:
    for log in FORMATS.values():
        if log.recognises(folder):
            return log
    known = "; ".join(f"{name}: {log.looks_for}" for name, log in FORMATS.items())
    raise FileFormatError(folder, f"the files of a known format ({known})", "none of them")


def _nearest_first(name: str) -> list[str]:
    return sorted(FORMATS, key=lambda known: -SequenceMatcher(None, name, known).ratio())
