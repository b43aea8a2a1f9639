"""The only module that imports `ompl`, on first use: its planners, their parameters, its log."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from planners.sampling.ompl_parameters import setter_of

LOG = logging.getLogger(__name__)
# Parameters that a planner inherits but that crash it.
CRASHING = {
    ("sorrtstar", name) for name in ("focus_search", "informed_sampling", "sample_rejection")
}


class Modules(NamedTuple):
    """OMPL's modules."""

    base: Any
    geometric: Any
    util: Any


def ompl() -> Modules:
    """Return OMPL's modules; the first call imports them."""
    from ompl import base, geometric, util

    return Modules(base, geometric, util)


@cache
def samplers() -> dict[str, str]:
    """Return the class names of OMPL's planners by planner name; empty without OMPL."""
    if find_spec("ompl") is None:
        return {}
    base, geometric, _ = ompl()
    classes = {name: getattr(geometric, name) for name in dir(geometric)}
    return {
        name.lower(): name
        for name, cls in classes.items()
        if isinstance(cls, type) and issubclass(cls, base.Planner)
    }


def has_parameter(planner: str, name: str) -> bool:
    """Whether a planner supports a parameter.

    Parameters
    ----------
    planner : str
        As in `samplers`.
    name : str
        As in `planners.sampling.ompl_parameters.PARAMETERS`.
    """
    planner_class = getattr(ompl().geometric, samplers()[planner])
    return (planner, name) not in CRASHING and hasattr(planner_class, setter_of(name))


@contextmanager
def redirect_log() -> Iterator[None]:
    """Suppress OMPL's messages; at level DEBUG, forward them to this module's logger."""
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
        handler = util.OutputHandlerFile(str(file))  # OMPL keeps no reference to it
        util.useOutputHandler(handler)
        try:
            yield
        finally:
            util.restorePreviousOutputHandler()
            del handler  # closes the file
            for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
                LOG.debug("%s", line)
