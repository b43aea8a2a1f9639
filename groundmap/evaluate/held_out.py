"""Figures of a map from held-out features, which were not mapped.

The tolerances are fixed and independent of the mapper's settings, so that figures of maps with
different settings can be compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.evaluate.figures import Tally
from groundmap.evaluate.landmark_kinds import LandmarkKinds
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState, GridWindow
from groundmap.view.view import View

JUDGED_RANGE = 15.0  # [m], farther features are left out
GROUND_HEIGHT = 0.10  # [m], distance of ground features from the plane: less than a kerb
OBSTACLE_HEIGHTS = (0.30, 1.80)  # [m], lowest and highest obstacle
NEAR = 0.3  # [m], distance from a non-free cell within which an obstacle counts as mapped
SWEPT = 0.8  # [m], half the width of the band that a robot sweeps along the trajectory
UNSEEN_START = 5.0  # [m] of the trajectory, which a forward camera does not see from its start
CELLS_AT_ONCE = 2**19  # cells of about 100 bytes that `cells_around` holds in memory
END_OF_SIGHT = 0.3  # [m], the end of a sight line, which is not judged


class HeldOut(NamedTuple):
    """Features that were not mapped, by kind."""

    obstacles: Floats  #: shape (n, 2) [m, map]
    grounds: Floats  #: shape (k, 2) [m, map], ground features
    viewpoints: Floats  #: shape (k, 2) [m, map], the camera position for each ground feature
    ids: Ints | None = None  #: shape (n,), landmarks of the obstacles

    @property
    def obstacle_ids(self) -> Ints:
        """Landmarks of the obstacles; -1 where they are not known."""
        return np.full(len(self.obstacles), -1) if self.ids is None else self.ids


def sort_by_height(views: Iterable[View]) -> HeldOut:
    """Return the obstacles and ground features among the point features of views.

    Features farther than 15 m from the camera are left out, as are views without a ground plane.
    """
    rows = list(_sort(views))
    obstacles, grounds, viewpoints, ids = zip(*rows, strict=True) if rows else ((), (), (), ())
    none = np.empty((0, 2))
    return HeldOut(
        np.concatenate([none, *obstacles]),
        np.concatenate([none, *grounds]),
        np.concatenate([none, *viewpoints]),
        np.concatenate([np.empty(0, dtype=np.int64), *ids]),
    )


def _sort(views: Iterable[View]) -> Iterator[tuple[Floats, Floats, Floats, Ints]]:
    for view in views:
        if view.plane is None:
            continue
        T_base_camera, T_map_camera = view.rig.T_base_camera, view.T_map_camera
        xyz = view.points.xyz
        height = view.plane.height(xyz @ T_base_camera[:3, :3].T + T_base_camera[:3, 3])
        xy = xyz @ T_map_camera[:2, :3].T + T_map_camera[:2, 3]
        near = np.hypot(*(xy - T_map_camera[:2, 3]).T) <= JUDGED_RANGE
        lowest, highest = OBSTACLE_HEIGHTS
        obstacle = near & (lowest <= height) & (height <= highest)
        grounds = xy[near & (np.abs(height) <= GROUND_HEIGHT)]
        viewpoints = np.tile(T_map_camera[:2, 3], (len(grounds), 1))
        yield xy[obstacle], grounds, viewpoints, view.points.ids[obstacle]


def judge(
    grid: ConfidenceGrid,
    held_out: HeldOut,
    trajectory: Floats,
    kinds: LandmarkKinds | None = None,
) -> Tally:
    """Return the tally of a map against held-out features.

    Parameters
    ----------
    grid : ConfidenceGrid
    held_out : HeldOut
    trajectory : ndarray, shape (n, 2) [m, map]
        Positions of the base, which drove through free space.
    kinds : LandmarkKinds, optional
        Landmarks whose figures are stated apart, too.
    """
    window = grid.window()
    states = window.states()
    at_obstacle = _states_at(window, states, held_out.obstacles)
    at_ground = _states_at(window, states, held_out.grounds)
    near = near_nonfree(window, states, held_out.obstacles)
    moving, thin = _of_kinds(held_out, kinds)
    in_free = at_obstacle == CellState.FREE
    swept = _swept(window, states, trajectory)
    sight_m, sight_free_m, crossings = _sight_lines(window, states, held_out)
    driven = _along(window, trajectory)
    known = np.flatnonzero(_states_at(window, states, driven) != CellState.UNKNOWN)
    first = int(known[0]) if len(known) else len(driven)
    cells = np.unique(window.world_to_cell(driven[first:]).reshape(-1, 2), axis=0)
    on_cells = _states_at(window, states, window.cell_to_world(cells))
    return Tally(
        obstacles=len(at_obstacle),
        near_nonfree=near.sum(),
        in_free=in_free.sum(),
        obstacles_unknown=_is_unknown(at_obstacle).sum(),
        grounds=len(at_ground),
        grounds_free=(at_ground == CellState.FREE).sum(),
        grounds_nonfree=(at_ground == CellState.NONFREE).sum(),
        grounds_unknown=_is_unknown(at_ground).sum(),
        sight_m=sight_m,
        sight_free_m=sight_free_m,
        crossings=crossings,
        driven=len(on_cells),
        driven_free=(on_cells == CellState.FREE).sum(),
        driven_nonfree=(on_cells == CellState.NONFREE).sum(),
        unseen_start_m=float(np.hypot(*np.diff(driven[: first + 1], axis=0).T).sum()),
        maps=1,
        swept=len(swept),
        swept_free=(swept == CellState.FREE).sum(),
        swept_nonfree=(swept == CellState.NONFREE).sum(),
        moving=moving.sum(),
        moving_in_free=(moving & in_free).sum(),
        moving_near=(moving & near).sum(),
        thin=thin.sum(),
        thin_in_free=(thin & in_free).sum(),
        thin_near=(thin & near).sum(),
    )


def _of_kinds(held_out: HeldOut, kinds: LandmarkKinds | None) -> tuple[Bools, Bools]:
    """Return which obstacles move, and which have few landmarks around them."""
    if kinds is None or held_out.ids is None:
        none = np.zeros(len(held_out.obstacles), dtype=np.bool_)
        return none, none
    return np.isin(held_out.ids, kinds.moving), np.isin(held_out.ids, kinds.thin)


def _swept(window: GridWindow, states: Bytes, trajectory: Floats) -> Bytes:
    """Return the states of the cells within `SWEPT` of the trajectory beyond `UNSEEN_START`."""
    points = _along(window, trajectory)
    driven = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    points = points[driven >= UNSEEN_START]
    none = np.empty((0, 2), dtype=np.int64)
    parts = [none]
    for cells, distances in cells_around(window, points, SWEPT, to_centre=True):
        parts.append(np.unique(cells[distances <= SWEPT], axis=0))
    cells = np.unique(np.concatenate(parts), axis=0)
    return _states_at(window, states, window.cell_to_world(cells))


def _is_unknown(states: Bytes) -> Bools:
    unknown: Bools = (states == CellState.UNKNOWN) | (states == CellState.CONTESTED)
    return unknown


def _states_at(window: GridWindow, states: Bytes, points: Floats) -> Bytes:
    """Return the states at positions; cells beyond the window are unknown."""
    at_points = np.full(len(points), CellState.UNKNOWN, dtype=np.uint8)
    if len(points):
        cells = window.world_to_cell(points)
        inside = window.contains(cells)
        at_points[inside] = states[tuple(cells[inside].T)]
    return at_points


def cells_around(
    window: GridWindow, points: Floats, radius: float, *, to_centre: bool = False
) -> Iterator[tuple[Ints, Floats]]:
    """Yield the cells in a box around each point, and their distances from the point.

    The points are processed in blocks of b points, in their order, to bound the memory.

    Parameters
    ----------
    window : GridWindow
    points : ndarray, shape (n, d) [m, map]
    radius : float [m]
        The box contains all cells within this distance.
    to_centre : bool, default False
        Whether distances are to the centres of cells, not to their squares.

    Yields
    ------
    cells : ndarray, shape (b, k, d)
        ``[row, col]``, in 3-D ``[layer, row, col]``, also of cells outside the window.
    distances : ndarray, shape (b, k) [m]
    """
    steps = int(np.ceil(radius / window.resolution)) + 1
    axes = len(window.origin)
    lattice = np.meshgrid(*[np.arange(-steps, steps + 1)] * axes)
    offsets = np.stack(lattice, axis=-1).reshape(-1, axes)
    block = max(1, CELLS_AT_ONCE // len(offsets))
    for first in range(0, len(points), block):
        part = points[first : first + block]
        cells = window.world_to_cell(part)[:, None, :] + offsets
        centres = window.origin + (cells[..., ::-1] + 0.5) * window.resolution
        offset = np.abs(part[:, None, :] - centres)
        if not to_centre:
            offset = np.maximum(offset - 0.5 * window.resolution, 0.0)
        yield cells, np.hypot.reduce(offset, axis=-1)


def near_nonfree(window: GridWindow, states: Bytes, points: Floats) -> Bools:
    """Return which points have a non-free cell within 0.3 m, shape (n,).

    Parameters
    ----------
    window : GridWindow
    states : ndarray, shape (rows, cols) or (layers, rows, cols)
        `CellState` of the cells of the window.
    points : ndarray, shape (n, d) [m, map]
    """
    near = [np.empty(0, dtype=np.bool_)]
    for cells, distance in cells_around(window, points, NEAR):
        inside = window.contains(cells)
        nonfree = np.zeros(inside.shape, dtype=np.bool_)
        nonfree[inside] = states[tuple(cells[inside].T)] == CellState.NONFREE
        near.append(np.logical_or.reduce(nonfree & (distance <= NEAR), axis=1))
    return np.concatenate(near)


def _along(window: GridWindow, points: Floats) -> Floats:
    """Return positions along a polyline, at most a quarter of a cell apart."""
    step = 0.25 * window.resolution
    pieces = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, int(np.ceil(np.hypot(*(b - a)) / step)))
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def _sight_lines(window: GridWindow, states: Bytes, held_out: HeldOut) -> tuple[float, float, int]:
    """Return the length and free length of the sight lines [m], and how many cross non-free."""
    total, free, crossings = 0.0, 0.0, 0
    for start, end in zip(held_out.viewpoints, held_out.grounds, strict=True):
        distance = float(np.hypot(*(end - start)))
        length = distance - END_OF_SIGHT
        if length <= 0:
            continue
        stop = start + (end - start) * (length / distance)
        along = _states_at(window, states, _along(window, np.array([start, stop])))
        total += length
        free += length * float((along == CellState.FREE).mean())
        crossings += int((along == CellState.NONFREE).any())
    return total, free, crossings
