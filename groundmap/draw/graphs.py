"""Pictures of the trees and roadmaps of sampling planners, given as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import as_floats, check_finite
from groundmap.draw.figure import add_to_legend
from groundmap.errors import InputError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

GRAPH = "#00695c"
MANY = 5000  # number of edges from which on they are thinner, and rasterised in .pdf and .svg files


def draw_graph(
    vertices: npt.ArrayLike, edges: npt.ArrayLike, *, ax: Axes, label: str = "graph"
) -> list[Artist]:
    """Draw the edges of a tree or a roadmap, above the map and below routes.

    Edges are drawn as straight lines, although they are curves in spaces of curves.

    Parameters
    ----------
    vertices : array_like, shape (n, 2) or (n, 3) [m, map]
        Only x and y are used.
    edges : array_like of int, shape (m, 2)
        Indices of the vertices of each edge.
    ax : matplotlib Axes
    label : str, default "graph"
        Name in the legend.

    Raises
    ------
    InputError
        Other shapes, or an edge of a nonexistent vertex.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    places = as_floats("vertices", vertices, (None, None))
    if places.shape[1] < 2 and len(places):
        raise InputError("vertices", "x and y", f"shape {places.shape}")
    check_finite("vertices", places)
    indices = as_floats("edges", edges, (None, 2))
    within = (indices >= 0) & (indices < len(places)) & (np.floor(indices) == indices)
    wrong = ~within.all(axis=1)
    if wrong.any():
        first = int(wrong.argmax())
        expected = f"indices of {len(places)} vertices"
        got = f"[{indices[first, 0]:g}, {indices[first, 1]:g}]"
        raise InputError("edges", expected, got, where=f"row {first}")
    joined = indices.astype(np.int64)
    segments: Any = places[joined][..., :2]
    many = len(joined) >= MANY
    lines = LineCollection(
        segments,
        colors=GRAPH,
        linewidths=0.3 if many else 0.5,
        alpha=0.25 if many else 0.45,
        zorder=1.5,
        rasterized=many,
        label=label,
    )
    ax.add_collection(lines, autolim=False)
    add_to_legend(ax, [Line2D([], [], color=GRAPH, linewidth=1.0, label=label)])
    return [lines]
