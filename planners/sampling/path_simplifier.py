"""Simplification of paths: the cheapest path over intermediate places along a given one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count, pairwise
from typing import TypeVar

import numpy as np

from groundmap.arrays import Floats
from planners.errors import CancelledError, TimeLimitError
from planners.geometry.kernels.curves import wrap
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.objectives import Objective
from planners.sampling.ompl_states import PollSchedule
from planners.sampling.settings import TURNING
from planners.search.base import Clock

T = TypeVar("T")

PLACES = 48  # number of places along a path, besides its states
WINDOW = 150  # number of earlier places that are tried as predecessors
ROUNDS = 6  # each with other places
MIN_GAIN = 1e-3  # relative improvement below which no further round is made
SHIFT = (math.sqrt(5.0) - 1.0) / 2.0  # offset of the places from round to round


def simplify_path(
    states: Sequence[Pose],
    validator: MotionValidator,
    objective: Objective,
    clock: Clock,
) -> list[Pose]:
    """Return a path that costs no more, from the same start to the same goal.

    OMPL's own simplifier minimises lengths only, ignores turns at places between states, and may
    not terminate.

    Parameters
    ----------
    states : sequence of states
        A clear path.
    validator : MotionValidator
    objective : Objective
        Minimised.
    clock : Clock
        Once the time is up, the best path so far is returned.
    """
    best, cost = list(states), objective.cost(states)
    for turn in range(ROUNDS):
        if clock.is_up:
            break
        places = _with_places(validator, best, (turn + 1) * SHIFT % 1.0)
        trial = _cheapest(places, validator, objective, clock)
        if trial is None:
            break
        before, after = cost, objective.cost(trial)
        if after < before:
            best, cost = trial, after
        if after > (1.0 - MIN_GAIN) * before:
            break
    return best


def _cheapest(
    places: list[Pose],
    validator: MotionValidator,
    objective: Objective,
    clock: Clock,
) -> list[Pose] | None:
    """Return the cheapest path over places in their order, or None if the time is up."""
    calls, schedule = count(1), PollSchedule(partial(clock.check, 0))

    def evaluate(function: Callable[..., T], i: int, j: int) -> T:
        if (call := next(calls)) >= schedule.due:
            schedule(call)
        return function(*places[i], *places[j])

    costs, came = [0.0], [0]
    try:
        for j in range(1, len(places)):
            begin = max(0, j - WINDOW)
            ranked = sorted((costs[i] + evaluate(objective.edge, i, j), i) for i in range(begin, j))
            clear = ((cost, i) for cost, i in ranked if evaluate(validator.is_clear, i, j))
            cost, i = next(clear, (math.inf, j - 1))
            costs.append(cost)
            came.append(i)
    except (TimeLimitError, CancelledError):
        return None
    last, path = len(places) - 1, [places[-1]]
    while last > 0:
        last = came[last]
        path.append(places[last])
    return path[::-1]


def _with_places(validator: MotionValidator, states: list[Pose], shift: float) -> list[Pose]:
    """Return the states of a path and places between them, about equally spaced."""
    steps = [math.dist(a[: validator.axes], b[: validator.axes]) for a, b in pairwise(states)]
    share = PLACES / sum(steps) if any(steps) else 0.0
    places = []
    for a, b, step in zip(states, states[1:], steps, strict=False):
        inner = round(step * share)
        places += [a, *_between(validator, a, b, (np.arange(inner) + shift) / max(inner, 1))]
    return [*places, states[-1]]


def _between(validator: MotionValidator, a: Pose, b: Pose, shares: Floats) -> list[Pose]:
    """Return places along an edge at the given shares of its length."""
    if len(shares) == 0:
        return []
    if validator.space in TURNING:
        poses = validator.poses([a, b])
        poses[:, :2] -= validator.costmap.window.origin
        places = poses[(shares * (len(poses) - 1)).astype(np.int64)]
    else:
        change = np.subtract(b, a)
        if validator.space == "se2":
            change[2] = wrap(change[2])
        places = np.array(a) + shares[:, None] * change
    return list(map(tuple, places.tolist()))
