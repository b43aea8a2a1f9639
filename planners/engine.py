"""What every planner is: an engine on a costmap, its settings, and what it brings back."""

from __future__ import annotations

import time
from typing import Any, NamedTuple, Protocol

from pydantic import Field

from groundmap.arrays import Floats
from groundmap.settings import Settings
from planners.costmap import Costmap
from planners.errors import ProblemError, TimeLimitError
from planners.problem import PlanningProblem

SLICE = 100_000  # expansions between two looks at the clock: about 20 ms

Pose = tuple[float, ...]  #: x, y [m, map] and, where the planner heeds it, yaw [rad]


class SearchSettings(Settings):
    """What every planner can be told."""

    time_limit: float | None = Field(30.0, ge=0, description="search time [s]; none: no limit")

    def heeds_headings(self, problem: PlanningProblem) -> bool:
        """Whether a planner that knows headings heeds them, told this."""
        return True


class Found(NamedTuple):
    """What a planner brings back."""

    waypoints: Floats  #: shape (n, 2) [m, map], start and goal included
    expanded: int  #: nodes the search expanded
    headings: Floats | None = None  #: shape (n,) [rad], where the planner decides on them
    bound: float | None = 1.0  #: the cost is at most this many times the best; None: unbounded
    cost: float | None = None  #: the length [m], dearer metres counted more; None: the length


class Engine(Protocol):
    """A planner on one costmap: made once, asked as often as one likes, by a thread at a time."""

    def __init__(self, costmap: Costmap) -> None: ...

    @property
    def name(self) -> str:
        """Name of the planner, as in `planners.PLANNERS`."""
        ...

    def search(self, start: Pose, goal: Pose, settings: Any) -> Found | None:
        """Return the best route between two places of the costmap, or None if there is none.

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        ...


def check_uniform(planner: str, costmap: Costmap) -> None:
    """Check that every metre of a costmap costs the same.

    Raises
    ------
    ProblemError
        The planner needs that; the sentence names one that doesn't.
    """
    if not costmap.uniform:
        raise ProblemError(
            "planner",
            f"uniform costs, which {planner!r} needs",
            "cells that cost more than others",
            hint="Take 'astar', which heeds them.",
        )


class Clock:
    """The time that a search has left.

    Parameters
    ----------
    planner : str
        Name for the exception.
    time_limit : float or None [s]
    """

    def __init__(self, planner: str, time_limit: float | None) -> None:
        self.planner, self.time_limit = planner, time_limit
        self.began = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Seconds since the search began."""
        return time.perf_counter() - self.began

    @property
    def is_up(self) -> bool:
        """Whether time has run out."""
        return self.time_limit is not None and self.seconds >= self.time_limit

    def check(self, expanded: int) -> None:
        """Raise if time has run out.

        Raises
        ------
        TimeLimitError
        """
        if self.time_limit is not None and self.is_up:
            raise TimeLimitError(self.planner, time_limit=self.time_limit, expanded=expanded)
