"""Obstacles as axis-aligned boxes, and exact distances to them, in any dimension."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bytes, Floats
from groundmap.grid.window import CellState

TOLERANCE = 1e-9  # [m]
RECENT, KEEP_OUT = 100, 101  # instead of a `CellState`, where the map has no say
NAMES: dict[int, str] = {
    CellState.NONFREE: "a non-free cell",
    CellState.UNKNOWN: "an unknown cell",
    CellState.CONTESTED: "a contested cell",
    RECENT: "a cell that the newest views saw as non-free",
    KEEP_OUT: "a keep-out cell",
}


class Obstacles(NamedTuple):
    """Cells that the footprint must not touch: squares, on a 3-D map cubes."""

    lower: Floats  #: shape (n, d) [m, map]: lower corners
    upper: Floats  #: shape (n, d) [m, map]: upper corners
    states: Bytes  #: shape (n,), a `CellState`, `RECENT` or `KEEP_OUT`

    def name(self, index: int) -> str:
        """Return what a cell is called in messages."""
        return NAMES[int(self.states[index])]


def segment_boxes(a: Floats, b: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the distance between each segment and its box, and the nearest point of the segment.

    The squared distance along a segment is convex, and quadratic between the parameters at which
    a coordinate passes a face of the box. Its slope is linear there, so the minimum follows by
    interpolation between the two parameters where the slope changes sign.

    Parameters
    ----------
    a, b : ndarray, shape (n, d) or (d,)
        Ends of the segments, or of one segment for all boxes.
    lower, upper : ndarray, shape (n, d)
        Corners of the boxes.

    Returns
    -------
    ndarray, shape (n,)
        Distances.
    ndarray, shape (n, d)
        Points of the segments.

    Examples
    --------
    >>> box = np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 1.0, 1.0]])
    >>> distance, nearest = segment_boxes(np.array([0.0, 3, 0.5]), np.array([3.0, 0, 0.5]), *box)
    >>> distance.round(3).tolist(), nearest.tolist()
    ([0.707], [[1.5, 1.5, 0.5]])
    """
    step = b - a
    parameters = [np.zeros((len(lower), 1)), np.ones((len(lower), 1))]
    for faces in (lower, upper):
        crossings = np.divide(faces - a, step, out=np.zeros_like(faces), where=step != 0)
        parameters.append(np.clip(crossings, 0.0, 1.0))
    t = np.sort(np.concatenate(parameters, axis=1), axis=1)
    steps = np.expand_dims(step, -2)
    points = np.expand_dims(a, -2) + t[..., None] * steps
    slope = (gaps(points, lower[:, None], upper[:, None]) * steps).sum(axis=-1)
    last = np.maximum((slope < 0).sum(axis=1), 1)  # the slope never decreases along t
    first = last - 1
    boxes = np.arange(len(lower))
    last = np.minimum(last, t.shape[1] - 1)
    before, after = slope[boxes, first], slope[boxes, last]
    share = np.divide(-before, after - before, out=np.zeros_like(before), where=after > before)
    share = np.clip(share, 0.0, 1.0)
    best = t[boxes, first] + share * (t[boxes, last] - t[boxes, first])
    nearest = a + best[:, None] * step
    return lengths(gaps(nearest, lower, upper)), nearest


def gaps(points: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return how far coordinates lie outside intervals: negative below them, 0 inside.

    Parameters
    ----------
    points : ndarray, shape (..., d)
    lower, upper : ndarray, shape (..., d)
        Ends of the intervals.
    """
    outside: Floats = np.minimum(points - lower, 0.0) + np.maximum(points - upper, 0.0)
    return outside


def lengths(vectors: Floats) -> Floats:
    """Return the lengths of vectors, shape (n, d)."""
    norms: Floats = np.sqrt((vectors * vectors).sum(axis=-1))
    return norms
