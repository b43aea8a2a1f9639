"""Slopes ahead of the driven track: changes of slope that features show on the way ahead."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.view.ground_strip import GroundStrip

CORRIDOR = 2.0  # [m], to both sides of the way ahead
PIECE = 0.5  # [m], length of the pieces of the way
LEVEL = 0.05  # [m], distance of the heights that features are counted at
FEWEST = 2.0  # features that a piece of ground needs
SHARE = 0.6  # of the features on a piece that are ground there; those of a bush are at all heights
AROUND = 1.0  # [m], distance from the ground of features that count against it
STEEP = 0.1  # slope from which on a piece is several levels high
BREAKS = 2  # pieces between the places that are tried for a change of slope
SLOPES: Floats = np.tan(np.radians(np.arange(-14.0, 15.0)))
LEAST_RUN = 4  # pieces between two changes of slope
STEPS: Floats = np.arange(-60.0, 61.0) * LEVEL  # [m], heights of steps, which are not slopes
BEGIN, LEAST_SEEN = 8, 5  # pieces at its beginning, and how many of them are seen to be ground
NEAREST = 0.01  # [m], between two places of a strip
GAIN = 4.0  # pieces of ground that a change of slope must explain beyond a step or level ground
MOST_CHANGES = 3


class Change(NamedTuple):
    """A change of the ground's slope."""

    distance: float  #: [m] after the end of the driven track
    slope: float  #: change of the rise per distance


def slopes_ahead(points: Floats, reach: float) -> list[Change]:
    """Return the changes of slope on the way ahead, in their order.

    The way is cut into pieces. A piece is ground if most features on it are at the height in
    question. Each change of slope makes more pieces ground, and all of them together more than a
    step at any place: a kerb is no slope, and neither is a stair that leads out of sight.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
        Features: distance ahead of the end of the driven track, offset to the left, and height
        above the ground that continues there.
    reach : float [m]
        Distance of the farthest features that are used.
    """
    ahead = (points[:, 0] > 0) & (points[:, 0] < reach) & (np.abs(points[:, 1]) <= CORRIDOR)
    counts = _Counts(points[ahead], reach)
    ground, total = np.zeros(len(counts.at)), 0.0
    explained = float(counts.ground(ground, total).sum())
    if counts.seen() < explained + GAIN:
        return []
    least = _best_step(counts) + GAIN
    changes: list[Change] = []
    begin = 0
    for _ in range(MOST_CHANGES):
        piece, slope, more = _best_change(counts, ground, total, begin)
        changed = ground + slope * np.maximum(counts.at - piece * PIECE, 0.0)
        begun = counts.ground(changed, total + slope)[piece : piece + BEGIN]
        if more < explained + GAIN or begun.sum() < LEAST_SEEN:
            break
        changes.append(Change(piece * PIECE, slope))
        ground = changed
        explained, total, begin = more, total + slope, piece + LEAST_RUN
        if begin >= len(counts.at):
            break
    return changes if explained >= least else []


def continue_strip(strip: GroundStrip, undriven: float, changes: list[Change]) -> GroundStrip:
    """Return a strip with changes of slope on its last piece.

    Parameters
    ----------
    strip : GroundStrip
    undriven : float [m]
        Length of the part of its last piece that is ahead of the driven track.
    changes : list of Change
    """
    if not changes:
        return strip
    last = strip.places[-1]
    onward = last - strip.places[-2]
    onward /= np.linalg.norm(onward)
    up = strip.normals[-1]
    places, normals = [*strip.places[:-1]], [*strip.normals[:-1]]
    slope, at, rise = 0.0, 0.0, 0.0
    for change in (*changes, Change(undriven, 0.0)):
        rise += slope * (change.distance - at)
        at = change.distance
        place = last - (undriven - at) * onward + rise * up
        if np.linalg.norm(place - places[-1]) < NEAREST:
            places.pop()
            normals.pop()
        tilted = up - (slope + 0.5 * change.slope) * onward
        places.append(place)
        normals.append(tilted / np.linalg.norm(tilted))
        slope += change.slope
    return GroundStrip(places=np.array(places), normals=np.array(normals))


class _Counts:
    """Numbers of features by piece of the way and height."""

    def __init__(self, points: Floats, reach: float) -> None:
        pieces = int(np.ceil(reach / PIECE))
        self.at = (np.arange(pieces) + 0.5) * PIECE
        highest = float(np.abs(SLOPES).max()) * reach + AROUND
        self.half = int(np.ceil(highest / LEVEL))
        levels = 2 * self.half + 1
        piece = np.minimum((points[:, 0] / PIECE).astype(np.int64), pieces - 1)
        level = np.rint(points[:, 2] / LEVEL).astype(np.int64) + self.half
        inside = (level >= 0) & (level < levels)
        counts = np.bincount(
            piece[inside] * levels + level[inside], minlength=pieces * levels
        ).reshape(pieces, levels)
        padded = np.zeros((pieces, levels + 1))
        np.cumsum(counts, axis=1, out=padded[:, 1:])
        self.sums = padded

    def seen(self) -> int:
        """Return the number of pieces that can be ground at any height."""
        return int((self.sums[:, -1] >= FEWEST).sum())

    def around(self, heights: Floats, levels: Ints) -> Floats:
        """Return the features up to some levels above or below heights, shape (..., pieces) [m]."""
        level = np.rint(heights / LEVEL).astype(np.int64) + self.half
        last = self.sums.shape[1] - 1
        start = np.clip(level - levels, 0, last)
        stop = np.clip(level + levels + 1, 0, last)
        pieces = np.arange(len(self.at))
        counts: Floats = self.sums[pieces, stop] - self.sums[pieces, start]
        return counts

    def ground(self, heights: Floats, slopes: Floats | float) -> Floats:
        """Return which pieces are ground, 1 or 0, shape (..., pieces).

        Parameters
        ----------
        heights : ndarray, shape (..., pieces) [m]
        slopes : ndarray or float
            Their slope, of a shape that is broadcast to that of the heights.
        """
        on = self.around(heights, 1 + (np.abs(slopes) > STEEP).astype(np.int64))
        around = self.around(heights, np.array(round(AROUND / LEVEL)))
        return ((on >= FEWEST) & (on >= SHARE * around)).astype(np.float64)


def _best_change(
    counts: _Counts, ground: Floats, total: float, begin: int
) -> tuple[int, float, float]:
    """Return piece and slope of the change that makes most pieces ground, and their number."""
    places = np.arange(begin, len(counts.at), BREAKS)
    run = np.maximum(counts.at - places[:, None] * PIECE, 0.0)
    slopes = SLOPES[:, None, None]
    changed = counts.ground(ground + slopes * run, total + slopes * (run > 0)).sum(axis=2)
    slope, place = np.unravel_index(int(np.argmax(changed)), changed.shape)
    return int(places[place]), float(SLOPES[slope]), float(changed[slope, place])


def _best_step(counts: _Counts) -> float:
    """Return how many pieces are ground with a step at any place, of any height."""
    after = np.arange(len(counts.at)) >= np.arange(0, len(counts.at), BREAKS)[:, None]
    return float(counts.ground(STEPS[:, None, None] * after, 0.0).sum(axis=2).max())
