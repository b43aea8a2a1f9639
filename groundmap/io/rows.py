"""Reader of tables of numbers in text files, in chunks; errors name the line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from os import PathLike
from typing import Any, NamedTuple, TextIO

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Ints
from groundmap.errors import FileFormatError
from groundmap.files.opening import open_text, reason_of

CHUNK_LINES = 65_536
SHOWN_CHARACTERS = 60
SEPARATORS = {None: "white space", ",": "commas", ";": "semicolons"}


class Rows(NamedTuple):
    """Consecutive rows of a table."""

    values: npt.NDArray[Any]  #: shape (n,), of the record type given to `read_rows`
    lines: Ints  #: shape (n,), the one-based line of each row


def record(integers: Sequence[str], numbers: int) -> np.dtype[Any]:
    """Return the type of a row: named integer columns, then an array ``values`` of float64.

    Integers are stored separately, because a float would round ids of more than 53 bits.

    Parameters
    ----------
    integers : sequence of str
        Names of the leading integer columns.
    numbers : int
        Number of the columns that follow.

    Examples
    --------
    >>> record(["view", "id"], 3).names
    ('view', 'id', 'values')
    """
    return np.dtype([*((name, np.int64) for name in integers), ("values", np.float64, (numbers,))])


@contextmanager
def open_rows(path: str | PathLike[str]) -> Iterator[TextIO]:
    """Open a text file with any content; a byte order mark is skipped.

    Raises
    ------
    FileFormatError
        The file is missing or not readable.
    """
    with open_text(path) as stream:
        try:
            yield stream
        except OSError as error:
            raise FileFormatError(path, "a readable file", reason_of(error)) from error


def read_rows(
    path: str | PathLike[str],
    row: np.dtype[Any],
    *,
    delimiter: str | None = None,
    header: bool = False,
) -> Iterator[Rows]:
    """Iterate over the rows of a table, a chunk at a time.

    Parameters
    ----------
    path : path
        Blank lines, and comments from ``#`` to the end of the line, are ignored.
    row : dtype
        Type of a row, see `record`.
    delimiter : str, optional
        Separator of the columns; default: any white space.
    header : bool, default False
        Whether the first line contains the names of the columns.

    Raises
    ------
    FileFormatError
        A line with a wrong number of columns, or with a column that is not a number.
    """
    with open_rows(path) as stream:
        first = 1
        if header:
            stream.readline()
            first = 2
        while lines := list(islice(stream, CHUNK_LINES)):
            text = [line.partition("#")[0].strip() for line in lines]
            filled = np.array([bool(line) for line in text])
            numbers = first + np.flatnonzero(filled)
            first += len(lines)
            if filled.any():
                kept = [line for line in text if line]
                yield Rows(_parse(path, kept, numbers, row, delimiter), numbers)


def _parse(
    path: str | PathLike[str],
    text: list[str],
    lines: Ints,
    row: np.dtype[Any],
    delimiter: str | None,
) -> npt.NDArray[Any]:
    try:
        return _numbers(text, row, delimiter)
    except ValueError as error:
        raise _offence(path, text, lines, row, delimiter) from error


def _numbers(text: list[str], row: np.dtype[Any], delimiter: str | None) -> npt.NDArray[Any]:
    parsed: npt.NDArray[Any] = np.loadtxt(
        text, dtype=row, comments=None, delimiter=delimiter, ndmin=1
    )
    return parsed


def _offence(
    path: str | PathLike[str],
    text: list[str],
    lines: Ints,
    row: np.dtype[Any],
    delimiter: str | None,
) -> FileFormatError:
    """Return the error for the first line that does not parse; slow, for failures only."""
    first = next(i for i, line in enumerate(text) if not _parses(line, row, delimiter))
    line, integers = text[first], len(row.names or ()) - 1
    expected, got = integers + row["values"].shape[0], len(line.split(delimiter))
    number, hint = int(lines[first]), _hint(line, expected, delimiter)
    if got != expected:
        if not hint and got < expected:
            hint = "Was the file cut short?"
        return FileFormatError(path, f"{expected} columns", str(got), line=number, hint=hint)
    leading = f", the first {integers} integers" if integers else ""
    shown = repr(line[:SHOWN_CHARACTERS])
    return FileFormatError(path, f"{expected} numbers{leading}", shown, line=number, hint=hint)


def _hint(line: str, expected: int, delimiter: str | None) -> str:
    """Return a hint for a row with another separator or with decimal commas; else ''."""
    wanted = SEPARATORS.get(delimiter, repr(delimiter))
    for separator, name in SEPARATORS.items():
        if separator != delimiter and len(line.split(separator)) == expected:
            return f"Columns are separated by {wanted} in this file, not by {name}."
    if delimiter is None and len(line.split()) == expected and "," in line:
        return "Numbers have a decimal point, not a comma."
    return ""


def _parses(line: str, row: np.dtype[Any], delimiter: str | None) -> bool:
    try:
        _numbers([line], row, delimiter)
    except ValueError:
        return False
    return True
