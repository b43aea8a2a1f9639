"""Conversion of a path of states to a route on the map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import FLAT
from planners.search.base import SearchResult


def to_search_result(
    validator: MotionValidator,
    states: Sequence[Pose],
    *,
    query: tuple[Pose, Pose],
    cost: float,
    checked: int,
) -> SearchResult:
    """Return a path as a route on the map, with start and goal exactly as given.

    Parameters
    ----------
    validator : MotionValidator
    states : sequence of states
    query : tuple of two poses [map]
        Start and goal; the path may end at another accepted goal.
    cost : float
    checked : int
        Number of edges checked.
    """
    (start, goal), axes = query, validator.axes
    poses = validator.poses(states)
    if len(poses) == 1:
        poses = np.concatenate([poses, poses])
    poses[0, :axes] = start[:axes]
    end: Pose | None = None
    if len(goal) >= len(states[-1]) and states[-1] == validator.state_of(goal):
        poses[-1, :axes] = goal[:axes]
    else:
        if states[-1] == states[0]:  # the start is an accepted goal
            poses[-1, :axes] = start[:axes]
        end = tuple(poses[-1].tolist())
    waypoints = np.ascontiguousarray(poses[:, :axes])
    if validator.space in FLAT:
        return SearchResult(waypoints, checked, bound=None, cost=cost, goal=end)
    headings = np.remainder(poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    headings[0] = start[2]
    headings[-1] = goal[2] if end is None else end[2]
    return SearchResult(waypoints, checked, headings, bound=None, cost=cost, goal=end)
