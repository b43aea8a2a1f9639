"""Update rules, by name: how the evidence of a view is added to the map."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from groundmap.arrays import Bools, Counts, Floats32, is_number
from groundmap.errors import InputError
from groundmap.grid.kernels.fuse import (
    merge_average,
    update_average,
    update_exponential,
    update_log_odds,
)
from groundmap.printable import format_value

ONE_VIEW = 1.05  # sum of evidence; a single view may be a false match
MOST_VIEWS = int(np.iinfo(np.uint32).max)  # counts saturate: one more would overflow to 0, unknown


@dataclass(frozen=True)
class Average:
    """Running average of all views with equal weights (paper, equation 1)."""

    name: ClassVar[str] = "average"
    mergeable: ClassVar[bool] = True  #: whether maps of parts of the views add up
    reads_shadow: ClassVar[bool] = False  #: whether `Evidence.shadow` becomes non-free

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

    def outweighs_one_view(self, confidence: Floats32, count: Counts) -> Bools:
        """Return the cells with more non-free evidence than a single view contains.

        Parameters
        ----------
        confidence, count : ndarray
            Arrays of one shape.
        """
        outweighs: Bools = confidence * count > ONE_VIEW
        return outweighs

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


@dataclass(frozen=True)
class Exponential(Average):
    """Exponential average: the weight of a view falls by a constant factor with each later one.

    The first view of a cell sets its confidence; from then on, x += alpha (z - x).

    Parameters
    ----------
    alpha : float, default 0.2
        Weight of the newest view, above 0 and at most 1.
    """

    name: ClassVar[str] = "exponential"
    mergeable: ClassVar[bool] = False

    alpha: float = 0.2

    def __post_init__(self) -> None:
        if not (is_number(self.alpha) and 0 < self.alpha <= 1):
            raise InputError("alpha", "a number above 0 and at most 1", format_value(self.alpha))

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add the evidence of one view in place.

        Parameters
        ----------
        confidence, count : ndarray
            C-contiguous arrays of one shape, updated in place.
        z : ndarray of float32
            Evidence in [-1, 1], of the same shape; cells with 0 do not change.
        """
        cells = confidence.reshape(-1), count.reshape(-1), z.reshape(-1)
        update_exponential(*cells, self.alpha, MOST_VIEWS)

    def outweighs_one_view(self, confidence: Floats32, count: Counts) -> Bools:
        """Return the cells with more non-free evidence than a single view contains.

        The weights of all views are worth those of 2 / alpha - 1 equal ones.

        Parameters
        ----------
        confidence, count : ndarray
            Arrays of one shape.
        """
        outweighs: Bools = confidence * np.minimum(count, 2.0 / self.alpha - 1.0) > ONE_VIEW
        return outweighs


@dataclass(frozen=True)
class LogOdds(Average):
    """Bayesian update of the probability p that a cell is non-free (Matthies and Elfes).

    The confidence is 2 p - 1, which is tanh(L / 2) for log-odds L. A view adds the log-odds of its
    sensor model to L: those of (1 + z (2 q - 1)) / 2, where q is the probability that a cell is as
    the view says with the surest evidence, z = 1 or -1. L is clamped, so that a cell can change.

    Parameters
    ----------
    nonfree_probability, free_probability : float, default 0.7
        Probability q for non-free and for free evidence, above 0.5 and at most 0.999.
    most_probable : float, default 0.97
        Largest probability that a cell is non-free or free, above 0.5 and at most 0.999.
    """

    name: ClassVar[str] = "log_odds"
    mergeable: ClassVar[bool] = False

    nonfree_probability: float = 0.7
    free_probability: float = 0.7
    most_probable: float = 0.97

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (is_number(value) and 0.5 < value <= 0.999):
                expected = "a probability above 0.5 and at most 0.999"
                raise InputError(name, expected, format_value(value))

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Add the evidence of one view in place.

        Parameters
        ----------
        confidence, count : ndarray
            C-contiguous arrays of one shape, updated in place.
        z : ndarray of float32
            Evidence in [-1, 1], of the same shape; cells with 0 do not change.
        """
        update_log_odds(
            confidence.reshape(-1),
            count.reshape(-1),
            z.reshape(-1),
            2.0 * self.nonfree_probability - 1.0,
            2.0 * self.free_probability - 1.0,
            2.0 * self.most_probable - 1.0,
            MOST_VIEWS,
        )

    def outweighs_one_view(self, confidence: Floats32, count: Counts) -> Bools:
        """Return the cells with more non-free evidence than a single view contains.

        Parameters
        ----------
        confidence, count : ndarray
            Arrays of one shape.
        """
        one_view = math.atanh(2.0 * self.nonfree_probability - 1.0)
        clamp = math.atanh(2.0 * self.most_probable - 1.0)
        outweighs: Bools = confidence > math.tanh(min(ONE_VIEW * one_view, 0.99 * clamp))
        return outweighs & (count > 1)


@dataclass(frozen=True)
class Absolute(Average):
    """The newest view of a cell decides: the rule for perfect data (paper, section 4.2).

    A new edge in freespace turns the region between its surfaces and the older boundary of
    freespace to non-free; a new edge in non-freespace turns the region before it to free.
    """

    name: ClassVar[str] = "absolute"
    mergeable: ClassVar[bool] = False
    reads_shadow: ClassVar[bool] = True

    def update(self, confidence: Floats32, count: Counts, z: Floats32) -> None:
        """Replace the confidence by the evidence of one view in place.

        Parameters
        ----------
        confidence, count : ndarray
            Arrays of one shape, updated in place.
        z : ndarray of float32
            Evidence in [-1, 1], of the same shape; cells with 0 do not change.
        """
        observed = z != 0.0
        confidence[observed] = z[observed]
        count[observed & (count < MOST_VIEWS)] += 1

    def outweighs_one_view(self, confidence: Floats32, count: Counts) -> Bools:
        """Return the cells whose newest view is non-free: with perfect data, one view suffices.

        Parameters
        ----------
        confidence, count : ndarray
            Arrays of one shape.
        """
        outweighs: Bools = (confidence > 0.0) & (count > 0)
        return outweighs


UpdateRule = Average
RULES: dict[str, type[Average]] = {
    rule.name: rule for rule in (Average, Capped, Exponential, LogOdds, Absolute)
}


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
