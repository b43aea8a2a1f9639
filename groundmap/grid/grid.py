"""The confidence grid: tile-sparse, of any dimension, lossless."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import (
    Counts,
    Floats,
    Floats32,
    Ints,
    as_cell,
    as_cells,
    as_floats,
    check_finite,
    is_number,
)
from groundmap.errors import FileFormatError, InputError, MergeError
from groundmap.files.archive import read_archive, write_archive
from groundmap.grid.cell_set import CellSet
from groundmap.grid.extents import cells_of_box, check_size, check_whole
from groundmap.grid.fusion import Average, UpdateRule, rule_from
from groundmap.grid.height_layers import SIGHT_HEIGHTS, HeightLayers, as_heights
from groundmap.grid.old_versions import upgrade
from groundmap.grid.recent_views import RecentViews
from groundmap.grid.tiles import LAYERS, TILE_SHAPES, Index, Tile, Tiles
from groundmap.grid.window import CellState, GridWindow, cells_of
from groundmap.printable import format_value, is_plain

FORMAT, VERSION = "groundmap-grid", 2
SMALLEST, LARGEST, FARTHEST = 1e-9, 1e9, 1e100  # [m] cells and origin; areas are then numbers
MOST_CELLS = 2**28  # of a dense window: 2 GiB


class ConfidenceGrid:
    """Confidence and update count per cell, held in tiles that exist where something was seen.

    Parameters
    ----------
    resolution : float, default 0.1524
        Size of a cell [m]; 6 inches, as in the paper (section 3).
    origin : sequence of float, default (0, 0)
        Outer corner of cell (0, 0) [m, map]; its length is the grid's dimension (2 or 3).
    frame : str, default "map"
    rule : UpdateRule, optional
        How views add up; default: `groundmap.grid.fusion.Average`.
    heights : tuple of float, default (0.05, 0.15, 0.6) [m]
        Heights that evidence is kept apart by, see `groundmap.grid.height_layers.HeightLayers`.

    Raises
    ------
    InputError
        A resolution that is not above zero, an origin that is not finite or not 2-D or 3-D.

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
        if not isinstance(frame, str):
            raise InputError("frame", "a name", format_value(frame))
        if not is_plain(frame):
            raise InputError(
                "frame", "a name without NUL and unpaired surrogates", format_value(frame)
            )
        if not (is_number(resolution) and resolution > 0):
            raise InputError("resolution", "a number above 0 [m]", format_value(resolution))
        if not SMALLEST <= resolution <= LARGEST:
            raise InputError("resolution", f"{SMALLEST:g} to {LARGEST:g} m", str(resolution))
        self.origin = as_floats("origin", origin, (None,))
        if len(self.origin) not in TILE_SHAPES:
            raise InputError("origin", "2 or 3 numbers [m]", f"{len(self.origin)}")
        self.resolution = float(resolution)
        check_finite("origin", self.origin)
        if (np.abs(self.origin) > FARTHEST).any():
            raise InputError("origin", f"numbers up to {FARTHEST:g} m", str(self.origin.tolist()))
        self.frame, self.rule = frame, rule or Average()
        self._tiles = Tiles(len(origin))
        self._layers = HeightLayers(len(origin), heights)
        #: The newest views, see `recent`; not saved, copied or merged.
        self.recent_views = RecentViews()
        self._saved_recent: Ints = np.empty((0, len(origin)), dtype=np.int64)
        #: Base poses the map was seen from, shape (n, 3): x, y [m], yaw [rad], frame map.
        self.trajectory: Floats = np.empty((0, 3))

    @property
    def ndim(self) -> int:
        """Dimension of the grid, 2 or 3."""
        return len(self.origin)

    @property
    def tile_shape(self) -> tuple[int, ...]:
        """Cells of a tile along each axis."""
        return self._tiles.shape

    @property
    def nbytes(self) -> int:
        """Memory held by the tiles [bytes]."""
        return self._tiles.nbytes + self._layers.nbytes

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights that evidence is kept apart by [m]."""
        return self._layers.heights

    def tile(self, index: Index) -> Tile:
        """Return the tile of that index, allocated on first touch: evidence of any height."""
        if np.ndim(index) != 1:
            raise InputError("index", f"{self.ndim} whole numbers", repr(index)[:60])
        return self._tiles.touch(tuple(as_cell("index", index, self.ndim).tolist()))

    def tiles(self) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) in the order of the indices."""
        return self._tiles.items()

    def has_tile(self, index: Index) -> bool:
        """Whether the tile of that index was touched."""
        return self._tiles.get(index) is not None

    def layer_tiles(self, layer: int) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) of the evidence below one of `heights`, in their order."""
        return self._layers.tiles(layer)

    def confidence_at(self, xy: npt.ArrayLike) -> float | Floats32:
        """Return the confidence at map positions (x, y) [m]; 0 where nothing was seen."""
        cells = cells_of(xy, self.origin, self.resolution)
        values: Floats32 = self._tiles.values_at(cells, "confidence")
        self._layers.raise_at(values, cells)
        return float(values[0]) if np.ndim(xy) == 1 else values

    def count_at(self, xy: npt.ArrayLike) -> int | Counts:
        """Return the update count at map positions (x, y) [m]; 0 is unknown."""
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
        self._layers.raise_confidence(confidence, lower, upper)
        return confidence

    def cell_bounds(self) -> tuple[Ints, Ints]:
        """Return the first cell of the touched tiles and the cell past the last."""
        return self._tiles.cell_bounds()

    def bounds(self) -> Floats:
        """Return the box around the touched tiles: lower then upper corner [m, map]."""
        lower, upper = self.cell_bounds()
        corners = np.concatenate([lower[::-1], upper[::-1]]).astype(np.float64)
        return np.tile(self.origin, 2) + corners * self.resolution

    def check_extent(self, most_cells: int = MOST_CELLS) -> None:
        """Check that the box around all touched tiles holds no more than `most_cells` cells.

        Raises
        ------
        InputError
            It holds more; tiles that lie far from the rest are named, and bounds without them.
        """
        check_whole(self._tiles, most_cells, self.origin, self.resolution)

    def window(
        self, bounds: npt.ArrayLike | None = None, *, most_cells: int = MOST_CELLS
    ) -> GridWindow:
        """Return the cells of a box as dense arrays.

        Parameters
        ----------
        bounds : array_like, shape (2 d,), optional
            Lower then upper corner [m, map], such as (xmin, ymin, xmax, ymax); every cell that
            the box touches is in. Default: the box around all touched tiles.
        most_cells : int, default 2**28
            Cells that the box may hold; each takes 8 bytes.

        Raises
        ------
        InputError
            Bounds that are not finite, whose upper corner is not above the lower, or that hold
            more than `most_cells` cells. Where far tiles make the box around all tiles that
            large, they are named.
        """
        if bounds is None:
            self.check_extent(most_cells)
            lower, upper = self.cell_bounds()
        else:
            lower, upper = cells_of_box(bounds, self.origin, self.resolution)
            check_size(lower, upper, most_cells, self.resolution)
        dense = self._tiles.read(lower, upper)
        self._layers.raise_confidence(dense.confidence, lower, upper)
        return GridWindow(
            dense.confidence,
            dense.count,
            origin=self.origin + lower[::-1] * self.resolution,
            resolution=self.resolution,
        )

    def area(self, state: CellState) -> float:
        """Return the area in that state [m²] (volume [m³] in 3-D)."""
        # Tile by tile: a dense window would take the memory of the bounding box.
        cells = 0
        for index, tile in self.tiles():
            confidence = tile.confidence.copy()
            self._layers.raise_tile(confidence, index)
            window = GridWindow(confidence, tile.count, self.origin, self.resolution)
            cells += int((window.states() == state).sum())
        return cells * self.resolution**self.ndim

    def fuse(self, lower: Ints, z: Floats32, height: Floats32 | None = None) -> None:
        """Add what one view says (paper, section 5.2, equation 1, with the default rule).

        Parameters
        ----------
        lower : ndarray, shape (d,)
            Cell of the block's first entry, ``[row, col]``.
        z : ndarray of float32
            Evidence per cell in [-1, 1]; 0 says nothing and changes nothing.
        height : ndarray of float32, optional [m]
            Where z < 0 the height of the lowest line of sight over the cell, where z > 0 the top
            of what was seen in it (below 0 for a drop-off, infinite where it is not known). Free
            evidence never outvotes a top that all lines of sight passed above, if more than one
            view saw it. Without heights, evidence of any kind outvotes any other.

        Raises
        ------
        InputError
            Evidence that is NaN or beyond [-1, 1], or a cell too far off to count; heights that
            are NaN or of another shape.
        """
        lower = as_cell("lower", lower, self.ndim)
        z = self._as_evidence(z)
        if not (np.abs(z) <= 1.0).all():
            raise InputError("z", "evidence in [-1, 1]", "NaN or numbers beyond")
        if height is not None:
            height = as_heights(height, np.shape(z))
        for tile, block in self._tiles.cut(lower, z):
            self.rule.update(tile.confidence, tile.count, block)
        if height is not None:
            self._layers.fuse(lower, z, height, self.rule)

    def _as_evidence(self, z: npt.ArrayLike) -> npt.NDArray[Any]:
        expected = f"evidence in {self.ndim} dimensions"
        try:
            block = np.asarray(z)
        except ValueError as error:  # rows of several lengths
            raise InputError("z", expected, format_value(z)) from error
        if block.ndim != self.ndim or block.dtype.kind not in "biuf":
            raise InputError("z", expected, f"{block.dtype} of shape {block.shape}")
        return block

    def merge(self, other: ConfidenceGrid) -> ConfidenceGrid:
        """Return a new grid that holds what both saw, as if one mapper had seen all views.

        Raises
        ------
        MergeError
            Other resolution, origin or frame; another rule, or one without an associative merge.

        Examples
        --------
        >>> a, b = ConfidenceGrid(resolution=1.0), ConfidenceGrid(resolution=1.0)
        >>> a.fuse(np.array([0, 0]), np.array([[-1.0]], dtype=np.float32))
        >>> b.fuse(np.array([0, 0]), np.array([[0.5]], dtype=np.float32))
        >>> a.merge(b).confidence_at((0.5, 0.5))
        -0.25
        """
        self._check_merge(other)
        merged = self.copy()
        for index, theirs in other.tiles():
            ours = merged.tile(index)
            self.rule.merge(ours.confidence, ours.count, theirs.confidence, theirs.count)
        merged._layers.merge(other._layers, self.rule)
        merged.trajectory = np.concatenate([self.trajectory, other.trajectory])
        return merged

    def _check_merge(self, other: ConfidenceGrid) -> None:
        for name in ("resolution", "frame", "rule", "origin", "heights"):
            ours, theirs = getattr(self, name), getattr(other, name)
            if not np.array_equal(ours, theirs):
                raise MergeError(f"maps add up only with one {name}: expected {ours}, got {theirs}")
        if not self.rule.mergeable:
            raise MergeError(
                f"the rule {self.rule.name!r} depends on the order of the views, so its maps "
                "don't add up. Map with fusion='average', or integrate all views in one mapper."
            )

    def copy(self) -> ConfidenceGrid:
        """Return a grid of its own with the same content."""
        twin = ConfidenceGrid(
            resolution=self.resolution,
            origin=self.origin.tolist(),
            frame=self.frame,
            rule=self.rule,
            heights=self.heights,
        )
        twin._layers.copy_from(self._layers)
        for index, tile in self.tiles():
            mine = twin.tile(index)
            for layer in LAYERS:
                getattr(mine, layer)[...] = getattr(tile, layer)
        twin.trajectory = self.trajectory.copy()
        return twin

    def save(self, path: str | PathLike[str]) -> None:
        """Write the grid to one file, without loss; an older file is replaced only at the end.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        header = {
            "format": FORMAT,
            "version": VERSION,
            "resolution": self.resolution,
            "origin": self.origin.tolist(),
            "frame": self.frame,
            "rule": self.rule.to_dict(),
            "heights": self.heights,
        }
        arrays = {
            **self._tiles.to_arrays(),
            **self._layers.to_arrays(),
            "trajectory": self.trajectory,
            "recent": self.recent.cells,
        }
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ConfidenceGrid:
        """Read a grid that `save` wrote, in this version or an older one.

        Raises
        ------
        FileFormatError
            Not such a file, of a newer version, truncated or tampered with.
        """
        header, arrays = read_archive(path, FORMAT, VERSION)
        try:
            header, arrays = upgrade(header, arrays)
            grid = cls(
                resolution=header["resolution"],
                origin=header["origin"],
                frame=header["frame"],
                rule=rule_from(header["rule"]),
                heights=tuple(header["heights"]),
            )
            grid._tiles = Tiles.from_arrays(grid.ndim, arrays)
            grid._layers = HeightLayers.from_arrays(grid.ndim, grid.heights, arrays)
            grid.trajectory = as_floats("trajectory", arrays["trajectory"], (None, 3))
            check_finite("trajectory", grid.trajectory)
            grid._saved_recent = as_cells("recent", arrays["recent"], grid.ndim)
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(path, "a complete map file", f"{error}") from error
        return grid
