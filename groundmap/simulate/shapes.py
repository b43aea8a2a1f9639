"""The shapes of scenario files: box, polygon, wall, pole, table."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import as_floats, as_number, check_finite
from groundmap.errors import InputError
from groundmap.simulate.world import FARTHEST, Solid

POLE_SIDES = 12
LEG, SLAB = 0.06, 0.05  # [m], of a table


def box(x0: float, y0: float, x1: float, y1: float) -> shapely.Polygon:
    """Return an axis-aligned rectangle.

    Parameters
    ----------
    x0, y0, x1, y1 : float [m]
        Two opposite corners.

    Raises
    ------
    InputError
        Corners that do not differ in both coordinates.
    """
    corners = (as_number("box", value, "two opposite corners [m]") for value in (x0, y0, x1, y1))
    x0, y0, x1, y1 = corners
    if x0 == x1 or y0 == y1:
        raise InputError("box", "two opposite corners [m]", f"{(x0, y0, x1, y1)}")
    return shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))


def polygon(corners: npt.ArrayLike) -> shapely.Polygon:
    """Return a polygon from its corners, shape (n, 2) [m].

    Raises
    ------
    InputError
        Fewer than three corners, or coordinates that are not finite.
    """
    ring = as_floats("polygon", corners, (None, 2))
    check_finite("polygon", ring)
    if len(ring) < 3:
        raise InputError("polygon", "at least three corners [m]", str(len(ring)))
    return shapely.Polygon(ring)


def wall(points: npt.ArrayLike, *, thickness: float = 0.2) -> shapely.Polygon:
    """Return the outline of a wall.

    Parameters
    ----------
    points : array_like, shape (n, 2) [m]
        Its centre line.
    thickness : float, default 0.2 [m]

    Examples
    --------
    >>> wall([(0, 0), (5, 0), (5, 3)], thickness=0.2).bounds
    (0.0, -0.1, 5.1, 3.0)
    """
    corners = as_floats("wall", points, (None, 2))
    check_finite("wall", corners)
    farthest = np.abs(corners).max(initial=0.0)
    if farthest > FARTHEST:
        raise InputError("wall", f"corners within {FARTHEST:g} m", f"{farthest:g} m")
    if len(corners) < 2:
        raise InputError("wall", "at least two corners [m]", str(len(corners)))
    thickness = as_number("thickness", thickness, f"a number up to {FARTHEST:g} [m]")
    if thickness > FARTHEST:
        raise InputError("thickness", f"a number up to {FARTHEST:g} [m]", f"{thickness:g}")
    line = shapely.LineString(corners)
    outline: shapely.Polygon = line.buffer(
        thickness / 2.0, cap_style="flat", join_style="mitre", single_sided=False
    )
    return outline


def pole(x: float, y: float, *, radius: float = 0.06) -> shapely.Polygon:
    """Return a regular polygon of twelve corners.

    Parameters
    ----------
    x, y : float [m]
        Its centre.
    radius : float, default 0.06 [m]
        From the centre to the corners.
    """
    x, y = as_number("x", x, "a number [m]"), as_number("y", y, "a number [m]")
    radius = as_number("radius", radius, "a number [m]")
    turns = 2.0 * np.pi * np.arange(POLE_SIDES) / POLE_SIDES
    return shapely.Polygon(
        np.column_stack([x + radius * np.cos(turns), y + radius * np.sin(turns)])
    )


def table(
    x0: float, y0: float, x1: float, y1: float, *, height: float = 0.75, **options: Any
) -> tuple[Solid, ...]:
    """Return a table: a thin top on four legs, 0.15 m from its edges.

    Parameters
    ----------
    x0, y0, x1, y1 : float [m]
        Two opposite corners of its top.
    height : float, default 0.75 [m]
    **options
        Other parameters of the solids, such as ``texture``.
    """
    height = as_number("height", height, "a number [m]")
    top = box(x0, y0, x1, y1)
    xmin, ymin, xmax, ymax = top.bounds
    inset = 0.15 + LEG / 2.0
    legs = tuple(
        Solid(shapely.box(x - LEG / 2, y - LEG / 2, x + LEG / 2, y + LEG / 2),
              top=height - SLAB, **options)
        for x in (xmin + inset, xmax - inset)
        for y in (ymin + inset, ymax - inset)
    )  # fmt: skip
    return (Solid(top, bottom=height - SLAB, top=height, **options), *legs)
