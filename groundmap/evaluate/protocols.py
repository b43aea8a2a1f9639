"""Protocols of held-out evaluation: which part of a log is mapped, and which part is held out.

The heights of held-out features are measured from ground planes that are fitted to all views.
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

FOLDS = 5  # one fifth is held out
STAMP_RADIUS = 0.3  # [m], of the discs of the baseline


class Verdict(NamedTuple):
    """Result of one protocol."""

    figures: Figures
    grid: ConfidenceGrid  #: the map of the last fold
    held_out: HeldOut  #: the held-out features of the last fold


# (fold, index of the view, view) -> (mapped part, held-out part).
Split = Callable[[int, int, View], tuple[View | None, View | None]]
# (views, mapper settings, arguments of fit_ground) -> map.
MakeMap = Callable[[Iterable[View], dict[str, Any], dict[str, Any]], ConfidenceGrid]


def evaluate(
    views: Iterable[View],
    *,
    watch: Callable[[list[Any]], Iterable[Any]] = iter,
    ground: dict[str, Any] | None = None,
    camera_height: float | None = None,
    **settings: Any,
) -> dict[str, Verdict]:
    """Return figures of maps of a part of a log, judged by the held-out part.

    The protocol ``views`` holds out every fifth view, ``ids`` a fifth of the landmarks in all
    views. ``thin`` maps a fifth of the landmarks and holds out another fifth. The baseline
    ``stamping`` holds out views, and maps a disc at each feature. Each protocol holds out each
    fifth in turn and pools the five results, which then do not depend on the choice of the fifth.

    Parameters
    ----------
    views : iterable of View
        All views of a log; a ground plane is fitted to them anew.
    watch : callable, default iter
        Wraps the list of steps, to show progress.
    ground : dict, optional
        Fields of `groundmap.GroundSettings` for the maps; the heights of held-out features are
        determined with the defaults.
    camera_height : float, optional [m]
        Use level ground this far below the left camera, for maps and held-out features, instead of
        fitting planes.
    **settings
        Fields of `groundmap.MapperSettings`.

    Returns
    -------
    dict of str to Verdict
        By protocol: ``views``, ``ids``, ``thin`` and ``stamping``.

    Raises
    ------
    InputError
        There are fewer than five views, or points without a landmark id.
    """
    given = list(fit_ground(views, camera_height=camera_height))
    ground = {**(ground or {}), "camera_height": camera_height}
    _check_log(given)
    trajectory = np.array([view.T_map_base[:2, 3] for view in given])
    tallies = dict.fromkeys(PROTOCOLS, Tally())
    verdicts = {}
    for name, fold in watch([(name, fold) for name in PROTOCOLS for fold in range(FOLDS)]):
        split, make_map = PROTOCOLS[name]
        parts = [split(fold, number, view) for number, view in enumerate(given)]
        grid = make_map((view for view, _ in parts if view is not None), settings, ground)
        held_out = sort_by_height(view for _, view in parts if view is not None)
        tallies[name] = tallies[name].plus(judge(grid, held_out, trajectory))
        verdicts[name] = Verdict(tallies[name].figures(), grid, held_out)
    return verdicts


def _check_log(views: list[View]) -> None:
    if len(views) < FOLDS:
        raise InputError("views", f"at least {FOLDS} views", str(len(views)))
    without_ids = [number for number, view in enumerate(views) if (view.points.ids < 0).any()]
    if without_ids:
        raise InputError(
            "views",
            "a landmark id for every point",
            "points without one",
            where=f"view {without_ids[0]}",
            hint="Ids are needed to hold a landmark out of all views that observe it.",
        )


def _folds(view: View) -> Ints:
    """Return the fold of each landmark: a hash of its id, the same in every view."""
    scrambled = view.points.ids.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return ((scrambled >> np.uint64(32)) % np.uint64(FOLDS)).astype(np.int64)


def _split_views(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    return (None, view) if number % FOLDS == fold else (view, None)


def _split_landmarks(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    folds = _folds(view)
    return _select(view, folds != fold), _select(view, folds == fold)


def _split_thin(fold: int, number: int, view: View) -> tuple[View | None, View | None]:
    folds = _folds(view)
    return _select(view, folds == (fold + 1) % FOLDS), _select(view, folds == fold)


def _select(view: View, keep: Bools) -> View:
    return replace(view, points=view.points.select(keep))


def _map(views: Iterable[View], settings: dict[str, Any], ground: dict[str, Any]) -> ConfidenceGrid:
    """Return a map of views in 2-D, with ground planes fitted to these views alone."""
    mapper = GroundMapper(**settings)
    for view in fit_ground(views, **ground):
        mapper.integrate(view)
    return mapper.grid.collapse(low=mapper.settings.step_height, high=mapper.settings.robot_height)


def _stamp(
    views: Iterable[View], settings: dict[str, Any], _ground: dict[str, Any]
) -> ConfidenceGrid:
    """Return a map of discs, free at ground features and non-free at obstacles."""
    grid = GroundMapper(**{**settings, "mode": "2d"}).grid
    for view in views:
        features = sort_by_height([view])
        xy = np.concatenate([features.grounds, features.obstacles])
        if len(xy) == 0:
            continue
        reach = STAMP_RADIUS + grid.resolution
        window = grid.window(np.concatenate([xy.min(axis=0) - reach, xy.max(axis=0) + reach]))
        z = np.zeros(window.count.shape, dtype=np.float32)
        for points, value in ((features.grounds, -1.0), (features.obstacles, 1.0)):
            for cells, distance in cells_around(window, points, STAMP_RADIUS, to_centre=True):
                z[tuple(cells[distance <= STAMP_RADIUS].T)] = value
        lower = np.rint((window.origin - grid.origin) / grid.resolution).astype(np.int64)[::-1]
        grid.fuse(lower, z)
    return grid


PROTOCOLS: dict[str, tuple[Split, MakeMap]] = {
    "views": (_split_views, _map),
    "ids": (_split_landmarks, _map),
    "thin": (_split_thin, _map),
    "stamping": (_split_views, _stamp),
}
