"""Measures of a map relative to the ground truth."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.ndimage import binary_dilation, distance_transform_edt
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats
from groundmap.evaluate.held_out import NEAR, cells_around, near_nonfree
from groundmap.grid.window import CellState, GridWindow
from groundmap.simulate.known_map import KnownMap
from groundmap.simulate.truth import HAIR

JUDGED_RANGE = 10.0  # [m], farther boundaries are not measured


@dataclass(frozen=True)
class Measures:
    """The agreement of a map with the truth; shares are 0 to 1, None for a share of an empty set.

    Maps are compared on observable cells: visible cells, and cells with a surface in sight. Only
    the ``false_free`` measures take all free cells of the map into account.
    """

    free_recall: float | None  #: share free on the map, of truly free visible cells
    free_precision: float | None  #: share truly free, of free cells
    nonfree_recall: float | None  #: share within 0.3 m of a non-free cell, of surfaces in sight
    nonfree_precision: float | None  #: share within 0.3 m of an obstacle, of non-free cells
    false_free: float | None  #: share in obstacles or behind them in every view, of free cells
    false_free_beyond_cell: float | None  #: of these, deeper than a cell
    false_free_beyond: float | None  #: of these, deeper than 0.3 m
    false_free_depth: float | None  #: largest distance from the nearest cell that may be free [m]
    boundary_mean: float | None  #: mean error of borders within 10 m of a view [m]
    boundary_p95: float | None  #: its 95th percentile [m]
    unknown: float | None  #: share unknown or contested, of truly free visible cells
    visible_m2: float | None = None  #: area truly free and visible [m²]; None in 3-D
    visible_m3: float | None = None  #: in 3-D its volume [m³]

    def to_dict(self) -> dict[str, float | None]:
        """Return the measures by name, with area or volume."""
        other = "visible_m3" if self.visible_m3 is None else "visible_m2"
        return {name: value for name, value in asdict(self).items() if name != other}


def measure(window: GridWindow, truth: KnownMap) -> Measures:
    """Return the measures of a map.

    Parameters
    ----------
    window : GridWindow
        The map, on the cells of the truth.
    truth : Truth, or VoxelTruth for a 3-D map
    """
    states = window.states()
    free, nonfree = states == CellState.FREE, states == CellState.NONFREE
    open_ground = truth.visible & ~truth.nonfree
    judged = truth.visible | _cells_holding(window, truth.surfaces)
    false = free & (truth.nonfree | ~truth.in_line)
    depths = _depths(window, truth)[false]
    centres = window.cell_to_world(np.argwhere(nonfree & judged))
    borders = _borders(window, nonfree, free, truth)
    return Measures(
        free_recall=_share((free & open_ground).sum(), open_ground.sum()),
        free_precision=_share((free & judged & ~truth.nonfree).sum(), (free & judged).sum()),
        nonfree_recall=_mean(near_nonfree(window, states, truth.surfaces)),
        nonfree_precision=_mean(truth.to_obstacles(centres) <= NEAR),
        false_free=_share(len(depths), free.sum()),
        false_free_beyond_cell=_share((depths > window.resolution).sum(), free.sum()),
        false_free_beyond=_share((depths > NEAR).sum(), free.sum()),
        false_free_depth=float(depths.max(initial=0.0)),
        boundary_mean=_mean(borders),
        boundary_p95=float(np.percentile(borders, 95.0)) if len(borders) else None,
        unknown=_share((~(free | nonfree) & open_ground).sum(), open_ground.sum()),
        **{f"visible_m{states.ndim}": float(open_ground.sum()) * window.resolution**states.ndim},
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


def _depths(window: GridWindow, truth: KnownMap) -> Floats:
    """Return the depth of each cell in space that must not be free, (rows, cols) [m].

    The distance from its centre to the border of the nearest cell that is truly free and in the
    line of sight of a view.
    """
    wrong = truth.nonfree | ~truth.in_line
    if wrong.all():  # the transform needs a target
        return np.full(wrong.shape, np.inf)
    centre_to_centre = distance_transform_edt(wrong, sampling=window.resolution)
    depths: Floats = np.maximum(centre_to_centre - 0.5 * window.resolution, 0.0)
    return depths


def _borders(window: GridWindow, nonfree: Bools, free: Bools, truth: KnownMap) -> Floats:
    """Return the distances of mapped borders between free and non-free to true surfaces [m].

    Measured from the centre of each non-free cell beside a free one, within 10 m of a viewpoint.
    """
    beside = nonfree & binary_dilation(free)
    centres = window.cell_to_world(np.argwhere(beside))
    if not len(centres):
        return np.empty(0)
    near, _ = cKDTree(truth.viewpoints).query(centres)
    in_view = truth.visible[beside]
    if len(truth.surfaces):
        in_view |= cKDTree(truth.surfaces).query(centres)[0] <= 1.0
    near[~in_view] = np.inf
    distances = truth.to_borders(centres[near <= JUDGED_RANGE])
    return distances[np.isfinite(distances)]
