"""From the states of a path to a route on the map."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from planners.engine import Found, Pose
from planners.sampling.settings import FLAT
from planners.sampling.ways import Ways
from planners.sampling.ways3d import Ways3D


def found_of(
    ways: Ways | Ways3D,
    states: Sequence[Pose],
    *,
    asked: tuple[Pose, Pose],
    cost: float,
    checked: int,
) -> Found:
    """Return a path as a route on the map, with start and goal as they were given.

    Parameters
    ----------
    ways : Ways or Ways3D
    states : sequence of states
    asked : tuple of two poses [map]
        Start and goal; the path may end at another goal that will do.
    cost : float
    checked : int
        Edges.
    """
    start, goal = asked
    axes = 3 if ways.space == "r3" else 2
    poses = ways.poses(states)
    if len(poses) == 1:
        poses = np.concatenate([poses, poses])
    poses[0, :axes] = start[:axes]
    end: Pose | None = None
    if len(goal) >= len(states[-1]) and states[-1] == ways.state_of(goal):
        poses[-1, :axes] = goal[:axes]
    else:
        if states[-1] == states[0]:  # it is there already
            poses[-1, :axes] = start[:axes]
        end = tuple(poses[-1].tolist())
    waypoints = np.ascontiguousarray(poses[:, :axes])
    if ways.space in FLAT:
        return Found(waypoints, checked, bound=None, cost=cost, goal=end)
    headings = np.remainder(poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    headings[0] = start[2]
    headings[-1] = goal[2] if end is None else end[2]
    return Found(waypoints, checked, headings, bound=None, cost=cost, goal=end)
