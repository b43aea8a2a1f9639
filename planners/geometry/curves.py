"""Shortest curves of bounded curvature between two poses: Dubins and Reeds-Shepp."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints, as_floats, check_finite
from planners.errors import ProblemError
from planners.geometry.kernels.curves import SEGMENTS, along, dubins_word, reeds_shepp_word


class Samples(NamedTuple):
    """Poses along a curve."""

    poses: Floats  #: shape (n, 3), x, y [m] and yaw [rad], start and end included
    gears: Ints  #: shape (n - 1,), of the piece to the next pose: 1 forward, -1 reverse


@dataclass(frozen=True, eq=False)
class Curve:
    """A sequence of pieces of constant curvature.

    Attributes
    ----------
    start, goal : tuple of float
        x, y [m], yaw [rad].
    lengths : ndarray, shape (n,) [m]
        Of the pieces; negative in reverse.
    curvatures : ndarray, shape (n,) [1/m]
        Positive to the left.

    Examples
    --------
    >>> curve = reeds_shepp((0, 0, 0), (0, 0, math.pi), radius=2.0)
    >>> round(curve.length, 6), np.sign(curve.lengths).tolist(), curve.curvatures.tolist()
    (6.283185, [1.0, -1.0, 1.0], [0.5, -0.5, 0.5])
    >>> round(dubins((0, 0, 0), (0, 0, math.pi), radius=2.0).length, 6)
    14.660766
    """

    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    lengths: Floats
    curvatures: Floats

    @property
    def length(self) -> float:
        """Total length, forward and reverse [m]."""
        return float(np.abs(self.lengths).sum())


def dubins(start: Sequence[float], goal: Sequence[float], *, radius: float) -> Curve:
    """Return the shortest forward curve.

    Parameters
    ----------
    start, goal : sequence of float
        x, y [m], yaw [rad].
    radius : float [m]
        Turning radius, above 0.

    Raises
    ------
    ProblemError
        A radius that is not a positive number.
    InputError
        A pose that is not three finite numbers.
    """
    return _curve(start, goal, radius, forward=True)


def reeds_shepp(start: Sequence[float], goal: Sequence[float], *, radius: float) -> Curve:
    """Return the shortest curve with forward and reverse motion.

    Parameters
    ----------
    start, goal : sequence of float
        x, y [m], yaw [rad].
    radius : float [m]
        Turning radius, above 0.

    Raises
    ------
    ProblemError
        A radius that is not a positive number.
    InputError
        A pose that is not three finite numbers.
    """
    return _curve(start, goal, radius, forward=False)


def sample(curve: Curve, step: float) -> Samples:
    """Return poses along a curve; the last is exactly the goal.

    Parameters
    ----------
    curve : Curve
    step : float [m]
        Largest distance between consecutive poses.

    Examples
    --------
    >>> poses, gears = sample(dubins((0, 0, 0), (3, 0, 0), radius=1.0), step=1.0)
    >>> poses[:, 0].tolist(), gears.tolist()
    ([0.0, 1.0, 2.0, 3.0], [1, 1, 1])
    """
    if not step > 0:
        raise ProblemError("step", "a length above 0 [m]", repr(step))
    poses, gears = [curve.start], []
    for length, curvature in zip(curve.lengths.tolist(), curve.curvatures.tolist(), strict=True):
        begin = poses[-1]
        pieces = math.ceil(abs(length) / step)
        for i in range(1, pieces + 1):
            poses.append(along(*begin, curvature, length * i / pieces))
            gears.append(1 if length > 0 else -1)
    if len(poses) == 1:
        poses.append(curve.goal)
        gears.append(1)
    poses[-1] = curve.goal
    return Samples(np.array(poses), np.array(gears, dtype=np.int64))


def _curve(start: Sequence[float], goal: Sequence[float], radius: float, *, forward: bool) -> Curve:
    a, b = (as_floats(name, pose, (3,)) for name, pose in (("start", start), ("goal", goal)))
    check_finite("start", a)
    check_finite("goal", b)
    if not (radius > 0 and math.isfinite(radius)):
        raise ProblemError("radius", "a turning radius above 0 [m]", repr(radius))
    cosine, sine = math.cos(a[2]), math.sin(a[2])
    x, y = (b[:2] - a[:2]) / radius
    seen = (cosine * x + sine * y, cosine * y - sine * x, b[2] - a[2])
    lengths, turns = np.zeros(SEGMENTS), np.zeros(SEGMENTS, dtype=np.int64)
    if forward:
        dubins_word(*seen, lengths, turns)
    else:
        reeds_shepp_word(*seen, 1.0, 0.0, lengths, turns)
    driven = lengths != 0.0
    return Curve(
        (float(a[0]), float(a[1]), float(a[2])),
        (float(b[0]), float(b[1]), float(b[2])),
        lengths[driven] * radius,
        turns[driven] / radius,
    )
