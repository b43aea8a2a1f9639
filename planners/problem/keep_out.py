"""Keep-out areas: polygons and cells that are not to be entered, whatever the map says."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from groundmap.arrays import as_cells
from groundmap.errors import InputError
from groundmap.grid.cell_set import CellSet
from groundmap.grid.grid import ConfidenceGrid
from planners.errors import ProblemError

EXPECTED = "polygons with an area (of shapely) or cells [row, col] of the map"
POLYGONS = {"Polygon", "MultiPolygon", "GeometryCollection"}
FARTHEST = 1e9  # [m], of a corner
SAME = 1e-6  # [cells] between the origins of two lattices that are one, up to rounding


@dataclass(frozen=True, eq=False)
class KeepOut:
    """Areas of the ground that no part of the footprint may enter.

    A planner blocks each cell that a polygon reaches into; the audit measures distances to the
    polygons themselves. On a 3-D map a polygon holds at every height.

    Parameters
    ----------
    areas : tuple of shapely.Polygon [m, map]
    cells : CellSet, optional
        Cells of the map.

    Examples
    --------
    >>> square = shapely.box(2, 2, 4, 5)
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> KeepOut.of([square, square.buffer(1)], grid).bounds
    (1.0, 1.0, 5.0, 6.0)
    >>> len(KeepOut.of([[3, 4], [3, 5]], grid).cells)
    2
    """

    areas: tuple[shapely.Polygon, ...]
    cells: CellSet

    @classmethod
    def of(cls, value: Any, grid: ConfidenceGrid) -> KeepOut:
        """Return the areas that a value stands for.

        Parameters
        ----------
        value : KeepOut, shapely geometry, iterable of shapely geometries, CellSet, array or None
            Polygons [m, map], or cells of the grid, shape (n, 2), on a 3-D map (n, 3).
        grid : ConfidenceGrid

        Raises
        ------
        ProblemError
            Neither polygons nor cells; an invalid polygon, or one that is not within 1e9 m of the
            origin; cells of another lattice.
        """
        none = as_cell_set("keep_out", None, grid)
        if value is None:
            return cls((), none)
        if isinstance(value, KeepOut):
            return cls(value.areas, as_cell_set("keep_out", value.cells, grid))
        if isinstance(value, shapely.Geometry):
            return cls(tuple(_polygons(value, 0)), none)
        if isinstance(value, CellSet | np.ndarray) or not _holds_geometries(value):
            return cls((), as_cell_set("keep_out", value, grid))
        return cls(tuple(p for i, part in enumerate(value) for p in _polygons(part, i)), none)

    def __bool__(self) -> bool:
        return bool(self.areas) or len(self.cells) > 0

    @property
    def bounds(self) -> tuple[float, ...]:
        """xmin, ymin, xmax, ymax of the polygons [m, map]; NaN without any."""
        return tuple(shapely.total_bounds(np.array(self.areas, dtype=object)).tolist())


def as_cell_set(name: str, value: Any, grid: ConfidenceGrid) -> CellSet:
    """Return cells of a grid, given as a set, an array or None.

    Parameters
    ----------
    name : str
        Name of the value, for the message.
    value : CellSet, array_like of int, shape (n, d), or None
    grid : ConfidenceGrid

    Raises
    ------
    ProblemError
        Not cells, or cells of a lattice with another resolution, origin or dimension.
    """
    if value is None:
        return CellSet(np.empty((0, grid.ndim), dtype=np.int64), grid.resolution, grid.origin)
    if not isinstance(value, CellSet):
        try:
            cells = as_cells(name, value, grid.ndim)
        except InputError as error:
            raise ProblemError(name, error.expected, error.got) from error
        return CellSet(np.unique(cells, axis=0), grid.resolution, grid.origin)
    ours, theirs = (grid.resolution, *grid.origin), (value.resolution, *value.origin)
    if len(ours) != len(theirs) or not np.allclose(
        ours, theirs, rtol=0.0, atol=SAME * grid.resolution
    ):
        raise ProblemError(
            name,
            f"cells of {grid.resolution:g} m from the origin {grid.origin.tolist()}",
            f"cells of {value.resolution:g} m from {np.asarray(value.origin).tolist()}",
            hint="Give cells of the problem's map, or of one with the same resolution and origin.",
        )
    return value


def _holds_geometries(value: Any) -> bool:
    """Whether a value is a collection with geometries in it, or empty."""
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise ProblemError("keep_out", EXPECTED, repr(value)[:60])
    return isinstance(value, list | tuple) and all(
        isinstance(part, shapely.Geometry) for part in value
    )


def _polygons(geometry: Any, index: int) -> list[shapely.Polygon]:
    """Return the polygons in a geometry, in two dimensions."""
    name = f"keep_out[{index}]"
    if not isinstance(geometry, shapely.Geometry) or geometry.geom_type not in POLYGONS:
        got = getattr(geometry, "geom_type", repr(geometry)[:60])
        hint = "Give a line or a point some width with its method buffer."
        raise ProblemError(name, "a polygon of shapely", got, hint=hint)
    if geometry.geom_type != "Polygon":
        return [p for part in shapely.get_parts(geometry) for p in _polygons(part, index)]
    corners = shapely.get_coordinates(geometry)
    if not (np.abs(corners) <= FARTHEST).all():
        raise ProblemError(name, f"a polygon within {FARTHEST:g} m of the origin", str(geometry))
    if not shapely.is_valid(geometry) or not shapely.area(geometry) > 0:
        got = "none" if shapely.is_valid(geometry) else str(shapely.is_valid_reason(geometry))
        raise ProblemError(name, "a valid polygon with an area", got)
    return [shapely.force_2d(geometry)]
