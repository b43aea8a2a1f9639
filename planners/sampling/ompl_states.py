"""OMPL's spaces, states and callbacks, without an import of OMPL.

Callbacks return Python's own bool, and keep no reference to a state: OMPL frees it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

from planners.problem.problem import Pose
from planners.sampling.motion_validator import Bounds, MotionValidator
from planners.sampling.settings import FLAT, SamplingSettings, StateSpace
from planners.sampling.state_sampler import StateSampler

MAX_CALLS = 256  # most calls between two polls
POLL_INTERVAL = 0.002  # [s] aimed at between two polls; a call takes microseconds to milliseconds


class PollSchedule:
    """Polls at about regular times while OMPL calls back, for calls of any duration.

    Parameters
    ----------
    poll : callable

    Attributes
    ----------
    due : int
        Number of the call, counted from 1, at which to poll next.

    Examples
    --------
    >>> polls = []
    >>> schedule = PollSchedule(lambda: polls.append(None))
    >>> for call in range(1, 1001):
    ...     if call >= schedule.due:
    ...         schedule(call)
    >>> 4 <= len(polls) <= 1000
    True
    """

    __slots__ = ("due", "last", "poll", "step")

    def __init__(self, poll: Callable[[], None]) -> None:
        self.poll, self.due, self.step = poll, 1, 1
        self.last = time.perf_counter()

    def __call__(self, call: int) -> None:
        """Schedule the next poll, and poll."""
        before, self.last = self.last, time.perf_counter()
        is_slow = self.last - before > POLL_INTERVAL
        self.step = max(self.step // 4, 1) if is_slow else min(2 * self.step, MAX_CALLS)
        self.due = call + self.step
        self.poll()


def space_of(base: Any, space: StateSpace, bounds: Bounds, settings: SamplingSettings) -> Any:
    """Return OMPL's state space within a box.

    Parameters
    ----------
    base : module
        OMPL's.
    space : {"r2", "se2", "dubins", "reeds_shepp", "r3"}
    bounds : tuple of float [m, corner]
        Low x, y (, z), high x, y (, z).
    settings : SamplingSettings
    """
    axes = len(bounds) // 2
    if space in FLAT:
        ompl_space = base.RealVectorStateSpace(axes)
    elif space == "se2":
        ompl_space = base.SE2StateSpace()
        ompl_space.setSubspaceWeight(1, settings.yaw_weight)
    elif space == "dubins":
        ompl_space = base.DubinsStateSpace(settings.turning_radius)
    else:
        ompl_space = base.ReedsSheppStateSpace(settings.turning_radius)
    ompl_bounds = base.RealVectorBounds(axes)
    for axis in range(axes):
        ompl_bounds.setLow(axis, bounds[axis])
        ompl_bounds.setHigh(axis, bounds[axis + axes])
    ompl_space.setBounds(ompl_bounds)
    return ompl_space


def information_of(
    base: Any,
    space: Any,
    edge: Callable[..., bool],
    *,
    state: Callable[[Any], bool] | None = None,
    allocator: Callable[[Any], Any] | None = None,
) -> Any:
    """Return OMPL's space information with callbacks for checks and samples.

    Parameters
    ----------
    base : module
        OMPL's.
    space : object
        OMPL's state space.
    edge : callable
        As of `edge_check`.
    state : callable, optional
        As of `state_check`; default: all states are valid.
    allocator : callable, optional
        As of `sampler_allocator`; default: OMPL's own sampler.
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
    """Return a state as OMPL's.

    Parameters
    ----------
    space : object
        OMPL's state space.
    pose : tuple of float
        A state [m, corner; rad].
    kind : {"r2", "se2", "dubins", "reeds_shepp", "r3"}
        Of the space.
    """
    state = space.allocState()
    writer(kind)(state, pose)
    return state


def goal_of(base: Any, information: Any, goals: list[Any]) -> Any:
    """Return OMPL's goal that any of several states satisfies.

    Parameters
    ----------
    base : module
        OMPL's.
    information : object
        OMPL's space information.
    goals : list of objects
        OMPL's states.
    """
    goal = base.GoalStates(information)
    for state in goals:
        goal.addState(state)
    return goal


def state_check(validator: MotionValidator, poll: Callable[[], None]) -> Callable[[Any], bool]:
    """Return a callback that checks whether a state is clear, and polls at intervals.

    Parameters
    ----------
    validator : MotionValidator
    poll : callable
        May raise to end the search.
    """
    is_clear, read, states = validator.is_clear, reader(validator.space), count(1)
    schedule = PollSchedule(poll)

    def check(state: Any) -> bool:
        if (call := next(states)) >= schedule.due:
            schedule(call)
        return is_clear(*2 * read(state))

    return check


def edge_check(
    validator: MotionValidator, edges: Iterator[int], poll: Callable[[], None]
) -> Callable[..., bool]:
    """Return a method that checks and counts an edge, and polls at intervals.

    The method does not set OMPL's optional third argument, the last valid state. Each kind of
    space has a method of its own, as unpacking a state by a call is measurably slower.

    Parameters
    ----------
    validator : MotionValidator
    edges : iterator of int
        Counts the edges from 1.
    poll : callable
        May raise to end the search.
    """
    is_clear, schedule = validator.is_clear, PollSchedule(poll)

    def line(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= schedule.due:
            schedule(call)
        return is_clear(a[0], a[1], b[0], b[1])

    def line_3d(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= schedule.due:
            schedule(call)
        return is_clear(a[0], a[1], a[2], b[0], b[1], b[2])

    def poses(_: Any, a: Any, b: Any, __: Any = None) -> bool:
        if (call := next(edges)) >= schedule.due:
            schedule(call)
        return is_clear(a.getX(), a.getY(), a.getYaw(), b.getX(), b.getY(), b.getYaw())

    return {"r2": line, "r3": line_3d}.get(validator.space, poses)


def sampler_allocator(base: Any, sampler: StateSampler, kind: StateSpace) -> Callable[[Any], Any]:
    """Return an allocator of OMPL's samplers of valid states.

    Parameters
    ----------
    base : module
        OMPL's.
    sampler : StateSampler
    kind : {"r2", "se2", "dubins", "reeds_shepp", "r3"}
        Of the space.
    """
    read, write = reader(kind), writer(kind)

    def sample(_: Any, state: Any) -> bool:
        return _write(state, sampler.sample())

    def sample_near(_: Any, state: Any, near: Any, distance: float) -> bool:
        return _write(state, sampler.sample_near(read(near), distance))

    def _write(state: Any, sampled: Pose | None) -> bool:
        if sampled is not None:
            write(state, sampled)
        return sampled is not None

    # The class is made here: one that outlives the search is reported as a leak at exit.
    methods = {"sample": sample, "sampleNear": sample_near}
    return type("Sampler", (base.ValidStateSampler,), methods)


def reader(space: StateSpace) -> Callable[[Any], Pose]:
    """Return a function that converts OMPL's state to a tuple."""
    return {"r2": _read_place, "r3": _read_place_3d}.get(space, _read_pose)


def writer(space: StateSpace) -> Callable[[Any, Pose], None]:
    """Return a function that sets OMPL's state to a tuple."""
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
