"""Shortest curves of bounded curvature: forward (Dubins 1957), both ways (Reeds and Shepp 1990).

Lengths are in turning radii. A curve starts at the origin with yaw 0; arcs turn left (+1) or right
(-1), straights turn by 0; a negative length is driven in reverse.

One derivation covers all words. Write points as complex numbers. An arc to the left that starts at
p with yaw a turns about p + i e^(ia), an arc to the right about p - i e^(ia). Let d be the vector
from the centre of the first arc, i for a left turn, to that of the last, which the goal determines.
In a frame rotated by the yaw t at which the first arc ends, it is a vector D that depends only on
the pieces in between: a straight of length s at yaw a adds s e^(ia), a change from left to right
-2i e^(ia), and a change back +2i e^(ia). So |D| = |d| gives the one unknown in between,
arg d - arg D gives t, and the goal's yaw gives the last arc. Words that begin with a right turn are
those of the mirrored goal; words in the other gear are those of the goal relative to a robot that
faces the opposite direction.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from groundmap.arrays import Floats, Ints

SEGMENTS = 5  # of the longest word
TURN, QUARTER = 2.0 * math.pi, 0.5 * math.pi
NEAR = 1e-12  # tolerance for rounding
# Words of both gears that begin with a left turn; Dubins curves use the first three.
LSL, LSR, LRL, LRLR, LRLR_CUSPS, LRSL, LRSR, LRSLR = range(8)
TURNS = np.array(
    [
        [1, 0, 1, 0, 0],
        [1, 0, -1, 0, 0],
        [1, -1, 1, 0, 0],
        [1, -1, 1, -1, 0],
        [1, -1, 1, -1, 0],
        [1, -1, 0, 1, 0],
        [1, -1, 0, -1, 0],
        [1, -1, 0, 1, -1],
    ],
    dtype=np.int64,
)
COUNTS = np.array([3, 3, 3, 4, 4, 4, 4, 5], dtype=np.int64)


@njit(cache=True, nogil=True)
def wrap(angle: float) -> float:
    """Return the equivalent angle in [-pi, pi]."""
    return angle - TURN * round(angle / TURN)


@njit(cache=True, nogil=True)
def dubins_word(x: float, y: float, yaw: float, lengths: Floats, turns: Ints) -> float:
    """Find the shortest forward curve to a pose; return its length.

    Parameters
    ----------
    x, y, yaw : float [turning radii; rad]
        The goal relative to the start.
    lengths, turns : ndarray, shape (5,)
        Receive the segments; unused ones have length 0.
    """
    best = math.inf
    for mirror in (1, -1):
        left_x, left_y, right_x, right_y = _centres(x, mirror * y, mirror * yaw)
        for word in (LSL, LSR, LRL, LRL):
            to_left = word != LSR
            d_x, d_y = (left_x, left_y) if to_left else (right_x, right_y)
            square = d_x * d_x + d_y * d_y
            if word == LSL:
                middle, angle, turned = math.sqrt(square), 0.0, 0.0
            elif word == LSR:
                if square < 4.0 - NEAR:
                    continue
                middle, turned = math.sqrt(max(square - 4.0, 0.0)), 0.0
                angle = math.atan2(-2.0, middle)
            else:  # the shortest one has a middle arc of more than half a turn
                if square > 16.0 + NEAR:
                    continue
                middle = TURN - 2.0 * math.asin(min(math.sqrt(square) / 4.0, 1.0))
                angle, turned = -middle / 2.0, -middle
            first = _ahead(math.atan2(d_y, d_x) - angle)
            last = mirror * yaw - first - turned
            last = _ahead(last if to_left else -last)
            total = first + middle + last
            if total < best:
                best = total
                lengths[:] = 0.0
                lengths[0], lengths[1], lengths[2] = first, middle, last
                turns[:] = TURNS[word] * mirror
    return best


@njit(cache=True, nogil=True)
def reeds_shepp_word(
    x: float, y: float, yaw: float, reverse: float, cusp: float, lengths: Floats, turns: Ints
) -> float:
    """Find the cheapest of the Reeds-Shepp curves to a pose; return its cost.

    Parameters
    ----------
    x, y, yaw : float [turning radii; rad]
        The goal relative to the start.
    reverse : float
        Cost per length in reverse; 1 gives the shortest curve.
    cusp : float [turning radii]
        Cost of a change of gear; 0 gives the shortest curve.
    lengths, turns : ndarray, shape (5,)
        Receive the segments; unused ones have length 0.
    """
    best = math.inf
    trial = np.zeros(SEGMENTS)
    for backwards in (False, True):
        # Some words differ from their reversal. Relative to the goal, facing the opposite
        # direction, the same segments in reversed order lead to the start.
        to_x, to_y = x, y
        if backwards:
            to_x = x * math.cos(yaw) + y * math.sin(yaw)
            to_y = x * math.sin(yaw) - y * math.cos(yaw)
        words = (LRSL, LRSR + 1) if backwards else (LSL, LRSLR + 1)
        for mirror in (1, -1):
            for gear in (1, -1):
                bearing = mirror * gear * yaw
                left_x, left_y, right_x, right_y = _centres(gear * to_x, mirror * to_y, bearing)
                for word in range(words[0], words[1]):
                    to_left = word in (LSL, LRL, LRSL)
                    d_x, d_y = (left_x, left_y) if to_left else (right_x, right_y)
                    if not _solve(word, d_x, d_y, bearing, to_left, trial):
                        continue
                    cost = _cost(trial, gear, reverse, cusp)
                    if cost < best:
                        best = cost
                        _store(trial, word, gear, mirror, backwards, lengths, turns)
    return best


@njit(cache=True, nogil=True)
def _centres(x: float, y: float, yaw: float) -> tuple[float, float, float, float]:
    """Return the vectors from the centre of the first left turn to both centres at the goal."""
    sine, cosine = math.sin(yaw), math.cos(yaw)
    return x - sine, y + cosine - 1.0, x + sine, y - cosine - 1.0


@njit(cache=True, nogil=True)
def _solve(word: int, x: float, y: float, yaw: float, to_left: bool, trial: Floats) -> bool:
    """Write the lengths of a word whose turning centres are (x, y) apart; False if impossible."""
    square = x * x + y * y
    distance = math.sqrt(square)
    beyond = math.sqrt(max(square - 4.0, 0.0))
    trial[:] = 0.0
    turned = 0.0
    if word == LSL:
        trial[1], angle = distance, 0.0
    elif word == LSR and square >= 4.0 - NEAR:
        trial[1], angle = beyond, math.atan2(-2.0, beyond)
    elif word == LRL and square <= 16.0 + NEAR:
        turned = 2.0 * math.asin(min(distance / 4.0, 1.0))
        trial[1], angle = -turned, turned / 2.0 + math.pi
    elif word == LRLR and distance <= 2.0 + NEAR:
        u = math.acos(min((2.0 + distance) / 4.0, 1.0))
        trial[1], trial[2], angle, turned = u, -u, -QUARTER - u, -2.0 * u
    elif word == LRLR_CUSPS and square <= 20.0 + NEAR and square >= 4.0 - NEAR:
        u = math.acos(min(max((20.0 - square) / 16.0, 0.0), 1.0))
        trial[1] = trial[2] = -u
        angle = math.atan2(math.cos(u) - 2.0, -math.sin(u))
    elif word == LRSL and beyond >= 2.0 - NEAR:
        trial[1], trial[2] = -QUARTER, min(2.0 - beyond, 0.0)
        angle, turned = math.atan2(-beyond, -2.0), QUARTER
    elif word == LRSR and distance >= 2.0 - NEAR:
        trial[1], trial[2] = -QUARTER, min(2.0 - distance, 0.0)
        angle, turned = -QUARTER, QUARTER
    elif word == LRSLR and beyond >= 4.0 - NEAR:
        trial[1], trial[2], trial[3] = -QUARTER, min(4.0 - beyond, 0.0), -QUARTER
        angle = math.atan2(-beyond, -2.0)
    else:
        return False
    trial[0] = wrap(math.atan2(y, x) - angle)
    last = wrap(yaw - trial[0] - turned)
    trial[COUNTS[word] - 1] = last if to_left else -last
    return True


@njit(cache=True, nogil=True)
def _cost(trial: Floats, gear: int, reverse: float, cusp: float) -> float:
    total, before = 0.0, 0.0
    for length in trial:
        if abs(length) > NEAR:
            total += abs(length) * (reverse if gear * length < 0.0 else 1.0)
            if before * length < 0.0:
                total += cusp
            before = length
    return total


@njit(cache=True, nogil=True)
def _store(
    trial: Floats,
    word: int,
    gear: int,
    mirror: int,
    backwards: bool,
    lengths: Floats,
    turns: Ints,
) -> None:
    count = COUNTS[word]
    lengths[:], turns[:] = 0.0, 0
    for k in range(count):
        of = count - 1 - k if backwards else k
        lengths[k] = gear * trial[of] if abs(trial[of]) > NEAR else 0.0
        turns[k] = mirror * TURNS[word, of]


@njit(cache=True, nogil=True)
def _ahead(angle: float) -> float:
    """Return the equivalent angle in [0, 2 pi); nearly a whole turn is 0."""
    angle -= TURN * math.floor(angle / TURN)
    return 0.0 if angle > TURN - NEAR else angle


@njit(cache=True, nogil=True)
def along(
    x: float, y: float, yaw: float, curvature: float, length: float
) -> tuple[float, float, float]:
    """Return the pose at the end of a piece of constant curvature.

    Parameters
    ----------
    x, y, yaw : float [any length; rad]
        The pose at its beginning.
    curvature : float [1 / length]
    length : float
        Negative in reverse.
    """
    if curvature == 0.0:
        return x + length * math.cos(yaw), y + length * math.sin(yaw), yaw
    after = yaw + curvature * length
    # A chord of 2 sin(turn / 2) / curvature: differences of sines lose digits on short pieces.
    half = 0.5 * curvature * length
    chord = 2.0 * math.sin(half) / curvature
    return x + chord * math.cos(yaw + half), y + chord * math.sin(yaw + half), after
