"""Recognition of files by their first bytes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from pathlib import Path

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file

HEAD_BYTES = 4096
MOST_FILES = 200  # of a folder that are looked at


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file; nothing for folders and unreadable files."""
    if not path.is_file():
        return b""
    try:
        with open_file(path) as stream:
            return stream.read(HEAD_BYTES)
    except (OSError, FileFormatError):
        return b""


def matching_files(path: Path, is_kind: Callable[[Path], bool]) -> list[Path]:
    """Return the file itself, or those of the first files of a folder that are of a kind.

    Parameters
    ----------
    path : Path
    is_kind : callable
        From a path to whether it is of the kind.
    """
    if path.is_file():
        return [path] if is_kind(path) else []
    if not path.is_dir():
        return []
    files = sorted(islice((entry for entry in path.iterdir() if entry.is_file()), MOST_FILES))
    return [file for file in files if is_kind(file)]


def single_file(path: Path, is_kind: Callable[[Path], bool]) -> Path | None:
    """Return the only file of a kind, the path itself or one in the folder; None if there is none.

    Parameters
    ----------
    path : Path
    is_kind : callable
        From a path to whether it is of the kind.

    Raises
    ------
    FileFormatError
        The folder has several.
    """
    found = matching_files(path, is_kind)
    if len(found) > 1:
        names = ", ".join(file.name for file in found[:5])
        hint = "Give one of the files."
        raise FileFormatError(path, "one map", f"{len(found)}: {names}", hint=hint)
    return found[0] if found else None
