"""The confidence grid: tile-sparse, of any dimension, lossless."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.archive import read_archive, write_archive
from groundmap.arrays import Counts, Floats, Floats32, Ints, as_floats, check_finite
from groundmap.errors import FileFormatError, InputError, MergeError
from groundmap.fusion import Average, UpdateRule, rule_from
from groundmap.window import CellState, GridWindow, cells_of

TILE_SHAPES = {2: (64, 64), 3: (16, 16, 16)}
FORMAT, VERSION = "groundmap-grid", 1


class Tile(NamedTuple):
    """One tile's arrays, each of the grid's tile shape."""

    confidence: Floats32
    count: Counts
    drop_offs: Counts  #: views that saw ground below the ground plane here


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
        How views add up, `groundmap.fusion.Average` unless told.

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
    ) -> None:
        if not (np.isfinite(resolution) and resolution > 0):
            raise InputError("resolution", "a number above 0 [m]", str(resolution))
        if len(origin) not in TILE_SHAPES:
            raise InputError("origin", "2 or 3 numbers [m]", f"{len(origin)}")
        self.resolution = float(resolution)
        self.origin = as_floats("origin", origin, (len(origin),))
        check_finite("origin", self.origin)
        self.frame, self.rule = frame, rule or Average()
        self.tile_shape = TILE_SHAPES[len(origin)]
        self._tiles: dict[tuple[int, ...], Tile] = {}
        #: Base poses the map was seen from, shape (n, 3): x, y [m], yaw [rad], frame map.
        self.trajectory: Floats = np.empty((0, 3))

    @property
    def ndim(self) -> int:
        """Dimension of the grid, 2 or 3."""
        return len(self.origin)

    @property
    def nbytes(self) -> int:
        """Memory held by the tiles [bytes]."""
        return sum(array.nbytes for tile in self._tiles.values() for array in tile)

    def tile(self, index: tuple[int, ...]) -> Tile:
        """Return the tile of that index, allocated on first touch."""
        if index not in self._tiles:
            self._tiles[index] = Tile(
                np.zeros(self.tile_shape, dtype=np.float32),
                np.zeros(self.tile_shape, dtype=np.uint32),
                np.zeros(self.tile_shape, dtype=np.uint32),
            )
        return self._tiles[index]

    def tiles(self) -> Iterator[tuple[tuple[int, ...], Tile]]:
        """Iterate over (index, tile) in the order of the indices."""
        for index in sorted(self._tiles):
            yield index, self._tiles[index]

    def confidence_at(self, xy: npt.ArrayLike) -> float | Floats32:
        """Return the confidence at map positions (x, y) [m]; 0 where nothing was seen."""
        return self._at(xy, 0)

    def count_at(self, xy: npt.ArrayLike) -> int | Counts:
        """Return the update count at map positions (x, y) [m]; 0 is unknown."""
        return self._at(xy, 1)

    def _at(self, xy: npt.ArrayLike, layer: int) -> npt.NDArray[np.generic]:
        cells = cells_of(xy, self.origin, self.resolution)
        shape = np.array(self.tile_shape)
        values = np.zeros(len(cells), dtype=(np.float32, np.uint32)[layer])
        for position, (index, inner) in enumerate(zip(cells // shape, cells % shape, strict=True)):
            tile = self._tiles.get(tuple(index.tolist()))
            if tile is not None:
                values[position] = tile[layer][tuple(inner)]
        return values[0].item() if np.ndim(xy) == 1 else values

    def cell_bounds(self) -> tuple[Ints, Ints]:
        """Return the first cell of the touched tiles and the cell past the last."""
        if not self._tiles:
            return np.zeros(self.ndim, dtype=np.int64), np.zeros(self.ndim, dtype=np.int64)
        indices = np.array(list(self._tiles), dtype=np.int64)
        shape = np.array(self.tile_shape)
        return indices.min(axis=0) * shape, (indices.max(axis=0) + 1) * shape

    def bounds(self) -> Floats:
        """Return the box around the touched tiles: lower then upper corner [m, map]."""
        lower, upper = self.cell_bounds()
        corners = np.concatenate([lower[::-1], upper[::-1]]).astype(np.float64)
        return np.tile(self.origin, 2) + corners * self.resolution

    def window(self, bounds: npt.ArrayLike | None = None) -> GridWindow:
        """Return the cells of a box as dense arrays.

        Parameters
        ----------
        bounds : array_like, shape (2 d,), optional
            Lower then upper corner [m, map], such as (xmin, ymin, xmax, ymax); every cell that
            the box touches is in. The box around all touched tiles unless told.

        Raises
        ------
        InputError
            Bounds that are not finite, or whose upper corner is not above the lower.
        """
        if bounds is None:
            lower, upper = self.cell_bounds()
        else:
            lower, upper = self._cells_of_box(bounds)
        window = self._empty_window(lower, upper)
        for index, tile in self._tiles.items():
            first = np.array(index) * self.tile_shape
            start = np.maximum(first, lower)
            stop = np.minimum(first + self.tile_shape, upper)
            if (start < stop).all():
                there = tuple(map(slice, start - lower, stop - lower))
                here = tuple(map(slice, start - first, stop - first))
                window.confidence[there] = tile.confidence[here]
                window.count[there] = tile.count[here]
                window.drop_offs[there] = tile.drop_offs[here]
        return window

    def _cells_of_box(self, bounds: npt.ArrayLike) -> tuple[Ints, Ints]:
        box = as_floats("bounds", bounds, (2 * self.ndim,))
        check_finite("bounds", box)
        if not (box[: self.ndim] < box[self.ndim :]).all():
            raise InputError("bounds", "an upper corner above the lower one", str(box.tolist()))
        scaled = (box.reshape(2, self.ndim) - self.origin) / self.resolution
        lower, upper = np.floor(scaled[0]), np.ceil(scaled[1])
        return lower[::-1].astype(np.int64), upper[::-1].astype(np.int64)

    def _empty_window(self, lower: Ints, upper: Ints) -> GridWindow:
        shape = tuple((upper - lower).tolist())
        return GridWindow(
            confidence=np.zeros(shape, dtype=np.float32),
            count=np.zeros(shape, dtype=np.uint32),
            drop_offs=np.zeros(shape, dtype=np.uint32),
            origin=self.origin + lower[::-1] * self.resolution,
            resolution=self.resolution,
        )

    def area(self, state: CellState) -> float:
        """Return the area in that state [m²] (volume [m³] in 3-D)."""
        cells = sum(
            int((GridWindow(*tile, self.origin, self.resolution).states() == state).sum())
            for tile in self._tiles.values()
        )
        return cells * self.resolution**self.ndim

    def fuse(self, lower: Ints, z: Floats32) -> None:
        """Add what one view says (paper, section 5.2, equation 1, with the default rule).

        Parameters
        ----------
        lower : ndarray, shape (d,)
            Cell of the block's first entry, ``[row, col]``.
        z : ndarray of float32
            Evidence per cell in [-1, 1]; 0 says nothing and changes nothing.
        """
        for tile, block in self._blocks(lower, z):
            self.rule.update(tile.confidence, tile.count, block)

    def add_drop_offs(self, cells: Ints) -> None:
        """Count one more view that saw ground below the ground plane in these cells."""
        for cell in np.unique(cells, axis=0):
            index, inner = divmod(cell, self.tile_shape)
            self.tile(tuple(index.tolist())).drop_offs[tuple(inner)] += 1

    def _blocks(self, lower: Ints, z: Floats32) -> Iterator[tuple[Tile, Floats32]]:
        """Cut a block along the tiles; pieces that say nothing touch no tile."""
        shape = np.array(self.tile_shape)
        upper = lower + z.shape
        first, last = lower // shape, (upper - 1) // shape
        for offset in np.ndindex(*(last - first + 1).tolist()):
            corner = (first + offset) * shape
            start, stop = np.maximum(corner, lower), np.minimum(corner + shape, upper)
            piece = z[tuple(map(slice, start - lower, stop - lower))]
            if piece.any():
                block = np.zeros(self.tile_shape, dtype=np.float32)
                block[tuple(map(slice, start - corner, stop - corner))] = piece
                yield self.tile(tuple((first + offset).tolist())), block

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
            ours.drop_offs[...] += theirs.drop_offs
        merged.trajectory = np.concatenate([self.trajectory, other.trajectory])
        return merged

    def _check_merge(self, other: ConfidenceGrid) -> None:
        for name in ("resolution", "frame", "rule"):
            ours, theirs = getattr(self, name), getattr(other, name)
            if ours != theirs:
                raise MergeError(f"maps add up only with one {name}: expected {ours}, got {theirs}")
        if not np.array_equal(self.origin, other.origin):
            raise MergeError(
                f"maps add up only with one origin: expected {self.origin.tolist()}, "
                f"got {other.origin.tolist()}"
            )
        if not self.rule.mergeable:
            raise MergeError(
                f"the rule {self.rule.name!r} depends on the order of the views, so its maps "
                "don't add up. Map with fusion='average', or integrate all views in one mapper."
            )

    def copy(self) -> ConfidenceGrid:
        """Return a grid of its own with the same content."""
        twin = self.like()
        twin._tiles = {i: Tile(*(a.copy() for a in tile)) for i, tile in self._tiles.items()}
        twin.trajectory = self.trajectory.copy()
        return twin

    def like(self) -> ConfidenceGrid:
        """Return an empty grid of the same resolution, origin, frame and rule."""
        return ConfidenceGrid(
            resolution=self.resolution,
            origin=self.origin.tolist(),
            frame=self.frame,
            rule=self.rule,
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the grid to one file, without loss; an older file is replaced only at the end.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        indices = np.array(sorted(self._tiles), dtype=np.int64).reshape(-1, self.ndim)
        tiles = [self._tiles[tuple(index)] for index in indices.tolist()]
        layers = {
            name: np.array([getattr(tile, name) for tile in tiles], dtype=kind).reshape(
                -1, *self.tile_shape
            )
            for name, kind in _LAYERS.items()
        }
        header = {
            "format": FORMAT,
            "version": VERSION,
            "resolution": self.resolution,
            "origin": self.origin.tolist(),
            "frame": self.frame,
            "rule": self.rule.to_dict(),
        }
        write_archive(path, header, {"tiles": indices, **layers, "trajectory": self.trajectory})

    @classmethod
    def load(cls, path: str | PathLike[str]) -> ConfidenceGrid:
        """Read a grid that `save` wrote.

        Raises
        ------
        FileFormatError
            Not such a file, of a newer version, truncated or tampered with.
        """
        header, arrays = read_archive(path, FORMAT, VERSION)
        try:
            grid = cls(
                resolution=header["resolution"],
                origin=header["origin"],
                frame=header["frame"],
                rule=rule_from(header["rule"]),
            )
            layers = [arrays[name].astype(kind, casting="equiv") for name, kind in _LAYERS.items()]
            for row, index in enumerate(arrays["tiles"].tolist()):
                tile = grid.tile(tuple(index))
                for mine, theirs in zip(tile, layers, strict=True):
                    mine[...] = theirs[row]
            grid.trajectory = as_floats("trajectory", arrays["trajectory"], (None, 3))
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise FileFormatError(path, "a complete map file", f"{error}") from error
        return grid


_LAYERS = {"confidence": np.float32, "count": np.uint32, "drop_offs": np.uint32}
