"""Parts of segments: one interval [t0, t1] within 0..1 per segment, empty if t0 > t1."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats

NOWHERE = (2.0, -1.0)  # an empty interval; its intersection with any other is empty


class Intervals(NamedTuple):
    """A part of each of n segments, from `start` to `stop`, shape (n,) each."""

    start: Floats
    stop: Floats

    @property
    def any(self) -> Bools:
        """Which intervals are not empty."""
        return self.start <= self.stop

    def cut(self, other: Intervals) -> Intervals:
        """Return the intersection with other intervals."""
        return Intervals(np.maximum(self.start, other.start), np.minimum(self.stop, other.stop))


def where_positive(at_start: Floats, at_end: Floats) -> Intervals:
    """Return where linear functions along segments are not negative.

    Parameters
    ----------
    at_start, at_end : ndarray, shape (n,)
        Values at both ends.

    Examples
    --------
    >>> where_positive(np.array([-1.0]), np.array([3.0]))
    Intervals(start=array([0.25]), stop=array([1.]))
    """
    slope = at_end - at_start
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -at_start / slope
    start = np.where(at_start >= 0, 0.0, np.where(slope > 0, root, NOWHERE[0]))
    stop = np.where(at_end >= 0, 1.0, np.where(slope < 0, root, NOWHERE[1]))
    return Intervals(start, stop)


def inside_circle(start: Floats, end: Floats, radius: float) -> Intervals:
    """Return the part of segments within a circle around the origin.

    Parameters
    ----------
    start, end : ndarray, shape (n, 2) [m]
    radius : float [m]

    Examples
    --------
    >>> inside_circle(np.array([[-4.0, 0.0]]), np.array([[4.0, 0.0]]), 1.0)
    Intervals(start=array([0.375]), stop=array([0.625]))
    """
    along = end - start
    a = (along**2).sum(axis=1)
    b = (start * along).sum(axis=1)
    c = (start**2).sum(axis=1) - radius**2
    discriminant = b * b - a * c
    root = np.sqrt(np.maximum(discriminant, 0.0))
    scale = np.where(a == 0.0, 1.0, a)
    t0, t1 = np.maximum((-b - root) / scale, 0.0), np.minimum((-b + root) / scale, 1.0)
    # A segment of zero length is inside entirely or not at all.
    outside = np.where(a == 0.0, c > 0.0, discriminant < 0.0)
    t0, t1 = np.where(a == 0.0, 0.0, t0), np.where(a == 0.0, 1.0, t1)
    return Intervals(np.where(outside, NOWHERE[0], t0), np.where(outside, NOWHERE[1], t1))
