"""Update rules, by name: how the evidence of a view is added to the map."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from groundmap.arrays import Counts, Floats32
from groundmap.errors import InputError
from groundmap.grid.kernels.fuse import merge_average, update_average

MOST_VIEWS = int(np.iinfo(np.uint32).max)  # counts saturate: one more would overflow to 0, unknown


@dataclass(frozen=True)
class Average:
    """Running average of all views with equal weights (paper, equation 1)."""

    name: ClassVar[str] = "average"
    mergeable: ClassVar[bool] = True

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add the evidence of one view in place.

        Parameters
        ----------
        confidence, count : ndarray
            C-contiguous arrays of one shape, updated in place.
        z : ndarray of float32
            Evidence in [-1, 1], of the same shape; cells with 0 do not change.
        """
        update_average(confidence.reshape(-1), count.reshape(-1), z.reshape(-1), MOST_VIEWS)

    def merge(
        self, confidence: Floats32, count: Counts, other: Floats32, other_count: Counts
    ) -> None:
        """Add the values of another map in place: the average of all views of both.

        Parameters
        ----------
        confidence, count : ndarray
            C-contiguous arrays of one shape, updated in place.
        other, other_count : ndarray
            Confidence and count of the other map, of the same shape.
        """
        merge_average(
            confidence.reshape(-1), count.reshape(-1), other.reshape(-1), other_count.reshape(-1)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return name and parameters of the rule, for a map file."""
        return {"name": self.name, **asdict(self)}


@dataclass(frozen=True)
class Capped(Average):
    """Running average whose count stops at `cap`; from then on, the weight of old views decays.

    After a lasting change of the world, a cell changes its sign after about 0.7 `cap` views.

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
            # Python does not print integers of several thousand digits.
            got = "a longer number" if whole and abs(self.cap) >= 2**64 else str(self.cap)[:60]
            raise InputError("cap", f"a count of 1 to {MOST_VIEWS}", got)

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add the evidence of one view in place.

        Parameters
        ----------
        confidence, count : ndarray
            C-contiguous arrays of one shape, updated in place.
        z : ndarray of float32
            Evidence in [-1, 1], of the same shape; cells with 0 do not change.
        """
        update_average(confidence.reshape(-1), count.reshape(-1), z.reshape(-1), self.cap)


UpdateRule = Average
RULES: dict[str, type[Average]] = {rule.name: rule for rule in (Average, Capped)}


def rule_from(described: dict[str, Any]) -> UpdateRule:
    """Return the rule for the output of `UpdateRule.to_dict`.

    Raises
    ------
    InputError
        No rule has this name.
    """
    parameters = dict(described)
    name = parameters.pop("name", None)
    if name not in RULES:
        raise InputError("rule", f"one of {', '.join(RULES)}", repr(name))
    return RULES[name](**parameters)
