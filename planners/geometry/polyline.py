"""Polylines: lengths, distances, redundant points, crossed cells."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.geometry.rounding import rounding_at

SAME = 1e-10  # [m] closer inner points coincide with their predecessor, up to rounding


class CrossedCells(NamedTuple):
    """The cells that a line crosses, in order; a cell may be repeated."""

    cells: Ints  #: shape (n, d): row, column (in 3-D: layer, row, column)
    lengths: Floats  #: shape (n,): length of the line inside the cell [cells]


def length_of(points: Floats) -> float:
    """Return the length of a polyline, in the points' unit.

    Parameters
    ----------
    points : ndarray, shape (n, d), n >= 1

    Examples
    --------
    >>> length_of(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]]))
    6.0
    """
    steps = np.diff(points, axis=0)
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())


def distances_to(points: Floats, line: Floats) -> Floats:
    """Return the distances of points to a polyline, shape (n,).

    Parameters
    ----------
    points : ndarray, shape (n, d)
    line : ndarray, shape (m, d), m >= 2

    Examples
    --------
    >>> distances_to(np.array([[1.0, 2.0], [5.0, 0.0]]), np.array([[0.0, 0.0], [3.0, 0.0]]))
    array([2., 2.])
    """
    nearest = np.full(len(points), np.inf)
    for a, b in pairwise(line):
        along = b - a
        squared = float(along @ along)
        t = (points - a) @ along / squared if squared > 0 else np.zeros(len(points))
        feet = a + np.clip(t, 0.0, 1.0)[:, None] * along
        nearest = np.minimum(nearest, np.linalg.norm(points - feet, axis=1))
    return nearest


def merge_collinear(points: Floats) -> Floats:
    """Return the polyline without inner points that repeat or lie exactly on a straight line.

    The first and the last point are kept even if they coincide: a line has two ends.

    Parameters
    ----------
    points : ndarray, shape (n, d), n >= 2 [m]

    Returns
    -------
    ndarray, shape (m, d), m >= 2 [m]

    Examples
    --------
    >>> line = np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [3.0, 0.0], [4.0, 1.0]])
    >>> merge_collinear(line).tolist()
    [[0.0, 0.0], [3.0, 0.0], [4.0, 1.0]]
    """
    differs = np.abs(np.diff(points, axis=0)).max(axis=1) >= SAME + rounding_at(points)
    # Drop inner points that repeat their predecessor, and those that the last point repeats.
    kept = np.concatenate([points[:1], points[1:-1][differs[:-1]]])
    if len(kept) > 1 and not differs[-1]:
        kept = kept[:-1]
    line = np.concatenate([kept, points[-1:]])
    steps = np.diff(line, axis=0)
    before, after = steps[:-1].T, steps[1:].T
    turns = (before * after).sum(axis=0) <= 0
    for i, j in combinations(range(len(before)), 2):
        turns |= before[i] * after[j] != before[j] * after[i]
    turned: Floats = line[np.concatenate([[True], turns, [True]])]
    return turned


def cross_cells(points: Floats) -> CrossedCells:
    """Return the cells that a polyline crosses, and its length inside each.

    Cells touched in a single point are left out. A line along a border crosses the cells above or
    to the right of it. A line of length 0 crosses one cell.

    Parameters
    ----------
    points : ndarray, shape (n, d) [cells]

    Examples
    --------
    >>> cross_cells(np.array([[0.5, 0.5], [2.5, 0.5]]))
    CrossedCells(cells=array([[0, 0],
           [0, 1],
           [0, 2]]), lengths=array([0.5, 1. , 0.5]))
    """
    starts, steps = points[:-1], np.diff(points, axis=0)
    pieces, shares = _cuts(starts, points[1:])
    gaps = np.diff(shares)
    apart = (pieces[:-1] == pieces[1:]) & (gaps > 0)
    pieces, gaps, middles = pieces[:-1][apart], gaps[apart], ((shares[:-1] + shares[1:]) / 2)[apart]
    places = starts[pieces] + middles[:, None] * steps[pieces]
    cells = np.floor(places).astype(np.int64)[:, ::-1]
    lengths = gaps * np.sqrt(np.vecdot(steps, steps))[pieces]
    inside = lengths > 0
    if not inside.any():
        return CrossedCells(cells[:1], lengths[:1])
    return CrossedCells(cells[inside], lengths[inside])


def _cuts(starts: Floats, ends: Floats) -> tuple[Ints, Floats]:
    """Return where straight pieces begin, cross the borders of cells and end.

    Parameters
    ----------
    starts, ends : ndarray, shape (n, d) [cells]

    Returns
    -------
    ndarray, shape (m,)
        Index of the piece, ascending.
    ndarray, shape (m,)
        Fraction of the piece up to there, ascending; a fraction may be repeated.
    """
    numbers = np.arange(len(starts))
    pieces, shares = [numbers, numbers], [np.zeros(len(starts)), np.ones(len(starts))]
    for start, end in zip(starts.T, ends.T, strict=True):
        first = np.ceil(np.minimum(start, end))
        count = np.floor(np.maximum(start, end)) - first + 1.0
        counts = np.where(start == end, 0, count).astype(np.int64)
        piece = np.repeat(numbers, counts)
        nth = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
        pieces.append(piece)
        away = first[piece] + nth - start[piece]
        shares.append(np.clip(away / (end - start)[piece], 0.0, 1.0))
    which, share = np.concatenate(pieces), np.concatenate(shares)
    order = np.lexsort((share, which))
    return which[order], share[order]
