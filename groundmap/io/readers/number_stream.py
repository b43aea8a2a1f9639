"""Text files that are one sequence of numbers, whose counts say what follows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.opening import read_file

MOST_BYTES = 2**30
SHOWN = 40  # characters of a word in a message


class NumberStream:
    """The numbers of a text file, read from the front.

    Parameters
    ----------
    path : Path
    expected : str
        Kind of file that is expected, for error messages.
    text : str, optional
        The numbers, if they are only a part of the file; default: the file without comments.

    Raises
    ------
    FileFormatError
        A word that is not a number.
    """

    def __init__(self, path: Path, expected: str, text: str | None = None) -> None:
        self.path, self.expected = path, expected
        words = (text if text is not None else text_of(path, expected)).split()
        try:
            self.numbers: Floats = np.array(words, dtype=np.float64)
        except ValueError:
            raise self._not_a_number(words) from None
        self.place = 0

    def _not_a_number(self, words: list[str]) -> FileFormatError:
        for place, word in enumerate(words):
            try:
                float(word)
            except ValueError:
                got = f"{word[:SHOWN]!r} as number {place + 1} of {len(words)}"
                return FileFormatError(self.path, f"{self.expected}: numbers", got)
        return FileFormatError(self.path, f"{self.expected}: numbers", "something else")

    def take(self, count: int, what: str) -> Floats:
        """Return the next numbers.

        Parameters
        ----------
        count : int
        what : str
            What they are, for error messages.

        Raises
        ------
        FileFormatError
            The file ends before.
        """
        left = len(self.numbers) - self.place
        if count < 0 or count > left:
            raise FileFormatError(
                self.path,
                f"{self.expected}: {count} numbers for {what}",
                f"{left} left after number {self.place} of {len(self.numbers)}",
                hint="Was the file cut short?",
            )
        found = self.numbers[self.place : self.place + count]
        self.place += count
        return found

    def count(self, what: str, *, smallest: int) -> int:
        """Return the next number, which counts records of a known least size.

        Parameters
        ----------
        what : str
            What is counted, for error messages.
        smallest : int
            Least size of a record, in numbers.

        Raises
        ------
        FileFormatError
            Not a whole number, or the rest of the file is too short for that many.
        """
        [value] = self.take(1, f"the number of {what}")
        left = len(self.numbers) - self.place
        if not (np.isfinite(value) and value == np.rint(value) and 0 <= value * smallest <= left):
            raise FileFormatError(
                self.path,
                f"{self.expected}: a number of {what}",
                f"{value:g} before the last {left} numbers",
                hint="Was the file cut short?",
            )
        return int(value)

    def indices(self, values: Floats, what: str) -> Ints:
        """Return numbers as indices.

        Parameters
        ----------
        values : ndarray, shape (n,)
        what : str
            What they refer to, for error messages.

        Raises
        ------
        FileFormatError
            One is not a whole number.
        """
        with np.errstate(invalid="ignore"):
            wrong = np.flatnonzero(~((np.rint(values) == values) & (np.abs(values) <= 2**53)))
        if len(wrong):
            got = f"{values[wrong[0]]:g}"
            raise FileFormatError(self.path, f"{self.expected}: indices of {what}", got)
        return values.astype(np.int64)


def text_of(path: Path, expected: str) -> str:
    """Return the text of a file without comments.

    Parameters
    ----------
    path : Path
    expected : str
        Kind of file that is expected, for error messages.
    """
    text = read_file(path, expected, most=MOST_BYTES).decode("utf-8-sig", "replace")
    if "#" not in text:
        return text
    return "\n".join(line.partition("#")[0] for line in text.splitlines())
