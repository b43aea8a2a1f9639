"""Held-out evaluation: map a part of a log, judge by the rest.

The judge's ground planes are fitted to all views, held-out ones included.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Bools, Ints
from groundmap.errors import InputError
from groundmap.evaluate.held_out import Figures, HeldOut, Tally, cells_around, judge, sort_by_height
from groundmap.grid.grid import ConfidenceGrid
from groundmap.mapper import GroundMapper
from groundmap.view.ground_fit import fit_ground
from groundmap.view.view import View

FOLDS = 5  # one in five is held out
STAMP_RADIUS = 0.3  # [m], of the baseline's discs


class Verdict(NamedTuple):
    """One protocol's outcome."""

    figures: Figures
    grid: ConfidenceGrid  #: the map of the last fold
    held_out: HeldOut  #: what that map was judged by


# Fold, number of the view, view: what of it is mapped, what is held out.
Split = Callable[[int, int, View], tuple[View | None, View | None]]
Mapped = Callable[[Iterable[View], dict[str, Any], dict[str, Any]], ConfidenceGrid]


def evaluate(
    views: Iterable[View],
    *,
    watch: Callable[[list[Any]], Iterable[Any]] = iter,
    ground: dict[str, Any] | None = None,
    camera_height: float | None = None,
    **settings: Any,
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
    ground : dict, optional
        `groundmap.settings.GroundSettings` of the maps; the judge keeps its own.
    camera_height : float, optional [m]
        Level ground that far below the camera, for the maps and the judge, instead of fitted
        planes.
    **settings
        `groundmap.settings.MapperSettings`.

    Raises
    ------
    InputError
        Fewer than five views, or landmarks without ids.
    """
    judged = list(fit_ground(views, camera_height=camera_height))
    standing = {**(ground or {}), "camera_height": camera_height}
    _check_log(judged)
    trajectory = np.array([view.T_map_base[:2, 3] for view in judged])
    tallies = dict.fromkeys(PROTOCOLS, Tally())
    verdicts = {}
    for name, fold in watch([(name, fold) for name in PROTOCOLS for fold in range(FOLDS)]):
        split, mapped_by = PROTOCOLS[name]
        parts = [split(fold, number, view) for number, view in enumerate(judged)]
        grid = mapped_by((view for view, _ in parts if view is not None), settings, standing)
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


def _thin(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    folds = _folds(view)
    return _only(view, folds == (fold + 1) % FOLDS), _only(view, folds == fold)


def _only(view: View, keep: Bools) -> View:
    return replace(view, points=view.points.select(keep))


def _map(views: Iterable[View], settings: dict[str, Any], ground: dict[str, Any]) -> ConfidenceGrid:
    """Map as a user would: the ground, too, is fitted to what is mapped, and nothing else."""
    mapper = GroundMapper(**settings)
    for view in fit_ground(views, **ground):
        mapper.integrate(view)
    return mapper.grid


def _stamp(
    views: Iterable[View], settings: dict[str, Any], _ground: dict[str, Any]
) -> ConfidenceGrid:
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
            for cells, distance in cells_around(window, points, STAMP_RADIUS, to_centre=True):
                z[tuple(cells[distance <= STAMP_RADIUS].T)] = value
        lower = np.rint((window.origin - grid.origin) / grid.resolution).astype(np.int64)[::-1]
        grid.fuse(lower, z)
    return grid


PROTOCOLS: dict[str, tuple[Split, Mapped]] = {
    "views": (_by_view, _map),
    "ids": (_by_id, _map),
    "thin": (_thin, _map),
    "stamping": (_by_view, _stamp),
}
