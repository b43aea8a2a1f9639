"""Everything that planners raises on purpose.

::

    PlanningError
    ├── ProblemError (ValueError)    a problem that can't be posed: NaN, a negative footprint, ...
    ├── NoRouteError                 a well-posed problem without a route
    │   ├── OutsideMapError          start or goal lies beyond the map
    │   ├── NonFreeError             the footprint overlaps non-free space there
    │   ├── UnknownSpaceError        the footprint overlaps unknown or contested space there
    │   ├── EnclosedError            start or goal is fenced in
    │   ├── SmoothingError           clearance allows no turns as wide as asked for
    │   ├── TimeLimitError           time ran out before the search ended
    │   ├── CancelledError           the search was cancelled before there was a route
    │   └── UnsolvedError            a sampling planner ended without a route
    └── AuditError                   a planner's route that keeps not what was asked: a bug

The exceptions take facts, keep them as attributes, and compose one sentence from them. Settings
that don't exist or are out of range raise `groundmap.errors.SettingsError`, as everywhere.
"""

from __future__ import annotations

from groundmap.errors import FactualError, WrongValueError
from planners.error_messages import (
    Place,
    Point,
    Turning,
    footprint_clause,
    format_place,
    format_point,
    left_clause,
    nearest_clause,
    widest_clause,
)


class PlanningError(FactualError):
    """Base of every exception of this package."""


class ProblemError(PlanningError, WrongValueError):
    """A problem that can't be posed.

    Examples
    --------
    >>> print(ProblemError("footprint", "a radius of 0 or more [m]", "-0.5"))
    footprint: expected a radius of 0 or more [m], got -0.5.
    """


class NoRouteError(PlanningError):
    """A well-posed problem without a route; the subclasses say why."""


class OutsideMapError(NoRouteError):
    """Start or goal lies beyond the map.

    Examples
    --------
    >>> print(OutsideMapError("goal", (90.0, 4.0), bounds=(0.0, -9.75, 48.77, 9.75)))
    goal (90.00, 4.00): outside the map: expected a place on it, which spans x 0.00 to 48.77 m and \
y -9.75 to 9.75 m (box around the touched tiles); nothing was ever seen near it.
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
            f"which spans {', '.join(spans[:-1])} and {spans[-1]} (box around the touched tiles)"
            if bounds
            else "which is empty"
        )
        super().__init__(
            f"{format_place(place, xy)}: outside the map: expected a place on it, {extent}; "
            f"nothing was ever seen near it.{nearest_clause(xy, nearest)}"
        )


class NonFreeError(NoRouteError):
    """The footprint overlaps non-free space at the start or the goal.

    Examples
    --------
    >>> print(NonFreeError("goal", (12.3, 4.1), clearance=0.42, needed=0.9, nearest=(12.3, 4.7)))
    goal (12.30, 4.10): the footprint (radius 0.90 m) overlaps non-free space; clearance there is \
0.42 m. The nearest place for it is (12.30, 4.70), 0.60 m away.
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
            f"{format_place(place, xy)}: {footprint_clause(needed, yaw)} overlaps non-free space; "
            f"clearance there is {clearance:.2f} m.{nearest_clause(xy, nearest)}"
        )


class UnknownSpaceError(NoRouteError):
    """The footprint overlaps unknown or contested space at the start or the goal.

    Examples
    --------
    >>> print(UnknownSpaceError("start", (0.0, 0.0), clearance=0.25, needed=0.9))
    start (0.00, 0.00): the footprint (radius 0.90 m) overlaps unknown or contested space, which \
begins 0.25 m away. Map that place, or plan with unknown='allow' (--unknown allow).
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
            f"{format_place(place, xy)}: {footprint_clause(needed, yaw)} overlaps unknown or "
            f"contested space, which begins {clearance:.2f} m away. "
            "Map that place, or plan with unknown='allow' (--unknown allow)."
            f"{nearest_clause(xy, nearest)}"
        )


class EnclosedError(NoRouteError):
    """Start or goal is fenced in.

    Parameters
    ----------
    place : {"start", "goal"}
        Which of the two is fenced in: the one whose reachable area is smaller.
    area : float [m²; m³ on 3-D maps]
        Area of the cells whose centres the footprint's centre can reach from there.
    nearest : tuple of float [m, map]
        Of the places that can be reached from the start, the one nearest to the goal.
    distance : float [m]
        From there to the goal.
    widest_gap : float [m]
        Width of the widest way from start to goal, on the half-cell lattice; 0 if there is none.
        Not smaller than `needed` where the way only misses the cell centres. NaN on 3-D maps,
        where it is not measured.
    needed : float [m]
        Width of the footprint.
    bottleneck : tuple of float, optional [m, map]
        Where the widest way is narrowest; None if there is none.
    slack : float, default 0 [m]
        A way off the lattice may be wider by up to this.
    turning : {"none", "anyhow", "heeded"}
        What `needed` is the width of: a disc; the disc that holds an outline however it is
        turned; the disc within an outline, of planners that heed headings.

    Examples
    --------
    >>> print(EnclosedError("goal", area=12.3, nearest=(7.5, 2.0), distance=3.25,
    ...                     widest_gap=0.52, needed=0.6, bottleneck=(12.3, 4.1)))
    no route: the goal is fenced in: an enclosed area of 12.3 m² around it; the reachable cell \
nearest to the goal is (7.50, 2.00), 3.25 m away; the widest way is 0.52 m wide at (12.30, 4.10), \
your footprint needs 0.60 m.
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
    ) -> None:
        self.place, self.area, self.nearest, self.distance = place, area, nearest, distance
        self.widest_gap, self.needed, self.bottleneck = widest_gap, needed, bottleneck
        self.turning, self.slack = turning, slack
        if turning == "heeded" and (widest_gap + slack >= needed or needed == 0):
            super().__init__(
                "no route that can be driven was found, looking at one pose for each cell and "
                "heading: turn in smaller circles, leave it more room, or map with smaller cells."
            )
            return
        what = f"area of {area:.1f} m²" if len(nearest) == 2 else f"space of {area:.1f} m³"
        way = widest_clause(widest_gap, needed, bottleneck, turning, slack=slack)
        super().__init__(
            f"no route: the {place} is fenced in: an enclosed {what} around it; the reachable "
            f"cell nearest to the goal is {format_point(nearest)}, {distance:.2f} m away"
            f"{'; ' if way else '.'}{way}"
        )


class SmoothingError(NoRouteError):
    """There is a route, but none was found along it that turns as wide as was asked for.

    Parameters
    ----------
    xy : tuple of float [m, map]
        Where the line bends too much, or comes too near to what it must not touch.
    turning_radius : float [m]
        What was asked for.
    possible : float [m]
        The largest turning radius found to be possible along all of the line; 0 if none was.

    Examples
    --------
    >>> print(SmoothingError((3.0, 1.5), turning_radius=1.5, possible=0.8))
    smooth: the bend at (3.00, 1.50) can't be rounded with a turning radius of 1.50 m: clearance \
allows about 0.80 m. Ask for less, or for a planner that plans with turns.
    """

    def __init__(self, xy: Point, *, turning_radius: float, possible: float) -> None:
        self.xy, self.turning_radius, self.possible = xy, turning_radius, possible
        allows = f"about {possible:.2f} m" if possible > 0 else "none that was tried"
        super().__init__(
            f"smooth: the bend at ({xy[0]:.2f}, {xy[1]:.2f}) can't be rounded with a turning "
            f"radius of {turning_radius:.2f} m: clearance allows {allows}. "
            "Ask for less, or for a planner that plans with turns."
        )


class TimeLimitError(NoRouteError):
    """Time ran out before the search ended: a route may or may not exist.

    Parameters
    ----------
    planner : str
    time_limit : float [s]
    expanded : int
        How much was searched, in `unit`.
    unit : str, default "nodes expanded"
        Sampling planners count "edges checked".
    left : float, optional [m]
        What was left to the goal from the nearest place that a sampling planner reached.

    Examples
    --------
    >>> print(TimeLimitError("astar", time_limit=0.5, expanded=180000))
    astar: no route within time_limit = 0.5 s (180000 nodes expanded). Allow more time.
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
            f"({expanded} {unit}{left_clause(left)}). Allow more time."
        )


class CancelledError(NoRouteError):
    """The search was cancelled before there was a route.

    Parameters
    ----------
    planner : str
    seconds : float [s]
        Since the search began.
    expanded : int
        Nodes that were expanded; of sampling planners, edges that were checked.

    Examples
    --------
    >>> print(CancelledError("rrtstar", seconds=0.25, expanded=480))
    rrtstar: cancelled after 0.25 s, before there was a route (480 nodes expanded).
    """

    def __init__(self, planner: str, *, seconds: float, expanded: int) -> None:
        self.planner, self.seconds, self.expanded = planner, seconds, expanded
        super().__init__(
            f"{planner}: cancelled after {seconds:.2f} s, before there was a route "
            f"({expanded} nodes expanded)."
        )


class UnsolvedError(NoRouteError):
    """A sampling planner ended without a route: there may or may not be one.

    Parameters
    ----------
    planner : str
    reason : str
        Why it ended.
    expanded : int
        Edges that were checked.
    left : float, optional [m]
        What was left to the goal from the nearest place that was reached.

    Examples
    --------
    >>> print(UnsolvedError("rrt", reason="iterations = 500 are used up", expanded=480, left=3.2))
    rrt: no route found: iterations = 500 are used up (480 edges checked, 3.20 m left to the goal).
    """

    def __init__(
        self, planner: str, *, reason: str, expanded: int, left: float | None = None
    ) -> None:
        self.planner, self.reason, self.expanded, self.left = planner, reason, expanded, left
        super().__init__(
            f"{planner}: no route found: {reason} ({expanded} edges checked{left_clause(left)})."
        )


class AuditError(PlanningError):
    """A planner returned a route that keeps not what was asked; please report it.

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
