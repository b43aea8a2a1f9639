"""Targets that call the public API with odd values."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path

from fuzz.case import Target
from fuzz.draw import Draw

Body = Callable[[Draw, Path], None]


class Call(Target):
    """A function that draws arguments and calls the API with them.

    Parameters
    ----------
    name : str
    body : callable
        Called with the case's random choices and an empty folder.
    weight : float
    warm : callable, optional
        Compiles and loads what the cases need.
    may_fail_on_disk : bool
        Whether OSError is documented, because files are written.
    """

    def __init__(
        self,
        name: str,
        body: Body,
        *,
        weight: float = 1.0,
        warm: Callable[[], object] | None = None,
        may_fail_on_disk: bool = False,
    ) -> None:
        super().__init__(name, weight)
        self._body, self._warm = body, warm
        self._allowed: tuple[type[Exception], ...] = (OSError,) if may_fail_on_disk else ()

    def warm_up(self, folder: Path) -> None:
        """Compile and load what the cases need."""
        if self._warm is not None:
            self._warm()
        super().warm_up(folder)

    def run(self, draw: Draw, folder: Path) -> None:
        """Call it."""
        with contextlib.suppress(*self._allowed):
            self._body(draw, folder)
