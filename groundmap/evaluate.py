"""Held-out evaluation: what features that the map never saw say about it.

The judge has its own ground planes (fitted to all views, held-out ones included) and its own fixed
tolerances; it reads nothing of the mapper's settings, so that no setting can flatter itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.errors import InputError
from groundmap.features import View
from groundmap.grid import ConfidenceGrid
from groundmap.ground_fit import fit_ground
from groundmap.mapper import GroundMapper
from groundmap.window import CellState, GridWindow

FOLDS = 5  # one in five is held out
JUDGED_RANGE = 15.0  # [m]
GROUND_HEIGHT = 0.10  # [m], features within this of the plane are ground: less than a kerb
OBSTACLE_HEIGHTS = (0.30, 1.80)  # [m], features between these are obstacles
NEAR = 0.3  # [m], an obstacle this near to a non-free cell is on the map
END_OF_SIGHT = 0.3  # [m], the last piece of a sight line is not judged
STAMP_RADIUS = 0.3  # [m], of the baseline's discs


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


class HeldOut(NamedTuple):
    """Features that the map never saw, as the judge sorts them; frame map."""

    obstacles: Floats  #: shape (n, 2) [m]
    grounds: Floats  #: shape (k, 2) [m]
    viewpoints: Floats  #: shape (k, 2) [m], where each ground feature was seen from


class Verdict(NamedTuple):
    """One protocol's outcome."""

    figures: Figures
    grid: ConfidenceGrid  #: the map of the last fold
    held_out: HeldOut  #: what that map was judged by


# Fold, number of the view, view: what of it is mapped, what is held out.
Split = Callable[[int, int, View], tuple[View | None, View | None]]


def evaluate(
    views: Iterable[View], *, watch: Callable[[list[Any]], Iterable[Any]] = iter, **settings: Any
) -> dict[str, Verdict]:
    """Map a part of a log and judge the map by the rest, in three ways and with a baseline.

    ``views`` holds out every fifth view; ``ids`` holds out a fifth of the landmarks, in all views;
    ``thin`` maps a fifth of the landmarks and judges by another fifth; ``stamping`` is ``views``
    with a map that only stamps a disc at each feature. Each is done five times, with another
    fifth held out, and the five are pooled: no choice of the fifth can flatter.

    Parameters
    ----------
    views : iterable of View
    watch : callable
        Wraps the list of steps, to show progress.
    **settings
        `groundmap.settings.MapperSettings`.

    Raises
    ------
    InputError
        Fewer than five views, or landmarks without ids.
    """
    judged = list(fit_ground(views))
    _check_log(judged)
    trajectory = np.array([view.T_map_base[:2, 3] for view in judged])
    tallies = dict.fromkeys(PROTOCOLS, Tally())
    verdicts = {}
    for name, fold in watch([(name, fold) for name in PROTOCOLS for fold in range(FOLDS)]):
        split, mapped_by = PROTOCOLS[name]
        parts = [split(fold, number, view) for number, view in enumerate(judged)]
        grid = mapped_by((view for view, _ in parts if view is not None), settings)
        held_out = sort_by_height(view for _, view in parts if view is not None)
        tallies[name] = tallies[name].plus(judge(grid, held_out, trajectory))
        verdicts[name] = Verdict(tallies[name].figures(), grid, held_out)
    return verdicts


def _check_log(views: list[View]) -> None:
    if len(views) < FOLDS:
        raise InputError("views", f"at least {FOLDS} views", str(len(views)))
    nameless = [number for number, view in enumerate(views) if (view.points.ids < 0).any()]
    if nameless:
        raise InputError(
            "views",
            "a landmark id for every point",
            "points without one",
            where=f"view {nameless[0]}",
            hint="Without ids, a landmark can't be held out of all views that saw it.",
        )


def _folds(view: View) -> Ints:
    """Return the fold of each landmark, the same in every view and in no order of the ids."""
    scrambled = view.points.ids.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return ((scrambled >> np.uint64(32)) % np.uint64(FOLDS)).astype(np.int64)


def _by_view(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    return (None, view) if number % FOLDS == fold else (view, None)


def _by_id(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    folds = _folds(view)
    return _only(view, folds != fold), _only(view, folds == fold)


def _thinned(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    folds = _folds(view)
    return _only(view, folds == (fold + 1) % FOLDS), _only(view, folds == fold)


def _only(view: View, keep: Bools) -> View:
    return replace(view, points=view.points.select(keep))


def _mapped(views: Iterable[View], settings: dict[str, Any]) -> ConfidenceGrid:
    """Map as a user would: the ground, too, is fitted to what is mapped, and nothing else."""
    mapper = GroundMapper(**settings)
    for view in fit_ground(views):
        mapper.integrate(view)
    return mapper.grid


def _stamped(views: Iterable[View], settings: dict[str, Any]) -> ConfidenceGrid:
    """Map without triangulation: free discs at ground features, non-free ones at obstacles."""
    grid = GroundMapper(**settings).grid
    for view in views:
        seen = sort_by_height([view])
        places = np.concatenate([seen.grounds, seen.obstacles])
        if len(places) == 0:
            continue
        reach = STAMP_RADIUS + grid.resolution
        window = grid.window(
            np.concatenate([places.min(axis=0) - reach, places.max(axis=0) + reach])
        )
        z = np.zeros(window.count.shape, dtype=np.float32)
        for points, value in ((seen.grounds, -1.0), (seen.obstacles, 1.0)):
            cells, distance = _cells_around(window, points, STAMP_RADIUS, to_centre=True)
            z[tuple(cells[distance <= STAMP_RADIUS].T)] = value
        lower = np.rint((window.origin - grid.origin) / grid.resolution).astype(np.int64)[::-1]
        grid.fuse(lower, z)
    return grid


PROTOCOLS: dict[str, tuple[Split, Callable[[Iterable[View], dict[str, Any]], ConfidenceGrid]]] = {
    "views": (_by_view, _mapped),
    "ids": (_by_id, _mapped),
    "thin": (_thinned, _mapped),
    "stamping": (_by_view, _stamped),
}


def sort_by_height(views: Iterable[View]) -> HeldOut:
    """Sort the point features of views by the judge's heights; far ones are left out."""
    rows = list(_sorted(views))
    obstacles, grounds, viewpoints = zip(*rows, strict=True) if rows else ((), (), ())
    none = np.empty((0, 2))
    return HeldOut(
        np.concatenate([none, *obstacles]),
        np.concatenate([none, *grounds]),
        np.concatenate([none, *viewpoints]),
    )


def _sorted(views: Iterable[View]) -> Iterator[tuple[Floats, Floats, Floats]]:
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
        near_nonfree=_near_nonfree(window, states, held_out.obstacles).sum(),
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


def _cells_around(
    window: GridWindow, points: Floats, radius: float, *, to_centre: bool = False
) -> tuple[Ints, Floats]:
    """Return the cells in a box around each point, (n, k, 2), and how far each is, (n, k) [m].

    Distances are to the cells' squares, or to their centres.
    """
    steps = int(np.ceil(radius / window.resolution)) + 1
    offsets = np.stack(np.meshgrid(*[np.arange(-steps, steps + 1)] * 2), axis=-1).reshape(-1, 2)
    at = window.world_to_cell(points) if len(points) else np.empty((0, 2), dtype=np.int64)
    cells = at[:, None, :] + offsets
    centres = window.origin + (cells[..., ::-1] + 0.5) * window.resolution
    apart = np.abs(points[:, None, :] - centres)
    if not to_centre:
        apart = np.maximum(apart - 0.5 * window.resolution, 0.0)
    distance: Floats = np.hypot(apart[..., 0], apart[..., 1])
    return cells, distance


def _near_nonfree(window: GridWindow, states: Bytes, points: Floats) -> Bools:
    cells, distance = _cells_around(window, points, NEAR)
    inside = window.contains(cells)
    nonfree = np.zeros(inside.shape, dtype=np.bool_)
    nonfree[inside] = states[tuple(cells[inside].T)] == CellState.NONFREE
    near: Bools = np.logical_or.reduce(nonfree & (distance <= NEAR), axis=1)
    return near


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
