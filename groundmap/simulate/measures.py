"""Measures of a map against the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats
from groundmap.evaluate.held_out import NEAR, cells_around, near_nonfree
from groundmap.grid.window import CellState, GridWindow
from groundmap.simulate.truth import HAIR, Truth

JUDGED_RANGE = 10.0  # [m], boundaries farther from every viewpoint are not judged


@dataclass(frozen=True)
class Measures:
    """How a map compares with the truth; shares are 0 to 1, None is the share of nothing.

    What the map says is judged where it could know: on visible cells and on those that hold a
    surface in sight. Only `false_free` looks at all free cells of the map.
    """

    free_recall: float | None  #: of truly free visible cells: free on the map
    free_precision: float | None  #: of free cells: truly free
    nonfree_recall: float | None  #: of surfaces in sight: within 0.3 m of a non-free cell
    nonfree_precision: float | None  #: of non-free cells: within 0.3 m of an obstacle
    false_free: float | None  #: of all free cells: in an obstacle, or behind one in every view
    false_free_beyond_cell: float | None  #: those more than a cell from where free is right
    false_free_beyond: float | None  #: those more than 0.3 m from where free is right
    false_free_depth: float | None  #: the farthest of them from where free is right [m]
    boundary_mean: float | None  #: from mapped borders within 10 m of a view to the surface [m]
    boundary_p95: float | None  #: the same, 95 % [m]
    unknown: float | None  #: of truly free visible cells: unknown or contested
    visible_m2: float  #: truly free and visible


def measure(window: GridWindow, truth: Truth) -> Measures:
    """Return the measures of a map.

    Parameters
    ----------
    window : GridWindow
        The map, on the cells that the truth is about.
    truth : Truth
    """
    states = window.states()
    free, nonfree = states == CellState.FREE, states == CellState.NONFREE
    open_ground = truth.visible & ~truth.nonfree
    judged = truth.visible | _cells_holding(window, truth.surfaces)
    false = free & (truth.nonfree | ~truth.in_line)
    depths = _depths(window, truth)[false]
    borders = _borders(window, nonfree, free, truth)
    return Measures(
        free_recall=_share((free & open_ground).sum(), open_ground.sum()),
        free_precision=_share((free & judged & ~truth.nonfree).sum(), (free & judged).sum()),
        nonfree_recall=_mean(near_nonfree(window, states, truth.surfaces)),
        nonfree_precision=_mean(_to_obstacles(window, nonfree & judged, truth) <= NEAR),
        false_free=_share(len(depths), free.sum()),
        false_free_beyond_cell=_share((depths > window.resolution).sum(), free.sum()),
        false_free_beyond=_share((depths > NEAR).sum(), free.sum()),
        false_free_depth=float(depths.max(initial=0.0)),
        boundary_mean=_mean(borders),
        boundary_p95=float(np.percentile(borders, 95.0)) if len(borders) else None,
        unknown=_share((~(free | nonfree) & open_ground).sum(), open_ground.sum()),
        visible_m2=float(open_ground.sum()) * window.resolution**2,
    )


def _share(part: float, whole: float) -> float | None:
    return float(part) / float(whole) if whole else None


def _mean(values: Floats | Bools) -> float | None:
    return float(values.mean()) if len(values) else None


def _cells_holding(window: GridWindow, points: Floats) -> Bools:
    held = np.zeros(window.count.shape, dtype=np.bool_)
    for cells, distance in cells_around(window, points, 2.0 * HAIR):
        near = window.contains(cells) & (distance <= 2.0 * HAIR)
        held[tuple(cells[near].T)] = True
    return held


def _depths(window: GridWindow, truth: Truth) -> Floats:
    """Return how far each cell is from where free is right, (rows, cols) [m].

    From its centre to the border of the nearest cell that is truly free and in line of a view.
    """
    wrong = truth.nonfree | ~truth.in_line
    if wrong.all():  # the transform has nothing to measure to
        return np.full(wrong.shape, np.inf)
    centre_to_centre = distance_transform_edt(wrong, sampling=window.resolution)
    depths: Floats = np.maximum(centre_to_centre - 0.5 * window.resolution, 0.0)
    return depths


def _to_obstacles(window: GridWindow, cells: Bools, truth: Truth) -> Floats:
    """Return the distance from the centres of cells to the nearest obstacle [m]; 0 inside."""
    points = shapely.points(window.cell_to_world(np.argwhere(cells)))
    if truth.obstacles.is_empty:
        return np.full(len(points), np.inf)
    shapely.prepare(truth.obstacles)
    distances: Floats = shapely.distance(points, truth.obstacles)
    return distances


def _borders(window: GridWindow, nonfree: Bools, free: Bools, truth: Truth) -> Floats:
    """Return how far the mapped borders between free and non-free are off the true surface [m].

    For each non-free cell beside a free one, within 10 m of a viewpoint: from its centre.
    """
    beside = nonfree & binary_dilation(free)
    centres = window.cell_to_world(np.argwhere(beside))
    if not len(centres) or truth.obstacles.is_empty:
        return np.empty(0)
    near, _ = cKDTree(truth.viewpoints).query(centres)
    in_view = truth.visible[beside]
    if len(truth.surfaces):
        in_view |= cKDTree(truth.surfaces).query(centres)[0] <= 1.0
    near[~in_view] = np.inf
    outline = truth.obstacles.boundary
    shapely.prepare(outline)
    distances: Floats = shapely.distance(shapely.points(centres[near <= JUDGED_RANGE]), outline)
    return distances
