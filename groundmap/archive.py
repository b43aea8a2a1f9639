"""One-file archives of arrays with a header: no pickle, atomic, versioned.

The file is a zip of ``.npy`` members (an ``.npz``), so NumPy alone can open it; the member
``header`` is JSON.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from groundmap.errors import FileFormatError


def write_atomically(path: str | PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
    """Call `write` on a temporary file beside `path`, then rename it: all or nothing."""
    target = Path(path)
    _check_regular(target)
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
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
    try:
        # Opened here: np.load leaves a broken archive's file open.
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(str(arrays.pop("header")))
    except FileNotFoundError as error:
        raise FileFormatError(path, f"a {expected_format} file", "no file of that name") from error
    except IsADirectoryError as error:
        raise FileFormatError(path, f"a {expected_format} file", "a folder") from error
    except Exception as error:  # damaged bytes make NumPy, zipfile and zlib raise nearly anything
        raise FileFormatError(
            path, f"a {expected_format} file", f"something else ({type(error).__name__})"
        ) from error
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

    Raises
    ------
    FileFormatError
        The folder does not exist, the path is a folder, a device or the like, or it is one of
        the files `sources` that the work reads.
    """
    target = Path(path)
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
