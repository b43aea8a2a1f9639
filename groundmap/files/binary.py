"""Binary files of records, read without trusting their counts."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.errors import FileFormatError
from groundmap.files.opening import read_file

MOST_BYTES = 2**32
MOST_OF_A_NAME = 10_000  # bytes
U32, U64 = np.dtype("<u4"), np.dtype("<u8")


class BinaryFile:
    """The content of a binary file, read from the front.

    Every count is checked against the bytes that are left before memory is allocated.

    Parameters
    ----------
    path : path
    expected : str
        Kind of file that is expected, for error messages.
    most : int, default 2**32
        Largest size [bytes].

    Raises
    ------
    FileFormatError
        The file cannot be opened, or is larger.
    """

    def __init__(self, path: str | PathLike[str], expected: str, *, most: int = MOST_BYTES) -> None:
        self.path, self.expected = path, expected
        self.content = read_file(path, expected, most=most)
        self.place = 0

    @property
    def left(self) -> int:
        """Number of bytes that were not read yet."""
        return len(self.content) - self.place

    def records(self, dtype: npt.DTypeLike, count: int, what: str) -> npt.NDArray[Any]:
        """Return the next records.

        Parameters
        ----------
        dtype : dtype
        count : int
        what : str
            What they contain, for error messages.

        Raises
        ------
        FileFormatError
            The file ends before.
        """
        row = np.dtype(dtype)
        if count < 0 or count * row.itemsize > self.left:
            raise self.error(f"{count} {what} of {row.itemsize} bytes", f"{self.left} bytes left")
        found = np.frombuffer(self.content, row, count, self.place)
        self.place += count * row.itemsize
        return found

    def value(self, dtype: npt.DTypeLike, what: str) -> Any:
        """Return the next record, as a plain number if it has a single field.

        Parameters
        ----------
        dtype : dtype
        what : str
        """
        return self.records(dtype, 1, what)[0].item()

    def count(self, what: str, *, smallest: int, dtype: npt.DTypeLike = U64) -> int:
        """Return the next number, which counts records of a known least size.

        Parameters
        ----------
        what : str
            What is counted, for error messages.
        smallest : int
            Least size of a record [bytes].
        dtype : dtype, default 64-bit unsigned

        Raises
        ------
        FileFormatError
            The rest of the file is too short for that many.
        """
        count = int(self.value(dtype, f"number of {what}"))
        if count < 0 or count * smallest > self.left:
            raise self.error(f"{count} {what}", f"only {self.left} bytes after their number")
        return count

    def text(self, length: int, what: str) -> str:
        """Return the next text of a known length.

        Parameters
        ----------
        length : int [bytes]
        what : str
        """
        if length > MOST_OF_A_NAME:
            raise self.error(f"a {what} of at most {MOST_OF_A_NAME} bytes", f"{length}")
        return (
            self.records(np.uint8, length, f"bytes of a {what}")
            .tobytes()
            .decode("utf-8", "replace")
        )

    def text_to_nul(self, what: str) -> str:
        """Return the next text, which ends at a NUL byte."""
        end = self.content.find(b"\0", self.place, self.place + MOST_OF_A_NAME)
        if end < 0:
            raise self.error(f"a {what} that ends with a NUL byte", "none")
        found = self.content[self.place : end].decode("utf-8", "replace")
        self.place = end + 1
        return found

    def error(self, expected: str, got: str) -> FileFormatError:
        """Return the error for invalid content at the present place.

        Parameters
        ----------
        expected, got : str
        """
        place = f"{got} at byte {self.place} of {len(self.content)}"
        hint = "Was the file cut short, or is it another format?"
        return FileFormatError(self.path, f"{self.expected}: {expected}", place, hint=hint)
