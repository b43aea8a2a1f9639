"""Rounding errors of coordinates, which grow with the distance from the origin."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SLACK = 5e-10  # [m] shortfall of clearance that is attributed to rounding near the origin


def rounding_at(*places: npt.ArrayLike) -> float:
    """Return the largest rounding error of a difference of coordinates near places [m].

    It is two steps of the floats there: half a step for each of the two coordinates, and half a
    step for each of the two sums that give the border of a cell.

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
    """Return the shortfall of clearance near places that is attributed to rounding [m].

    It is below the tolerance of the audit for a line through these places.

    Parameters
    ----------
    *places : array_like [m, map]

    Examples
    --------
    >>> slack_at((448_000.0, 5_412_000.0))
    2.362645149230957e-09
    """
    return SLACK + rounding_at(*places)
