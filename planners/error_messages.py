"""Parts of error messages: positions, footprints, passages."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, TypeAlias

Place: TypeAlias = Literal["start", "goal"]
Turning: TypeAlias = Literal["none", "any", "planned"]
Point: TypeAlias = tuple[float, ...]  #: x, y (on a 3-D map also z) [m, map]
SEPARATORS = {  # by the problem's field
    "keep_out": "the keep-out areas",
    "recent": "what the newest views saw as non-free",
}
MOST_DECIMALS = 9  # of a width [m]; smaller differences are rounding errors


def widest_clause(
    widest: float, needed: float, at: Point | None, turning: Turning, *, slack: float
) -> str:
    """Return a sentence that compares the widest passage with the footprint; "" if unmeasured.

    Parameters
    ----------
    widest : float [m]
        Width of the widest passage; 0 if there is none, NaN if it was not measured.
    needed : float [m]
        Width of the footprint.
    at : tuple of float, optional [m, map]
        Where the passage is narrowest.
    turning : {"none", "any", "planned"}
        What `needed` is the width of, see `planners.errors.EnclosedError`.
    slack : float [m]
        A passage off the lattice may be wider by up to this.
    """
    if math.isnan(widest):
        return ""
    if widest == 0:
        return " No passage connects start and goal, however narrow the footprint."
    has, needs = _apart(widest, needed)
    # The width is that along a lattice: a slanted passage may be wide enough if it nearly is.
    about = "about " if widest < needed <= widest + slack else ""
    where = "" if at is None else f" at {format_point(at)}"
    passage = f" The widest passage is {about}{has} m wide{where}"
    if widest < needed:
        least = "at least " if turning == "planned" else ""
        heading = " to fit at any heading" if turning == "any" else ""
        return f"{passage}; the footprint needs {least}{needs} m{heading}."
    return (
        f"{passage}, which is enough for the footprint ({needs} m), but it does not follow cell "
        "centres. Use a map with smaller cells, or plan with 'hybrid_astar'."
    )


def _apart(a: float, b: float) -> tuple[str, str]:
    """Return two numbers with as many decimals as distinguish them, at least two."""
    for decimals in range(2, MOST_DECIMALS + 1):
        texts = f"{a:.{decimals}f}", f"{b:.{decimals}f}"
        if texts[0] != texts[1]:
            return texts
    return f"{a:.2f}", f"{b:.2f}"


def format_place(place: Place, xy: Point) -> str:
    """Return a position with its name, such as ``goal (1.00, 2.00)``.

    Parameters
    ----------
    place : {"start", "goal"}
    xy : tuple of float [m, map]
    """
    return f"{place} {format_point(xy)}"


def format_point(xy: Point) -> str:
    """Return coordinates to the centimetre."""
    return f"({', '.join(f'{value:.2f}' for value in xy)})"


def footprint_clause(radius: float, yaw: float | None) -> str:
    """Return which footprint was checked: the disc, or the outline at a heading.

    Parameters
    ----------
    radius : float [m]
    yaw : float or None [rad]
    """
    return f"the footprint ({f'radius {radius:.2f} m' if yaw is None else f'at yaw {yaw:.2f} rad'})"


class WayOut(NamedTuple):
    """A way out of unknown space around a start."""

    place: Point  #: nearest position from which the goal can be reached [m, map]
    distance: float  #: from the start [m]
    clear_start_radius: float  #: from which on there is a route from the start [m]


def way_out_clause(way_out: WayOut | None) -> str:
    """Return sentences on unknown space around the start and what to do; "" if that is no cause."""
    if way_out is None:
        return ""
    radius = f"{way_out.clear_start_radius:.1f}"
    return (
        " The cause is unknown space around the start: a camera does not see the ground that it "
        f"starts on. Start from {format_point(way_out.place)}, {way_out.distance:.2f} m away, or, "
        f"if the ground around the start is free, give clear_start_radius={radius} "
        f"(--clear-start-radius {radius})."
    )


def left_clause(left: float | None) -> str:
    """Return the remaining distance to the goal [m] as a clause; "" if it is unknown."""
    return "" if left is None else f", {left:.2f} m from the goal"


def without_clause(without: tuple[str, ...]) -> str:
    """Return a sentence on what separates start and goal; "" if it is the map alone."""
    if not without:
        return ""
    what = " and ".join(SEPARATORS[name] for name in without)
    return f" Without {what} they are connected."


def nearest_clause(xy: Point, nearest: Point | None) -> str:
    """Return a sentence on the nearest position that fits; "" if there is none.

    Parameters
    ----------
    xy : tuple of float [m, map]
    nearest : tuple of float or None [m, map]
    """
    if nearest is None:
        return ""
    fit, away = format_point(nearest), math.dist(xy, nearest)
    return f" The nearest position where the footprint fits is {fit}, {away:.2f} m away."
