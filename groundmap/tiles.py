"""Tiles: small dense arrays that exist where something was seen, in any direction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Counts, Floats32, Ints
from groundmap.errors import InputError

TILE_SHAPES = {2: (64, 64), 3: (16, 16, 16)}
LAYERS = {"confidence": np.float32, "count": np.uint32, "drop_offs": np.uint32}

Index = tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One tile's arrays, each of the tile shape; the fields are `LAYERS`."""

    confidence: Floats32
    count: Counts
    drop_offs: Counts  #: views that saw ground below the ground plane here


class Tiles:
    """Tiles by index, in a grid of 2 or 3 dimensions.

    Parameters
    ----------
    ndim : int

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
        """Memory held [bytes]."""
        cells = int(np.prod(self.shape))
        return len(self) * cells * sum(np.dtype(kind).itemsize for kind in LAYERS.values())

    def touch(self, index: Index) -> Tile:
        """Return the tile of that index, allocated if it was not there."""
        if index not in self._held:
            self._held[index] = Tile(
                **{name: np.zeros(self.shape, dtype=kind) for name, kind in LAYERS.items()}
            )
        return self._held[index]

    def get(self, index: Index) -> Tile | None:
        """Return the tile of that index, if there is one."""
        return self._held.get(index)

    def items(self) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) in the order of the indices."""
        for index in sorted(self._held):
            yield index, self._held[index]

    def cell_bounds(self) -> tuple[Ints, Ints]:
        """Return the first cell of the tiles and the cell past the last; zeros without tiles."""
        indices = np.array(list(self._held), dtype=np.int64).reshape(-1, len(self.shape))
        if len(indices) == 0:
            nowhere = np.zeros(len(self.shape), dtype=np.int64)
            return nowhere, nowhere
        return indices.min(axis=0) * self.shape, (indices.max(axis=0) + 1) * self.shape

    def cut(self, lower: Ints, block: Floats32) -> Iterator[tuple[Tile, Floats32]]:
        """Cut a block of cells along the tiles: yield each tile with its part, zeros around it.

        Parts that are all zero touch no tile.
        """
        upper = lower + block.shape
        first, last = lower // self.shape, (upper - 1) // self.shape
        for offset in np.ndindex(*(last - first + 1).tolist()):
            index = first + offset
            here, there = self._overlap(index, lower, upper)
            if block[there].any():
                part = np.zeros(self.shape, dtype=np.float32)
                part[here] = block[there]
                yield self.touch(tuple(index.tolist())), part

    def read(self, lower: Ints, upper: Ints) -> Tile:
        """Return the cells from `lower` up to `upper` as dense arrays; zeros without tiles."""
        shape = tuple((upper - lower).tolist())
        dense = Tile(**{name: np.zeros(shape, dtype=kind) for name, kind in LAYERS.items()})
        for index, tile in self._held.items():
            here, there = self._overlap(np.array(index), lower, upper)
            for name in LAYERS:
                getattr(dense, name)[there] = getattr(tile, name)[here]
        return dense

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return all tiles stacked, one array per layer, and their indices as ``tiles``."""
        indices = np.array([index for index, _ in self.items()], dtype=np.int64)
        arrays: dict[str, npt.NDArray[Any]] = {"tiles": indices.reshape(-1, len(self.shape))}
        for name, kind in LAYERS.items():
            layer = np.array([getattr(tile, name) for _, tile in self.items()], dtype=kind)
            arrays[name] = layer.reshape(-1, *self.shape)
        return arrays

    @classmethod
    def from_arrays(cls, ndim: int, arrays: Mapping[str, npt.NDArray[Any]]) -> Tiles:
        """Return the tiles that `to_arrays` stacked.

        Raises
        ------
        InputError
            Another type or shape, a tile that comes twice, confidence beyond [-1, 1].
        KeyError
            A layer is missing.
        """
        tiles = cls(ndim)
        indices = arrays["tiles"]
        _check_array("tiles", indices, np.int64, (len(indices), ndim))
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
        """Return where a tile and a box meet: slices of the tile, slices of the box."""
        corner = index * self.shape
        start = np.maximum(corner, lower)
        stop = np.maximum(start, np.minimum(corner + self.shape, upper))
        in_tile = tuple(map(slice, start - corner, stop - corner))
        in_box = tuple(map(slice, start - lower, stop - lower))
        return in_tile, in_box


def _check_array(
    name: str, array: npt.NDArray[Any], kind: npt.DTypeLike, shape: tuple[int, ...]
) -> None:
    if array.dtype != kind or array.shape != shape:
        got = f"{array.dtype} of shape {array.shape}"
        raise InputError(name, f"{np.dtype(kind)} of shape {shape}", got)
