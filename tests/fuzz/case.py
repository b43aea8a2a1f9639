"""What a target is, and how one case of it ends."""

from __future__ import annotations

import traceback
import warnings
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import groundmap
import planners
from fuzz.draw import Draw
from groundmap.errors import GroundmapError
from planners.errors import AuditError, PlanningError

Ending = Literal["accepted", "refused", "traceback", "hang", "ended", "memory"]
FAILURES: tuple[Ending, ...] = ("traceback", "hang", "ended", "memory")
PACKAGES = tuple(f"{Path(package.__path__[0])}/" for package in (groundmap, planners))
LONGEST_SENTENCE = 2000  # characters of a message that a person can still read


@dataclass(frozen=True)
class Outcome:
    """How one case ended."""

    ending: Ending
    place: str = ""  #: where a failure comes from, by which failures are grouped
    text: str = ""  #: the whole story of a failure


class OutputError(Exception):
    """A result or a message that breaks a promise, although nothing was raised."""


class Target(ABC):
    """One thing to fuzz.

    Parameters
    ----------
    name : str
    weight : float
        How often it is chosen, compared with the others of its kind.
    """

    def __init__(self, name: str, weight: float = 1.0) -> None:
        self.name, self.weight = name, weight

    @abstractmethod
    def run(self, draw: Draw, folder: Path) -> None:
        """Run one case in an empty folder; raise only what is documented."""

    def warm_up(self, folder: Path) -> None:
        """Compile and load what the cases need, so that the watchdog doesn't count it."""
        for number in range(3):
            outcome_of(self, Draw(f"warm-up {number}"), folder)


def outcome_of(target: Target, draw: Draw, folder: Path) -> Outcome:
    """Run one case; warnings count as failures."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            target.run(draw, folder)
    except AuditError as error:
        return _failure(error, draw)
    except (GroundmapError, PlanningError) as error:
        return _checked_refusal(error, draw)
    except Exception as error:  # what is left is what the fuzzer looks for
        return _failure(error, draw)
    return Outcome("accepted")


def check_sentence(text: str) -> None:
    """Check that a message is printable and of bounded length.

    Raises
    ------
    OutputError
    """
    if len(text) > LONGEST_SENTENCE:
        raise OutputError(f"a message of {len(text)} characters: {text[:200]!r}")
    if not text.isprintable():
        first = next(character for character in text if not character.isprintable())
        raise OutputError(f"a message with an unprintable {first!r}: {text[:200]!r}")


def _checked_refusal(error: GroundmapError | PlanningError, draw: Draw) -> Outcome:
    try:
        check_sentence(str(error))
    except OutputError as wrong:
        raised = _place(error)
        return Outcome("traceback", f"OutputError {raised}", _story(wrong, draw, cause=error))
    return Outcome("refused")


def _failure(error: Exception, draw: Draw) -> Outcome:
    return Outcome("traceback", f"{type(error).__name__} {_place(error)}", _story(error, draw))


def _story(error: Exception, draw: Draw, cause: Exception | None = None) -> str:
    lines = traceback.format_exception(cause or error)
    return "\n".join([*draw.record, "", *([str(error)] if cause else []), "".join(lines)])


def _place(error: Exception) -> str:
    """Return the innermost line of the two packages that the exception came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if frame.filename.startswith(PACKAGES)]
    if not ours:
        return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
    path = Path(ours[-1].filename)
    return f"{path.parent.name}/{path.name}:{ours[-1].name}"
