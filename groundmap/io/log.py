"""A recorded log of views: the small base of every format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

from groundmap.view.view import View


class ViewLog(ABC):
    """The views of one log on disk, as many times as asked for.

    ``len(log)`` is the number of views; every ``for view in log`` reads from the start and makes
    one view at a time, so that a log may be larger than memory.

    Parameters
    ----------
    path : Path
        The log's folder.
    poses : Path, optional
        A file whose poses replace the log's own; `groundmap.io.poses` describes its two forms.

    Raises
    ------
    FileFormatError
        A file that is missing or does not say what the format asks for.
    """

    looks_for: ClassVar[str]  #: what `recognises` looks for, as it reads in an error message

    def __init__(self, path: Path, *, poses: Path | None = None) -> None:
        self.path, self.poses_path = path, poses

    @classmethod
    @abstractmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a folder looks like this format, by the names of its files."""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of views."""

    @abstractmethod
    def __iter__(self) -> Iterator[View]:
        """Iterate over the views, one at a time."""
