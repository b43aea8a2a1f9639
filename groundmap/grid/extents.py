"""Boxes of cells: conversion from map coordinates, and checks of their size."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints, as_floats, check_finite
from groundmap.errors import InputError
from groundmap.grid.tiles import LAYERS, Tiles
from groundmap.grid.window import scaled_cells

CELL_BYTES = sum(np.dtype(kind).itemsize for kind in LAYERS.values())


def cells_of_box(bounds: npt.ArrayLike, origin: Floats, resolution: float) -> tuple[Ints, Ints]:
    """Return the range of cells that a box overlaps: the first cell and the cell past the last.

    Parameters
    ----------
    bounds : array_like, shape (2 d,) [m, map]
        Lower then upper corner.
    origin : ndarray, shape (d,) [m, map]
    resolution : float [m]

    Raises
    ------
    InputError
        The bounds are not finite, or the upper corner is not above the lower.
    """
    ndim = len(origin)
    box = as_floats("bounds", bounds, (2 * ndim,))
    check_finite("bounds", box)
    if not (box[:ndim] < box[ndim:]).all():
        raise InputError("bounds", "an upper corner above the lower one", str(box.tolist()))
    lower = scaled_cells(np.floor, box[None, :ndim], origin, resolution)[0]
    upper = scaled_cells(np.ceil, box[None, ndim:], origin, resolution)[0]
    return lower, upper


def check_size(lower: Ints, upper: Ints, most_cells: int, resolution: float) -> None:
    """Check the number of cells in a box before allocation.

    Parameters
    ----------
    lower, upper : ndarray of int, shape (d,)
        First cell of the box and the cell past its last.
    most_cells : int
    resolution : float [m]

    Raises
    ------
    InputError
        The box has more than `most_cells` cells.
    """
    if _count(lower, upper) > most_cells:
        raise InputError(
            "bounds",
            _expected(most_cells),
            _size(lower, upper, resolution),
            hint="Ask for a smaller box.",
        )


def check_whole(tiles: Tiles, most_cells: int, origin: Floats, resolution: float) -> None:
    """Check the number of cells in the box around the observed tiles before allocation.

    Parameters
    ----------
    tiles : Tiles
    most_cells : int
    origin : ndarray, shape (d,) [m, map]
    resolution : float [m]

    Raises
    ------
    InputError
        The box has more than `most_cells` cells. The message names tiles that lie far from the
        others, and bounds that exclude them.
    """
    lower, upper = tiles.cell_bounds()
    if _count(lower, upper) <= most_cells:
        return
    kept, away = tiles.main_part(most_cells)
    advice = "Give the bounds of a part (bounds=..., --bounds)"
    if len(away):
        main = _box(kept, tiles.shape, origin, resolution)
        far = np.array([_box(index[None], tiles.shape, origin, resolution) for index in away])
        apart = _apart(far, main)
        middle = 0.5 * (far[apart.argmax(), 0] + far[apart.argmax(), 1])
        place = ", ".join(f"{value:.0f}" for value in middle)
        one = len(away) == 1
        advice = (
            f"{len(away)} of {len(away) + len(kept)} tiles {'lies' if one else 'lie'} far from the "
            f"rest, {'the one' if one else 'the farthest'} at ({place}) m, {apart.max():.0f} m "
            f"away: is a pose wrong there? {advice}"
        )
        if _fits(kept, tiles.shape, most_cells):
            outwards = np.concatenate([np.floor(10 * main[0]), np.ceil(10 * main[1])]) / 10
            advice += ", without them " + ",".join(f"{value:.1f}" for value in outwards)
    size = _size(lower, upper, resolution)
    expected = f"{_expected(most_cells)} around the observed tiles"
    raise InputError("map", expected, size, hint=f"{advice}.")


def _count(lower: Ints, upper: Ints) -> int:
    return math.prod((upper - lower).tolist())  # Python's int does not overflow


def _expected(most_cells: int) -> str:
    return f"a box of {most_cells} cells at most"


def _size(lower: Ints, upper: Ints, resolution: float) -> str:
    sides = (upper - lower).tolist()[::-1]
    cells, metres = (" x ".join(f"{side * unit:.6g}" for side in sides) for unit in (1, resolution))
    return f"{cells} cells ({metres} m, {_count(lower, upper) * CELL_BYTES / 1e9:.3g} GB)"


def _fits(indices: Ints, shape: tuple[int, ...], most_cells: int) -> bool:
    sides = (np.ptp(indices, axis=0) + 1).tolist()
    return bool(math.prod(sides) * math.prod(shape) <= most_cells)


def _box(indices: Ints, shape: tuple[int, ...], origin: Floats, resolution: float) -> Floats:
    """Return the bounding box of tiles, lower and upper corner, shape (2, d) [m, map]."""
    corners = np.stack([indices.min(axis=0), indices.max(axis=0) + 1]) * shape
    box: Floats = origin + corners[:, ::-1] * resolution
    return box


def _apart(boxes: Floats, main: Floats) -> Floats:
    """Return the distances of boxes, shape (n, 2, d), from one box, shape (2, d) [m]."""
    gaps = np.maximum(np.maximum(boxes[:, 0] - main[1], main[0] - boxes[:, 1]), 0.0)
    apart: Floats = np.sqrt((gaps**2).sum(axis=1))
    return apart
