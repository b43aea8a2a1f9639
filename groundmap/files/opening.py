"""Opening of input files; every fault of a name or a file is a `FileFormatError`."""

from __future__ import annotations

import io
import os
import stat
from os import PathLike
from typing import BinaryIO

from groundmap.errors import FileFormatError

INVALID_NAME = "an invalid file name"


def open_file(path: str | PathLike[str], expected: str = "a readable file") -> BinaryIO:
    """Return a stream of the bytes of a file.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The name is invalid, or the file is missing, is a folder or cannot be read.
    """
    try:
        stream = open(path, "rb")  # noqa: SIM115  # the caller closes it
        if stat.S_ISDIR(os.fstat(stream.fileno()).st_mode):  # some systems also open folders
            stream.close()
            raise IsADirectoryError
        return stream
    except FileNotFoundError as error:
        raise FileFormatError(path, expected, "no file of that name") from error
    except IsADirectoryError as error:
        raise FileFormatError(path, expected, "a folder") from error
    except OSError as error:
        raise FileFormatError(path, expected, reason_of(error)) from error
    except ValueError as error:  # NUL, or an unpaired surrogate
        raise FileFormatError(path, expected, INVALID_NAME) from error


def open_text(path: str | PathLike[str], expected: str = "a readable file") -> io.TextIOWrapper:
    """Return a stream of the text of a file.

    A byte order mark is skipped, and bytes that are not UTF-8 become replacement characters.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The file cannot be opened; see `open_file`.
    """
    return io.TextIOWrapper(open_file(path, expected), encoding="utf-8-sig", errors="replace")


def read_file(path: str | PathLike[str], expected: str, *, most: int) -> bytes:
    """Return the bytes of a file of a bounded size.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.
    most : int
        Largest size [bytes].

    Raises
    ------
    FileFormatError
        The file cannot be opened (see `open_file`), or is larger.
    """
    with open_file(path, expected) as stream:
        try:
            content = stream.read(most + 1)
        except OSError as error:
            raise FileFormatError(path, expected, reason_of(error)) from error
    if len(content) > most:
        raise FileFormatError(path, f"{expected} of at most {most} bytes", "a larger file")
    return content


def check_name(path: str | PathLike[str], expected: str) -> None:
    """Check that a name is valid for a file or folder, which need not exist.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The name is invalid, such as one that is too long or has NUL in it.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise FileFormatError(path, expected, reason_of(error)) from error
    except ValueError as error:  # NUL, or an unpaired surrogate
        raise FileFormatError(path, expected, INVALID_NAME) from error


def reason_of(error: OSError) -> str:
    """Return the message of the operating system in lower case, such as ``permission denied``."""
    return (error.strerror or str(error)).lower()
