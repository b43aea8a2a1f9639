"""Warm start: A*'s route as the first one, and the region that a better one lies in."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Bools, Floats
from groundmap.grid.window import slabs
from planners.costmap.voxel_map import Voxels
from planners.errors import TimeLimitError
from planners.geometry.kernels.curves import wrap
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import FLAT, TURNING, SamplingSettings
from planners.search.astar import AStar, AStarSettings
from planners.search.astar3d import AStar3D
from planners.search.base import Clock, SearchResult, SearchSettings, clock_from
from planners.search.hybrid_astar import HybridAStar, HybridAStarSettings


def astar_states(
    validator: MotionValidator,
    start: Pose,
    goal: Pose,
    settings: SamplingSettings,
    clock: Clock,
) -> list[Pose]:
    """Return the states of A*'s route (in curved spaces, hybrid A*'s); empty if there is none.

    A* plans for a disc that contains the footprint at every heading, so in se2 the yaw is
    interpolated along its route.

    Parameters
    ----------
    validator : MotionValidator
    start, goal : tuple of float
        x, y (, z) [m, map] and, where the space has one, yaw [rad].
    settings : SamplingSettings
    clock : Clock
        Of the whole search.
    """
    if validator.space not in FLAT and len(goal) == 2:  # any yaw is accepted
        goal = (*goal, start[2])
    try:
        with clock_from(clock.began):
            route = _search(validator, start, goal, settings, clock.time_limit)
    except TimeLimitError:
        return []
    if route is None:
        return []
    if validator.space == "se2":
        poses = _add_yaw(route.waypoints, start[2], goal[2])
    elif validator.space in TURNING:
        assert route.headings is not None
        poses = np.column_stack([route.waypoints, route.headings])
    else:
        poses = route.waypoints
    states = [validator.state_of(tuple(pose)) for pose in poses.tolist()]
    return states if validator.are_clear(states) else []


def _search(
    validator: MotionValidator,
    start: Pose,
    goal: Pose,
    settings: SamplingSettings,
    limit: float | None,
) -> SearchResult | None:
    costmap = validator.costmap
    if isinstance(costmap, Voxels):
        return AStar3D(costmap).search(start, goal, SearchSettings(time_limit=limit))
    if validator.space not in TURNING:
        return AStar(costmap).search(start, goal, AStarSettings(time_limit=limit))
    hybrid_settings = HybridAStarSettings(
        time_limit=limit,
        motion="dubins" if validator.space == "dubins" else "reeds_shepp",
        turning_radius=settings.turning_radius,
    )
    return HybridAStar(costmap).search(start, goal, hybrid_settings)


def _add_yaw(waypoints: Floats, first: float, last: float) -> Floats:
    """Return poses along a line, shape (n, 3), with the yaw interpolated over its length."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T)))
    share = along / along[-1] if along[-1] > 0.0 else np.linspace(0.0, 1.0, len(along))
    return np.column_stack([waypoints, first + share * wrap(last - first)])


def informed_region(
    region: Bools,
    size: float,
    start: Pose,
    goals: list[Pose],
    max_length: float,
    *,
    clock: Clock | None = None,
) -> Bools:
    """Return the cells of a region that a line up to a length may cross: the informed set.

    Parameters
    ----------
    region : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    size : float [m]
        Side of a cell.
    start : state [m, corner]
    goals : list of states [m, corner]
    max_length : float [m]
        Cells are left out if the distances to the start and to the nearest goal add up to more at
        all of their places.
    clock : Clock, optional
        Once the time is up, the whole region is returned.

    Examples
    --------
    >>> informed_region(np.ones((5, 7), bool), 1.0, (1.5, 2.5), [(5.5, 2.5)], 4.0).astype(int)[:3]
    array([[0, 0, 0, 0, 0, 0, 0],
           [0, 1, 1, 1, 1, 1, 0],
           [0, 1, 1, 1, 1, 1, 0]])
    """
    informed = region.copy()
    for part in slabs(region.shape):
        to_goal = np.full(region[part].shape, math.inf)
        for goal in goals:
            if clock is not None and clock.is_up:
                return region
            np.minimum(to_goal, _distances(part, region.shape, size, goal), out=to_goal)
        lengths = _distances(part, region.shape, size, start) + to_goal
        informed[part] &= lengths <= max_length + math.sqrt(region.ndim) * size
    return informed


def _distances(part: slice, shape: tuple[int, ...], size: float, state: Pose) -> Floats:
    """Return the distances of the centres of a part of the first axis to a state [m]."""
    squared = np.zeros((1,) * len(shape))
    for axis, length in enumerate(shape):
        indices = np.arange(length) if axis else np.arange(part.start, part.stop)
        gaps = (indices + 0.5) * size - state[len(shape) - 1 - axis]
        others = [k for k in range(len(shape)) if k != axis]
        squared = squared + np.expand_dims(gaps**2, others)
    distances: Floats = np.sqrt(squared)
    return distances
