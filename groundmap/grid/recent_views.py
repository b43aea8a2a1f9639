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
    """What one view said, see `groundmap.evidence.evidence.Evidence`."""

    lower: Ints
    z: Floats32
    height: Floats32 | None
    viewpoint: Floats  #: shape (d,) [m, map]
    features: Floats  #: shape (n, d) [m, map], obstacle features
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
        A cell counts if two features are within this distance: a lone one is most likely a false
        match.
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
            seen = self._confirmed(view, _nonfree_cells(view), resolution, origin)
            if len(seen):
                parts += [seen, self._hidden(view, seen, read, resolution, origin)]
        cells: Ints = np.unique(np.concatenate(parts), axis=0)
        return cells

    def _confirmed(self, view: RecentView, cells: Ints, resolution: float, origin: Floats) -> Ints:
        """Return the cells that two features are near, and all where ground is missing."""
        sure = np.zeros(len(cells), dtype=np.bool_)
        if view.height is not None:
            sure |= view.height[tuple((cells - view.lower).T)] < 0.0
        if len(view.features) > 1:
            centres = origin + (cells[:, ::-1] + 0.5) * resolution
            tree = cKDTree(view.features)
            sure |= tree.query_ball_point(centres, self.spacing, return_length=True) > 1
        return cells[sure]

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
        cells = np.unique(np.floor(places).astype(np.int64).reshape(-1, new.shape[1]), axis=0)
        cells = cells[:, ::-1] - lower
        inside = np.logical_and.reduce((cells >= 0) & (cells < confidence.shape), axis=1)
        cells = cells[inside]
        hidden: Ints = cells[confidence[tuple(cells.T)] <= -EPSILON] + lower
        return hidden


def _is_new(cells: Ints, confidence: Floats32, near: float) -> Bools:
    """Return which cells the map calls free, with no non-free cell within `near` cells."""
    new: Bools = confidence[tuple(cells.T)] <= -EPSILON
    known = np.argwhere(confidence >= EPSILON)
    if len(known):
        distances, _ = cKDTree(known).query(cells, distance_upper_bound=near)
        new &= np.isinf(distances)
    return new


def _nonfree_cells(view: RecentView) -> Ints:
    """Return where the view saw a surface or missing ground, without the spread around them."""
    nonfree = view.z >= EPSILON
    if view.height is not None:
        nonfree &= np.isfinite(view.height)
    return np.argwhere(nonfree) + view.lower


def _corners(ndim: int) -> Floats:
    """Return the corners and the centre of a cube with sides of 2 around 0."""
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * ndim), axis=-1).reshape(-1, ndim)
    return np.concatenate([np.zeros((1, ndim)), corners])


def _time(view: RecentView) -> float:
    assert view.timestamp is not None
    return view.timestamp
