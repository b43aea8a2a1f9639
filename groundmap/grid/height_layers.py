"""Evidence by height: what a line of sight can refute, and what it passes over.

A line of sight says something only about what would have stood in its way. Each layer has a height,
and holds the evidence of things lower than the next layer's height against sight lower than its
own: sight that passes above a thing never gets into the layer that the thing is in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Counts, Floats32, Ints, as_floats
from groundmap.errors import InputError
from groundmap.grid.fusion import UpdateRule
from groundmap.grid.kernels.fuse import keep_low
from groundmap.grid.tiles import LAYERS, Index, Tile, Tiles

ONE_VIEW = 1.05  # sum of evidence: what a single view saw may be a false match
SIGHT_HEIGHTS = (0.05, 0.15, 0.6)  # [m]
NO_TOP = float("inf")  # [m], height of non-free evidence whose top was not seen


class HeightLayers:
    """Confidence and count per cell and height, in tiles that exist where heights are known.

    Parameters
    ----------
    ndim : int
        Dimension of the grid.
    heights : tuple of float [m]
        Ascending. Free evidence is in a layer if sight passed below the layer's height, non-free
        evidence if the top of what was seen is below the next layer's height; the last layer
        holds all tops.

    Raises
    ------
    InputError
        Heights that are not above 0 and ascending.
    """

    def __init__(self, ndim: int, heights: tuple[float, ...] = SIGHT_HEIGHTS) -> None:
        self.heights = tuple(as_floats("heights", heights, (None,)).tolist())
        steps = np.diff(np.array([0.0, *self.heights]))
        if not (np.isfinite(steps).all() and (steps > 0).all()):
            raise InputError("heights", "ascending numbers above 0 [m]", str(heights)[:60])
        self._layers = tuple(Tiles(ndim) for _ in heights)

    @property
    def nbytes(self) -> int:
        """Memory held by the tiles [bytes]."""
        return sum(tiles.nbytes for tiles in self._layers)

    def fuse(self, lower: Ints, z: Floats32, height: Floats32, rule: UpdateRule) -> None:
        """Add what one view says, with the height of each cell's evidence [m].

        The height of free evidence is that of the lowest line of sight over the cell, that of
        non-free evidence the top of what was seen there, below 0 for a drop-off, `NO_TOP` where
        no top was seen.
        """
        tops = (*self.heights[1:], NO_TOP)
        for tiles, sight, top in zip(self._layers, self.heights, tops, strict=True):
            low = np.zeros_like(z)
            keep_low(z.reshape(-1), height.reshape(-1), sight, top, low.reshape(-1))
            for tile, block in tiles.cut(lower, low):
                rule.update(tile.confidence, tile.count, block)

    def raise_confidence(self, confidence: Floats32, lower: Ints, upper: Ints) -> None:
        """Raise the confidence of a box of cells to that of the surest layer, in place.

        A layer says something only where its evidence adds up to more than one view's.
        """
        for tiles in self._layers:
            dense = tiles.read(lower, upper)
            _raise(confidence, dense.confidence, dense.count)

    def raise_tile(self, confidence: Floats32, index: Index) -> None:
        """Do the same for the cells of one tile."""
        for tiles in self._layers:
            tile = tiles.get(index)
            if tile is not None:
                _raise(confidence, tile.confidence, tile.count)

    def raise_at(self, confidence: Floats32, cells: Ints) -> None:
        """Do the same for single cells, shape (n, d)."""
        for tiles in self._layers:
            low, count = tiles.values_at(cells, "confidence"), tiles.values_at(cells, "count")
            _raise(confidence, low, count)

    def merge(self, other: HeightLayers, rule: UpdateRule) -> None:
        """Add another map's layers in place."""
        for ours, theirs in zip(self._layers, other._layers, strict=True):
            for index, tile in theirs.items():
                mine = ours.touch(index)
                rule.merge(mine.confidence, mine.count, tile.confidence, tile.count)

    def copy_from(self, other: HeightLayers) -> None:
        """Take over the content of layers of the same heights."""
        for ours, theirs in zip(self._layers, other._layers, strict=True):
            for index, tile in theirs.items():
                mine = ours.touch(index)
                mine.confidence[...], mine.count[...] = tile.confidence, tile.count

    def tiles(self, layer: int) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) of one layer, counted from the lowest, by index."""
        return self._layers[layer].items()

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return all tiles stacked, as `Tiles.to_arrays`, each name with the layer's number."""
        return {
            f"{name}_{number}": array
            for number, tiles in enumerate(self._layers)
            for name, array in tiles.to_arrays().items()
        }

    @classmethod
    def from_arrays(
        cls, ndim: int, heights: tuple[float, ...], arrays: Mapping[str, npt.NDArray[Any]]
    ) -> HeightLayers:
        """Return the layers that `to_arrays` stacked.

        Raises
        ------
        InputError
            Heights or arrays that are none.
        KeyError
            A layer is missing.
        """
        layers = cls(ndim, heights)
        layers._layers = tuple(
            Tiles.from_arrays(
                ndim, {name: arrays[f"{name}_{number}"] for name in ("tiles", *LAYERS)}
            )
            for number in range(len(heights))
        )
        return layers


def as_heights(height: npt.ArrayLike, shape: tuple[int, ...]) -> Floats32:
    """Return heights of evidence as an array, none of them NaN.

    Raises
    ------
    InputError
        No numbers, NaN, or another shape.
    """
    array = np.asarray(height)
    if array.shape != shape or array.dtype.kind not in "iuf" or np.isnan(array).any():
        got = f"{array.dtype} of shape {array.shape}" + (
            " with NaN" if array.dtype.kind == "f" and np.isnan(array).any() else ""
        )
        raise InputError("height", f"heights of shape {shape} [m]", got)
    return np.ascontiguousarray(array, dtype=np.float32)


def _raise(confidence: Floats32, low: Floats32, count: Counts) -> None:
    """Raise confidence, in place, where a layer's evidence is that of more than one view."""
    np.maximum(confidence, low, out=confidence, where=low * count > ONE_VIEW)
