"""Pictures of routes, given as plain arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import as_floats
from groundmap.draw.figure import add_to_legend

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

ROUTE, FOOTPRINT = "#c2185b", "#f06292"


def draw_route(waypoints: npt.ArrayLike, *, footprint: float, ax: Axes) -> list[Artist]:
    """Draw a route and the footprint along it.

    Parameters
    ----------
    waypoints : array_like, shape (n, 2) [m, map]
    footprint : float
        Radius [m].
    """
    from matplotlib.patches import Circle, Polygon

    points = as_floats("waypoints", waypoints, (None, 2))
    line = shapely.LineString(points if len(points) > 1 else np.repeat(points, 2, axis=0))
    artists: list[Artist] = []
    if footprint > 0:
        swept = line.buffer(footprint)
        band = Polygon(np.asarray(swept.exterior.coords), closed=True, zorder=2)
        band.set(facecolor=FOOTPRINT, alpha=0.22, edgecolor="none", label="swept footprint")
        artists.append(ax.add_patch(band))
        for distance in np.linspace(0.0, line.length, max(2, int(line.length / 8.0) + 1)):
            centre = line.interpolate(distance)
            circle = Circle((centre.x, centre.y), footprint, fill=False, zorder=4)
            circle.set(edgecolor=ROUTE, linewidth=0.8)
            artists.append(ax.add_patch(circle))
    casing = ax.plot(*points.T, color="white", linewidth=4.0, zorder=4)[0]
    core = ax.plot(*points.T, color=ROUTE, linewidth=1.8, zorder=5, label="route")[0]
    ends = ax.plot(
        *points[[0, -1]].T, "o", color="white", markeredgecolor=ROUTE, markersize=7, zorder=6
    )[0]
    add_to_legend(ax, [core, *artists[:1]])
    return [*artists, casing, core, ends]
