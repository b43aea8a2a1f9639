"""The interface of planners: an engine on a costmap, its settings, its result and its clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple, Protocol, TypeAlias

from pydantic import Field

from groundmap.arrays import Floats, is_number
from groundmap.settings import Settings
from planners.costmap.costmap import Costmap
from planners.errors import CancelledError, ProblemError, TimeLimitError
from planners.problem.problem import PlanningProblem, Pose
from planners.search.graph import Graph
from planners.search.kernels.compiling import compiled_for


class SearchSettings(Settings):
    """Settings that all planners share."""

    time_limit: float | None = Field(
        30.0,
        ge=0,
        description="time from the call to the answer, without compilation [s]; none: no limit",
    )

    def uses_headings(self, problem: PlanningProblem) -> bool:
        """Whether a planner that supports headings uses them with these settings."""
        return True

    @property
    def takes_other_goals(self) -> bool:
        """Whether a route may end at a place other than the problem's goal."""
        return False

    def accepts_end(self, end: Pose, goal: Pose, *, axes: int) -> bool:
        """Whether a route to a goal may end at a pose.

        Parameters
        ----------
        end, goal : tuple of float [m, map; rad]
        axes : int
            Number of axes of the map: 2 or 3.
        """
        return end == goal


class SearchResult(NamedTuple):
    """The route that a planner found, and facts about it."""

    waypoints: Floats  #: shape (n, 2) or (n, 3) [m, map], start and goal included
    expanded: int  #: number of expanded nodes
    headings: Floats | None = None  #: shape (n,) [rad], if the planner decides on them
    bound: float | None = 1.0  #: the cost is at most this factor times the least; None: unknown
    cost: float | None = None  #: length [m], weighted by the costs of cells; None: the length
    goal: Pose | None = None  #: where the route ends, if not at the problem's goal
    graph: Graph | None = None  #: the tree or roadmap of the search, if requested


class Improvement(NamedTuple):
    """A route that an anytime planner found, while the search continues."""

    cost: float  #: the planner's objective, such as the length [m] weighted by costs of cells
    bound: float  #: the cost is at most this factor times the least; infinite if unknown
    seconds: float  #: time since the search began [s]
    waypoints: Floats  #: shape (n, 2) [m, map], not audited; empty if OMPL does not provide them


OnImproved: TypeAlias = Callable[[Improvement], bool | None]  #: True ends the search


class Cancel(Protocol):
    """A flag with which another thread stops a search, such as a `threading.Event`."""

    def is_set(self) -> bool:
        """Whether the search is to stop."""
        ...


def check_cancel(cancel: Any) -> None:
    """Check that an object can cancel a search, unless it is None.

    Raises
    ------
    ProblemError
    """
    if cancel is not None and not callable(getattr(cancel, "is_set", None)):
        raise ProblemError("cancel", "a threading.Event", repr(cancel))


def check_limit(time_limit: Any) -> float | None:
    """Return a time limit [s], or None for no limit.

    Raises
    ------
    ProblemError
        The limit is neither None nor a number of 0 or more.
    """
    if time_limit is None:
        return None
    if not (is_number(time_limit) and time_limit >= 0):
        raise ProblemError("time_limit", "a number of 0 or more [s], or none", repr(time_limit))
    return float(time_limit)


class Engine(Protocol):
    """A planner on one costmap, for any number of queries, by one thread at a time."""

    def __init__(self, costmap: Costmap) -> None: ...

    @property
    def name(self) -> str:
        """Name of the planner, as in `planners.PLANNERS`."""
        ...

    def search(self, start: Pose, goal: Pose, settings: Any) -> SearchResult | None:
        """Return the best route between two places of the costmap, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float [m, map; rad]
        settings : SearchSettings
            Settings of the planner.

        Raises
        ------
        TimeLimitError
            The time limit is exceeded; with a limit of 0, always.
        """
        ...


_began: ContextVar[float | None] = ContextVar("_began", default=None)


def now() -> float:
    """Return the time [s] of a clock that stops while kernels are compiled."""
    return time.perf_counter() - compiled_for()


@contextmanager
def clock_from(began: float) -> Iterator[None]:
    """Make the next `Clock` of this thread begin at an earlier time.

    Parameters
    ----------
    began : float [s]
        A time that `now` returned.
    """
    token = _began.set(began)
    try:
        yield
    finally:
        _began.reset(token)


class Clock:
    """The clock of one search, which stops while kernels are compiled.

    Parameters
    ----------
    planner : str
        Name of the planner for exceptions.
    time_limit : float or None [s]
        Counted from the call, or from the time given to `clock_from`.
    cancel : Cancel, optional
        Once set, time is up as well.

    Examples
    --------
    >>> with clock_from(now() - 5.0):
    ...     first, second = Clock("astar", 1.0), Clock("astar", 1.0)
    >>> first.is_up, second.is_up
    (True, False)
    """

    def __init__(
        self, planner: str, time_limit: float | None, cancel: Cancel | None = None
    ) -> None:
        self.planner, self.time_limit, self.cancel = planner, time_limit, cancel
        began = _began.get()
        _began.set(None)  # a search within this one's callbacks has a limit of its own
        self.began = now() if began is None else began

    @property
    def seconds(self) -> float:
        """Seconds since the search began."""
        return now() - self.began

    @property
    def is_up(self) -> bool:
        """Whether the time limit is exceeded or the search is cancelled."""
        ran_out = self.time_limit is not None and self.seconds >= self.time_limit
        return ran_out or self.is_cancelled

    @property
    def is_cancelled(self) -> bool:
        """Whether the search is cancelled."""
        return self.cancel is not None and self.cancel.is_set()

    def check(self, expanded: int) -> None:
        """Raise an error if time is up.

        Parameters
        ----------
        expanded : int
            Number of expanded nodes, for the message.

        Raises
        ------
        TimeLimitError
            The time limit is exceeded.
        CancelledError
            The search is cancelled.
        """
        if self.is_cancelled:
            raise CancelledError(self.planner, seconds=self.seconds, expanded=expanded)
        if self.time_limit is not None and self.is_up:
            raise TimeLimitError(self.planner, time_limit=self.time_limit, expanded=expanded)
