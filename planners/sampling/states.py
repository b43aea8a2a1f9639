"""OMPL's spaces and states, and what it calls back, without an import of it.

What is called back returns Python's own bool, and keeps no state: OMPL frees them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from planners.engine import Pose
from planners.sampling.settings import SamplingSettings, Space
from planners.sampling.ways import Bounds, Ways


def space_of(base: Any, space: Space, room: Bounds, settings: SamplingSettings) -> Any:
    """Return a space of OMPL's within a box."""
    if space == "r2":
        made = base.RealVectorStateSpace(2)
    elif space == "se2":
        made = base.SE2StateSpace()
        made.setSubspaceWeight(1, settings.yaw_weight)
    elif space == "dubins":
        made = base.DubinsStateSpace(settings.turning_radius)
    else:
        made = base.ReedsSheppStateSpace(settings.turning_radius)
    bounds = base.RealVectorBounds(2)
    for axis in range(2):
        bounds.setLow(axis, room[axis])
        bounds.setHigh(axis, room[axis + 2])
    made.setBounds(bounds)
    return made


def state_of(space: Any, pose: Pose) -> Any:
    """Return a state of OMPL's."""
    state = space.allocState()
    if len(pose) == 2:
        state[0], state[1] = pose
    else:
        state.setXY(pose[0], pose[1])
        state.setYaw(pose[2])
    return state


def state_check(ways: Ways) -> Callable[[Any], bool]:
    """Return what tells whether a state is clear."""
    is_clear, read = ways.is_clear, reader(ways.space)
    return lambda state: is_clear(*2 * read(state))


def edge_check(ways: Ways, edges: Iterator[int]) -> Callable[..., bool]:
    """Return a method that checks an edge and counts it; OMPL's third argument stays as it is."""
    is_clear = ways.is_clear

    def line(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        next(edges)
        return is_clear(a[0], a[1], b[0], b[1])

    def poses(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        next(edges)
        return is_clear(a.getX(), a.getY(), a.getYaw(), b.getX(), b.getY(), b.getYaw())

    return line if ways.space == "r2" else poses


def reader(space: Space) -> Callable[[Any], Pose]:
    """Return what turns a state of OMPL's into ours."""
    return _read_place if space == "r2" else _read_pose


def _read_place(state: Any) -> Pose:
    return state[0], state[1]


def _read_pose(state: Any) -> Pose:
    return state.getX(), state.getY(), state.getYaw()
