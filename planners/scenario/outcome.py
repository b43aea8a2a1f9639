"""What running one scenario gives."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from planners.scenario.patterns import is_found

REASON = "reason"  # figure of a query that an error answers: its sentence
Figure = float | int | str | None  # None: there was nothing to measure


@dataclass(frozen=True)
class Bound:
    """What a figure is held to."""

    min: float | None = None
    max: float | None = None
    equals: Figure = None
    matches: str | None = None  #: a pattern that a sentence holds

    def holds(self, value: Figure) -> bool:
        """Return whether a figure keeps to it; one that is missing or not a number does not."""
        if self.equals is not None:
            return value == self.equals
        if self.matches is not None:
            return isinstance(value, str) and is_found(self.matches, value)
        if value is None or isinstance(value, str) or math.isnan(value):
            return False
        return (self.min is None or value >= self.min) and (self.max is None or value <= self.max)

    def __str__(self) -> str:
        """Return it as people write it: ``>= 0.97``."""
        if self.equals is not None:
            return f"= {self.equals}"
        if self.matches is not None:
            return f"with '{self.matches}' in it"
        parts = [("≥", self.min), ("≤", self.max)]
        return " and ".join(f"{sign} {value:g}" for sign, value in parts if value is not None)


@dataclass(frozen=True)
class Outcome:
    """One scenario, run."""

    name: str
    why: str  #: the reason that the scenario exists
    passed: bool | None  #: None where it was skipped
    figures: dict[str, Figure] = field(default_factory=dict)  #: in the order to show them
    bounds: dict[str, Bound] = field(default_factory=dict)  #: by the figure that they hold
    missed: tuple[str, ...] = ()  #: a sentence for each bound that does not hold
    skipped: str = ""  #: why, where it was
    picture: bytes = b""  #: PNG
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints of it."""
        return {
            "name": self.name,
            "passed": self.passed,
            "figures": self.figures,
            "missed": list(self.missed),
            "skipped": self.skipped,
            "seconds": self.seconds,
        }
