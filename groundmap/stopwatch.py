"""Where the time goes: seconds by stage, each second counted once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")


class Stopwatch:
    """A stopwatch with named laps; a stage inside another one stops the outer one's clock.

    Parameters
    ----------
    outside : str, optional
        Stage that takes the time outside of all others; it is not counted unless told.

    Examples
    --------
    >>> stages = Stopwatch()
    >>> with stages.measure("read"):
    ...     with stages.measure("parse"):
    ...         pass
    >>> sorted(stages.seconds)
    ['parse', 'read']
    """

    def __init__(self, *, outside: str | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self._running: list[str | None] = [outside]
        self._since = perf_counter()

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Count the time inside to a stage."""
        self._lap()
        self._running.append(stage)
        try:
            yield
        finally:
            self._lap()
            self._running.pop()

    def each(self, stage: str, items: Iterable[T]) -> Iterator[T]:
        """Yield `items`, counting the time that making each of them takes to a stage."""
        source = iter(items)
        while True:
            with self.measure(stage):
                try:
                    item = next(source)
                except StopIteration:
                    return
            yield item

    def stop(self) -> dict[str, float]:
        """Return the seconds by stage so far."""
        self._lap()
        return dict(self.seconds)

    def _lap(self) -> None:
        now = perf_counter()
        stage = self._running[-1]
        if stage is not None:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._since
        self._since = now
