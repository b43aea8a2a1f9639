"""One-file archives of arrays with a header: no pickle, atomic, versioned.

The file is a zip of ``.npy`` members (an ``.npz``), so NumPy alone can open it; the member
``header`` is JSON.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from groundmap.errors import FileFormatError
from groundmap.files.array_files import read_arrays
from groundmap.files.documents import WrongDocumentError, parse_json
from groundmap.files.opening import check_name, reason_of

TEMPORARY = ".groundmap-"  # what the names of files begin with until they are whole


def write_atomically(path: str | PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
    """Call `write` on a temporary file beside `path`, then rename it: all or nothing."""
    target = Path(path)
    check_name(target, "a file that can be written")
    _check_regular(target)
    # Its name does not hold the target's, which may be as long as the system takes.
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=TEMPORARY)
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes private files; a map is as readable as any other file of its owner.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_archive(
    path: str | PathLike[str],
    header: Mapping[str, Any],
    arrays: Mapping[str, npt.NDArray[np.generic]],
) -> None:
    """Write a header and arrays to one compressed file, atomically."""
    text = np.array(json.dumps(header))

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(stream, allow_pickle=False, header=text, **arrays)

    write_atomically(path, write)


def read_archive(
    path: str | PathLike[str], expected_format: str, newest_version: int
) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Return header and arrays of a file that `write_archive` wrote.

    Raises
    ------
    FileFormatError
        Missing, no archive, truncated, of another format or of a newer version.
    """
    arrays = read_arrays(path, f"a {expected_format} file")
    try:
        header = parse_json(str(arrays.pop("header")))
    except (KeyError, WrongDocumentError):  # some other program's archive
        header = None
    if not isinstance(header, dict) or header.get("format") != expected_format:
        raise FileFormatError(path, f"a {expected_format} file", "another kind of archive")
    version = header.get("version")
    if not isinstance(version, int) or isinstance(version, bool):
        raise FileFormatError(path, "a version number", repr(version))
    if version > newest_version:
        raise FileFormatError(
            path,
            f"version {newest_version} or older",
            f"version {version}",
            hint="Upgrade groundmap.",
        )
    return header, arrays


def check_writable(
    path: str | PathLike[str], *, sources: Iterable[str | PathLike[str]] = ()
) -> None:
    """Check that a file can be written there, before the work whose result it is to hold.

    An empty file is made in its folder, and removed: nothing else shows what may be written.

    Raises
    ------
    FileFormatError
        A folder that does not exist or can't be written to, a path that is a folder, a device or
        the like, a name that no file can have, or that of one of the files `sources` that the
        work reads.
    """
    target = Path(path)
    try:
        _check_target(target, sources)
        with tempfile.TemporaryFile(dir=target.parent, prefix=TEMPORARY):
            pass
    except OSError as error:
        raise FileFormatError(target, "a file that can be written", reason_of(error)) from error
    except (ValueError, RuntimeError) as error:  # NUL or an unpaired surrogate; links in a circle
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(target, "a file that can be written", "no such name") from error


def _check_target(target: Path, sources: Iterable[str | PathLike[str]]) -> None:
    with suppress(FileNotFoundError, NotADirectoryError):
        target.lstat()  # says what no name can be, such as one that is too long
    if target.is_dir():
        raise FileFormatError(target, "a file name", "a folder")
    if target.resolve() in [Path(source).resolve() for source in sources]:
        raise FileFormatError(target, "another file than the one that is read", "the same")
    _check_regular(target)
    if not target.parent.is_dir():
        raise FileFormatError(
            target, "a file in a folder that exists", f"no folder {target.parent}"
        )


def _check_regular(target: Path) -> None:
    """Refuse to replace a device, a pipe or the like by a file."""
    if target.exists() and not (target.is_file() or target.is_dir()):
        raise FileFormatError(target, "a file, or the name of a new one", "something else")
