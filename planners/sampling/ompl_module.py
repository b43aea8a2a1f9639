"""The only door to `ompl`, which the first question opens: its planners' names, its messages."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from planners.sampling.settings import FIXED, setter_of

LOG = logging.getLogger(__name__)


class Modules(NamedTuple):
    """OMPL."""

    base: Any
    geometric: Any
    util: Any


def ompl() -> Modules:
    """Return OMPL, loaded when first asked for."""
    from ompl import base, geometric, util

    return Modules(base, geometric, util)


@cache
def samplers() -> dict[str, str]:
    """Return the names of the planners that OMPL offers, and of their classes; none without it."""
    if find_spec("ompl") is None:
        return {}
    base, geometric, _ = ompl()
    classes = {name: getattr(geometric, name) for name in dir(geometric)}
    return {
        name.lower(): name
        for name, found in classes.items()
        if isinstance(found, type) and issubclass(found, base.Planner)
    }


def has_parameter(planner: str, name: str) -> bool:
    """Whether one of OMPL's planners has a parameter."""
    setters = getattr(ompl().geometric, samplers()[planner])
    return (planner, name) not in FIXED and hasattr(setters, setter_of(name))


@contextmanager
def redirect_log() -> Iterator[None]:
    """Keep OMPL's messages off the console; log them if anybody listens at level DEBUG."""
    util = ompl().util
    if not LOG.isEnabledFor(logging.DEBUG):
        util.noOutputHandler()
        try:
            yield
        finally:
            util.restorePreviousOutputHandler()
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "log"
        handler = util.OutputHandlerFile(str(file))  # OMPL holds no reference of its own
        util.useOutputHandler(handler)
        try:
            yield
        finally:
            util.restorePreviousOutputHandler()
            del handler  # closes the file
            for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
                LOG.debug("%s", line)
