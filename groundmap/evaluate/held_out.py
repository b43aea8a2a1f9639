"""The judge: what features that a map never saw say about it.

It has its own fixed tolerances and reads nothing of the mapper's settings, so that no setting can
flatter itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState, GridWindow
from groundmap.view.view import View

JUDGED_RANGE = 15.0  # [m]
GROUND_HEIGHT = 0.10  # [m], features within this of the plane are ground: less than a kerb
OBSTACLE_HEIGHTS = (0.30, 1.80)  # [m], features between these are obstacles
NEAR = 0.3  # [m], an obstacle this near to a non-free cell is on the map
CELLS_AT_ONCE = 2**19  # around points; each takes some 100 bytes
END_OF_SIGHT = 0.3  # [m], the last piece of a sight line is not judged


class HeldOut(NamedTuple):
    """Features that the map never saw, as the judge sorts them; frame map."""

    obstacles: Floats  #: shape (n, 2) [m]
    grounds: Floats  #: shape (k, 2) [m]
    viewpoints: Floats  #: shape (k, 2) [m], where each ground feature was seen from


def sort_by_height(views: Iterable[View]) -> HeldOut:
    """Sort the point features of views by the judge's heights; far ones are left out."""
    rows = list(_sort(views))
    obstacles, grounds, viewpoints = zip(*rows, strict=True) if rows else ((), (), ())
    none = np.empty((0, 2))
    return HeldOut(
        np.concatenate([none, *obstacles]),
        np.concatenate([none, *grounds]),
        np.concatenate([none, *viewpoints]),
    )


def _sort(views: Iterable[View]) -> Iterator[tuple[Floats, Floats, Floats]]:
    for view in views:
        if view.plane is None:
            continue
        T_base_camera, T_map_camera = view.rig.T_base_camera, view.T_map_camera
        xyz = view.points.xyz
        height = view.plane.height(xyz @ T_base_camera[:3, :3].T + T_base_camera[:3, 3])
        xy = xyz @ T_map_camera[:2, :3].T + T_map_camera[:2, 3]
        near = np.hypot(*(xy - T_map_camera[:2, 3]).T) <= JUDGED_RANGE
        lowest, highest = OBSTACLE_HEIGHTS
        obstacles = xy[near & (lowest <= height) & (height <= highest)]
        grounds = xy[near & (np.abs(height) <= GROUND_HEIGHT)]
        yield obstacles, grounds, np.tile(T_map_camera[:2, 3], (len(grounds), 1))


@dataclass(frozen=True)
class Figures:
    """What the held-out features say; shares are 0 to 1, pooled over the five folds."""

    obstacle_near_nonfree: float  #: obstacles within 0.3 m of a non-free cell
    obstacle_in_free: float
    obstacle_unknown: float  #: obstacles in unknown or contested cells
    ground_free: float
    ground_nonfree: float
    ground_unknown: float
    sightline_free: float  #: of the length of sight lines to ground features
    sightline_crosses_nonfree: float  #: of the number of those lines
    trajectory_free: float  #: of the cells driven over since the first known one
    trajectory_nonfree: float
    trajectory_unseen_start_m: float  #: [m] driven before the first known cell, mean of the folds
    obstacles: int  #: features judged
    grounds: int


class Tally(NamedTuple):
    """Sums that figures are made of; tallies of several folds add up field by field."""

    obstacles: float = 0
    near_nonfree: float = 0
    in_free: float = 0
    obstacles_unknown: float = 0
    grounds: float = 0
    grounds_free: float = 0
    grounds_nonfree: float = 0
    grounds_unknown: float = 0
    sight_m: float = 0
    sight_free_m: float = 0
    crossings: float = 0
    driven: float = 0
    driven_free: float = 0
    driven_nonfree: float = 0
    unseen_start_m: float = 0
    maps: float = 0

    def plus(self, other: Tally) -> Tally:
        """Return the sums of both."""
        return Tally(*(a + b for a, b in zip(self, other, strict=True)))

    def figures(self) -> Figures:
        """Return the shares; of nothing, 0."""

        def share(part: float, whole: float) -> float:
            return part / whole if whole else 0.0

        return Figures(
            obstacle_near_nonfree=share(self.near_nonfree, self.obstacles),
            obstacle_in_free=share(self.in_free, self.obstacles),
            obstacle_unknown=share(self.obstacles_unknown, self.obstacles),
            ground_free=share(self.grounds_free, self.grounds),
            ground_nonfree=share(self.grounds_nonfree, self.grounds),
            ground_unknown=share(self.grounds_unknown, self.grounds),
            sightline_free=share(self.sight_free_m, self.sight_m),
            sightline_crosses_nonfree=share(self.crossings, self.grounds),
            trajectory_free=share(self.driven_free, self.driven),
            trajectory_nonfree=share(self.driven_nonfree, self.driven),
            trajectory_unseen_start_m=share(self.unseen_start_m, self.maps),
            obstacles=int(self.obstacles),
            grounds=int(self.grounds),
        )


def judge(grid: ConfidenceGrid, held_out: HeldOut, trajectory: Floats) -> Tally:
    """Return the tally of one map.

    Parameters
    ----------
    grid : ConfidenceGrid
    held_out : HeldOut
    trajectory : ndarray, shape (n, 2) [m, map]
    """
    window = grid.window()
    states = window.states()
    at_obstacle = _states_at(window, states, held_out.obstacles)
    at_ground = _states_at(window, states, held_out.grounds)
    sight_m, sight_free_m, crossings = _sight_lines(window, states, held_out)
    driven = _along(window, trajectory)
    known = np.flatnonzero(_states_at(window, states, driven) != CellState.UNKNOWN)
    first = int(known[0]) if len(known) else len(driven)
    cells = np.unique(window.world_to_cell(driven[first:]).reshape(-1, 2), axis=0)
    on_cells = _states_at(window, states, window.cell_to_world(cells))
    return Tally(
        obstacles=len(at_obstacle),
        near_nonfree=near_nonfree(window, states, held_out.obstacles).sum(),
        in_free=(at_obstacle == CellState.FREE).sum(),
        obstacles_unknown=_not_known(at_obstacle).sum(),
        grounds=len(at_ground),
        grounds_free=(at_ground == CellState.FREE).sum(),
        grounds_nonfree=(at_ground == CellState.NONFREE).sum(),
        grounds_unknown=_not_known(at_ground).sum(),
        sight_m=sight_m,
        sight_free_m=sight_free_m,
        crossings=crossings,
        driven=len(on_cells),
        driven_free=(on_cells == CellState.FREE).sum(),
        driven_nonfree=(on_cells == CellState.NONFREE).sum(),
        unseen_start_m=float(np.hypot(*np.diff(driven[: first + 1], axis=0).T).sum()),
        maps=1,
    )


def _not_known(states: Bytes) -> Bools:
    unknown: Bools = (states == CellState.UNKNOWN) | (states == CellState.CONTESTED)
    return unknown


def _states_at(window: GridWindow, states: Bytes, points: Floats) -> Bytes:
    """Return the states at positions; beyond the window all is unknown."""
    found = np.full(len(points), CellState.UNKNOWN, dtype=np.uint8)
    if len(points):
        cells = window.world_to_cell(points)
        inside = window.contains(cells)
        found[inside] = states[tuple(cells[inside].T)]
    return found


def cells_around(
    window: GridWindow, points: Floats, radius: float, *, to_centre: bool = False
) -> Iterator[tuple[Ints, Floats]]:
    """Yield the cells in a box around each point, (b, k, 2), and how far each is, (b, k) [m].

    In blocks of points, in their order, as small cells would fill the memory with the boxes of
    all. Distances are to the cells' squares, or to their centres.
    """
    steps = int(np.ceil(radius / window.resolution)) + 1
    offsets = np.stack(np.meshgrid(*[np.arange(-steps, steps + 1)] * 2), axis=-1).reshape(-1, 2)
    block = max(1, CELLS_AT_ONCE // len(offsets))
    for first in range(0, len(points), block):
        part = points[first : first + block]
        cells = window.world_to_cell(part)[:, None, :] + offsets
        centres = window.origin + (cells[..., ::-1] + 0.5) * window.resolution
        apart = np.abs(part[:, None, :] - centres)
        if not to_centre:
            apart = np.maximum(apart - 0.5 * window.resolution, 0.0)
        yield cells, np.hypot(apart[..., 0], apart[..., 1])


def near_nonfree(window: GridWindow, states: Bytes, points: Floats) -> Bools:
    """Return which points, shape (n, 2) [m, map], have a non-free cell within 0.3 m."""
    near = [np.empty(0, dtype=np.bool_)]
    for cells, distance in cells_around(window, points, NEAR):
        inside = window.contains(cells)
        nonfree = np.zeros(inside.shape, dtype=np.bool_)
        nonfree[inside] = states[tuple(cells[inside].T)] == CellState.NONFREE
        near.append(np.logical_or.reduce(nonfree & (distance <= NEAR), axis=1))
    return np.concatenate(near)


def _along(window: GridWindow, points: Floats) -> Floats:
    """Return places along a polyline, a quarter of a cell apart."""
    step = 0.25 * window.resolution
    pieces = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, int(np.ceil(np.hypot(*(b - a)) / step)))
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def _sight_lines(window: GridWindow, states: Bytes, held_out: HeldOut) -> tuple[float, float, int]:
    """Return the length of the sight lines, how much of it is free [m], how many cross non-free."""
    total, free, crossings = 0.0, 0.0, 0
    for start, end in zip(held_out.viewpoints, held_out.grounds, strict=True):
        distance = float(np.hypot(*(end - start)))
        length = distance - END_OF_SIGHT
        if length <= 0:
            continue
        stop = start + (end - start) * (length / distance)
        seen = _states_at(window, states, _along(window, np.array([start, stop])))
        total += length
        free += length * float((seen == CellState.FREE).mean())
        crossings += int((seen == CellState.NONFREE).any())
    return total, free, crossings
