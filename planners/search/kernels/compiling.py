"""The time that this process spent on compiling kernels or loading them from numba's cache."""

from __future__ import annotations

import threading
import time
from typing import Any

from numba.core import event


class _Stopwatch(event.Listener):
    """Measures the total time during which any thread compiles."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._total, self._since, self._active = 0.0, 0.0, 0

    @property
    def seconds(self) -> float:
        """Total so far [s]."""
        with self._lock:
            running = time.perf_counter() - self._since if self._active else 0.0
            return self._total + running

    def on_start(self, event: Any) -> None:
        """Start unless already running: compiling a kernel compiles the kernels that it calls."""
        with self._lock:
            if self._active == 0:
                self._since = time.perf_counter()
            self._active += 1

    def on_end(self, event: Any) -> None:
        """Stop with the outermost compilation."""
        with self._lock:
            self._active -= 1
            if self._active == 0:
                self._total += time.perf_counter() - self._since


_stopwatch = _Stopwatch()
_register: Any = event.register  # it has no annotations
_register("numba:compiler_lock", _stopwatch)


def compiled_for() -> float:
    """Return the time spent on compiling or loading kernels in this process [s].

    Examples
    --------
    >>> compiled_for() >= 0.0
    True
    """
    return _stopwatch.seconds
