"""What every planner is: an engine on a costmap, its settings, and what it brings back."""

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

SLICE = 100_000  # expansions between two looks at the clock: about 20 ms


class SearchSettings(Settings):
    """What every planner can be told."""

    time_limit: float | None = Field(
        30.0,
        ge=0,
        description="time from the call to the answer, but for compilation [s]; none: no limit",
    )

    def heeds_headings(self, problem: PlanningProblem) -> bool:
        """Whether a planner that knows headings heeds them, told this."""
        return True

    @property
    def takes_other_goals(self) -> bool:
        """Whether a route may end elsewhere than at the problem's goal."""
        return False

    def will_do(self, end: Pose, goal: Pose, *, axes: int) -> bool:
        """Whether a route to a goal may end in a pose, on a map of two axes or three."""
        return end == goal


class SearchResult(NamedTuple):
    """What a planner brings back."""

    waypoints: Floats  #: shape (n, 2) [m, map], start and goal included
    expanded: int  #: nodes the search expanded
    headings: Floats | None = None  #: shape (n,) [rad], where the planner decides on them
    bound: float | None = 1.0  #: the cost is at most this many times the best; None: unbounded
    cost: float | None = None  #: the length [m], dearer metres counted more; None: the length
    goal: Pose | None = None  #: where it ends, if that is not the problem's goal
    graph: Graph | None = None  #: the tree or roadmap it was found in, if that was to be kept


class Improvement(NamedTuple):
    """A route, and what is known of it when it is found, while the search goes on."""

    cost: float  #: what the planner minimises: the length [m], dearer metres counted more
    bound: float  #: the cost is at most this many times the least; infinite if nobody knows
    seconds: float  #: since the search began [s]
    waypoints: Floats  #: shape (n, 2) [m, map], not audited; none while OMPL doesn't tell


OnImproved: TypeAlias = Callable[[Improvement], bool | None]  #: True: that will do


class Cancel(Protocol):
    """What another thread stops a search with: `threading.Event`, or what looks like one."""

    def is_set(self) -> bool:
        """Whether the search is to end."""
        ...


def check_cancel(cancel: Any) -> None:
    """Check that a search can be stopped with what is given for that, if anything is.

    Raises
    ------
    ProblemError
    """
    if cancel is not None and not callable(getattr(cancel, "is_set", None)):
        raise ProblemError("cancel", "a threading.Event", repr(cancel))


def check_limit(time_limit: Any) -> float | None:
    """Return a time limit [s] that is given outside of settings, or None for no limit.

    Raises
    ------
    ProblemError
        Not a number of 0 or more.
    """
    if time_limit is None:
        return None
    if not (is_number(time_limit) and time_limit >= 0):
        raise ProblemError("time_limit", "a number of 0 or more [s], or none", repr(time_limit))
    return float(time_limit)


class Engine(Protocol):
    """A planner on one costmap: made once, asked as often as one likes, by a thread at a time."""

    def __init__(self, costmap: Costmap) -> None: ...

    @property
    def name(self) -> str:
        """Name of the planner, as in `planners.PLANNERS`."""
        ...

    def search(self, start: Pose, goal: Pose, settings: Any) -> SearchResult | None:
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


_began: ContextVar[float | None] = ContextVar("_began", default=None)


def now() -> float:
    """Return a time [s], to compare with others: it stands still while kernels are compiled."""
    return time.perf_counter() - compiled_for()


@contextmanager
def clock_from(began: float) -> Iterator[None]:
    """Let the next `Clock` in this thread begin at a time before it is made.

    Parameters
    ----------
    began : float [s]
        By `now`.
    """
    token = _began.set(began)
    try:
        yield
    finally:
        _began.reset(token)


class Clock:
    """The time that a search has left.

    It stands still while kernels are compiled.

    Parameters
    ----------
    planner : str
        Name for the exception.
    time_limit : float or None [s]
        From now, or from the time that `clock_from` was given.
    cancel : Cancel, optional
        Once it is set, time is up, too.

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
        _began.set(None)  # a search that this one's callbacks make has a limit of its own
        self.began = now() if began is None else began

    @property
    def seconds(self) -> float:
        """Seconds since the search began."""
        return now() - self.began

    @property
    def is_up(self) -> bool:
        """Whether time has run out, or somebody wants the search to end."""
        ran_out = self.time_limit is not None and self.seconds >= self.time_limit
        return ran_out or self.is_cancelled

    @property
    def is_cancelled(self) -> bool:
        """Whether somebody wants the search to end."""
        return self.cancel is not None and self.cancel.is_set()

    def check(self, expanded: int) -> None:
        """Raise if time has run out.

        Raises
        ------
        TimeLimitError
        CancelledError
            Somebody wanted the search to end.
        """
        if self.is_cancelled:
            raise CancelledError(self.planner, seconds=self.seconds, expanded=expanded)
        if self.time_limit is not None and self.is_up:
            raise TimeLimitError(self.planner, time_limit=self.time_limit, expanded=expanded)
