"""The words of the exceptions: places, footprints, widths."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

Place: TypeAlias = Literal["start", "goal"]
Turning: TypeAlias = Literal["none", "anyhow", "heeded"]
Point: TypeAlias = tuple[float, ...]  #: x, y (on a 3-D map also z) [m, map]
MOST_DECIMALS = 9  # of a width [m]: what is nearer is the same, up to rounding


def widest_clause(
    widest: float, needed: float, at: Point | None, turning: Turning, *, slack: float
) -> str:
    """Return how wide the widest way is and what that means; nothing if it was not measured."""
    if math.isnan(widest):
        return ""
    if widest == 0:
        return "no way from start to goal exists, however narrow the footprint."
    has, needs = _apart(widest, needed)
    # The width is that along a lattice: near what is needed, a slanted way may be wide enough.
    about = "about " if widest < needed <= widest + slack else ""
    way = f"the widest way is {about}{has} m wide{'' if at is None else f' at {format_point(at)}'}"
    footprint = "your footprint, turned anyhow," if turning == "anyhow" else "your footprint"
    at_least = " at least" if turning == "heeded" else ""
    if widest < needed:
        return f"{way}, {footprint} needs {needs} m{at_least}."
    return (
        f"{way}, enough for what {footprint} needs, {needs} m, but not along cell centres: "
        "map with smaller cells, or plan with 'hybrid_astar'."
    )


def _apart(a: float, b: float) -> tuple[str, str]:
    """Return two numbers with as many decimals as tell them apart, mostly two."""
    for decimals in range(2, MOST_DECIMALS + 1):
        format_point = f"{a:.{decimals}f}", f"{b:.{decimals}f}"
        if format_point[0] != format_point[1]:
            return format_point
    return f"{a:.2f}", f"{b:.2f}"


def format_place(place: Place, xy: Point) -> str:
    """Return a place with its name, such as ``goal (1.00, 2.00)``."""
    return f"{place} {format_point(xy)}"


def format_point(xy: Point) -> str:
    """Return coordinates to the centimetre."""
    return f"({', '.join(f'{value:.2f}' for value in xy)})"


def footprint_clause(radius: float, yaw: float | None) -> str:
    """Return which footprint is meant: the disc, or the outline as it is turned."""
    if yaw is None:
        return f"the footprint (radius {radius:.2f} m)"
    return f"the footprint, turned by {yaw:.2f} rad,"


def left_clause(left: float | None) -> str:
    """Return how much of the way is left; nothing if that is not known."""
    return "" if left is None else f", {left:.2f} m left to the goal"


def nearest_clause(xy: Point, nearest: Point | None) -> str:
    """Return a sentence on where to go instead; nothing if there is nowhere."""
    if nearest is None:
        return ""
    away = math.dist(xy, nearest)
    return f" The nearest place for it is {format_point(nearest)}, {away:.2f} m away."
