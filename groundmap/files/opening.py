"""Opening files that others wrote: whatever is wrong with a name or a file is said by one error."""

from __future__ import annotations

import io
import os
import stat
from os import PathLike
from typing import BinaryIO

from groundmap.errors import FileFormatError


def open_file(path: str | PathLike[str], expected: str = "a readable file") -> BinaryIO:
    """Open a file to read its bytes.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for the error.

    Raises
    ------
    FileFormatError
        A name that no file can have, or a file that is missing, is a folder or can't be read.
    """
    try:
        stream = open(path, "rb")  # noqa: SIM115  # the caller closes it
        if stat.S_ISDIR(os.fstat(stream.fileno()).st_mode):  # some systems open folders, too
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
        raise FileFormatError(path, expected, "a name that no file can have") from error


def open_text(path: str | PathLike[str], expected: str = "a readable file") -> io.TextIOWrapper:
    """Open a text file, whatever bytes it holds; a byte order mark is passed over.

    Raises
    ------
    FileFormatError
        As of `open_file`.
    """
    return io.TextIOWrapper(open_file(path, expected), encoding="utf-8-sig", errors="replace")


def read_file(path: str | PathLike[str], expected: str, *, most: int) -> bytes:
    """Return the bytes of a file of a bounded size.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for the error.
    most : int
        Largest size [bytes].

    Raises
    ------
    FileFormatError
        As of `open_file`, or a file that is larger.
    """
    with open_file(path, expected) as stream:
        try:
            content = stream.read(most + 1)
        except OSError as error:
            raise FileFormatError(path, expected, reason_of(error)) from error
    if len(content) > most:
        raise FileFormatError(path, f"{expected} of at most {most} bytes", "a larger one")
    return content


def check_name(path: str | PathLike[str], expected: str) -> None:
    """Check that a file or folder can have such a name, before it is asked for or made.

    Raises
    ------
    FileFormatError
        A name that the system takes for no file or folder, such as one with NUL in it.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise FileFormatError(path, expected, reason_of(error)) from error
    except ValueError as error:  # NUL, or an unpaired surrogate
        raise FileFormatError(path, expected, "a name that no file can have") from error


def reason_of(error: OSError) -> str:
    """Return what the system says, in lower case, such as ``permission denied``."""
    return (error.strerror or str(error)).lower()
