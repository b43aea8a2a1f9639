"""Pictures of routes, given as plain arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Floats, as_floats
from groundmap.draw.figure import add_to_legend

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

ROUTE, FOOTPRINT = "#c2185b", "#f06292"
STAMPS = 8.0  # [m] of route between two outlines of the footprint
# Told apart by colour and by dash, however many there are and whoever looks.
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
    points = as_floats("waypoints", waypoints, (None, 2))
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

    Routes that are the same to the last bit are one line, with all their names.

    Parameters
    ----------
    routes : mapping of str to array_like, shape (n, 2) [m, map]
    ax : matplotlib Axes
    """
    lines: list[tuple[list[str], Floats]] = []
    for name, waypoints in routes.items():
        points = as_floats("waypoints", waypoints, (None, 2))
        same = next((names for names, line in lines if np.array_equal(line, points)), None)
        if same is None:
            lines.append(([name], points))
        else:
            same.append(name)
    artists: list[Artist] = []
    for number, (names, points) in enumerate(lines):
        line = ax.plot(*points.T, zorder=5, label=", ".join(names))[0]
        # The later, the thinner: what runs along another line still shows.
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
    """Return the swept band first, and outlines of the footprint now and then."""
    from matplotlib.patches import Circle, Polygon

    outlines: list[Patch] = []
    if np.ndim(footprint) == 0:
        radius, line = float(np.asarray(footprint)), _line(points)
        if radius == 0:
            return []
        along = np.linspace(0.0, line.length, max(2, int(line.length / STAMPS) + 1))
        for centre in shapely.get_coordinates(shapely.line_interpolate_point(line, along)):
            outlines.append(Circle(centre.tolist(), radius, fill=False, zorder=4))
        swept = line.buffer(radius)
    else:
        corners = as_floats("footprint", footprint, (None, 2))
        placed = _placed(corners, points, headings)
        outlines = [Polygon(placed[k], fill=False, zorder=4) for k in _stamped(points)]
        swept = shapely.union_all(shapely.polygons(placed))
    for outline in outlines:
        outline.set(edgecolor=ROUTE, linewidth=0.8)
    bands: list[Patch] = []
    for part in shapely.get_parts(swept):
        band = Polygon(shapely.get_coordinates(part.exterior), closed=True, zorder=2)
        band.set(facecolor=FOOTPRINT, alpha=0.22, edgecolor="none", label="swept footprint")
        bands.append(band)
    return [*bands, *outlines]


def _placed(corners: Floats, points: Floats, headings: npt.ArrayLike | None) -> Floats:
    """Return the corners at every waypoint, shape (n, m, 2) [m, map]."""
    turns = as_floats("headings", np.zeros(len(points)) if headings is None else headings, (None,))
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = corners.T
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1) + points[:, None]


def _stamped(points: Floats) -> list[int]:
    """Return the waypoints at which an outline is drawn."""
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    wanted = np.linspace(0.0, along[-1], max(2, int(along[-1] / STAMPS) + 1))
    return [int(k) for k in np.unique(np.searchsorted(along, wanted).clip(max=len(points) - 1))]


def _line(points: Floats) -> shapely.LineString:
    return shapely.LineString(points if len(points) > 1 else np.repeat(points, 2, axis=0))
