"""A route to begin with, and where a better one may be."""

from __future__ import annotations

import math

import numpy as np

from groundmap.arrays import Bools, Floats
from planners.costmap.voxel_map import Voxels
from planners.errors import TimeLimitError
from planners.geometry.kernels.curves import wrap
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.settings import FLAT, TURNING, SamplingSettings
from planners.search.astar import AStar, AStarSettings
from planners.search.astar3d import AStar3D
from planners.search.base import Clock, SearchResult, SearchSettings, clock_from
from planners.search.hybrid_astar import HybridAStar, HybridAStarSettings


def first_states(
    validator: MotionValidator | MotionValidator3D,
    start: Pose,
    goal: Pose,
    settings: SamplingSettings,
    clock: Clock,
) -> list[Pose]:
    """Return the states of A*'s route (in curved spaces, hybrid A*'s), or none if it has none.

    A* moves a disc that holds the footprint at every heading, so in se2 the yaw changes evenly
    along its route.

    Parameters
    ----------
    validator : MotionValidator
    start, goal : tuple of float
        x, y [m, map] and, where the space has it, yaw [rad].
    settings : SamplingSettings
    clock : Clock
        Of the whole search.
    """
    if validator.space not in FLAT and len(goal) == 2:  # any heading will do
        goal = (*goal, start[2])
    try:
        with clock_from(clock.began):
            found = _search(validator, start, goal, settings, clock.time_limit)
    except TimeLimitError:
        return []
    if found is None:
        return []
    if validator.space == "se2":
        poses = _add_yaw(found.waypoints, start[2], goal[2])
    elif validator.space in TURNING:
        assert found.headings is not None
        poses = np.column_stack([found.waypoints, found.headings])
    else:
        poses = found.waypoints
    states = [validator.state_of(tuple(pose)) for pose in poses.tolist()]
    return states if validator.are_clear(states) else []


def _search(
    validator: MotionValidator | MotionValidator3D,
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
    told = HybridAStarSettings(
        time_limit=limit,
        motion="dubins" if validator.space == "dubins" else "reeds_shepp",
        turning_radius=settings.turning_radius,
    )
    return HybridAStar(costmap).search(start, goal, told)


def _add_yaw(waypoints: Floats, first: float, last: float) -> Floats:
    """Return poses along a line, shape (n, 3); the yaw goes over from first to last evenly."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(waypoints, axis=0).T)))
    share = along / along[-1] if along[-1] > 0.0 else np.linspace(0.0, 1.0, len(along))
    return np.column_stack([waypoints, first + share * wrap(last - first)])


def better_region(
    region: Bools,
    size: float,
    start: Pose,
    goals: list[Pose],
    longest: float,
    *,
    clock: Clock | None = None,
) -> Bools:
    """Return the cells of a region through which a line may lead that is not longer.

    Parameters
    ----------
    region : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    size : float [m]
        Of a cell.
    start, goals : states [m, corner]
    longest : float [m]
        Cells all of whose places are farther from the start and the nearest goal together are left
        out.
    clock : Clock, optional
        Once time is up, all of the region is returned.

    Examples
    --------
    >>> better_region(np.ones((5, 7), bool), 1.0, (1.5, 2.5), [(5.5, 2.5)], 4.0).astype(int)[:3]
    array([[0, 0, 0, 0, 0, 0, 0],
           [0, 1, 1, 1, 1, 1, 0],
           [0, 1, 1, 1, 1, 1, 0]])
    """
    to_goal = np.full(region.shape, math.inf)
    for goal in goals:
        if clock is not None and clock.is_up:
            return region
        np.minimum(to_goal, _away(region.shape, size, goal), out=to_goal)
    validator = _away(region.shape, size, start) + to_goal
    kept: Bools = region & (validator <= longest + math.sqrt(region.ndim) * size)
    return kept


def _away(shape: tuple[int, ...], size: float, state: Pose) -> Floats:
    """Return how far the centres of cells are from a state."""
    squared = np.zeros((1,) * len(shape))
    for axis, length in enumerate(shape):
        gaps = (np.arange(length) + 0.5) * size - state[len(shape) - 1 - axis]
        others = [k for k in range(len(shape)) if k != axis]
        squared = squared + np.expand_dims(gaps**2, others)
    away: Floats = np.sqrt(squared)
    return away
