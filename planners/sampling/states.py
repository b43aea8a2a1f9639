"""OMPL's spaces and states, and what it calls back, without an import of it.

What is called back returns Python's own bool, and keeps no state: OMPL frees them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

from planners.engine import Pose
from planners.sampling.draws import Draws
from planners.sampling.settings import FLAT, SamplingSettings, Space
from planners.sampling.ways import Bounds, Ways
from planners.sampling.ways3d import Ways3D

OFTEN = 256  # checks between two looks


def space_of(base: Any, space: Space, room: Bounds, settings: SamplingSettings) -> Any:
    """Return a space of OMPL's within a box."""
    axes = len(room) // 2
    if space in FLAT:
        made = base.RealVectorStateSpace(axes)
    elif space == "se2":
        made = base.SE2StateSpace()
        made.setSubspaceWeight(1, settings.yaw_weight)
    elif space == "dubins":
        made = base.DubinsStateSpace(settings.turning_radius)
    else:
        made = base.ReedsSheppStateSpace(settings.turning_radius)
    bounds = base.RealVectorBounds(axes)
    for axis in range(axes):
        bounds.setLow(axis, room[axis])
        bounds.setHigh(axis, room[axis + axes])
    made.setBounds(bounds)
    return made


def information_of(
    base: Any,
    space: Any,
    edge: Callable[..., bool],
    *,
    state: Callable[[Any], bool] | None = None,
    sampler: Callable[[Any], Any] | None = None,
) -> Any:
    """Return a space of OMPL's with our own checks of edges and states, and our own samples.

    Without a check of states, all are taken for clear.
    """
    information = base.SpaceInformation(space)
    all_valid = base.AllValidStateValidityChecker(information)
    information.setStateValidityChecker(all_valid if state is None else state)
    # The class is made here: one that outlives the search is reported as a leak at exit.
    motions = type("Motions", (base.MotionValidator,), {"checkMotion": edge})
    information.setMotionValidator(motions(information))
    if sampler is not None:
        information.setValidStateSamplerAllocator(sampler)
    information.setup()
    return information


def state_of(space: Any, pose: Pose, kind: Space) -> Any:
    """Return a state of OMPL's."""
    state = space.allocState()
    writer(kind)(state, pose)
    return state


def goal_of(base: Any, information: Any, goals: list[Any]) -> Any:
    """Return OMPL's goal of several states, each of which will do."""
    goal = base.GoalStates(information)
    for state in goals:
        goal.addState(state)
    return goal


def state_check(ways: Ways | Ways3D, look: Callable[[], None]) -> Callable[[Any], bool]:
    """Return what tells whether a state is clear, and looks around now and then."""
    is_clear, read, states = ways.is_clear, reader(ways.space), count(1)

    def check(state: Any) -> bool:
        if not next(states) % OFTEN:
            look()
        return is_clear(*2 * read(state))

    return check


def edge_check(
    ways: Ways | Ways3D, edges: Iterator[int], look: Callable[[], None]
) -> Callable[..., bool]:
    """Return a method that checks an edge and counts it, and looks around now and then.

    OMPL's third argument stays as it is.
    """
    is_clear = ways.is_clear

    def line(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if not next(edges) % OFTEN:
            look()
        return is_clear(a[0], a[1], b[0], b[1])

    def line_3d(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if not next(edges) % OFTEN:
            look()
        return is_clear(a[0], a[1], a[2], b[0], b[1], b[2])

    def poses(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if not next(edges) % OFTEN:
            look()
        return is_clear(a.getX(), a.getY(), a.getYaw(), b.getX(), b.getY(), b.getYaw())

    return {"r2": line, "r3": line_3d}.get(ways.space, poses)


def drawing(base: Any, draws: Draws, kind: Space) -> Callable[[Any], Any]:
    """Return what makes samplers of clear states."""
    read, write = reader(kind), writer(kind)

    def sample(_: Any, state: Any) -> bool:
        return _written(state, draws.anywhere())

    def sample_near(_: Any, state: Any, near: Any, distance: float) -> bool:
        return _written(state, draws.near(read(near), distance))

    def _written(state: Any, drawn: Pose | None) -> bool:
        if drawn is not None:
            write(state, drawn)
        return drawn is not None

    # The class is made here: one that outlives the search is reported as a leak at exit.
    methods = {"sample": sample, "sampleNear": sample_near}
    return type("Sampler", (base.ValidStateSampler,), methods)


def reader(space: Space) -> Callable[[Any], Pose]:
    """Return what turns a state of OMPL's into ours."""
    return {"r2": _read_place, "r3": _read_place_3d}.get(space, _read_pose)


def writer(space: Space) -> Callable[[Any, Pose], None]:
    """Return what sets a state of OMPL's to ours."""
    return _write_place if space in FLAT else _write_pose


def _read_place(state: Any) -> Pose:
    return state[0], state[1]


def _read_place_3d(state: Any) -> Pose:
    return state[0], state[1], state[2]


def _read_pose(state: Any) -> Pose:
    return state.getX(), state.getY(), state.getYaw()


def _write_place(state: Any, place: Pose) -> None:
    for axis, value in enumerate(place):
        state[axis] = value


def _write_pose(state: Any, pose: Pose) -> None:
    state.setXY(pose[0], pose[1])
    state.setYaw(pose[2])
