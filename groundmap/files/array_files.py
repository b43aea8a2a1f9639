"""Archives of arrays (``.npz``) of any origin, read without trusting their headers."""

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
DENSEST = 1040  # largest compression ratio of deflate
MAGIC = b"\x93NUMPY"
MOST_OF_A_HEADER = 10_000  # bytes
DTYPE = re.compile(r"[<>|=]?(?:b1|i[1248]|u[1248]|f[248]|U[0-9]{1,7})")
DIGITS = re.compile(r"[0-9]{20}")  # more than any length has
# Exceptions of the standard library for damaged archives, collected by damaging archives.
DAMAGES = (OSError, EOFError, ValueError, ArithmeticError, LookupError, RuntimeError, SyntaxError,
           TypeError, MemoryError, zipfile.BadZipFile, zlib.error)  # fmt: skip


class _WrongArchiveError(Exception):
    """An invalid archive; the message describes the first fault."""


def read_arrays(
    path: str | PathLike[str], expected: str = "an archive of arrays (npz)"
) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an archive by name: truth values, whole and real numbers, or text.

    Memory is only allocated after a check that the file is large enough for the array.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.

    Raises
    ------
    FileFormatError
        The file is missing, damaged or not an archive, or a member is not an array, has complex
        numbers or objects, or has another size than its header states.
    """
    with open_file(path, expected) as stream:
        try:
            return _read(stream)
        except _WrongArchiveError as error:
            raise FileFormatError(path, expected, str(error)) from error
        except DAMAGES as error:
            got = f"something else, or a damaged file ({type(error).__name__})"
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
        raise _WrongArchiveError(f"a member {member.filename!r}, which is not an array")
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise _WrongArchiveError("a compression other than deflate")
    if member.file_size > DENSEST * length:
        raise _WrongArchiveError(f"a member of {member.file_size} bytes in a file of {length}")


def _array(stream: IO[bytes], member: zipfile.ZipInfo) -> npt.NDArray[Any]:
    """Return one array from NumPy's format, version 1 to 3."""
    name = repr(member.filename)
    start = stream.read(8)
    if start[:6] != MAGIC or start[6:7] not in (b"\1", b"\2", b"\3"):
        raise _WrongArchiveError(f"a member {name}, which is not an array")
    size_bytes = stream.read(2 if start[6] == 1 else 4)
    size = int.from_bytes(size_bytes, "little")
    if size > MOST_OF_A_HEADER:
        raise _WrongArchiveError(f"a header of {size} bytes in {name}")
    dtype, order, shape = _header(stream.read(size).decode("utf-8"), name)
    length = member.file_size - len(start) - len(size_bytes) - size
    if math.prod(shape) * dtype.itemsize != length:
        sides = " x ".join(map(str, shape)) or "1"
        raise _WrongArchiveError(f"{sides} values of {dtype} in {length} bytes in {name}")
    content = stream.read()
    if len(content) != length:
        raise _WrongArchiveError(f"{len(content)} of {length} bytes in {name}")
    # A copy is writable and in native byte order.
    array: npt.NDArray[Any] = np.frombuffer(content, dtype).astype(dtype.newbyteorder("="))
    return array.reshape(shape, order="F" if order else "C")


def _header(text: str, name: str) -> tuple[np.dtype[Any], bool, tuple[int, ...]]:
    """Return the dtype, whether the order is column-major, and the shape."""
    header = None if DIGITS.search(text) else ast.literal_eval(text.strip())
    if not isinstance(header, dict) or set(header) != {"descr", "fortran_order", "shape"}:
        raise _WrongArchiveError(f"an invalid header in {name}")
    kind, order, shape = header["descr"], header["fortran_order"], header["shape"]
    if not isinstance(kind, str) or not DTYPE.fullmatch(kind):
        raise _WrongArchiveError(f"values of type {kind!r} in {name}")
    whole = isinstance(shape, tuple) and all(type(side) is int and side >= 0 for side in shape)
    if not whole or len(shape) > 32 or not isinstance(order, bool):
        raise _WrongArchiveError(f"the shape {shape!r} in {name}")
    return np.dtype(kind), order, shape
