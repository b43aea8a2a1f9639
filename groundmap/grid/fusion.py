"""Update rules: how what one view says is added to what is known, by name."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from groundmap.arrays import Counts, Floats32
from groundmap.errors import InputError
from groundmap.grid.kernels.fuse import merge_average, update_average

MOST_VIEWS = int(np.iinfo(np.uint32).max)  # counts stop there: one more would be 0, unknown


@dataclass(frozen=True)
class Average:
    """Running average of all views (paper, equation 1): every view weighs the same for ever."""

    name: ClassVar[str] = "average"
    mergeable: ClassVar[bool] = True

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add evidence `z` (0 says nothing) in place; C-contiguous arrays of one shape."""
        update_average(confidence.reshape(-1), count.reshape(-1), z.reshape(-1), MOST_VIEWS)

    def merge(
        self, confidence: Floats32, count: Counts, other: Floats32, other_count: Counts
    ) -> None:
        """Add another map's values in place: the mean of all views of both."""
        merge_average(
            confidence.reshape(-1), count.reshape(-1), other.reshape(-1), other_count.reshape(-1)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return what a file needs to know the rule again."""
        return {"name": self.name, **asdict(self)}


@dataclass(frozen=True)
class Capped(Average):
    """Running average whose count stops at `cap`: from there on old views fade.

    A cell that changes for good has changed sign after about 0.7 `cap` views.

    Parameters
    ----------
    cap : int, default 50
        Largest update count, 1 to 2**32 - 1.
    """

    name: ClassVar[str] = "capped"
    mergeable: ClassVar[bool] = False

    cap: int = 50

    def __post_init__(self) -> None:
        whole = isinstance(self.cap, int) and not isinstance(self.cap, bool)
        if not (whole and 1 <= self.cap <= MOST_VIEWS):
            # Python refuses to write whole numbers of thousands of digits.
            got = "a longer number" if whole and abs(self.cap) >= 2**64 else str(self.cap)[:60]
            raise InputError("cap", f"a count of 1 to {MOST_VIEWS}", got)

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add evidence `z` (0 says nothing) in place; C-contiguous arrays of one shape."""
        update_average(confidence.reshape(-1), count.reshape(-1), z.reshape(-1), self.cap)


UpdateRule = Average
RULES: dict[str, type[Average]] = {rule.name: rule for rule in (Average, Capped)}


def rule_from(described: dict[str, Any]) -> UpdateRule:
    """Return the rule that `UpdateRule.to_dict` described.

    Raises
    ------
    InputError
        No rule of that name.
    """
    parameters = dict(described)
    name = parameters.pop("name", None)
    if name not in RULES:
        raise InputError("rule", f"one of {', '.join(RULES)}", repr(name))
    return RULES[name](**parameters)
