"""Searches with OMPL take turns: its random numbers and its log are global."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from planners.engine import Clock

PATIENCE = 0.1  # [s] between two looks at the clock, while another search runs
_alone = threading.RLock()


@contextmanager
def turn(clock: Clock) -> Iterator[None]:
    """Wait until no other search runs, or time is up.

    Raises
    ------
    TimeLimitError, CancelledError
    """
    while not _alone.acquire(timeout=PATIENCE):
        clock.check(0)
    try:
        clock.check(0)
        yield
    finally:
        _alone.release()
