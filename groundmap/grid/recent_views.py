"""What is there now: the cells that the newest views saw as non-free.

An average remembers the road that was empty before a car came. Next to it, the newest views are
kept as they are, and planning takes what they saw as non-free, whatever the average says.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats, Floats32, Ints
from groundmap.errors import InputError
from groundmap.grid.window import EPSILON

KNOWN_NEAR = 0.5  # [m]: what a view sees as close to a non-free cell of the map is not new

#: Returns the confidence of the cells from a lower up to an upper one.
Read: TypeAlias = Callable[[Ints, Ints], Floats32]


class RecentView(NamedTuple):
    """What one view saw as non-free."""

    surfaces: Floats  #: shape (k, 2, d) [m, map], ends of surfaces that nothing is seen through
    lone: Bools  #: shape (k,), which of them are a single point or segment feature
    cells: Ints  #: shape (n, d), further cells, such as those where ground is missing
    viewpoint: Floats  #: shape (d,) [m, map]
    timestamp: float | None = None  #: [s]


@dataclass(kw_only=True)
class RecentViews:
    """The newest views of a grid.

    Parameters
    ----------
    views : int, default 2
        How many views are kept, unless `seconds` is given.
    seconds : float, optional [s]
        Views are kept that are no older than this before the newest.
    spacing : float, default 1.0 [m]
        A lone feature counts if another surface is within this distance: else it is most likely a
        false match.
    depth : float, default 4.5 [m]
        Where something new is, cells that it hides count up to this far behind what is seen of it.
    """

    views: int = 2
    seconds: float | None = None
    spacing: float = 1.0
    depth: float = 4.5
    held: deque[RecentView] = field(default_factory=deque)

    def check(self, timestamp: float | None) -> None:
        """Check that a view can be kept.

        Raises
        ------
        InputError
            The window is in seconds, and the view has no timestamp.
        """
        if self.seconds is not None and timestamp is None:
            hint = "Set recent_views instead of recent_seconds."
            raise InputError("timestamp", "a time [s]", "none", hint=hint)

    def add(self, view: RecentView) -> None:
        """Add the newest view, and drop those that are no longer in the window."""
        self.check(view.timestamp)
        self.held.append(view)
        if self.seconds is None:
            while len(self.held) > self.views:
                self.held.popleft()
            return
        newest = max(_time(each) for each in self.held)
        self.held = deque(each for each in self.held if _time(each) >= newest - self.seconds)

    def cells(self, read: Read, resolution: float, origin: Floats) -> Ints:
        """Return the cells that the views saw as non-free, and what new things hide.

        Parameters
        ----------
        read : callable
            Returns the map's confidence of the cells from a lower up to an upper one.
        resolution : float [m]
        origin : ndarray, shape (d,) [m, map]
        """
        parts = [np.empty((0, len(origin)), dtype=np.int64)]
        for view in self.held:
            surfaces = view.surfaces[_is_confirmed(view, self.spacing)]
            seen = np.concatenate([_crossed(surfaces, resolution, origin), view.cells])
            if len(seen):
                parts += [seen, self._hidden(view, seen, read, resolution, origin)]
        cells: Ints = np.unique(np.concatenate(parts), axis=0)
        return cells

    def _hidden(
        self, view: RecentView, seen: Ints, read: Read, resolution: float, origin: Floats
    ) -> Ints:
        """Return the cells behind new things that the map calls free.

        A thing is new where it stands in cells that the map calls free, away from what the map
        knows. How far it extends can't be seen.
        """
        reach = int(np.ceil((self.depth + KNOWN_NEAR) / resolution)) + 1
        lower, upper = seen.min(axis=0) - reach, seen.max(axis=0) + reach + 1
        confidence = read(lower, upper)
        new = seen[_is_new(seen - lower, confidence, KNOWN_NEAR / resolution)]
        centres = origin + (new[:, ::-1] + 0.5) * resolution
        away = centres - view.viewpoint
        ranges = np.linalg.norm(away, axis=1)
        new, away, ranges = new[ranges > 0], away[ranges > 0], ranges[ranges > 0]
        # Steps and beams of half a cell leave no cell between them out.
        steps = np.arange(0.5, self.depth / resolution + 0.5, 0.5)
        beams = _corners(new.shape[1]) * 0.5
        ahead = steps[None, :, None] * (away / ranges[:, None])[:, None, :]
        places = new[:, None, None, ::-1] + 0.5 + beams[None, :, None, :] + ahead[:, None]
        cells = np.floor(places).astype(np.int64).reshape(-1, new.shape[1])[:, ::-1] - lower
        inside = np.logical_and.reduce((cells >= 0) & (cells < confidence.shape), axis=1)
        behind = np.zeros(confidence.shape, dtype=np.bool_)
        behind[tuple(cells[inside].T)] = True
        hidden: Ints = np.argwhere(behind & (confidence <= -EPSILON)) + lower
        return hidden


def _is_new(cells: Ints, confidence: Floats32, near: float) -> Bools:
    """Return which cells the map calls free, with no non-free cell within `near` cells."""
    new: Bools = confidence[tuple(cells.T)] <= -EPSILON
    steps = np.arange(-np.floor(near), np.floor(near) + 1).astype(np.int64)
    around = np.stack(np.meshgrid(*[steps] * confidence.ndim), axis=-1).reshape(-1, confidence.ndim)
    around = around[np.linalg.norm(around, axis=1) <= near]
    places = cells[new][:, None] + around
    known = confidence[tuple(np.moveaxis(places, -1, 0))] >= EPSILON
    new[new] = ~np.logical_or.reduce(known, axis=1)
    return new


def _is_confirmed(view: RecentView, spacing: float) -> Bools:
    """Return which surfaces are no lone feature without another surface within `spacing` [m]."""
    confirmed = ~view.lone
    lone = np.flatnonzero(view.lone)
    if len(lone) and len(view.surfaces) > 1:
        middles = view.surfaces.mean(axis=1)
        near = cKDTree(middles).query_ball_point(middles[lone], spacing, return_length=True)
        confirmed[lone] = near > 1
    return confirmed


def _crossed(surfaces: Floats, resolution: float, origin: Floats) -> Ints:
    """Return the cells of places along surfaces, half a cell apart.

    Parameters
    ----------
    surfaces : ndarray, shape (k, 2, d) [m, map]
    resolution : float [m]
    origin : ndarray, shape (d,) [m, map]
    """
    along = surfaces[:, 1] - surfaces[:, 0]
    counts = np.ceil(np.linalg.norm(along, axis=1) / (0.5 * resolution)).astype(np.int64) + 1
    row = np.repeat(np.arange(len(surfaces)), counts)
    number = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / np.maximum(np.repeat(counts, counts) - 1, 1)
    places = surfaces[row, 0] + share[:, None] * along[row]
    cells = np.floor((places - origin) / resolution).astype(np.int64)[:, ::-1]
    return np.unique(cells, axis=0)


def _corners(ndim: int) -> Floats:
    """Return the corners and the centre of a cube with sides of 2 around 0."""
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * ndim), axis=-1).reshape(-1, ndim)
    return np.concatenate([np.zeros((1, ndim)), corners])


def _time(view: RecentView) -> float:
    assert view.timestamp is not None
    return view.timestamp
