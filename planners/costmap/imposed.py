"""Cells that are not to be entered whatever the map says: keep-out areas, and what is there now."""

from __future__ import annotations

import numpy as np
import shapely

from groundmap.arrays import Bools, Floats, Ints
from groundmap.grid.cell_set import CellSet
from groundmap.grid.window import CellFrame
from planners.geometry.polyline import cross_cells
from planners.problem.problem import PlanningProblem

TOUCH = 1e-9  # [cells]: a polygon that reaches no deeper into a cell only touches it


def imposed_cells(problem: PlanningProblem, window: CellFrame) -> Bools | None:
    """Return which cells of a window are not to be entered, or None if there are no such areas.

    Parameters
    ----------
    problem : PlanningProblem
    window : CellFrame
        In any dimension.
    """
    masks = [mask(problem, window) for mask in (keep_out_cells, recent_cells)]
    given = [mask for mask in masks if mask is not None]
    return np.logical_or.reduce(given) if given else None


def recent_cells(problem: PlanningProblem, window: CellFrame) -> Bools | None:
    """Return which cells of a window the newest views saw as non-free, or None without any.

    Parameters
    ----------
    problem : PlanningProblem
    window : CellFrame
    """
    return _mask_of(problem.recent_set, window) if len(problem.recent_set) else None


def keep_out_cells(problem: PlanningProblem, window: CellFrame) -> Bools | None:
    """Return which cells of a window a keep-out area reaches into, or None without any.

    Parameters
    ----------
    problem : PlanningProblem
    window : CellFrame
    """
    areas = problem.keep_out_areas
    if not areas:
        return None
    mask = _mask_of(areas.cells, window)
    for area in areas.areas:
        corners = (shapely.get_coordinates(area) - window.origin[:2]) / window.resolution
        size = mask.shape[:-3:-1]
        first = np.clip(np.floor(corners.min(axis=0)), 0, size).astype(np.int64)
        last = np.clip(np.ceil(corners.max(axis=0)), 0, size).astype(np.int64)
        if (first < last).all():
            # On a 3-D map, in all layers.
            part = mask[..., first[1] : last[1], first[0] : last[0]]
            polygon = shapely.set_coordinates(shapely.Polygon(area), corners - first)
            part |= _reached(polygon, part.shape[-2:])
    return mask


def _mask_of(cells: CellSet, window: CellFrame) -> Bools:
    first = np.rint((window.origin - cells.origin) / window.resolution).astype(np.int64)[::-1]
    return cells.mask(first, window.shape)


def _reached(polygon: shapely.Polygon, shape: tuple[int, int]) -> Bools:
    """Return which cells a polygon reaches into [cells, x along columns]."""
    rings = [polygon.exterior, *polygon.interiors]
    reached = _centres_inside([shapely.get_coordinates(ring) for ring in rings], shape)
    rows, cols = shape
    border = shapely.clip_by_rect(polygon.boundary, -1.0, -1.0, cols + 1.0, rows + 1.0)
    lines = [
        shapely.get_coordinates(line)
        for line in shapely.get_parts(border)
        if line.geom_type == "LineString"
    ]
    if not lines:
        return reached
    cells = np.unique(np.concatenate([cross_cells(line).cells for line in lines]), axis=0)
    inside = np.logical_and.reduce((cells >= 0) & (cells < shape), axis=1)
    cells = cells[inside]
    cells = cells[~reached[tuple(cells.T)]]
    squares = shapely.box(
        cells[:, 1] + TOUCH, cells[:, 0] + TOUCH, cells[:, 1] + 1 - TOUCH, cells[:, 0] + 1 - TOUCH
    )
    shapely.prepare(polygon)
    cells = cells[shapely.intersects(polygon, squares)]
    reached[tuple(cells.T)] = True
    return reached


def _centres_inside(rings: list[Floats], shape: tuple[int, int]) -> Bools:
    """Return which cells' centres are inside the rings, by the parity of the crossings."""
    rows, cols = shape
    odd = np.zeros((rows, cols + 1), dtype=np.int64)
    for ring in rings:
        p, q = ring[:-1], ring[1:]
        upward = p[:, 1] <= q[:, 1]
        low, high = np.where(upward[:, None], p, q), np.where(upward[:, None], q, p)
        first, last = (_first_centre(end[:, 1], rows) for end in (low, high))
        count = last - first
        edge = np.repeat(np.arange(len(count)), count)
        row = first[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
        rise = high[edge, 1] - low[edge, 1]
        share = (row + 0.5 - low[edge, 1]) / rise
        x = low[edge, 0] + share * (high[edge, 0] - low[edge, 0])
        np.add.at(odd, (row, _first_centre(x, cols)), 1)
    inside: Bools = np.cumsum(odd, axis=1)[:, :cols] % 2 == 1
    return inside


def _first_centre(coordinates: Floats, count: int) -> Ints:
    """Return the first cell whose centre is at or after each coordinate, from 0 to `count`."""
    return np.clip(np.ceil(coordinates - 0.5), 0, count).astype(np.int64)
