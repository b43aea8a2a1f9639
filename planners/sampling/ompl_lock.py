"""A lock that lets one search with OMPL run at a time: its random numbers and log are global."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from planners.search.base import Cancel, Clock, now

POLL_INTERVAL = 0.1  # [s] between checks for cancellation while another search runs
EXIT_TIMEOUT = 5.0  # [s] that interpreter shutdown waits for a search
_lock = threading.RLock()
_exiting = threading.Event()


class StopRequest:
    """User cancellation or interpreter shutdown.

    At shutdown, a daemon thread that is killed within OMPL would crash the process.

    Parameters
    ----------
    cancel : Cancel, optional
    """

    def __init__(self, cancel: Cancel | None) -> None:
        self.cancel = cancel

    def is_set(self) -> bool:
        """Whether the search has to end."""
        return _exiting.is_set() or (self.cancel is not None and self.cancel.is_set())


def _stop_at_exit() -> None:
    """Stop a search that runs in a daemon thread, and prevent others from starting."""
    _exiting.set()
    _lock.acquire(timeout=EXIT_TIMEOUT)


atexit.register(_stop_at_exit)


def _reset_after_fork() -> None:
    """Create a new lock: in a child process, no thread would release one held at the fork."""
    global _lock  # noqa: PLW0603 (each process has its own lock)
    _lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_reset_after_fork)


@contextmanager
def hold_ompl(clock: Clock) -> Iterator[None]:
    """Hold the lock; waiting for it does not count against the clock.

    Raises
    ------
    TimeLimitError, CancelledError
        The time was up or the search was cancelled before the lock was free.
    """
    lock, began = _lock, now()
    while not lock.acquire(timeout=POLL_INTERVAL):
        if clock.is_cancelled:
            clock.check(0)
    try:
        clock.began += now() - began
        clock.check(0)
        yield
    finally:
        lock.release()
