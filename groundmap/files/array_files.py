"""Archives of arrays (``.npz``) that others wrote, read without trust in what they say."""

from __future__ import annotations

import ast
import math
import re
import zipfile
import zlib
from os import PathLike
from typing import IO, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file

MOST_BYTES = 2**32  # of all arrays of an archive, uncompressed
MOST_MEMBERS = 100
DENSEST = 1040  # bytes that one of deflate's can stand for
MAGIC = b"\x93NUMPY"
MOST_OF_A_HEADER = 10_000  # bytes
DTYPE = re.compile(r"[<>|=]?(?:b1|i[1248]|u[1248]|f[248]|U[0-9]{1,7})")
DIGITS = re.compile(r"[0-9]{20}")  # of a number that no length has
# What the standard library raises at damaged archives, found by damaging them.
DAMAGES = (OSError, EOFError, ValueError, ArithmeticError, LookupError, RuntimeError, SyntaxError,
           TypeError, MemoryError, zipfile.BadZipFile, zlib.error)  # fmt: skip


class _WrongArchiveError(Exception):
    """Something that such an archive can't have; the message says what."""


def read_arrays(
    path: str | PathLike[str], expected: str = "an archive of arrays (npz)"
) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an archive: truth values, whole and real numbers, text.

    Nothing is allocated before the file is known to be large enough to hold it.

    Parameters
    ----------
    path : path
    expected : str
        What the file should be, for the error.

    Raises
    ------
    FileFormatError
        A file that is missing, damaged or no archive; a member that is no array, holds complex
        numbers or objects, or says another shape than it has.
    """
    with open_file(path, expected) as stream:
        try:
            return _read(stream)
        except _WrongArchiveError as error:
            raise FileFormatError(path, expected, str(error)) from error
        except DAMAGES as error:
            got = f"something else, or a damaged one ({type(error).__name__})"
            raise FileFormatError(path, expected, got) from error


def _read(stream: BinaryIO) -> dict[str, npt.NDArray[Any]]:
    length = stream.seek(0, 2)
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
        if len(members) > MOST_MEMBERS:
            raise _WrongArchiveError(f"{len(members)} members")
        for member in members:
            _check_member(member, length)
        if sum(member.file_size for member in members) > MOST_BYTES:
            raise _WrongArchiveError(f"more than {MOST_BYTES} bytes")
        arrays = {}
        for member in members:
            with archive.open(member) as part:
                arrays[member.filename.removesuffix(".npy")] = _array(part, member)
        return arrays


def _check_member(member: zipfile.ZipInfo, length: int) -> None:
    if not member.filename.endswith(".npy"):
        raise _WrongArchiveError(f"a member {member.filename!r}, which is no array")
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise _WrongArchiveError("another compression than NumPy's")
    if member.file_size > DENSEST * length:
        raise _WrongArchiveError(f"a member of {member.file_size} bytes in a file of {length}")


def _array(stream: IO[bytes], member: zipfile.ZipInfo) -> npt.NDArray[Any]:
    """Read one array in NumPy's format, version 1 to 3."""
    name = repr(member.filename)
    start = stream.read(8)
    if start[:6] != MAGIC or start[6:7] not in (b"\1", b"\2", b"\3"):
        raise _WrongArchiveError(f"a member {name}, which is no array")
    counted = stream.read(2 if start[6] == 1 else 4)
    size = int.from_bytes(counted, "little")
    if size > MOST_OF_A_HEADER:
        raise _WrongArchiveError(f"a header of {size} bytes in {name}")
    dtype, order, shape = _header(stream.read(size).decode("utf-8"), name)
    held = member.file_size - len(start) - len(counted) - size
    if math.prod(shape) * dtype.itemsize != held:
        said = " x ".join(map(str, shape)) or "1"
        raise _WrongArchiveError(f"{said} values of {dtype} in {held} bytes in {name}")
    content = stream.read()
    if len(content) != held:
        raise _WrongArchiveError(f"{len(content)} of {held} bytes in {name}")
    # A copy, so that the array can be written to, in the machine's order of bytes.
    array: npt.NDArray[Any] = np.frombuffer(content, dtype).astype(dtype.newbyteorder("="))
    return array.reshape(shape, order="F" if order else "C")


def _header(text: str, name: str) -> tuple[np.dtype[Any], bool, tuple[int, ...]]:
    """Return type, whether columns come first, and shape."""
    said = None if DIGITS.search(text) else ast.literal_eval(text.strip())
    if not isinstance(said, dict) or set(said) != {"descr", "fortran_order", "shape"}:
        raise _WrongArchiveError(f"a strange header in {name}")
    kind, order, shape = said["descr"], said["fortran_order"], said["shape"]
    if not isinstance(kind, str) or not DTYPE.fullmatch(kind):
        raise _WrongArchiveError(f"values of type {kind!r} in {name}")
    whole = isinstance(shape, tuple) and all(type(side) is int and side >= 0 for side in shape)
    if not whole or len(shape) > 32 or not isinstance(order, bool):
        raise _WrongArchiveError(f"the shape {shape!r} in {name}")
    return np.dtype(kind), order, shape
