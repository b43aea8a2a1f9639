"""Archives of arrays with a versioned header, written atomically and without pickle.

An archive is a zip of ``.npy`` members (an ``.npz``), which NumPy can open; the member ``header``
is JSON.
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
from groundmap.files.opening import INVALID_NAME, check_name, reason_of

TEMPORARY = ".groundmap-"  # prefix of the names of files that are being written


def write_atomically(path: str | PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
    """Write a file completely or not at all: to a temporary file that is then renamed.

    Parameters
    ----------
    path : path
    write : callable
        Writes the content to the binary stream that it is called with.

    Raises
    ------
    FileFormatError
        The name is invalid, or that of a device, a pipe or the like.
    OSError
        The file cannot be written.
    """
    target = Path(path)
    check_name(target, "a file that can be written")
    _check_regular(target)
    # The temporary name does not contain that of the target, which may have the maximum length.
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=TEMPORARY)
    try:
        with os.fdopen(handle, "wb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes private files; a map gets the permissions of any new file.
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
    """Write a header and arrays to a compressed archive, atomically.

    Parameters
    ----------
    path : path
    header : mapping
        JSON values by key, with ``format`` and ``version`` among them.
    arrays : mapping of str to ndarray
    """
    text = np.array(json.dumps(header))

    def write(stream: IO[bytes]) -> None:
        np.savez_compressed(stream, allow_pickle=False, header=text, **arrays)

    write_atomically(path, write)


def read_archive(
    path: str | PathLike[str], expected_format: str, newest_version: int
) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Return the header and the arrays of an archive from `write_archive`.

    Parameters
    ----------
    path : path
    expected_format : str
        ``format`` of the header.
    newest_version : int
        Newest ``version`` that the caller can read.

    Raises
    ------
    FileFormatError
        The file is missing, damaged, not an archive, of another format, or of a newer version.
    """
    arrays = read_arrays(path, f"a {expected_format} file")
    try:
        header = parse_json(str(arrays.pop("header")))
    except (KeyError, WrongDocumentError):  # an archive of another program
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
    """Check that a file can be written, before the computation of its content.

    An empty file is created in the same folder and removed, since only this shows permissions.

    Parameters
    ----------
    path : path
    sources : iterable of path
        Input files of the computation.

    Raises
    ------
    FileFormatError
        The folder does not exist or is not writable, the name is invalid, or the path is that of a
        folder, a device or the like, or of one of the `sources`.
    """
    target = Path(path)
    try:
        _check_target(target, sources)
        with tempfile.TemporaryFile(dir=target.parent, prefix=TEMPORARY):
            pass
    except OSError as error:
        raise FileFormatError(target, "a file that can be written", reason_of(error)) from error
    except (ValueError, RuntimeError) as error:  # NUL or an unpaired surrogate; a loop of links
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(target, "a file that can be written", INVALID_NAME) from error


def _check_target(target: Path, sources: Iterable[str | PathLike[str]]) -> None:
    with suppress(FileNotFoundError, NotADirectoryError):
        target.lstat()  # raises for invalid names, such as one that is too long
    if target.is_dir():
        raise FileFormatError(target, "a file name", "a folder")
    if target.resolve() in [Path(source).resolve() for source in sources]:
        raise FileFormatError(target, "a file other than the input", "an input file")
    _check_regular(target)
    if not target.parent.is_dir():
        raise FileFormatError(
            target, "a file in a folder that exists", f"no folder {target.parent}"
        )


def _check_regular(target: Path) -> None:
    """Check that writing would not replace a device, a pipe or the like."""
    if target.exists() and not (target.is_file() or target.is_dir()):
        raise FileFormatError(target, "a file, or the name of a new one", "something else")
