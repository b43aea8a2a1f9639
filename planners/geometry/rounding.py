"""How far coordinates are off by their rounding: more, the farther from the origin they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SLACK = 5e-10  # [m] shortfall of clearance that is put down to rounding, near the origin


def rounding_at(*places: npt.ArrayLike) -> float:
    """Return how far a difference of coordinates near places may be off by their rounding [m].

    That is two steps of the floats there: each of the two coordinates may be off by half a step,
    and so may the two sums that the border of a cell is computed with.

    Parameters
    ----------
    *places : array_like [m, map]

    Examples
    --------
    >>> rounding_at((0.0, 1.0)), rounding_at((448_000.0, 5_412_000.0))
    (4.440892098500626e-16, 1.862645149230957e-09)
    """
    return 2.0 * float(np.spacing(max(np.abs(place).max() for place in places)))


def slack_at(*places: npt.ArrayLike) -> float:
    """Return the shortfall of clearance near places that is put down to rounding [m].

    It stays below what the audit tolerates of a line through these places.

    Parameters
    ----------
    *places : array_like [m, map]

    Examples
    --------
    >>> slack_at((448_000.0, 5_412_000.0))
    2.362645149230957e-09
    """
    return SLACK + rounding_at(*places)
