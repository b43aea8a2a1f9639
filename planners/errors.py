"""Exceptions of `planners`.

::

    PlanningError
    ├── ProblemError (ValueError)    an invalid problem: NaN, a negative footprint, ...
    ├── NoRouteError                 a valid problem without a route
    │   ├── OutsideMapError          start or goal lies outside the map
    │   ├── NonFreeError             the footprint overlaps non-free space there
    │   ├── KeepOutError             the footprint overlaps a keep-out area there
    │   ├── UnknownSpaceError        the footprint overlaps unknown or contested space there
    │   ├── EnclosedError            start and goal are not connected
    │   ├── SmoothingError           the clearance does not allow the turning radius
    │   ├── TimeLimitError           time ran out before the search ended
    │   ├── CancelledError           the search was cancelled before it found a route
    │   └── UnsolvedError            a sampling planner ended without a route
    └── AuditError                   a route that violates the problem: a bug in the planner

The exceptions take facts, keep them as attributes, and compose the message from them. Unknown
settings and settings out of range raise `groundmap.errors.SettingsError`.
"""

from __future__ import annotations

from groundmap.errors import FactualError, WrongValueError
from planners.error_messages import (
    Place,
    Point,
    Turning,
    WayOut,
    footprint_clause,
    format_place,
    format_point,
    left_clause,
    nearest_clause,
    way_out_clause,
    widest_clause,
    without_clause,
)


class PlanningError(FactualError):
    """Base of every exception of this package."""


class ProblemError(PlanningError, WrongValueError):
    """An invalid problem.

    Examples
    --------
    >>> print(ProblemError("footprint", "a radius of 0 or more [m]", "-0.5"))
    footprint: expected a radius of 0 or more [m], got -0.5.
    """


class NoRouteError(PlanningError):
    """A valid problem without a route; the subclass is the reason."""


class OutsideMapError(NoRouteError):
    """Start or goal lies outside the map.

    Parameters
    ----------
    place : {"start", "goal"}
    xy : tuple of float [m, map]
    bounds : tuple of float [m, map]
        Bounding box of the observed tiles, lower then upper corner; empty for an empty map.
    nearest : tuple of float, optional [m, map]
        Nearest position where the footprint fits.

    Examples
    --------
    >>> print(OutsideMapError("goal", (90.0, 4.0), bounds=(0.0, -9.75, 48.77, 9.75)))
    goal (90.00, 4.00) is outside the map: expected a point on an observed tile; the tiles span \
x 0.00 to 48.77 m and y -9.75 to 9.75 m.
    """

    def __init__(
        self,
        place: Place,
        xy: Point,
        *,
        bounds: tuple[float, ...],
        nearest: Point | None = None,
    ) -> None:
        self.place, self.xy, self.bounds, self.nearest = place, xy, bounds, nearest
        half = len(bounds) // 2
        spans = [
            f"{axis} {low:.2f} to {high:.2f} m"
            for axis, low, high in zip("xyz", bounds[:half], bounds[half:], strict=False)
        ]
        extent = (
            f"the tiles span {', '.join(spans[:-1])} and {spans[-1]}"
            if bounds
            else "the map has none"
        )
        super().__init__(
            f"{format_place(place, xy)} is outside the map: expected a point on an observed tile; "
            f"{extent}.{nearest_clause(xy, nearest)}"
        )


class NonFreeError(NoRouteError):
    """The footprint overlaps non-free space at the start or the goal.

    Parameters
    ----------
    place : {"start", "goal"}
    xy : tuple of float [m, map]
    clearance : float [m]
        Distance from there to the nearest non-free cell.
    needed : float [m]
        Radius of the footprint.
    nearest : tuple of float, optional [m, map]
        Nearest position where the footprint fits.
    yaw : float, optional [rad]
        Heading of a polygon footprint, if the planner plans headings.
    recent : bool, default False
        Whether only the newest views saw it as non-free, not the map.

    Examples
    --------
    >>> print(NonFreeError("goal", (12.3, 4.1), clearance=0.42, needed=0.9, nearest=(12.3, 4.7)))
    goal (12.30, 4.10): the footprint (radius 0.90 m) overlaps non-free space; the clearance there \
is 0.42 m. The nearest position where the footprint fits is (12.30, 4.70), 0.60 m away.
    """

    def __init__(
        self,
        place: Place,
        xy: Point,
        *,
        clearance: float,
        needed: float,
        nearest: Point | None = None,
        yaw: float | None = None,
        recent: bool = False,
    ) -> None:
        self.place, self.xy, self.clearance, self.needed = place, xy, clearance, needed
        self.nearest, self.yaw, self.recent = nearest, yaw, recent
        space = "space that the newest views saw as non-free" if recent else "non-free space"
        super().__init__(
            f"{format_place(place, xy)}: {footprint_clause(needed, yaw)} overlaps {space}; "
            f"the clearance there is {clearance:.2f} m.{nearest_clause(xy, nearest)}"
        )


class KeepOutError(NoRouteError):
    """The footprint overlaps a keep-out area at the start or the goal.

    Parameters
    ----------
    place : {"start", "goal"}
    xy : tuple of float [m, map]
    clearance : float [m]
        Distance from there to the nearest cell of such an area.
    needed : float [m]
        Radius of the footprint.
    nearest : tuple of float, optional [m, map]
        Nearest position where the footprint fits.
    yaw : float, optional [rad]
        Heading of a polygon footprint, if the planner plans headings.

    Examples
    --------
    >>> print(KeepOutError("goal", (12.3, 4.1), clearance=0.42, needed=0.9, nearest=(12.3, 4.7)))
    goal (12.30, 4.10): the footprint (radius 0.90 m) overlaps a keep-out area, which begins 0.42 \
m away. The nearest position where the footprint fits is (12.30, 4.70), 0.60 m away.
    """

    def __init__(
        self,
        place: Place,
        xy: Point,
        *,
        clearance: float,
        needed: float,
        nearest: Point | None = None,
        yaw: float | None = None,
    ) -> None:
        self.place, self.xy, self.clearance, self.needed = place, xy, clearance, needed
        self.nearest, self.yaw = nearest, yaw
        super().__init__(
            f"{format_place(place, xy)}: {footprint_clause(needed, yaw)} overlaps a keep-out area, "
            f"which begins {clearance:.2f} m away.{nearest_clause(xy, nearest)}"
        )


class UnknownSpaceError(NoRouteError):
    """The footprint overlaps unknown or contested space at the start or the goal.

    Parameters
    ----------
    place : {"start", "goal"}
    xy : tuple of float [m, map]
    clearance : float [m]
        Distance from there to the nearest unknown or contested cell.
    needed : float [m]
        Radius of the footprint.
    nearest : tuple of float, optional [m, map]
        Nearest position where the footprint fits.
    yaw : float, optional [rad]
        Heading of a polygon footprint, if the planner plans headings.
    way_out : WayOut, optional
        Where a route could start, if unknown space around the start is all that prevents one.

    Examples
    --------
    >>> print(UnknownSpaceError("start", (0.0, 0.0), clearance=0.25, needed=0.9))
    start (0.00, 0.00): the footprint (radius 0.90 m) overlaps unknown or contested space, which \
begins 0.25 m away. Map that area, or plan with unknown='allow' (--unknown allow).
    """

    def __init__(
        self,
        place: Place,
        xy: Point,
        *,
        clearance: float,
        needed: float,
        nearest: Point | None = None,
        yaw: float | None = None,
        way_out: WayOut | None = None,
    ) -> None:
        self.place, self.xy, self.clearance, self.needed = place, xy, clearance, needed
        self.nearest, self.yaw, self.way_out = nearest, yaw, way_out
        super().__init__(
            f"{format_place(place, xy)}: {footprint_clause(needed, yaw)} overlaps unknown or "
            f"contested space, which begins {clearance:.2f} m away. "
            "Map that area, or plan with unknown='allow' (--unknown allow)."
            f"{way_out_clause(way_out) or nearest_clause(xy, nearest)}"
        )


class EnclosedError(NoRouteError):
    """Start and goal are not connected: one of them is enclosed.

    Parameters
    ----------
    place : {"start", "goal"}
        The enclosed one: its reachable area is the smaller one.
    area : float [m²; m³ on 3-D maps]
        Area of the cells whose centres the footprint's centre can reach from there.
    nearest : tuple of float [m, map]
        The position reachable from the start that is nearest to the goal.
    distance : float [m]
        From there to the goal.
    widest_gap : float [m]
        Width of the widest passage from start to goal on the half-cell lattice; 0 if there is
        none. It may exceed `needed` where the passage misses the cell centres. NaN on 3-D maps,
        where it is not measured.
    needed : float [m]
        Width of the footprint.
    bottleneck : tuple of float, optional [m, map]
        Where the widest passage is narrowest; None if there is no passage.
    slack : float, default 0 [m]
        A passage off the lattice may be wider by up to this.
    turning : {"none", "any", "planned"}
        What `needed` is the width of: a disc; the disc that holds an outline at any heading; the
        disc within an outline, for planners that plan headings.
    way_out : WayOut, optional
        Where a route could start, if unknown space around the start is all that prevents one.
    without : tuple of str, default ()
        What would have to be left out to connect them: "keep_out", "recent", or both.

    Examples
    --------
    >>> print(EnclosedError("goal", area=12.3, nearest=(7.5, 2.0), distance=3.25,
    ...                     widest_gap=0.52, needed=0.6, bottleneck=(12.3, 4.1)))
    no route: the goal is enclosed in an area of 12.3 m²; the reachable cell nearest to the goal \
is (7.50, 2.00), 3.25 m away. The widest passage is 0.52 m wide at (12.30, 4.10); the footprint \
needs 0.60 m.
    """

    def __init__(
        self,
        place: Place,
        *,
        area: float,
        nearest: Point,
        distance: float,
        widest_gap: float,
        needed: float,
        bottleneck: Point | None = None,
        slack: float = 0.0,
        turning: Turning = "none",
        way_out: WayOut | None = None,
        without: tuple[str, ...] = (),
    ) -> None:
        self.without = without
        self.place, self.area, self.nearest, self.distance = place, area, nearest, distance
        self.widest_gap, self.needed, self.bottleneck = widest_gap, needed, bottleneck
        self.turning, self.slack, self.way_out = turning, slack, way_out
        if turning == "planned" and (widest_gap + slack >= needed or needed == 0):
            super().__init__(
                "no route: a search over one pose per cell and heading found no drivable motion. "
                "Use a smaller turning radius, a smaller footprint, or a map with smaller cells."
                f"{without_clause(without)}"
            )
            return
        extent = f"an area of {area:.1f} m²" if len(nearest) == 2 else f"a space of {area:.1f} m³"
        passage = widest_clause(widest_gap, needed, bottleneck, turning, slack=slack)
        super().__init__(
            f"no route: the {place} is enclosed in {extent}; the reachable cell nearest to the "
            f"goal is {format_point(nearest)}, {distance:.2f} m away.{passage}"
            f"{way_out_clause(way_out)}"
            f"{without_clause(without)}"
        )


class SmoothingError(NoRouteError):
    """A route could not be rounded with the requested turning radius.

    Parameters
    ----------
    xy : tuple of float [m, map]
        Where the line bends too much or comes too close to an obstacle.
    turning_radius : float [m]
        The requested one.
    possible : float [m]
        The largest turning radius found for the whole line; 0 if none was found.

    Examples
    --------
    >>> print(SmoothingError((3.0, 1.5), turning_radius=1.5, possible=0.8))
    smooth: the bend at (3.00, 1.50) can't be rounded with a turning radius of 1.50 m: the \
clearance allows about 0.80 m. Use a smaller turning radius, or a planner that plans curves.
    """

    def __init__(self, xy: Point, *, turning_radius: float, possible: float) -> None:
        self.xy, self.turning_radius, self.possible = xy, turning_radius, possible
        allows = f"about {possible:.2f} m" if possible > 0 else "none of the radii tried"
        super().__init__(
            f"smooth: the bend at {format_point(xy)} can't be rounded with a turning radius of "
            f"{turning_radius:.2f} m: the clearance allows {allows}. "
            "Use a smaller turning radius, or a planner that plans curves."
        )


class TimeLimitError(NoRouteError):
    """Time ran out before the search ended: a route may or may not exist.

    Parameters
    ----------
    planner : str
    time_limit : float [s]
    expanded : int
        Effort of the search, in `unit`.
    unit : str, default "nodes expanded"
        Sampling planners count "edges checked".
    left : float, optional [m]
        Distance to the goal from the nearest position that a sampling planner reached.

    Examples
    --------
    >>> print(TimeLimitError("astar", time_limit=0.5, expanded=180000))
    astar: no route within time_limit = 0.5 s (180000 nodes expanded). Increase the limit.
    """

    def __init__(
        self,
        planner: str,
        *,
        time_limit: float,
        expanded: int,
        unit: str = "nodes expanded",
        left: float | None = None,
    ) -> None:
        self.planner, self.time_limit, self.expanded = planner, time_limit, expanded
        self.unit, self.left = unit, left
        super().__init__(
            f"{planner}: no route within time_limit = {time_limit:g} s "
            f"({expanded} {unit}{left_clause(left)}). Increase the limit."
        )


class CancelledError(NoRouteError):
    """The search was cancelled before it found a route.

    Parameters
    ----------
    planner : str
    seconds : float [s]
        Since the search began.
    expanded : int
        Effort of the search, in `unit`.
    unit : str, default "nodes expanded"
        Sampling planners count "edges checked".

    Examples
    --------
    >>> print(CancelledError("rrtstar", seconds=0.25, expanded=480, unit="edges checked"))
    rrtstar: cancelled after 0.25 s, before a route was found (480 edges checked).
    """

    def __init__(
        self, planner: str, *, seconds: float, expanded: int, unit: str = "nodes expanded"
    ) -> None:
        self.planner, self.seconds = planner, seconds
        self.expanded, self.unit = expanded, unit
        super().__init__(
            f"{planner}: cancelled after {seconds:.2f} s, before a route was found "
            f"({expanded} {unit})."
        )


class UnsolvedError(NoRouteError):
    """A sampling planner ended without a route; one may or may not exist.

    Parameters
    ----------
    planner : str
    reason : str
        Why it ended.
    expanded : int
        Checked edges.
    left : float, optional [m]
        Distance to the goal from the nearest position that it reached.

    Examples
    --------
    >>> print(UnsolvedError("rrt", reason="iterations = 500 are used up", expanded=480, left=3.2))
    rrt: no route found: iterations = 500 are used up (480 edges checked, 3.20 m from the goal).
    """

    def __init__(
        self, planner: str, *, reason: str, expanded: int, left: float | None = None
    ) -> None:
        self.planner, self.reason, self.expanded, self.left = planner, reason, expanded, left
        super().__init__(
            f"{planner}: no route found: {reason} ({expanded} edges checked{left_clause(left)})."
        )


class AuditError(PlanningError):
    """A planner returned a route that violates the requested clearance or endpoints: a bug.

    Parameters
    ----------
    fault : str
        What is wrong with the route, as a predicate.
    xy : tuple of float [m, map]
        Where.
    got, needed : float
        Measured and required value.
    unit : str, default "m"
        Unit of both.

    Examples
    --------
    >>> print(AuditError("comes too close to a non-free cell", (3.0, 1.5), got=0.31, needed=0.9))
    audit: the route comes too close to a non-free cell at (3.00, 1.50): expected 0.9 m, got 0.31 m.
    """

    def __init__(
        self, fault: str, xy: Point, *, got: float, needed: float, unit: str = "m"
    ) -> None:
        self.fault, self.xy, self.got, self.needed, self.unit = fault, xy, got, needed, unit
        super().__init__(
            f"audit: the route {fault} at {format_point(xy)}: "
            f"expected {needed:.9g} {unit}, got {got:.9g} {unit}."
        )
