"""Planners that sample, as engines: what is asked is checked before, and what OMPL brings after."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from groundmap.errors import SettingsError
from planners.costmap import Costmap
from planners.engine import Clock, Found, Pose, check_uniform
from planners.errors import ProblemError, TimeLimitError, UnsolvedError
from planners.sampling.door import has_parameter
from planners.sampling.run import EXACT, REASONS, THREADED, Outcome, Run
from planners.sampling.settings import SamplingSettings, Space, refusal
from planners.sampling.ways import Ways
from planners.wording import Place

_alone = threading.RLock()  # OMPL's random numbers and its log are global


class Sampler:
    """One of OMPL's planners on one costmap.

    Parameters
    ----------
    name : str
        As in `samplers`: the class's name in small letters.
    costmap : Costmap

    Raises
    ------
    ProblemError
        Cells that cost more than others.

    Notes
    -----
    In r2, waypoints are the corners of a line that the disc around the footprint keeps clear. In
    the other spaces they are poses as dense as the sweep between them was checked: half a cell
    apart at most. No route is the best one for sure; its `expanded` counts edges that were checked.

    Searches wait for each other, as OMPL's random numbers are global. With ``iterations``, a search
    repeats exactly, unless the time limit ends it; PRM and PRM* run threads, and never do.
    """

    def __init__(self, name: str, costmap: Costmap) -> None:
        check_uniform(name, costmap)
        self.name, self.costmap = name, costmap
        self._ways: dict[tuple[Space, float], Ways] = {}

    def search(self, start: Pose, goal: Pose, settings: SamplingSettings) -> Found | None:
        """Return a route from start to goal, or None if it is proved that there is none.

        None is also what a start or a goal gets where the footprint overlaps blocked cells.

        Raises
        ------
        ProblemError
            A space that the planner can't plan in, or a place that lacks a yaw there.
        SettingsError
            A parameter that the planner doesn't have.
        UnsolvedError
            The planner ended without reaching the goal.
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        space = settings.space_for(self.costmap.problem.shape, start, goal)
        self._check(space, settings)
        ways = self._ways_in(space, settings.turning_radius)
        ends = self._state(ways, "start", start), self._state(ways, "goal", goal)
        if not all(ways.is_clear(*end, *end) for end in ends):
            return None
        room = ways.room(*ends)
        if room is None:
            return None
        if ends[0] == ends[1]:
            return _found(ways, [*ends], start, goal, 0)
        with _turn(clock):
            found = Run(
                self.name, ways, room=room, ends=ends, settings=settings, clock=clock
            ).outcome()
        if found.status == EXACT:
            return _found(ways, found.states, start, goal, found.checked)
        raise self._unsolved(found, settings, clock)

    def _check(self, space: Space, settings: SamplingSettings) -> None:
        reason = refusal(self.name, space)
        if reason is not None:
            raise ProblemError("planner", f"one that works in {space!r}", self.name, hint=reason)
        if self.name in THREADED and settings.iterations is not None:
            reason = "It runs threads, which no count stops: use time_limit."
            raise SettingsError("iterations", f"none for {self.name!r}", "a count", hint=reason)
        for name in settings.parameters():
            if not has_parameter(self.name, name):
                raise SettingsError(name, f"a parameter that {self.name!r} has", "another's")

    def _ways_in(self, space: Space, turning_radius: float) -> Ways:
        key = space, turning_radius
        if key not in self._ways:
            self._ways[key] = Ways(self.costmap, *key)
        return self._ways[key]

    def _state(self, ways: Ways, place: Place, pose: Pose) -> Pose:
        if ways.space != "r2" and len(pose) != 3:
            expected = f"x, y [m] and yaw [rad] for {self.name} in {ways.space}"
            raise ProblemError(place, expected, str(pose))
        return ways.state_of(pose)

    def _unsolved(
        self, found: Outcome, settings: SamplingSettings, clock: Clock
    ) -> TimeLimitError | UnsolvedError:
        if clock.is_up and clock.time_limit is not None:
            return TimeLimitError(
                self.name, time_limit=clock.time_limit, expanded=found.checked, left=found.left
            )
        reason = REASONS.get(found.status, found.status)
        if settings.iterations is not None and found.status in ("TIMEOUT", "APPROXIMATE_SOLUTION"):
            reason = f"the goal was not reached in iterations = {settings.iterations}"
        return UnsolvedError(self.name, reason=reason, expanded=found.checked, left=found.left)


def _found(ways: Ways, states: Sequence[Pose], start: Pose, goal: Pose, checked: int) -> Found:
    """Return a path as a route on the map, with start and goal as they were given."""
    poses = ways.poses(states)
    if len(poses) == 1:
        poses = np.concatenate([poses, poses])
    poses[0, :2], poses[-1, :2] = start[:2], goal[:2]
    if ways.space == "r2":
        return Found(poses, checked, bound=None)
    headings = np.remainder(poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    headings[0], headings[-1] = start[2], goal[2]
    return Found(np.ascontiguousarray(poses[:, :2]), checked, headings, bound=None)


@contextmanager
def _turn(clock: Clock) -> Iterator[None]:
    """Wait until no other search runs, or time is up."""
    left = -1.0 if clock.time_limit is None else max(clock.time_limit - clock.seconds, 0.0)
    taken = _alone.acquire(timeout=left)
    try:
        clock.check(0)
        yield
    finally:
        if taken:
            _alone.release()
