"""The exceptions of groundmap.

::

    GroundmapError
    ├── InputError (ValueError)      an argument is invalid
    │   ├── SettingsError            a setting is unknown or out of range
    │   ├── CameraError              a rig or a pose is not that of a camera
    │   └── FileFormatError          a file is missing, unreadable or not in its format
    ├── NoGroundPlaneError           a camera has no ground plane below it
    ├── RegistrationError            features do not determine a motion or a pose
    └── MergeError                   two maps cannot be merged

The exceptions compose their messages from facts, in the same order: the expected value, the
actual value, the first offending place, and a hint.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

from groundmap.printable import MOST_OF_A_VALUE, printable

MOST_OF_A_FACT = 1000  # characters of an expected value or a hint, which may list all names


class FactualError(Exception):
    r"""Base of the exceptions of both packages, which compose their messages from facts.

    It can be pickled with its facts. Python's default would call the class with the complete
    message as its only argument, and fail with a TypeError.

    Parameters
    ----------
    message : str
        Unprintable characters are escaped, and a text that is too long is cut in the middle.

    Examples
    --------
    >>> print(FactualError("frame \x1b[31m"))
    frame \x1b[31m
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(printable(message))

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the parts to restore the exception from, without a call of its class."""
        return _restore, (type(self), self.args, self.__dict__)


def _restore(
    kind: type[FactualError], args: tuple[Any, ...], facts: dict[str, Any]
) -> FactualError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(facts)
    return error


class WrongValueError(FactualError, ValueError):
    """A value is invalid: base of the errors of both packages about input.

    Parameters
    ----------
    name : str
        Name of the value for the caller, such as that of an argument.
    expected, got : str
        The expected and the actual value. Like all facts, they are made printable, and cut in the
        middle if they are too long.
    where : str, optional
        The first offending place, such as ``"row 3"``.
    hint : str, optional
        A sentence about what to do.
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
    """Base of all exceptions of groundmap."""


class InputError(GroundmapError, WrongValueError):
    """An argument is invalid.

    Examples
    --------
    >>> print(InputError("baseline", "a number above 0 [m]", "0.0", hint="Give the rig's."))
    baseline: expected a number above 0 [m], got 0.0. Give the rig's.
    """


class SettingsError(InputError):
    """A setting is unknown or out of range."""


class CameraError(InputError):
    """A rig or a pose is not that of a camera."""


class FileFormatError(InputError):
    """A file is missing, unreadable or not in its format.

    Parameters
    ----------
    path : path
    expected, got : str
        The expected and the actual content.
    line : int, optional
        The first offending line, from 1.
    hint : str, optional
        A sentence about what to do.

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
    """A camera has no ground plane below it."""


class MergeError(GroundmapError):
    """Two maps differ in resolution, frame, origin or update rule, and cannot be merged."""


class RegistrationError(GroundmapError):
    """Features do not determine the motion between views, or the pose of a view in a map.

    Parameters
    ----------
    reason : {"too_few", "ambiguous", "undetermined"}
        Too few features agree under any motion, two motions explain the features alike, or the
        matched features leave a direction open.
    message : str
    """

    def __init__(self, reason: str, message: str) -> None:
        self.reason = reason
        super().__init__(message)
