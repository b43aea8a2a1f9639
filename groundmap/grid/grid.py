"""The confidence grid: sparse, in 2 or 3 dimensions."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Counts, Floats, Floats32, Ints, as_cell
from groundmap.errors import InputError
from groundmap.grid.arguments import (
    as_evidence,
    as_origin,
    as_resolution,
    check_frame,
    check_merge,
)
from groundmap.grid.cell_set import CellSet
from groundmap.grid.collapse import as_band, as_planes, collapse_tiles
from groundmap.grid.extents import cells_of_box, check_size, check_whole
from groundmap.grid.fusion import Average, UpdateRule
from groundmap.grid.grid_files import GridContent, read_grid, write_grid
from groundmap.grid.height_layers import SIGHT_HEIGHTS, HeightLayers, as_heights
from groundmap.grid.recent_views import RecentViews
from groundmap.grid.shadow import with_shadow
from groundmap.grid.tiles import Index, Tile, Tiles
from groundmap.grid.window import CellBox, CellState, GridWindow, cells_of

MOST_CELLS = 2**28  # of a dense window: 2 GiB


class ConfidenceGrid:
    """Confidence and update count per cell, stored in tiles; only observed tiles are allocated.

    Parameters
    ----------
    resolution : float, default 0.1524
        Size of a cell [m]; 6 inches, as in the paper (section 3).
    origin : sequence of float, default (0, 0)
        Outer corner of cell (0, 0) [m, map]; its length is the grid's dimension (2 or 3).
    frame : str, default "map"
        Name of the coordinate frame.
    rule : UpdateRule, optional
        Rule that adds views; default: `groundmap.grid.fusion.Average`.
    heights : tuple of float, default (0.05, 0.15, 0.6) [m]
        Heights of the evidence layers, see `groundmap.grid.height_layers.HeightLayers`.

    Raises
    ------
    InputError
        The resolution is not above zero, or the origin is not finite or not 2-D or 3-D.

    Examples
    --------
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.tile((0, 0)).confidence[1, 2] = -0.75
    >>> grid.tile((0, 0)).count[1, 2] = 4
    >>> grid.confidence_at((1.2, 0.7)), grid.count_at((1.2, 0.7))
    (-0.75, 4)
    """

    def __init__(
        self,
        *,
        resolution: float = 0.1524,
        origin: Sequence[float] = (0.0, 0.0),
        frame: str = "map",
        rule: UpdateRule | None = None,
        heights: tuple[float, ...] = SIGHT_HEIGHTS,
    ) -> None:
        check_frame(frame)
        self.frame, self.rule = frame, rule or Average()
        self.resolution, self.origin = as_resolution(resolution), as_origin(origin)
        self._tiles = Tiles(len(origin))
        self._layers = HeightLayers(len(origin), heights)
        #: The newest views, see `recent`; not saved, copied or merged.
        self.recent_views = RecentViews()
        self._saved_recent: Ints = np.empty((0, len(origin)), dtype=np.int64)
        #: Base poses of the views, shape (n, 3): x, y [m], yaw [rad], in the map frame.
        self.trajectory: Floats = np.empty((0, 3))
        #: Ground under the views of a 3-D map, shape (k, 6): a place [m, map], and the unit normal
        #: of the ground there, which points up.
        self.planes: Floats = np.empty((0, 6))

    @property
    def ndim(self) -> int:
        """Dimension of the grid, 2 or 3."""
        return len(self.origin)

    @property
    def tile_shape(self) -> tuple[int, ...]:
        """Number of cells of a tile along each axis."""
        return self._tiles.shape

    @property
    def nbytes(self) -> int:
        """Memory of the tiles [bytes]."""
        return self._tiles.nbytes + self._layers.nbytes

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights of the evidence layers [m]."""
        return self._layers.heights

    def tile(self, index: Index) -> Tile:
        """Return a tile, with evidence of all heights; it is allocated if it does not exist."""
        if np.ndim(index) != 1:
            raise InputError("index", f"{self.ndim} whole numbers", repr(index)[:60])
        return self._tiles.touch(tuple(as_cell("index", index, self.ndim).tolist()))

    def tiles(self) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) in the order of the indices."""
        return self._tiles.items()

    def has_tile(self, index: Index) -> bool:
        """Whether the tile of an index exists."""
        return self._tiles.get(index) is not None

    def layer_tiles(self, layer: int) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) of a layer of `heights`, in the order of the indices."""
        return self._layers.tiles(layer)

    def confidence_at(self, xy: npt.ArrayLike) -> float | Floats32:
        """Return the confidence at map positions (x, y) [m]; 0 where unknown."""
        cells = cells_of(xy, self.origin, self.resolution)
        values: Floats32 = self._tiles.values_at(cells, "confidence")
        self._layers.raise_at(values, cells, self.rule)
        return float(values[0]) if np.ndim(xy) == 1 else values

    def count_at(self, xy: npt.ArrayLike) -> int | Counts:
        """Return the update count at map positions (x, y) [m]; 0 where unknown."""
        cells = cells_of(xy, self.origin, self.resolution)
        values: Counts = self._tiles.values_at(cells, "count")
        return int(values[0]) if np.ndim(xy) == 1 else values

    @property
    def recent(self) -> CellSet:
        """What is there now: the cells that the newest views saw as non-free.

        The average of many views remembers the empty road under a car that has just come. On a
        loaded map, what was there when it was saved. A merged map has none.
        """
        cells = self._saved_recent
        if self.recent_views.held:
            cells = self.recent_views.cells(self._confidence, self.resolution, self.origin)
        return CellSet(cells, self.resolution, self.origin)

    def _confidence(self, lower: Ints, upper: Ints) -> Floats32:
        """Return the confidence of the cells from `lower` up to `upper`."""
        confidence = self._tiles.read(lower, upper).confidence
        self._layers.raise_confidence(confidence, lower, upper, self.rule)
        return confidence

    def cell_bounds(self) -> tuple[Ints, Ints]:
        """Return the first cell of the observed tiles and the cell past the last."""
        return self._tiles.cell_bounds()

    def bounds(self) -> Floats:
        """Return the bounding box of the observed tiles: lower then upper corner [m, map]."""
        lower, upper = self.cell_bounds()
        corners = np.concatenate([lower[::-1], upper[::-1]]).astype(np.float64)
        return np.tile(self.origin, 2) + corners * self.resolution

    def check_extent(self, most_cells: int = MOST_CELLS) -> None:
        """Check that the bounding box of the observed tiles has at most `most_cells` cells.

        Raises
        ------
        InputError
            The box has more cells. The message names tiles that lie far from the others, and
            bounds that exclude them.
        """
        check_whole(self._tiles, most_cells, self.origin, self.resolution)

    def box(self, bounds: npt.ArrayLike | None = None, *, most_cells: int = MOST_CELLS) -> CellBox:
        """Return where the cells of a box lie.

        Parameters
        ----------
        bounds : array_like, shape (2 d,), optional
            Lower then upper corner [m, map], such as (xmin, ymin, xmax, ymax). The window
            contains every cell that the box overlaps. Default: the bounding box of the observed
            tiles.
        most_cells : int, default 2**28
            Largest number of cells in the box; each takes 8 bytes.

        Raises
        ------
        InputError
            The bounds are not finite, the upper corner is not above the lower, or the box has
            more than `most_cells` cells. If this is due to tiles far from the others, the message
            names them.
        """
        if bounds is None:
            self.check_extent(most_cells)
            lower, upper = self.cell_bounds()
        else:
            lower, upper = cells_of_box(bounds, self.origin, self.resolution)
            check_size(lower, upper, most_cells, self.resolution)
        corner = self.origin + lower[::-1] * self.resolution
        return CellBox(lower, upper, corner, self.resolution)

    def read(self, box: CellBox) -> GridWindow:
        """Return the cells of a box as dense arrays; each takes 8 bytes."""
        dense = self._tiles.read(box.lower, box.upper)
        self._layers.raise_confidence(dense.confidence, box.lower, box.upper, self.rule)
        return GridWindow(dense.confidence, dense.count, box.origin, self.resolution)

    def window(
        self, bounds: npt.ArrayLike | None = None, *, most_cells: int = MOST_CELLS
    ) -> GridWindow:
        """Return the cells of a box as dense arrays.

        Parameters
        ----------
        bounds : array_like, shape (2 d,), optional
            As for `box`.
        most_cells : int, default 2**28
            Cells that the box may hold; each takes 8 bytes.

        Raises
        ------
        InputError
            As for `box`.
        """
        return self.read(self.box(bounds, most_cells=most_cells))

    def area(self, state: CellState) -> float:
        """Return the area of all cells in a state [m²]; on 3-D maps the volume [m³]."""
        # Tile by tile, as a dense window may be much larger than the tiles.
        cells = 0
        for index, tile in self.tiles():
            confidence = tile.confidence.copy()
            self._layers.raise_tile(confidence, index, self.rule)
            window = GridWindow(confidence, tile.count, self.origin, self.resolution)
            cells += int((window.states() == state).sum())
        return cells * self.resolution**self.ndim

    def fuse(
        self,
        lower: Ints,
        z: Floats32,
        height: Floats32 | None = None,
        shadow: Bools | None = None,
    ) -> None:
        """Add the evidence of one view (default rule: paper, section 5.2, equation 1).

        Parameters
        ----------
        lower : ndarray, shape (d,)
            Cell of the block's first entry, ``[row, col]``.
        z : ndarray of float32
            Evidence per cell in [-1, 1]; cells with 0 do not change.
        height : ndarray of float32, optional [m]
            Where z < 0, the height of the lowest line of sight over the cell; where z > 0, the
            top of the object in the cell: below 0 for a drop-off, infinite if unknown. Free
            evidence of lines of sight above an object never cancels this object if more than one
            view observed it. Without heights, free and non-free evidence cancel each other.
        shadow : ndarray of bool, optional
            Cells from `groundmap.grid.shadow.behind_new_surfaces`. The rule `absolute` makes those
            without other evidence non-free; the other rules ignore them.

        Raises
        ------
        InputError
            Evidence is NaN or outside [-1, 1], a cell is out of range, heights are NaN or of
            another shape, or the shadow is.
        """
        lower = as_cell("lower", lower, self.ndim)
        z = as_evidence(z, self.ndim)
        if height is not None:
            height = as_heights(height, np.shape(z))
        if shadow is not None and self.rule.reads_shadow:
            z, height = with_shadow(z, height, shadow)
        self._fuse(lower, z, height)

    def rebuild(
        self, cells: Ints, evidence: Iterable[tuple[Ints, Floats32, Floats32 | None]]
    ) -> None:
        """Discard the tiles of some cells, and fuse the evidence of views there anew.

        Parameters
        ----------
        cells : ndarray, shape (n, d)
        evidence : iterable of (lower, z, height)
            Evidence of all views, as `fuse` takes it; other tiles do not change.
        """
        touched = self._tiles.indices_of(cells)
        for index in touched:
            self._tiles.drop(index)
            self._layers.drop(index)
        for lower, z, height in evidence:
            self._fuse(lower, z, height, touched)

    def _fuse(
        self,
        lower: Ints,
        z: Floats32,
        height: Floats32 | None,
        only: Container[Index] | None = None,
    ) -> None:
        for tile, block in self._tiles.cut(lower, z, only):
            self.rule.update(tile.confidence, tile.count, block)
        if height is not None:
            self._layers.fuse(lower, z, height, self.rule, only)

    def merge(self, other: ConfidenceGrid) -> ConfidenceGrid:
        """Return a new grid with the views of both, equal to a map of all views.

        Raises
        ------
        MergeError
            Resolution, origin, frame, heights or rule differ, or the rule depends on the order of
            the views.

        Examples
        --------
        >>> a, b = ConfidenceGrid(resolution=1.0), ConfidenceGrid(resolution=1.0)
        >>> a.fuse(np.array([0, 0]), np.array([[-1.0]], dtype=np.float32))
        >>> b.fuse(np.array([0, 0]), np.array([[0.5]], dtype=np.float32))
        >>> a.merge(b).confidence_at((0.5, 0.5))
        -0.25
        """
        check_merge(self._settings(), other._settings())
        merged = self.copy()
        for index, theirs in other.tiles():
            ours = merged.tile(index)
            self.rule.merge(ours.confidence, ours.count, theirs.confidence, theirs.count)
        merged._layers.merge(other._layers, self.rule)
        merged.trajectory = np.concatenate([self.trajectory, other.trajectory])
        merged.planes = np.concatenate([self.planes, other.planes])
        return merged

    def copy(self) -> ConfidenceGrid:
        """Return an independent copy of the grid."""
        twin = ConfidenceGrid(**self._settings())
        twin._tiles.copy_from(self._tiles)
        twin._layers.copy_from(self._layers)
        twin.trajectory, twin.planes = self.trajectory.copy(), self.planes.copy()
        return twin

    def collapse(
        self,
        *,
        low: float = 0.15,
        high: float = 2.0,
        free_below: float = 0.5,
        doubtful: float = 0.25,
    ) -> ConfidenceGrid:
        """Return the 2-D map of a band of heights above the local ground of a 3-D map.

        A cell is non-free if a voxel of its column in the band is. It is free only if a voxel low
        in the band is: free space above a box says nothing about what the robot drives into. A 2-D
        map is returned as a copy.

        Parameters
        ----------
        low, high : float, default 0.15, 2.0 [m]
            Band of heights above the ground in which the centres of voxels count: what is lower
            can be driven over, what is higher is passed below.
        free_below : float, default 0.5 [m]
            A cell is free if a voxel between `low` and this height is.

        doubtful : float, default 0.25
            A non-free voxel whose evidence adds up to no more than this does not block a column
            that is free below it. A column has many voxels, and what one view alone said of one
            from afar is refuted by none.

        Raises
        ------
        InputError
            Heights that do not ascend, a band without a voxel that was seen, or a map without
            ground planes.
        """
        band = as_band(low, high, free_below, doubtful)
        if self.ndim == 2:
            return self.copy()
        if len(self.planes) == 0:
            raise InputError(
                "map",
                "ground planes of its views",
                "none",
                hint="Map views with ground planes, as from groundmap.fit_ground, or set "
                "`grid.planes`.",
            )
        settings = self._settings() | {"origin": self.origin[:2], "heights": SIGHT_HEIGHTS}
        flat = ConfidenceGrid(**settings)
        planes = as_planes(self.planes)
        for lower, confidence, count in collapse_tiles(
            self._tiles, planes, self.origin, self.resolution, band
        ):
            flat._tiles.write(lower, confidence, count)
        flat.trajectory = self.trajectory.copy()
        return flat

    def save(self, path: str | PathLike[str]) -> None:
        """Write the grid to a file without loss; an existing file is replaced at the end.

        Raises
        ------
        OSError
            The folder does not exist or is not writable.
        """
        content = GridContent(
            self._settings(),
            self._tiles,
            self._layers,
            self.trajectory,
            self.recent.cells,
            self.planes,
        )
        write_grid(path, content)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ConfidenceGrid:
        """Read a grid that `save` wrote, in this version or an older one.

        Raises
        ------
        FileFormatError
            The file is not a map file, of a newer version, truncated or altered.
        """
        content = read_grid(path)
        grid = cls(**content.settings)
        grid._tiles, grid._layers = content.tiles, content.layers
        grid._saved_recent = content.recent
        grid.trajectory, grid.planes = content.trajectory, content.planes
        return grid

    def _settings(self) -> dict[str, Any]:
        """Return the arguments of the constructor."""
        return {
            "resolution": self.resolution,
            "origin": self.origin.copy(),
            "frame": self.frame,
            "rule": self.rule,
            "heights": self.heights,
        }
