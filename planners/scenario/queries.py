"""The queries of a scenario file, their bounds, and the bounds in ``[bounds]``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from groundmap.errors import InputError, SettingsError
from groundmap.settings import Settings
from planners.errors import ProblemError
from planners.problem.footprint import Footprint
from planners.problem.problem import Unknown
from planners.registry import PLANNERS
from planners.scenario.outcome import REASON, Bound
from planners.scenario.patterns import check_pattern

OUTCOME = "route"  # outcome of a query without an error
# The key of a query that bounds each of its figures, as a hint for an error.
STATED_BY = {
    "outcome": "Set 'expect' of the query.",
    REASON: "Set 'reason' of the query.",
    "collisions": "The bound is always 0; set 'robot_radius' of the query for the size.",
    "ratio": "Omit 'max_ratio' of the query, or this bound.",
}


Expected = Literal[
    "route",
    "OutsideMapError",
    "NonFreeError",
    "KeepOutError",
    "UnknownSpaceError",
    "EnclosedError",
    "TimeLimitError",
    "UnsolvedError",
]


class QuerySettings(Settings):
    """A query, its expected outcome and its bounds."""

    name: str = Field(description="prefix of the names of its figures")
    start: tuple[float, ...] = Field(
        description="x, y, on a 3-D map z [m, map], and optionally yaw [rad]"
    )
    goal: tuple[float, ...] = Field(
        description="x, y, on a 3-D map z [m, map], and optionally yaw [rad]"
    )
    footprint: float | tuple[tuple[float, float], ...] = Field(
        description="footprint to plan with: a radius [m], or corners [m, base_link]"
    )
    robot_radius: float | None = Field(
        None,
        ge=0,
        description="radius that must not touch the true world [m]; default: the footprint's",
    )
    expect: Expected = Field("route", description="'route', or the name of the error")
    reason: str | None = Field(
        None, description="regular expression that matches in the error's message"
    )
    planner: str = Field("astar", description="name of the planner")
    unknown: Unknown = Field("avoid", description="unknown and contested space")
    recent: bool = Field(
        False, description="also avoid what the last views saw as non-free, as a live robot does"
    )
    time_limit: float | None = Field(
        None, ge=0, description="time limit [s]; default: that of the planner"
    )
    settings: dict[str, Any] = Field(
        default_factory=dict, description="settings of the planner, such as seed and iterations"
    )
    max_ratio: float | None = Field(
        None, ge=1, description="most length, divided by that of the best route in the true world"
    )

    @property
    def radius(self) -> float:
        """Radius of the disc around the footprint [m]."""
        return Footprint.of(self.footprint).radius


class BoundSettings(Settings):
    """A bound in ``[bounds]``."""

    min: float | None = Field(None, description="least value of the figure")
    max: float | None = Field(None, description="greatest value of the figure")


def check_query(query: QuerySettings) -> None:
    """Check planner, settings, footprint and reason of a query before the scenario runs."""
    if query.planner not in PLANNERS:
        known = ", ".join(sorted(PLANNERS))
        raise InputError("queries.planner", f"one of {known}", repr(query.planner))
    try:
        PLANNERS[query.planner].settings(**query.settings)
    except SettingsError as error:
        raise InputError(f"queries.settings.{error.name}", error.expected, error.got) from error
    try:
        Footprint.of(query.footprint)
    except ProblemError as error:
        raise InputError(f"queries.{error.name}", error.expected, error.got) from error
    if query.reason is not None and query.expect == "route":
        raise InputError("queries.reason", "none where a route is expected", repr(query.reason))
    check_pattern("queries.reason", query.reason or "")


def bounds_of(query: QuerySettings, *, known_world: bool) -> dict[str, Bound]:
    """Return the bounds of a query on its figures.

    Parameters
    ----------
    query : QuerySettings
    known_world : bool
        Whether the true world is known: a simulated one.
    """
    bounds = {"outcome": Bound(equals=query.expect)}
    if query.reason is not None:
        bounds[REASON] = Bound(matches=query.reason)
    if query.expect == OUTCOME and known_world:
        bounds["collisions"] = Bound(max=0)
    if query.max_ratio is not None:
        bounds["ratio"] = Bound(max=query.max_ratio)
    return bounds


def check_stated_once(
    query: QuerySettings, bounds: Mapping[str, Bound], *, known_world: bool
) -> None:
    """Check that ``[bounds]`` has no bound on a figure that the query bounds itself.

    Parameters
    ----------
    query : QuerySettings
    bounds : mapping of str to Bound
        Those of ``[bounds]``.
    known_world : bool
        Whether the true world is known: a simulated one.
    """
    for key, bound in bounds_of(query, known_world=known_world).items():
        name = f"{query.name}.{key}"
        if name in bounds:
            raise InputError(
                f"bounds.{name}",
                f"no bound, since the query has its own: {key} {bound}",
                str(bounds[name]),
                hint=STATED_BY[key],
            )


def bound_from(name: str, table: dict[str, Any]) -> Bound:
    """Return the bound of a table in ``[bounds]``.

    Parameters
    ----------
    name : str
        Name of the figure.
    table : dict
    """
    bound = BoundSettings(**table)
    if bound.min is None and bound.max is None:
        raise InputError(f"bounds.{name}", "min, max, or both", "neither")
    if bound.min is not None and bound.max is not None and bound.min > bound.max:
        got = f"{bound.min:g} and {bound.max:g}"
        raise InputError(f"bounds.{name}", "min not above max", got)
    return Bound(min=bound.min, max=bound.max)
