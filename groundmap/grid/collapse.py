"""Collapse of a 3-D map: the 2-D map of a band of heights above the local ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from groundmap.arrays import (
    Bools,
    Counts,
    Floats,
    Floats32,
    Ints,
    as_floats,
    as_number,
    check_finite,
)
from groundmap.errors import InputError
from groundmap.grid.tiles import TILE_SHAPES, Tiles
from groundmap.grid.window import EPSILON, centres_of

NEAREST = 5  # planes that the height of the ground at a place is the mean of
STEEPEST = 0.5  # least z of a plane's normal: 60 degrees


class Band(NamedTuple):
    """Heights above the local ground [m], and what counts between them."""

    low: float  #: lowest voxels of the band
    high: float  #: highest voxels of the band
    free_below: float  #: a column is free if it is free between `low` and this height
    doubtful: (
        float  #: sum of a voxel's evidence up to which it does not block a free column, no [m]
    )


def as_band(low: object, high: object, free_below: object, doubtful: object) -> Band:
    """Return a band of heights.

    Parameters
    ----------
    low, high, free_below : float [m]
    doubtful : float

    Raises
    ------
    InputError
        Not ``low < free_below <= high``, or `doubtful` is below 0.
    """
    band = Band(
        low=as_number("band", low, "numbers [m]"),
        high=as_number("band", high, "numbers [m]"),
        free_below=as_number("band", free_below, "numbers [m]"),
        doubtful=as_number("doubtful", doubtful, "a number of 0 or more", least=0.0),
    )
    if not band.low < band.free_below <= band.high:
        expected = "low < free_below <= high [m]"
        raise InputError("band", expected, f"{band.low:g}, {band.free_below:g}, {band.high:g}")
    return band


def as_planes(values: npt.ArrayLike) -> Floats:
    """Return ground planes as an array, shape (k, 6): places, and normals that point up.

    Raises
    ------
    InputError
        Another shape, numbers that are not finite, or a normal whose z is not above 0.
    """
    planes = as_floats("planes", values, (None, 6))
    check_finite("planes", planes)
    if (planes[:, 5] <= 0).any():
        row = int(np.argmax(planes[:, 5] <= 0))
        raise InputError("planes", "normals that point up", str(planes[row, 3:].tolist()))
    return planes


def ground_heights(planes: Floats, xy: Floats) -> Floats:
    """Return the height of the ground at places, shape (n,) [m, map].

    Parameters
    ----------
    planes : ndarray, shape (k, 6), k >= 1
        Places on the ground [m, map], and its normals there.
    xy : ndarray, shape (n, 2) [m, map]
    """
    count = min(NEAREST, len(planes))
    _, nearest = KDTree(planes[:, :2]).query(xy, k=[*range(1, count + 1)])
    some = planes[nearest]
    offset = xy[:, None] - some[..., :2]
    rise = (some[..., 3:5] * offset).sum(axis=2) / np.maximum(some[..., 5], STEEPEST)
    heights: Floats = (some[..., 2] - rise).mean(axis=1)
    return heights


def collapse_tiles(
    tiles: Tiles, planes: Floats, origin: Floats, resolution: float, band: Band
) -> Iterator[tuple[Ints, Floats32, Counts]]:
    """Yield blocks of the columns of a 3-D map: first cell ``[row, col]``, confidence and count.

    A column with a non-free voxel in the band has the confidence of the surest of them. In a column
    that is free below it, a voxel does not count whose evidence adds up to `Band.doubtful` at most.
    Otherwise, a column with a free voxel below `Band.free_below` has the confidence of the surest
    of these. Of others, the least sure voxel below that height counts, if one was seen.

    Parameters
    ----------
    tiles : Tiles
    planes : ndarray, shape (k, 6)
    origin : ndarray, shape (3,) [m, map]
    resolution : float [m]
    band : Band

    Raises
    ------
    InputError
        No voxel lies in the band.
    """
    layers, *sides = TILE_SHAPES[3]
    stacks: dict[tuple[int, ...], list[tuple[int, Any]]] = {}
    for (layer, *column), tile in tiles.items():
        stacks.setdefault(tuple(column), []).append((layer, tile))
    held = False
    for index, stack in stacks.items():
        lower = np.array(index, dtype=np.int64) * sides
        cells = lower + np.argwhere(np.ones(sides, dtype=np.bool_))
        ground = ground_heights(planes, centres_of(cells, origin[:2], resolution)).reshape(sides)
        z = np.concatenate([layer * layers + np.arange(layers) for layer, _ in stack])
        height = origin[2] + (z + 0.5)[:, None, None] * resolution - ground
        confidence = np.concatenate([tile.confidence for _, tile in stack])
        count = np.concatenate([tile.count for _, tile in stack])
        # A voxel that begins below the band may hold what can be driven over.
        above = height - 0.5 * resolution >= band.low
        seen = (count > 0) & above & (height <= band.high)
        if seen.any():
            held = True
            near = height < band.free_below
            yield (lower, *_columns(confidence, count, seen, near, band.doubtful))
    if not held and len(tiles):
        raise InputError(
            "band",
            "heights above the ground with voxels that were seen [m]",
            f"{band.low:g} to {band.high:g} m",
            hint="`low` and `high` are heights above the ground under the views.",
        )


def _columns(
    confidence: Floats32, count: Counts, seen: Bools, low: Bools, doubtful: float
) -> tuple[Floats32, Counts]:
    """Return confidence and count of columns, shape (rows, cols); arrays have layers first."""
    # A column has many voxels, and those that few views saw are outvoted by none.
    free = (seen & low & (confidence <= -EPSILON)).any(axis=0)
    seen = seen & ~(free & (confidence >= EPSILON) & (confidence * count <= doubtful))
    highest = np.where(seen, confidence, -np.inf).argmax(axis=0)[None]
    nonfree = np.take_along_axis(np.where(seen, confidence, -np.inf), highest, 0) >= EPSILON
    near = np.where(seen & low, confidence, np.inf)
    surest = near.argmin(axis=0)[None]
    chosen = np.where(nonfree, highest, surest)
    known = nonfree | np.isfinite(np.take_along_axis(near, surest, 0))
    return (
        np.where(known, np.take_along_axis(confidence, chosen, 0), np.float32(0.0))[0],
        np.where(known, np.take_along_axis(count, chosen, 0), np.uint32(0))[0],
    )
