"""Sparse storage of cells: dense tiles, allocated on first use."""

from __future__ import annotations

import itertools
import math
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import FARTHEST_CELL, Bools, Counts, Floats32, Ints
from groundmap.errors import InputError
from groundmap.grid.kernels.fuse import parts_with_evidence

TILE_SHAPES = {2: (64, 64), 3: (16, 16, 16)}
LAYERS = {"confidence": np.float32, "count": np.uint32}

Index = tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """Arrays of a tile, each of the tile shape; the fields are `LAYERS`."""

    confidence: Floats32
    count: Counts


class Tiles:
    """Tiles by index, in a grid of 2 or 3 dimensions.

    Parameters
    ----------
    ndim : int
        2 or 3.

    Examples
    --------
    >>> tiles = Tiles(2)
    >>> tiles.touch((-1, 3)).count.shape
    (64, 64)
    >>> [bound.tolist() for bound in tiles.cell_bounds()]
    [[-64, 192], [0, 256]]
    """

    def __init__(self, ndim: int) -> None:
        self.shape = TILE_SHAPES[ndim]
        self._held: dict[Index, Tile] = {}

    def __len__(self) -> int:
        return len(self._held)

    @property
    def nbytes(self) -> int:
        """Memory of all tiles [bytes]."""
        cells = int(np.prod(self.shape))
        return len(self) * cells * sum(np.dtype(kind).itemsize for kind in LAYERS.values())

    def touch(self, index: Index) -> Tile:
        """Return the tile of an index; it is allocated if it does not exist."""
        if index not in self._held:
            self._held[index] = Tile(
                **{name: np.zeros(self.shape, dtype=kind) for name, kind in LAYERS.items()}
            )
        return self._held[index]

    def get(self, index: Index) -> Tile | None:
        """Return the tile of an index, or None if it does not exist."""
        return self._held.get(index)

    def items(self) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) in the order of the indices."""
        for index in sorted(self._held):
            yield index, self._held[index]

    def cell_bounds(self) -> tuple[Ints, Ints]:
        """Return the first cell of all tiles and the cell past the last; zeros without tiles."""
        indices = np.array(list(self._held), dtype=np.int64).reshape(-1, len(self.shape))
        if len(indices) == 0:
            nowhere = np.zeros(len(self.shape), dtype=np.int64)
            return nowhere, nowhere
        return indices.min(axis=0) * self.shape, (indices.max(axis=0) + 1) * self.shape

    def drop(self, index: Index) -> None:
        """Remove a tile, if it exists."""
        self._held.pop(index, None)

    def indices_of(self, cells: Ints) -> set[Index]:
        """Return the indices of the tiles of cells, shape (n, d)."""
        return {tuple(index) for index in np.unique(cells // self.shape, axis=0).tolist()}

    def cut(
        self, lower: Ints, block: Floats32, only: Container[Index] | None = None
    ) -> Iterator[tuple[Tile, Floats32]]:
        """Split a block of cells by tile: yield each tile and its part, padded with zeros.

        Parts without values other than zero are skipped, and their tiles are not allocated.

        Parameters
        ----------
        lower : ndarray of int, shape (d,)
            Cell of the block's first entry.
        block : ndarray of float32
        only : container of tuple of int, optional
            Indices of the tiles to yield; default: all.
        """
        if block.size == 0:
            return
        shape = np.array(self.shape)
        first, offset = lower // shape, lower % shape
        parts = -(-(offset + block.shape) // shape)
        some = np.zeros(parts, dtype=np.bool_)
        # Two dimensions are one layer of three.
        layers = (1,) * (3 - block.ndim)
        parts_with_evidence(
            block.reshape(layers + block.shape),
            np.concatenate([np.zeros(len(layers), dtype=np.int64), offset]),
            np.concatenate([np.ones(len(layers), dtype=np.int64), shape]),
            some.reshape(layers + some.shape),
        )
        corner = (first * shape - lower).tolist()
        for index in np.argwhere(some).tolist():
            start = [c + i * side for c, i, side in zip(corner, index, self.shape, strict=True)]
            number = tuple(f + i for f, i in zip(first.tolist(), index, strict=True))
            if only is not None and number not in only:
                continue
            there = tuple(
                slice(max(a, 0), a + side) for a, side in zip(start, self.shape, strict=True)
            )
            inside = block[there]
            part = np.zeros(self.shape, dtype=np.float32)
            part[
                tuple(
                    slice(max(-a, 0), max(-a, 0) + length)
                    for a, length in zip(start, inside.shape, strict=True)
                )
            ] = inside
            yield self.touch(number), part

    def write(self, lower: Ints, confidence: Floats32, count: Counts) -> None:
        """Write a block of cells that lies within one tile.

        Parameters
        ----------
        lower : ndarray, shape (d,)
            Cell of the block's first entry.
        confidence, count : ndarray
        """
        tile = self.touch(tuple((lower // self.shape).tolist()))
        here = tuple(map(slice, lower % self.shape, lower % self.shape + confidence.shape))
        tile.confidence[here], tile.count[here] = confidence, count

    def read(self, lower: Ints, upper: Ints) -> Tile:
        """Return the cells of a box as dense arrays; zeros where no tile exists.

        Parameters
        ----------
        lower, upper : ndarray of int, shape (d,)
            First cell of the box and the cell past its last.
        """
        shape = tuple((upper - lower).tolist())
        dense = Tile(**{name: np.zeros(shape, dtype=kind) for name, kind in LAYERS.items()})
        for index, tile in self._within(lower, upper):
            here, there = self._overlap(np.array(index), lower, upper)
            for name in LAYERS:
                getattr(dense, name)[there] = getattr(tile, name)[here]
        return dense

    def values_at(self, cells: Ints, layer: str) -> npt.NDArray[Any]:
        """Return the values of cells, shape (n,); 0 where no tile exists.

        Parameters
        ----------
        cells : ndarray of int, shape (n, d)
        layer : str
            A key of `LAYERS`.
        """
        values = np.zeros(len(cells), dtype=LAYERS[layer])
        for rows, index in self._by_tile(cells):
            tile = self.get(index)
            if tile is not None:
                inner = cells[rows] % self.shape
                values[rows] = getattr(tile, layer)[tuple(inner.T)]
        return values

    def _by_tile(self, cells: Ints) -> Iterator[tuple[Ints, Index]]:
        """Yield, for each tile, the rows of its cells and its index."""
        if len(cells) == 0:
            return
        indices = cells // self.shape
        order = np.lexsort(indices.T[::-1])
        changes = np.logical_or.reduce(np.diff(indices[order], axis=0) != 0, axis=1)
        for rows in np.split(order, np.flatnonzero(changes) + 1):
            yield rows, tuple(indices[rows[0]].tolist())

    def _within(self, lower: Ints, upper: Ints) -> Iterator[tuple[Index, Tile]]:
        """Yield the tiles that a box of cells overlaps; for small boxes without a search of all."""
        if (upper <= lower).any():
            return
        first, last = lower // self.shape, (upper - 1) // self.shape
        if math.prod((last - first + 1).tolist()) <= len(self):
            sides = (range(a, b + 1) for a, b in zip(first.tolist(), last.tolist(), strict=True))
            for index in itertools.product(*sides):
                tile = self._held.get(index)
                if tile is not None:
                    yield index, tile
            return
        low, high = tuple(first.tolist()), tuple(last.tolist())
        for index, tile in self._held.items():
            if all(a <= i <= b for a, i, b in zip(low, index, high, strict=True)):
                yield index, tile

    def main_part(self, most_cells: int) -> tuple[Ints, Ints]:
        """Return the indices of the main part of the tiles and of the others, (n, d) each.

        While the bounding box of the main part has more than `most_cells` cells, it is split at
        its widest gap along an axis, and the smaller part is removed. If there is no gap, the box
        stays too large.
        """
        kept = np.array(sorted(self._held), dtype=np.int64).reshape(-1, len(self.shape))
        away = [kept[:0]]
        while math.prod((np.ptp(kept, axis=0) + 1).tolist()) * math.prod(self.shape) > most_cells:
            lower = _beyond_widest_gap(kept)
            if lower is None:
                break
            fewer = lower if 2 * int(lower.sum()) < len(kept) else ~lower
            away.append(kept[fewer])
            kept = kept[~fewer]
        return kept, np.concatenate(away)

    def copy_from(self, other: Tiles) -> None:
        """Copy the values of all tiles of another grid."""
        for index, tile in other.items():
            mine = self.touch(index)
            mine.confidence[...], mine.count[...] = tile.confidence, tile.count

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return one array per layer with all tiles stacked, and their indices as ``tiles``."""
        indices = np.array([index for index, _ in self.items()], dtype=np.int64)
        arrays: dict[str, npt.NDArray[Any]] = {"tiles": indices.reshape(-1, len(self.shape))}
        for name, kind in LAYERS.items():
            layer = np.array([getattr(tile, name) for _, tile in self.items()], dtype=kind)
            arrays[name] = layer.reshape(-1, *self.shape)
        return arrays

    @classmethod
    def from_arrays(cls, ndim: int, arrays: Mapping[str, npt.NDArray[Any]]) -> Tiles:
        """Return the tiles of the arrays that `to_arrays` returned.

        Parameters
        ----------
        ndim : int
            Dimension of the grid.
        arrays : mapping of str to ndarray

        Raises
        ------
        InputError
            An array has another type or shape, an index is duplicated or out of range, or a
            confidence is outside [-1, 1].
        KeyError
            A layer is missing.
        """
        tiles = cls(ndim)
        indices = arrays["tiles"]
        _check_array("tiles", indices, np.int64, (len(indices), ndim))
        farthest = FARTHEST_CELL // max(tiles.shape)
        if ((indices > farthest) | (indices < -farthest)).any():
            raise InputError("tiles", f"indices within {farthest}", "one beyond")
        if len(np.unique(indices, axis=0)) != len(indices):
            raise InputError("tiles", "each tile once", "one that comes twice")
        for name, kind in LAYERS.items():
            _check_array(name, arrays[name], kind, (len(indices), *tiles.shape))
            for row, index in enumerate(indices.tolist()):
                getattr(tiles.touch(tuple(index)), name)[...] = arrays[name][row]
        if not (np.abs(arrays["confidence"]) <= 1.0).all():
            raise InputError("confidence", "numbers in [-1, 1]", "NaN or numbers beyond")
        return tiles

    def _overlap(
        self, index: Ints, lower: Ints, upper: Ints
    ) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Return the intersection of a tile and a box: slices of the tile, slices of the box."""
        corner = index * self.shape
        start = np.maximum(corner, lower)
        stop = np.maximum(start, np.minimum(corner + self.shape, upper))
        in_tile = tuple(map(slice, start - corner, stop - corner))
        in_box = tuple(map(slice, start - lower, stop - lower))
        return in_tile, in_box


def _beyond_widest_gap(indices: Ints) -> Bools | None:
    """Return which indices lie below the widest gap along an axis; None if there is no gap."""
    widest, below = 1, None
    for along in indices.T:
        places = np.unique(along)
        gaps = np.diff(places)
        if len(gaps) and gaps.max() > widest:
            widest, below = int(gaps.max()), along <= places[gaps.argmax()]
    return below


def _check_array(
    name: str, array: npt.NDArray[Any], kind: npt.DTypeLike, shape: tuple[int, ...]
) -> None:
    if array.dtype != kind or array.shape != shape:
        got = f"{array.dtype} of shape {array.shape}"
        raise InputError(name, f"{np.dtype(kind)} of shape {shape}", got)
