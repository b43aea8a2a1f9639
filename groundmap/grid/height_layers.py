"""Evidence by height.

A line of sight is evidence against obstacles that would block it, not against lower ones. Each
layer has a height. It holds free evidence of lines of sight below this height, and non-free
evidence of objects lower than the next layer's height. A line of sight that passes above an object
is thus never in the layer of that object.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Counts, Floats32, Ints, as_floats
from groundmap.errors import InputError
from groundmap.grid.fusion import UpdateRule
from groundmap.grid.kernels.fuse import keep_low
from groundmap.grid.tiles import LAYERS, Index, Tile, Tiles

SIGHT_HEIGHTS = (0.05, 0.15, 0.6)  # [m]
NO_TOP = float("inf")  # [m], height of non-free evidence with an unobserved top


class HeightLayers:
    """Confidence and update count per cell and height layer, in tiles.

    Parameters
    ----------
    ndim : int
        Dimension of the grid.
    heights : tuple of float [m]
        Ascending heights of the layers. A layer holds free evidence of lines of sight below its
        height, and non-free evidence of objects whose top is below the next layer's height; the
        last layer holds non-free evidence of any height.

    Raises
    ------
    InputError
        The heights are not above 0 and ascending.
    """

    def __init__(self, ndim: int, heights: tuple[float, ...] = SIGHT_HEIGHTS) -> None:
        self.heights = tuple(as_floats("heights", heights, (None,)).tolist())
        steps = np.diff(np.array([0.0, *self.heights]))
        if not (np.isfinite(steps).all() and (steps > 0).all()):
            raise InputError("heights", "ascending numbers above 0 [m]", str(heights)[:60])
        self._layers = tuple(Tiles(ndim) for _ in heights)

    @property
    def nbytes(self) -> int:
        """Memory of the tiles [bytes]."""
        return sum(tiles.nbytes for tiles in self._layers)

    def drop(self, index: Index) -> None:
        """Remove a tile of all layers."""
        for tiles in self._layers:
            tiles.drop(index)

    def fuse(
        self,
        lower: Ints,
        z: Floats32,
        height: Floats32,
        rule: UpdateRule,
        only: Container[Index] | None = None,
    ) -> None:
        """Add the evidence of one view.

        Parameters
        ----------
        lower : ndarray of int, shape (d,)
            Cell of the block's first entry, ``[row, col]``.
        z : ndarray of float32
            Evidence per cell in [-1, 1].
        height : ndarray of float32, of z's shape [m]
            Height of the lowest line of sight over the cell where z < 0; top of the object in the
            cell where z > 0: below 0 for a drop-off, `NO_TOP` if no top was observed.
        rule : UpdateRule
        only : container of tuple of int, optional
            Indices of the tiles to change; default: all.
        """
        tops = (*self.heights[1:], NO_TOP)
        for tiles, sight, top in zip(self._layers, self.heights, tops, strict=True):
            low = np.zeros_like(z)
            keep_low(z.reshape(-1), height.reshape(-1), sight, top, low.reshape(-1))
            for tile, block in tiles.cut(lower, low, only):
                rule.update(tile.confidence, tile.count, block)

    def raise_confidence(
        self, confidence: Floats32, lower: Ints, upper: Ints, rule: UpdateRule
    ) -> None:
        """Raise the confidence of a box of cells to the highest of all layers, in place.

        A layer counts only where its evidence exceeds that of one view.

        Parameters
        ----------
        confidence : ndarray of float32
            Confidence of the cells of the box, raised in place.
        lower, upper : ndarray of int, shape (d,)
            First cell of the box and the cell past its last.
        rule : UpdateRule
        """
        for tiles in self._layers:
            dense = tiles.read(lower, upper)
            _raise(confidence, dense.confidence, dense.count, rule)

    def raise_tile(self, confidence: Floats32, index: Index, rule: UpdateRule) -> None:
        """Raise the confidence of the cells of a tile in place, as `raise_confidence`.

        Parameters
        ----------
        confidence : ndarray of float32, of the tile shape
        index : tuple of int
        rule : UpdateRule
        """
        for tiles in self._layers:
            tile = tiles.get(index)
            if tile is not None:
                _raise(confidence, tile.confidence, tile.count, rule)

    def raise_at(self, confidence: Floats32, cells: Ints, rule: UpdateRule) -> None:
        """Raise the confidence of single cells in place, as `raise_confidence`.

        Parameters
        ----------
        confidence : ndarray of float32, shape (n,)
        cells : ndarray of int, shape (n, d)
        rule : UpdateRule
        """
        for tiles in self._layers:
            low, count = tiles.values_at(cells, "confidence"), tiles.values_at(cells, "count")
            _raise(confidence, low, count, rule)

    def merge(self, other: HeightLayers, rule: UpdateRule) -> None:
        """Add the layers of another map in place.

        Parameters
        ----------
        other : HeightLayers
            Layers of the same heights.
        rule : UpdateRule
        """
        for ours, theirs in zip(self._layers, other._layers, strict=True):
            for index, tile in theirs.items():
                mine = ours.touch(index)
                rule.merge(mine.confidence, mine.count, tile.confidence, tile.count)

    def copy_from(self, other: HeightLayers) -> None:
        """Copy the content of layers of the same heights."""
        for ours, theirs in zip(self._layers, other._layers, strict=True):
            ours.copy_from(theirs)

    def tiles(self, layer: int) -> Iterator[tuple[Index, Tile]]:
        """Iterate over (index, tile) of a layer, 0 for the lowest, in the order of the indices."""
        return self._layers[layer].items()

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the arrays of `Tiles.to_arrays` of all layers, the layer appended to the name."""
        return {
            f"{name}_{number}": array
            for number, tiles in enumerate(self._layers)
            for name, array in tiles.to_arrays().items()
        }

    @classmethod
    def from_arrays(
        cls, ndim: int, heights: tuple[float, ...], arrays: Mapping[str, npt.NDArray[Any]]
    ) -> HeightLayers:
        """Return the layers of the arrays that `to_arrays` returned.

        Parameters
        ----------
        ndim : int
            Dimension of the grid.
        heights : tuple of float [m]
        arrays : mapping of str to ndarray

        Raises
        ------
        InputError
            Heights or arrays are invalid.
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
    """Return the heights of evidence as an array without NaN.

    Parameters
    ----------
    height : array_like [m]
    shape : tuple of int
        Expected shape.

    Raises
    ------
    InputError
        The array has another shape, is not numeric or contains NaN.
    """
    try:
        array = np.asarray(height)
    except ValueError as error:  # rows of different lengths
        got = repr(height)[:60]
        raise InputError("height", f"heights of shape {shape} [m]", got) from error
    if array.shape != shape or array.dtype.kind not in "iuf" or np.isnan(array).any():
        got = f"{array.dtype} of shape {array.shape}" + (
            " with NaN" if array.dtype.kind == "f" and np.isnan(array).any() else ""
        )
        raise InputError("height", f"heights of shape {shape} [m]", got)
    return np.ascontiguousarray(array, dtype=np.float32)


def _raise(confidence: Floats32, low: Floats32, count: Counts, rule: UpdateRule) -> None:
    """Raise confidence in place where a layer's evidence exceeds that of one view."""
    np.maximum(confidence, low, out=confidence, where=rule.outweighs_one_view(low, count))
