"""Computation time by stage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeVar

T = TypeVar("T")


class Stopwatch:
    """A stopwatch for named stages; a stage within another one pauses the outer one.

    Parameters
    ----------
    outside : str, optional
        Stage for the time outside all others; default: this time is not counted.

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
        """Return a context whose time is added to a stage."""
        self._lap()
        self._running.append(stage)
        try:
            yield
        finally:
            self._lap()
            self._running.pop()

    def each(self, stage: str, items: Iterable[T]) -> Iterator[T]:
        """Yield items, and add the time that the iterator takes for each of them to a stage.

        Parameters
        ----------
        stage : str
        items : iterable
        """
        source = iter(items)
        while True:
            with self.measure(stage):
                try:
                    item = next(source)
                except StopIteration:
                    return
            yield item

    def stop(self) -> dict[str, float]:
        """Return the seconds by stage until now."""
        self._lap()
        return dict(self.seconds)

    def _lap(self) -> None:
        now = perf_counter()
        stage = self._running[-1]
        if stage is not None:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._since
        self._since = now
