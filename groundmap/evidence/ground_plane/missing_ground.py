"""Places without ground, detected by lines of sight to features below the ground."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import features_beside

DEEPEST_SIGHT = 3.0  # [m], along the ground; features that lie deeper are mostly false matches
BESIDE = 0.15  # [m], distance up to which a ground feature is beside a line of sight


def missing_ground(ground_view: GroundView, step: float) -> tuple[Floats, Ints]:
    """Return the places where lines of sight to drop-offs run below ground level.

    A line of sight with ground features beside this part belongs to a false match, and is left out.

    Parameters
    ----------
    ground_view : GroundView
    step : float [m]
        Largest distance between places.

    Returns
    -------
    places : ndarray, shape (n, 2) [m, view]
    line : ndarray of int, shape (n,)
        Row of `drop_offs` of each place.
    """
    range_at_end = np.hypot(ground_view.drop_offs[:, 0], ground_view.drop_offs[:, 1])
    entry = ground_view.camera_height / (ground_view.camera_height - ground_view.drop_off_heights)
    gap = range_at_end * (1.0 - entry)
    rows = np.flatnonzero(gap <= DEEPEST_SIGHT)
    rows = rows[~_beside_ground(ground_view, rows, (entry * range_at_end)[rows])]
    counts = np.ceil(gap[rows] / step).astype(np.int64)
    line = np.repeat(rows, counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = entry[line] + (1.0 - entry[line]) * (number + 0.5) / np.repeat(counts, counts)
    return ground_view.drop_offs[line] * share[:, None], line


def _beside_ground(ground_view: GroundView, rows: Ints, entry: Floats) -> Bools:
    """Return which lines of sight to drop-offs have ground beside them beyond `entry` [m]."""
    ends = ground_view.drop_offs[rows]
    rays = ends / np.hypot(ends[:, 0], ends[:, 1])[:, None]
    end = (rays * ends).sum(axis=1)
    beside = np.empty(len(rows), dtype=np.bool_)
    features_beside(rays, entry + BESIDE, end - BESIDE, ground_view.supports, BESIDE, beside)
    return beside
