"""Which landmarks of a log move, and which are on thin things: kinds that maps are worst at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from groundmap.arrays import Bools, Floats, Ints
from groundmap.view.view import View

MOVED = 0.5  # [m], least distance between two places of a landmark that moves
SURELY = 3.0  # standard deviations, by which its places differ from their mean
NEIGHBOURHOOD = 1.0  # [m] around a landmark
FEW = 5  # landmarks in it, itself included, of which one is on a thin thing


class LandmarkKinds(NamedTuple):
    """Sorted ids of landmarks."""

    moving: Ints
    thin: Ints  #: of obstacles with few landmarks


def kinds_of(views: Iterable[View], obstacles: Iterable[tuple[Floats, Ints]]) -> LandmarkKinds:
    """Return which landmarks move, and which obstacles have few landmarks around them.

    A landmark moves if its places in the map are more than 0.5 m apart, and differ by more than
    three standard deviations from their weighted mean. A thing is thin if there are at most five
    obstacle landmarks within a metre: a pole, or a car of few features.

    Parameters
    ----------
    views : iterable of View
    obstacles : iterable of (ndarray, ndarray)
        Places [m, map] and ids of the obstacle features of each view.
    """
    places, inverse, ids = _sightings(views)
    unique, row, counts = np.unique(ids, return_inverse=True, return_counts=True)
    weight, pull = np.zeros((len(unique), 2, 2)), np.zeros((len(unique), 2))
    np.add.at(weight, row, inverse)
    np.add.at(pull, row, np.einsum("nij,nj->ni", inverse, places))
    mean = np.linalg.solve(weight, pull[..., None])[..., 0]
    off = places - mean[row]
    squared = np.zeros(len(unique))
    np.add.at(squared, row, np.einsum("ni,nij,nj->n", off, inverse, off))
    low, high = np.full((len(unique), 2), np.inf), np.full((len(unique), 2), -np.inf)
    np.minimum.at(low, row, places)
    np.maximum.at(high, row, places)
    extent = np.hypot(*(high - low).T)
    freedom = 2.0 * np.maximum(counts - 1, 1)
    moves: Bools = (counts > 1) & (extent > MOVED) & (squared > SURELY**2 * freedom)
    return LandmarkKinds(unique[moves], _thin(list(obstacles)))


def _sightings(views: Iterable[View]) -> tuple[Floats, Floats, Ints]:
    """Return place [m, map], inverse covariance and id of each sighting of a landmark."""
    places, inverse, ids = [np.empty((0, 2))], [np.empty((0, 2, 2))], [np.empty(0, dtype=np.int64)]
    for view in views:
        rotation = view.T_map_camera[:2, :3]
        covariance = rotation @ view.points.covariance @ rotation.T
        places.append(view.points.xyz @ rotation.T + view.T_map_camera[:2, 3])
        uncertain: Floats = covariance + 1e-4 * np.eye(2)  # a centimetre of the pose
        inverse.append(np.linalg.inv(uncertain).astype(np.float64))
        ids.append(view.points.ids)
    return np.concatenate(places), np.concatenate(inverse), np.concatenate(ids)


def _thin(obstacles: list[tuple[Floats, Ints]]) -> Ints:
    """Return the ids of obstacles with few others around the mean of their places."""
    if not obstacles:
        return np.empty(0, dtype=np.int64)
    places = np.concatenate([xy for xy, _ in obstacles])
    ids, row, counts = np.unique(
        np.concatenate([ids for _, ids in obstacles]), return_inverse=True, return_counts=True
    )
    if len(ids) == 0:
        return ids
    mean = np.zeros((len(ids), 2))
    np.add.at(mean, row, places / counts[row, None])
    around = cKDTree(mean).query_ball_point(mean, NEIGHBOURHOOD, return_length=True)
    thin: Ints = ids[around <= FEW]
    return thin
