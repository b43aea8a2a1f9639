"""Jumps in a sequence of poses: steps between views that are too long to be motion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, as_floats, as_numbers, as_positions

FAR_LONGER = 10.0  # typical steps; a jump is longer
LEAST_JUMP = 3.0  # [m]; keyframes are up to this far apart, so shorter steps are not jumps
STANDSTILL = 0.01  # [m]; shorter steps are pauses, and left out of the typical step
MOST_TYPICAL = 10.0  # [m] and [m/s]; in a log of few views, a jump is itself the median step
AROUND = 5  # steps before and after; a robot does not speed up for a single step


class Jump(NamedTuple):
    """A step between consecutive views that is too long to be motion."""

    view: int  #: index of the view at the end of the step
    step: float  #: length of the step [m]
    typical_step: float  #: typical length of the steps around it [m]


def pose_jumps(positions: npt.ArrayLike, times: npt.ArrayLike | None = None) -> list[Jump]:
    """Return the jumps in a sequence of poses.

    A step is a jump if it is longer than 3 m and longer than ten typical steps. The typical step
    is the median of all steps without pauses, or the median of the ten surrounding steps if that
    is larger. With `times`, the speed must exceed ten typical speeds as well, because views may be
    missing in between. A single displaced view counts as one jump, not as two.

    Parameters
    ----------
    positions : array_like, shape (n, 2) or (n, 3) [m, map]
        Positions of consecutive views.
    times : array_like, shape (n,), optional [s]

    Returns
    -------
    list of Jump

    Raises
    ------
    InputError
        A position is not finite, a time is not a number, or the lengths differ.

    Examples
    --------
    >>> drive = [(0.5 * number, 0.0) for number in range(20)]
    >>> drive[7] = (903.5, 0.0)
    >>> pose_jumps(drive)
    [Jump(view=7, step=900.5, typical_step=0.5)]
    """
    given = as_numbers("positions", positions, "numbers of shape (n, 2) or (n, 3)")
    places = as_positions("positions", given, 3 if given.shape[1:] == (3,) else 2)
    if len(places) < 2:
        return []
    with np.errstate(over="ignore"):  # an infinite step is a jump
        steps = np.hypot.reduce(np.diff(places, axis=0), axis=1)
    typical = _typical(steps, steps)
    far = _far(steps, typical, LEAST_JUMP)
    if times is not None:
        spans = np.diff(as_floats("times", times, (len(places),)))
        # Between views with equal or decreasing timestamps there is no time to move.
        with np.errstate(over="ignore"):
            speeds = np.where(spans > 0, steps / np.where(spans > 0, spans, 1.0), np.inf)
        far &= _far(speeds, _typical(speeds, steps), 0.0)
    jumps: list[Jump] = []
    for number in np.flatnonzero(far).tolist():
        back = number and far[number - 1] and jumps and jumps[-1].view == number
        if back and math.dist(places[number + 1], places[number - 1]) < 0.5 * steps[number]:
            continue
        jumps.append(Jump(number + 1, float(steps[number]), float(typical[number])))
    return jumps


def _far(values: Floats, typical: Floats, least: float) -> Bools:
    far: Bools = values > np.maximum(least, FAR_LONGER * np.minimum(typical, MOST_TYPICAL))
    return far


def _typical(values: Floats, steps: Floats) -> Floats:
    """Return the larger of two medians for each step: all without pauses, and those around it."""
    moving = values[steps > STANDSTILL]
    with np.errstate(over="ignore"):
        overall = float(np.median(moving)) if len(moving) else 0.0
    around = np.full(len(values) + 2 * AROUND, np.nan)
    around[AROUND:-AROUND] = values
    windows = np.lib.stride_tricks.sliding_window_view(around, 2 * AROUND + 1)
    others = np.delete(windows, AROUND, axis=1)
    known = ~np.isnan(others).all(axis=1)
    typical = np.full(len(values), overall)
    with np.errstate(over="ignore"):
        typical[known] = np.maximum(overall, np.nanmedian(others[known], axis=1))
    return typical
