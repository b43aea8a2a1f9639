"""Guesses of which view saw which landmark, for maps that do not contain it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from groundmap.arrays import Bools, Floats, Ints
from groundmap.sparse.sparse_map import FARTHEST as FARTHEST_PLACE
from groundmap.sparse.sparse_map import SparseMap

USUAL_BORDER = 1.0  # tangent, of a camera whose image size is unknown: 90 degrees
FARTHEST = 3.0  # of the usual distance of a landmark from the nearest camera
CELL = 0.03  # [rad], of directions in which the nearest landmark hides others
HIDDEN = 1.2  # distance of a hidden landmark, relative to the nearest in its surroundings
NOTE = (
    "which view saw which landmark was guessed: on maps where it is known, a fifth to four fifths "
    "of such guesses are right. Do not drive by this map"
)


def guess_visibility(sparse: SparseMap) -> SparseMap:
    """Return a map whose sightings are guessed.

    A view is taken to see the landmarks in its image that are no farther than three times what is
    usual, and no more than a fifth farther than the nearest one within 2 to 4 degrees.

    Parameters
    ----------
    sparse : SparseMap
        Its own sightings are ignored.
    """
    if not len(sparse) or not len(sparse.landmarks):
        return sparse
    with np.errstate(invalid="ignore"):
        finite = np.flatnonzero((np.abs(sparse.landmarks) <= FARTHEST_PLACE).all(axis=1))
    if not len(finite):
        return sparse
    nearest, _ = KDTree(sparse.centres).query(sparse.landmarks[finite])
    farthest = FARTHEST * float(np.median(nearest))
    seen = [finite[_seen(sparse, view, finite, farthest)] for view in range(len(sparse))]
    return replace(
        sparse,
        view_of=np.repeat(np.arange(len(sparse)), [len(rows) for rows in seen]),
        landmark_of=np.concatenate(seen),
        pixels=None,
        notes=(*sparse.notes, NOTE),
    )


def _seen(sparse: SparseMap, view: int, rows: Ints, farthest: float) -> Ints:
    """Return which of the given landmarks a view sees, as places in `rows`."""
    pose, camera = sparse.T_world_camera[view], sparse.camera(view)
    local = (sparse.landmarks[rows] - pose[:3, 3]) @ pose[:3, :3]
    distance = np.linalg.norm(local, axis=1)
    inside = (distance < farthest) & (distance > 0)
    if camera.projection != "equirectangular":
        border = (camera.border or USUAL_BORDER) * local[:, 2]
        height = border if not camera.height else border * camera.height / max(camera.width, 1)
        inside &= (np.abs(local[:, 0]) < border) & (np.abs(local[:, 1]) < np.maximum(height, 0))
    found = np.flatnonzero(inside)
    return found[~_hidden(local[found], distance[found])]


def _hidden(local: Floats, distance: Floats) -> Bools:
    """Return whether a much nearer landmark lies in about the same direction, shape (n,)."""
    if not len(local):
        return np.zeros(0, dtype=np.bool_)
    azimuth = np.arctan2(local[:, 0], local[:, 2])
    elevation = np.arcsin(np.clip(local[:, 1] / distance, -1.0, 1.0))
    cells = np.floor(np.stack([azimuth, elevation], axis=1) / CELL).astype(np.int64)
    cells -= cells.min(axis=0) - 1
    nearest = np.full(cells.max(axis=0) + 2, np.inf)
    np.minimum.at(nearest, (cells[:, 0], cells[:, 1]), distance)
    around = np.min(
        [nearest[cells[:, 0] + i, cells[:, 1] + j] for i in (-1, 0, 1) for j in (-1, 0, 1)],
        axis=0,
    )
    hidden: Bools = distance > HIDDEN * around
    return hidden
