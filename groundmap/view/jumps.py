"""Jumps of the poses: steps from view to view that nothing drove."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, as_floats, as_numbers, as_positions

FAR_LONGER = 10.0  # a jump is longer than so many typical steps
LEAST_JUMP = 3.0  # [m], a shorter step is none: keyframes are taken that far apart
STANDSTILL = 0.01  # [m], shorter steps are pauses, and say nothing of what is typical
MOST_TYPICAL = 10.0  # [m], and [m/s]: of few views, the typical step is the jump's own
AROUND = 5  # steps before and after: a robot does not speed up for one step alone


class Jump(NamedTuple):
    """A step from one view to the next that nothing drove."""

    view: int  #: number of the view that it leads to, from 0
    step: float  #: its length [m]
    typical_step: float  #: what is usual around it [m]


def pose_jumps(positions: npt.ArrayLike, times: npt.ArrayLike | None = None) -> list[Jump]:
    """Return the jumps in a sequence of poses; a view that lies off alone counts once.

    A step is a jump if it is longer than 3 m and than ten typical steps. What is typical is the
    median of all steps but pauses, or of the ten steps around it if that is more. Where times are
    known, it must be as much faster than is typical, too: views may be missing in between.

    Parameters
    ----------
    positions : array_like, shape (n, 2) or (n, 3) [m, map]
        Of the views, in their order.
    times : array_like, shape (n,), optional [s]

    Raises
    ------
    InputError
        Positions or times that are not finite numbers, or not as many times as positions.

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
    with np.errstate(over="ignore"):  # farther than numbers reach is far
        steps = np.hypot.reduce(np.diff(places, axis=0), axis=1)
    typical = _typical(steps, steps)
    far = _far(steps, typical, LEAST_JUMP)
    if times is not None:
        spans = np.diff(as_floats("times", times, (len(places),)))
        # Views at one time, or in another order than time's, leave no time to move.
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
    """Return, for each step, the median of all but pauses, or of those around it if it is more."""
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
