"""The ground under a log whose world may be tilted and without a metre: one plane for all views."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from groundmap.arrays import Floats
from groundmap.view.view import View

MOST_VIEWS = 400  # that are kept, evenly
MOST_FEATURES = 20_000  # that the search uses, evenly
LEAST_AGREEMENT = 0.3  # length of the mean of the views' directions up
PITCHES = np.tan(np.radians(np.arange(-40.0, 40.1, 2.5)))
ROLLS = np.tan(np.radians(np.arange(-15.0, 15.1, 2.5)))
STEP = 0.05  # width of the bins of depths, as a share of the depth
BELOW = 0.5  # weight of features below a plane against those on it
REACH = 3.0  # [depth] to the side of the track, in the search and the refinement
UNDER = (0.5, 1.0, 1.5, 2.0, 3.0)  # [depth] to the side of the track, for the camera height
ENOUGH = 50  # features under the track that the camera height needs
TOLERANCES = (0.25, 0.15, 0.1, 0.1, 0.1)  # of refinement steps, as a share of the depth
FEWEST = 12
TRACK_POINTS = 20  # between two views
WORST_CONDITION = 1e10  # of the information matrix, for a depth of 1


class GroundEstimate(NamedTuple):
    """The plane on which most of the low features of a log lie, relative to its cameras."""

    up: Floats  #: shape (3,), unit normal [map of the log]
    camera_height: float  #: mean height of the cameras above it [unit of the log]
    support: int  #: number of features on it


class _Cloud(NamedTuple):
    points: Floats  # (n, 3), relative to the nearest point of the track [forward, left, up]
    axes: Floats  # (3, 3), rows forward, left and up of the views on average [map]


def estimate_ground(views: Iterable[View]) -> GroundEstimate | None:
    """Return the plane under the cameras of a log, or None if there is none.

    The search depends neither on the axes of the world nor on its unit. The plane is up to 40
    degrees off the mean attitude of the cameras and parallel to their track. What counts is how far
    features are below the nearest point of the track, so that the ground may climb.

    Parameters
    ----------
    views : iterable of View
    """
    cloud = _cloud(views)
    plane = None if cloud is None else _search(cloud.points)
    for tolerance in TOLERANCES:
        if cloud is None or plane is None:
            return None
        plane = _refine(cloud.points, plane, tolerance)
    if cloud is None or plane is None:
        return None
    a, b, c = plane
    normal = np.array([-a, -b, 1.0]) / np.sqrt(1.0 + a * a + b * b)
    depths = _under(cloud.points, normal, float(-c * normal[2]))
    if not len(depths):
        return None
    return GroundEstimate(cloud.axes.T @ normal, float(np.median(depths)), len(depths))


def _cloud(views: Iterable[View]) -> _Cloud | None:
    kept: list[View] = []
    stride = 1
    for number, view in enumerate(views):
        if number % stride:
            continue
        kept.append(view)
        if len(kept) > MOST_VIEWS:
            kept, stride = kept[::2], 2 * stride
    axes = _mean_axes(kept)
    if axes is None:
        return None
    points = np.concatenate([_positions(view) for view in kept])
    points = points[:: max(1, len(points) // MOST_FEATURES)]
    if len(points) < FEWEST:
        return None
    track = _track(np.array([view.T_map_camera[:3, 3] for view in kept])) @ axes.T
    level = points @ axes.T
    _, nearest = KDTree(track[:, :2]).query(level[:, :2])
    return _Cloud(level - track[nearest], axes)


def _mean_axes(views: list[View]) -> Floats | None:
    """Return forward, left and up of the views on average, shape (3, 3) [map]; None if unclear."""
    if not views:
        return None
    up = np.mean([view.T_map_base[:3, :3] @ view.rig.up for view in views], axis=0)
    length = float(np.linalg.norm(up))
    if length < LEAST_AGREEMENT:
        return None
    up /= length
    axis = np.mean([view.T_map_camera[:3, 2] for view in views], axis=0)
    forward = axis - (axis @ up) * up
    if np.linalg.norm(forward) < 1e-6:
        forward = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _positions(view: View) -> Floats:
    """Return the features of a view, shape (n, 3) [map]."""
    xyz = np.concatenate([view.points.xyz, view.segments.xyz.reshape(-1, 3)])
    return xyz @ view.T_map_camera[:3, :3].T + view.T_map_camera[:3, 3]


def _track(centres: Floats) -> Floats:
    """Return points along the line through the cameras."""
    share = np.linspace(0.0, 1.0, TRACK_POINTS, endpoint=False)[:, None]
    steps = centres[:-1, None] + share * (centres[1:] - centres[:-1])[:, None]
    return np.concatenate([steps.reshape(-1, 3), centres[-1:]])


def _search(points: Floats) -> Floats | None:
    """Return the plane (a, b, c: up = a forward + b left + c) with most features on it.

    A Hough transform over pitch, roll and the logarithm of the depth, which needs no unit. Features
    count by the share of the surroundings of the track that they lie in: deep planes have more.
    """
    best, found = -np.inf, None
    aside = np.hypot(points[:, 0], points[:, 1])
    for pitch in PITCHES:
        for roll in ROLLS:
            tilt = np.sqrt(1.0 + pitch * pitch + roll * roll)
            depth = (pitch * points[:, 0] + roll * points[:, 1] - points[:, 2]) / tilt
            inside = (depth > 0) & (aside < REACH * depth)
            if inside.sum() < FEWEST:
                continue
            bins = np.floor(np.log(depth[inside]) / STEP).astype(np.int64)
            lowest = int(bins.min())
            votes = np.bincount(bins - lowest)
            padded = np.pad(votes, 1)
            on = votes + padded[:-2] + padded[2:]
            deeper = votes.sum() - np.cumsum(votes)
            heights = np.exp((lowest + np.arange(len(votes)) + 0.5) * STEP)
            score = (on - BELOW * (deeper - padded[2:])) / heights
            score[on < FEWEST] = -np.inf
            column = int(np.argmax(score))
            if score[column] > best:
                best = float(score[column])
                found = np.array([pitch, roll, -heights[column] * tilt])
    return found


def _refine(points: Floats, plane: Floats, tolerance: float) -> Floats | None:
    """Return the plane after a step of reweighted least squares, or None without support."""
    a, b, c = plane
    tilt = np.sqrt(1.0 + a * a + b * b)
    depth = -c / tilt
    if depth <= 0:
        return None
    x, y, z = points.T
    off = (z - a * x - b * y - c) / tilt
    near = np.hypot(x, y) < REACH * depth
    weights = np.where(near, np.maximum(0.0, 1.0 - (off / (tolerance * depth)) ** 2) ** 2, 0.0)
    if int((weights > 0).sum()) < FEWEST:
        return None
    design = np.column_stack([x, y, np.ones(len(x))])
    information = (design * weights[:, None]).T @ design
    if np.linalg.cond(information) > WORST_CONDITION * depth**2:
        return plane
    solved: Floats = np.linalg.solve(information, design.T @ (weights * z))
    return solved


def _under(points: Floats, normal: Floats, expected: float) -> Floats:
    """Return the depths of the ground features that are nearest to the track, shape (k,)."""
    depth = -points @ normal
    aside = np.linalg.norm(points + depth[:, None] * normal, axis=1)
    found = depth[:0]
    for reach in UNDER:
        inside = (aside < reach * expected) & (np.abs(depth - expected) < 0.2 * expected)
        found = depth[inside]
        if len(found) >= ENOUGH:
            found = found[np.abs(found - np.median(found)) < 0.1 * expected]
            break
    return found
