"""Pictures of routes, given as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Floats, as_floats, as_number, check_finite
from groundmap.draw.figure import LARGEST_BOX, add_to_legend
from groundmap.errors import InputError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

ROUTE, FOOTPRINT = "#c2185b", "#f06292"
MOST_STAMPS = 1000
STAMPS = 8.0  # [m] along a route between two outlines of the footprint
# Routes differ by colour and by dashes.
COLOURS = ("#c2185b", "#1565c0", "#ef6c00", "#2e7d32", "#6a1b9a", "#00838f", "#5d4037", "#37474f")
DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)))


def draw_route(
    waypoints: npt.ArrayLike,
    *,
    footprint: float | npt.ArrayLike,
    headings: npt.ArrayLike | None = None,
    ax: Axes,
) -> list[Artist]:
    """Draw a route and the footprint along it.

    Parameters
    ----------
    waypoints : array_like, shape (n, 2) [m, map]
    footprint : float or array_like, shape (m, 2)
        Radius [m], or the corners of an outline [m, base_link], which needs headings.
    headings : array_like, shape (n,), optional [rad, map]
    ax : matplotlib Axes
    """
    points = _points("waypoints", waypoints)
    artists: list[Artist] = []
    for patch in _footprints(points, footprint, headings):
        artists.append(ax.add_patch(patch))
    casing = ax.plot(*points.T, color="white", linewidth=4.0, zorder=4)[0]
    core = ax.plot(*points.T, color=ROUTE, linewidth=1.8, zorder=5, label="route")[0]
    ends = _draw_ends(points, ax)
    add_to_legend(ax, [core, *artists[:1]])
    return [*artists, casing, core, ends]


def draw_routes(routes: Mapping[str, npt.ArrayLike], *, ax: Axes) -> list[Artist]:
    """Draw several routes between the same places, with their names in the legend.

    Identical routes are drawn as one line with all their names.

    Parameters
    ----------
    routes : mapping of str to array_like, shape (n, 2) [m, map]
    ax : matplotlib Axes
    """
    lines: list[tuple[list[str], Floats]] = []
    for name, waypoints in routes.items():
        points = _points(f"waypoints of {name}", waypoints)
        same = next((names for names, line in lines if np.array_equal(line, points)), None)
        if same is None:
            lines.append(([name], points))
        else:
            same.append(name)
    artists: list[Artist] = []
    for number, (names, points) in enumerate(lines):
        line = ax.plot(*points.T, zorder=5, label=", ".join(names))[0]
        # Later lines are thinner, so that lines below them remain visible.
        line.set(
            color=COLOURS[number % len(COLOURS)],
            linestyle=DASHES[number // len(COLOURS) % len(DASHES)],
            linewidth=1.4 + 0.8 * (len(lines) - 1 - number),
        )
        artists.append(line)
    add_to_legend(ax, artists)
    return [*artists, _draw_ends(lines[0][1], ax)] if artists else []


def _draw_ends(points: Floats, ax: Axes) -> Artist:
    return ax.plot(
        *points[[0, -1]].T, "o", color="white", markeredgecolor=ROUTE, markersize=7, zorder=6
    )[0]


def _footprints(
    points: Floats, footprint: float | npt.ArrayLike, headings: npt.ArrayLike | None
) -> list[Patch]:
    """Return the swept area, then outlines of the footprint at intervals."""
    from matplotlib.patches import Circle, Polygon

    outlines: list[Patch] = []
    if isinstance(footprint, Real) or (isinstance(footprint, np.ndarray) and footprint.ndim == 0):
        expected = "a radius of 0 or more [m], or corners x, y [m, base_link]"
        given = footprint.item() if isinstance(footprint, np.ndarray) else footprint
        radius, line = as_number("footprint", given, expected, least=0.0), _line(points)
        if radius > LARGEST_BOX:
            raise InputError("footprint", f"a radius up to {LARGEST_BOX:g} m", f"{radius:g}")
        if radius == 0:
            return []
        along = np.linspace(0.0, line.length, _stamps(line.length))
        for centre in shapely.get_coordinates(shapely.line_interpolate_point(line, along)):
            outlines.append(Circle(centre.tolist(), radius, fill=False, zorder=4))
        swept = line.buffer(radius)
    else:
        corners = _points("footprint", footprint, least=3)
        placed = _place(corners, points, headings)
        outlines = [Polygon(placed[k], fill=False, zorder=4) for k in _select_stamps(points)]
        swept = shapely.union_all(shapely.polygons(placed))
    for outline in outlines:
        outline.set(edgecolor=ROUTE, linewidth=0.8)
    bands: list[Patch] = []
    for part in shapely.get_parts(swept):
        band = Polygon(shapely.get_coordinates(part.exterior), closed=True, zorder=2)
        band.set(facecolor=FOOTPRINT, alpha=0.22, edgecolor="none", label="swept footprint")
        bands.append(band)
    return [*bands, *outlines]


def _place(corners: Floats, points: Floats, headings: npt.ArrayLike | None) -> Floats:
    """Return the corners at every waypoint, shape (n, m, 2) [m, map]."""
    turns = np.zeros(len(points))
    if headings is not None:
        turns = as_floats("headings", headings, (len(points),))
        check_finite("headings", turns)
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = corners.T
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + points[:, None]


def _select_stamps(points: Floats) -> list[int]:
    """Return the indices of the waypoints at which an outline is drawn."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    stops = np.linspace(0.0, along[-1], _stamps(float(along[-1])))
    return [int(k) for k in np.unique(np.searchsorted(along, stops).clip(max=len(points) - 1))]


def _stamps(length: float) -> int:
    """Return the number of outlines of the footprint along a route of a given length [m]."""
    return 2 if length < STAMPS else min(int(length / STAMPS) + 1, MOST_STAMPS)


def _points(name: str, values: npt.ArrayLike, *, least: int = 1) -> Floats:
    """Return points, shape (n, 2) [m]: at least `least`, finite, and within `LARGEST_BOX`."""
    points = as_floats(name, values, (None, 2))
    check_finite(name, points)
    if len(points) < least:
        raise InputError(name, f"{least} or more points x, y [m]", str(len(points)))
    farthest = float(np.abs(points).max())
    if farthest > LARGEST_BOX:
        raise InputError(name, f"points within {LARGEST_BOX:g} m", f"{farthest:g} m")
    return points


def _line(points: Floats) -> shapely.LineString:
    return shapely.LineString(points if len(points) > 1 else np.repeat(points, 2, axis=0))
