"""Recorded logs of views: the base class of every format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

from groundmap.view.view import View


class ViewLog(ABC):
    """The views of one log on disk, which can be iterated over repeatedly.

    ``len(log)`` is the number of views. Every ``for view in log`` reads from the start and creates
    one view at a time, so that a log may be larger than memory.

    Parameters
    ----------
    path : Path
        The log's folder, or a file of some formats.
    poses : Path, optional
        A file whose poses replace those of the log, in a form that `groundmap.io.poses` describes.

    Raises
    ------
    FileFormatError
        A file that is missing, or violates the format.
    """

    looks_for: ClassVar[str]  #: files that `recognises` looks for, for error messages
    weak: ClassVar[bool] = False  #: whether any text files may look like this format

    def __init__(self, path: Path, *, poses: Path | None = None) -> None:
        self.path, self.poses_path = path, poses

    @classmethod
    @abstractmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a folder or file looks like this format."""

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of views."""

    @abstractmethod
    def __iter__(self) -> Iterator[View]:
        """Iterate over the views, one at a time."""
