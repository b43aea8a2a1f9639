"""Searches with OMPL take turns: its random numbers and its log are global."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from planners.search.base import Cancel, Clock, now

PATIENCE = 0.1  # [s] between two looks at the clock, while another search runs
FAREWELL = 5.0  # [s] that the interpreter's end waits for a search
_alone = threading.RLock()
_leaving = threading.Event()


class Ending:
    """What ends a search: somebody's wish, or the interpreter's own end.

    A daemon thread that is ended within OMPL takes the process with it.

    Parameters
    ----------
    wish : Cancel, optional
    """

    def __init__(self, wish: Cancel | None) -> None:
        self.wish = wish

    def is_set(self) -> bool:
        """Whether the search is to end."""
        return _leaving.is_set() or (self.wish is not None and self.wish.is_set())


def _leave() -> None:
    """Let the search end that runs in a daemon thread, and none begin."""
    _leaving.set()
    _alone.acquire(timeout=FAREWELL)


atexit.register(_leave)


def _renew() -> None:
    """Take a new lock: a process that was forked off during a search has nobody who ends it."""
    global _alone  # noqa: PLW0603 (a lock is the process's own)
    _alone = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew)


@contextmanager
def turn(clock: Clock) -> Iterator[None]:
    """Wait until no other search runs; time that is waited doesn't count.

    Raises
    ------
    TimeLimitError, CancelledError
        Time was up before, or somebody wants no search any more.
    """
    alone, began = _alone, now()
    while not alone.acquire(timeout=PATIENCE):
        if clock.is_cancelled:
            clock.check(0)
    try:
        clock.began += now() - began
        clock.check(0)
        yield
    finally:
        alone.release()
