"""OMPL's spaces and states, and what it calls back, without an import of it.

What is called back returns Python's own bool, and keeps no state: OMPL frees them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

from planners.problem.problem import Pose
from planners.sampling.motion_validator import Bounds, MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.settings import FLAT, SamplingSettings, StateSpace
from planners.sampling.state_sampler import StateSampler

OFTEN = 256  # calls between two looks, at most
SOON = 0.002  # [s] between two looks, about: a call takes microseconds, or milliseconds


class Glance:
    """Decides when to look around between calls from OMPL, however long each of them takes.

    Parameters
    ----------
    look : callable

    Attributes
    ----------
    due : int
        Number of the call, counted from 1, at which to look next.

    Examples
    --------
    >>> looks = []
    >>> glance = Glance(lambda: looks.append(None))
    >>> for call in range(1, 1001):
    ...     if call >= glance.due:
    ...         glance(call)
    >>> 4 <= len(looks) <= 1000
    True
    """

    __slots__ = ("due", "last", "look", "step")

    def __init__(self, look: Callable[[], None]) -> None:
        self.look, self.due, self.step = look, 1, 1
        self.last = time.perf_counter()

    def __call__(self, call: int) -> None:
        """Work out when to look next, and look."""
        before, self.last = self.last, time.perf_counter()
        hurried = self.last - before > SOON
        self.step = max(self.step // 4, 1) if hurried else min(2 * self.step, OFTEN)
        self.due = call + self.step
        self.look()


def space_of(base: Any, space: StateSpace, room: Bounds, settings: SamplingSettings) -> Any:
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
    allocator: Callable[[Any], Any] | None = None,
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
    if allocator is not None:
        information.setValidStateSamplerAllocator(allocator)
    information.setup()
    return information


def state_of(space: Any, pose: Pose, kind: StateSpace) -> Any:
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


def state_check(
    validator: MotionValidator | MotionValidator3D, look: Callable[[], None]
) -> Callable[[Any], bool]:
    """Return what tells whether a state is clear, and looks around now and then."""
    is_clear, read, states = validator.is_clear, reader(validator.space), count(1)
    glance = Glance(look)

    def check(state: Any) -> bool:
        if (call := next(states)) >= glance.due:
            glance(call)
        return is_clear(*2 * read(state))

    return check


def edge_check(
    validator: MotionValidator | MotionValidator3D, edges: Iterator[int], look: Callable[[], None]
) -> Callable[..., bool]:
    """Return a method that checks an edge and counts it, and looks around now and then.

    OMPL's third argument stays as it is.
    """
    is_clear, glance = validator.is_clear, Glance(look)

    def line(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= glance.due:
            glance(call)
        return is_clear(a[0], a[1], b[0], b[1])

    def line_3d(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= glance.due:
            glance(call)
        return is_clear(a[0], a[1], a[2], b[0], b[1], b[2])

    def poses(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= glance.due:
            glance(call)
        return is_clear(a.getX(), a.getY(), a.getYaw(), b.getX(), b.getY(), b.getYaw())

    return {"r2": line, "r3": line_3d}.get(validator.space, poses)


def drawing(base: Any, sampler: StateSampler, kind: StateSpace) -> Callable[[Any], Any]:
    """Return what makes samplers of clear states."""
    read, write = reader(kind), writer(kind)

    def sample(_: Any, state: Any) -> bool:
        return _write(state, sampler.anywhere())

    def sample_near(_: Any, state: Any, near: Any, distance: float) -> bool:
        return _write(state, sampler.near(read(near), distance))

    def _write(state: Any, drawn: Pose | None) -> bool:
        if drawn is not None:
            write(state, drawn)
        return drawn is not None

    # The class is made here: one that outlives the search is reported as a leak at exit.
    methods = {"sample": sample, "sampleNear": sample_near}
    return type("Sampler", (base.ValidStateSampler,), methods)


def reader(space: StateSpace) -> Callable[[Any], Pose]:
    """Return what turns a state of OMPL's into ours."""
    return {"r2": _read_place, "r3": _read_place_3d}.get(space, _read_pose)


def writer(space: StateSpace) -> Callable[[Any, Pose], None]:
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
