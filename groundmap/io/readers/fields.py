"""Access to the fields of documents (JSON, msgpack) whose content is not trusted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.printable import format_value

MOST_JSON = 2**28  # bytes
LARGEST_INDEX = 2**62


class Fields:
    """A dictionary of a document, with its place in the document for error messages.

    Parameters
    ----------
    path : Path
    content : object
    place : str, default ''
        Such as ``"shots.01.jpg"``.

    Raises
    ------
    FileFormatError
        The content is not a dictionary.
    """

    def __init__(self, path: Path, content: Any, place: str = "") -> None:
        self.path, self.place = path, place
        if not isinstance(content, dict):
            raise self._error("", "a dictionary", content)
        self.content: dict[Any, Any] = content

    def _error(self, key: str, expected: str, got: object) -> FileFormatError:
        where = ".".join(part for part in (self.place, key) if part) or "the document"
        return FileFormatError(self.path, f"{where} to be {expected}", format_value(got, most=60))

    def get(self, key: str) -> Any:
        """Return a value.

        Raises
        ------
        FileFormatError
            There is none of that key.
        """
        if key not in self.content:
            raise self._error(key, "a value", "nothing")
        return self.content[key]

    def fields(self, key: str) -> Fields:
        """Return a dictionary; a missing one is empty."""
        return Fields(self.path, self.content.get(key, {}), self._join(key))

    def items(self) -> list[tuple[str, Fields]]:
        """Return the entries, each of which is a dictionary."""
        return [
            (str(key), Fields(self.path, value, self._join(str(key))))
            for key, value in self.content.items()
        ]

    def list(self, key: str) -> list[Any]:
        """Return a list; a missing one, and None, is empty."""
        value = self.content.get(key)
        if value is None:
            return []
        if not isinstance(value, list):
            raise self._error(key, "a list", value)
        return value

    def text(self, key: str, default: str = "") -> str:
        """Return a text.

        Parameters
        ----------
        key : str
        default : str
            For a missing one.
        """
        value = self.content.get(key, default)
        if not isinstance(value, str):
            raise self._error(key, "a text", value)
        return value

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number.

        Parameters
        ----------
        key : str
        default : float, optional
            For a missing one; without it, a missing one is an error.
        """
        value = self.get(key) if default is None else self.content.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self._error(key, "a number", value)
        return float(value)

    def index(self, key: str, default: int | None = None) -> int:
        """Return a whole number.

        Parameters
        ----------
        key : str
        default : int, optional
            For a missing one; without it, a missing one is an error.
        """
        value = self.get(key) if default is None else self.content.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int) or abs(value) > LARGEST_INDEX:
            raise self._error(key, "a whole number", value)
        return value

    def array(self, key: str, *shape: int) -> Floats:
        """Return numbers of a known shape.

        Parameters
        ----------
        key : str
        *shape : int
            -1 for any length.

        Raises
        ------
        FileFormatError
            Not numbers, or of another shape.
        """
        value = self.get(key)
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise self._error(key, f"numbers of shape {shape}", value) from None
        wanted = len(array.shape) == len(shape) and all(
            side in (-1, length) for side, length in zip(shape, array.shape, strict=True)
        )
        if not wanted:
            raise self._error(key, f"numbers of shape {shape}", value)
        return array

    def _join(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key


def as_index(path: Path, text: str, what: str) -> int:
    """Return a key of a document as a number.

    Parameters
    ----------
    path : Path
    text : str
    what : str
        For error messages.
    """
    digits = text.removeprefix("-")
    if not (digits.isascii() and digits.isdigit()) or len(digits) > 18:
        raise FileFormatError(path, f"the number of a {what}", repr(text[:40]))
    return int(text)
