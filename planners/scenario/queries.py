"""The queries of a scenario's file, and the bounds that they and ``[bounds]`` state."""

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

OUTCOME = "route"  # what is expected where no error is
# Where a query states the bounds of its figures.
STATED_BY = {
    "outcome": "Set 'expect' of the query.",
    REASON: "Set 'reason' of the query.",
    "collisions": "A route never collides; 'robot_radius' of the query says with what.",
    "ratio": "Leave out 'max_ratio' of the query, or this bound.",
}


Expected = Literal[
    "route",
    "OutsideMapError",
    "NonFreeError",
    "UnknownSpaceError",
    "EnclosedError",
    "TimeLimitError",
    "UnsolvedError",
]


class QuerySettings(Settings):
    """A route to be asked for, and what is expected of it."""

    name: str = Field(description="what figures of it are called after")
    start: tuple[float, ...] = Field(description="x, y [m, map] and optionally yaw [rad]")
    goal: tuple[float, ...] = Field(description="x, y [m, map] and optionally yaw [rad]")
    footprint: float | tuple[tuple[float, float], ...] = Field(
        description="what to plan with: a radius [m], or the corners of an outline [m, base_link]"
    )
    robot_radius: float | None = Field(
        None, ge=0, description="what must not touch the true world; the footprint unless told [m]"
    )
    expect: Expected = Field("route", description="'route', or the name of the error")
    reason: str | None = Field(
        None, description="pattern that the error's sentence holds, as Python's re takes it"
    )
    planner: str = Field("astar", description="name of the planner")
    unknown: Unknown = Field("avoid", description="unknown and contested space")
    time_limit: float | None = Field(
        None, ge=0, description="time limit [s]; the planner's own unless told"
    )
    settings: dict[str, Any] = Field(
        default_factory=dict, description="of the planner, such as seed and iterations"
    )
    max_ratio: float | None = Field(
        None, ge=1, description="of the route's length to that of the best in the true world"
    )

    @property
    def radius(self) -> float:
        """Radius of the disc that holds the footprint at every heading [m]."""
        return Footprint.of(self.footprint).radius


class BoundSettings(Settings):
    """What a figure is held to."""

    min: float | None = Field(None, description="it is at least this")
    max: float | None = Field(None, description="it is at most this")


def check_query(query: QuerySettings) -> None:
    """Refuse what would only show when the query is asked, or never."""
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
    """Return what the figures of a query are held to by the query itself."""
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
    """Refuse a bound on a figure that the query holds, which would replace or be replaced."""
    for key, held in bounds_of(query, known_world=known_world).items():
        name = f"{query.name}.{key}"
        if name in bounds:
            raise InputError(
                f"bounds.{name}",
                f"no bound, since the query holds {key} {held} itself",
                str(bounds[name]),
                hint=STATED_BY[key],
            )


def bound_from(name: str, table: dict[str, Any]) -> Bound:
    """Return the bound of a table under ``[bounds]``."""
    bound = BoundSettings(**table)
    if bound.min is None and bound.max is None:
        raise InputError(f"bounds.{name}", "min, max, or both", "neither")
    if bound.min is not None and bound.max is not None and bound.min > bound.max:
        got = f"{bound.min:g} and {bound.max:g}"
        raise InputError(f"bounds.{name}", "min of at most max", got)
    return Bound(min=bound.min, max=bound.max)
