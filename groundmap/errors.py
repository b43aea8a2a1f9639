"""Everything that groundmap raises on purpose.

::

    GroundmapError
    ├── InputError (ValueError)      an array or a number is not what was asked for
    │   ├── SettingsError            a setting is unknown or out of its range
    │   ├── CameraError              a rig or a pose that no camera can have
    │   └── FileFormatError          a file does not say what its format asks for
    ├── NoGroundPlaneError           a camera with no ground plane below it
    └── MergeError                   two maps that do not add up

The exceptions take facts and compose the message, so that every message reads alike:
what was expected, what came instead, where it was first seen, and what to do.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

from groundmap.printable import MOST_OF_A_VALUE, printable

MOST_OF_A_FACT = 1000  # characters of what was expected, or of a hint: some list all names


class FactualError(Exception):
    r"""An exception that composes its message from facts, and survives pickling with them.

    Both packages' trees grow from it. Python would call the class again with the finished message;
    a worker process that raises one would then die of a TypeError instead.

    Parameters
    ----------
    message : str
        Unprintable characters are escaped, and what is too long is cut in the middle.

    Examples
    --------
    >>> print(FactualError("frame \x1b[31m"))
    frame \x1b[31m
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """Carry message and facts over as they are."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[FactualError], args: tuple[Any, ...], facts: dict[str, Any]) -> FactualError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(facts)
    return error


class WrongValueError(FactualError, ValueError):
    """A value is not what was asked for: what both packages' errors about input are.

    Parameters
    ----------
    name : str
        What the value is called where the caller wrote it.
    expected, got : str
        What it should have been, and what it is. Like all facts they are made printable, and
        cut in the middle if they are too long for a sentence.
    where : str, optional
        The first place that offends, such as ``"row 3"``.
    hint : str, optional
        What to do about it.
    """

    def __init__(
        self, name: str, expected: str, got: str, *, where: str = "", hint: str = ""
    ) -> None:
        self.name, self.got, self.where = (
            printable(fact, most=MOST_OF_A_VALUE) for fact in (name, got, where)
        )
        self.expected, self.hint = (
            printable(fact, most=MOST_OF_A_FACT) for fact in (expected, hint)
        )
        place = f" at {self.where}" if where else ""
        advice = f" {self.hint}" if hint else ""
        super().__init__(f"{self.name}: expected {self.expected}, got {self.got}{place}.{advice}")


class GroundmapError(FactualError):
    """Base of every exception of this package."""


class InputError(GroundmapError, WrongValueError):
    """A value is not what was asked for.

    Examples
    --------
    >>> print(InputError("baseline", "a number above 0 [m]", "0.0", hint="Give the rig's."))
    baseline: expected a number above 0 [m], got 0.0. Give the rig's.
    """


class SettingsError(InputError):
    """A setting is unknown or out of its range."""


class CameraError(InputError):
    """A rig or a pose that no camera can have."""


class FileFormatError(InputError):
    """A file does not say what its format asks for.

    Examples
    --------
    >>> print(FileFormatError("poses.txt", "8 columns", "7", line=12))
    poses.txt: expected 8 columns, got 7 at line 12.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        expected: str,
        got: str,
        *,
        line: int | None = None,
        hint: str = "",
    ) -> None:
        where = "" if line is None else f"line {line}"
        super().__init__(str(path), expected, got, where=where, hint=hint)
        self.path, self.line = path, line


class NoGroundPlaneError(GroundmapError):
    """A camera with no ground plane below it."""


class MergeError(GroundmapError):
    """Two maps that do not add up: other resolution, frame, origin or rule."""
