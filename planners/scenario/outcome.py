"""Outcomes of scenarios, and bounds on their figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from planners.scenario.patterns import is_found

REASON = "reason"  # figure of a query without a route: the message of the error
Figure = float | int | str | None  # None: not measured


@dataclass(frozen=True)
class Bound:
    """Bound on a figure: a range, a value, or a pattern."""

    min: float | None = None
    max: float | None = None
    equals: Figure = None
    matches: str | None = None  #: a pattern to search for in a text

    def holds(self, value: Figure) -> bool:
        """Return whether a figure satisfies the bound; None and NaN do not."""
        if self.equals is not None:
            return value == self.equals
        if self.matches is not None:
            return isinstance(value, str) and is_found(self.matches, value)
        if value is None or isinstance(value, str) or math.isnan(value):
            return False
        return (self.min is None or value >= self.min) and (self.max is None or value <= self.max)

    def __str__(self) -> str:
        """Return the bound as text, such as ``≥ 0.97``."""
        if self.equals is not None:
            return f"= {self.equals}"
        if self.matches is not None:
            return f"a match of '{self.matches}'"
        parts = [("≥", self.min), ("≤", self.max)]
        return " and ".join(f"{sign} {value:g}" for sign, value in parts if value is not None)


@dataclass(frozen=True)
class Outcome:
    """Result of one scenario."""

    name: str
    why: str  #: purpose of the scenario
    passed: bool | None  #: None if skipped
    figures: dict[str, Figure] = field(default_factory=dict)  #: in the order of display
    bounds: dict[str, Bound] = field(default_factory=dict)  #: by the name of the figure
    missed: tuple[str, ...] = ()  #: a sentence for each missed bound
    skipped: str = ""  #: reason why it was skipped
    picture: bytes = b""  #: PNG
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return the object that ``--json`` prints."""
        return {
            "name": self.name,
            "passed": self.passed,
            "figures": self.figures,
            "missed": list(self.missed),
            "skipped": self.skipped,
            "seconds": self.seconds,
        }
