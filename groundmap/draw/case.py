"""The picture of one case: the true world, the map with its routes, and their difference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Bools, as_floats
from groundmap.draw.figure import add_to_legend
from groundmap.draw.maps import draw_grid, draw_trajectory
from groundmap.draw.routes import ROUTE, draw_route
from groundmap.draw.truth import draw_difference, draw_truth
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import GridWindow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FoundRoute: TypeAlias = tuple[str, npt.ArrayLike, float]  # label, waypoints [m], footprint [m]
FailedQuery: TypeAlias = tuple[str, npt.ArrayLike, npt.ArrayLike]  # label, start, goal [m]

WIDE = 2.0  # ratio of width to height from which on panels are stacked
ROW, STACK, LONGEST = (
    4.0,
    10.8,
    8.5,
)  # [inch]: width of a panel in a row, in a stack; largest height
NARROWEST = 2.9  # [inch], of a panel: room for its legend
LEGEND_COLUMN, LEGEND_DROP = 1.5, 0.45  # [inch]: width; distance below the axes and their label


def draw_case(
    grid: ConfidenceGrid,
    *,
    outline: shapely.Geometry,
    nonfree: Bools,
    visible: Bools,
    behind: Bools,
    window: GridWindow,
    routes: Sequence[FoundRoute] = (),
    failed: Sequence[FailedQuery] = (),
    trajectory: npt.ArrayLike = (),
    title: str = "",
) -> Figure:
    """Draw the truth, the map and their difference; stacked if they are wide.

    Parameters
    ----------
    grid : ConfidenceGrid
    outline : shapely.Geometry [m, map]
        True obstacles.
    nonfree, visible, behind : ndarray of bool, shape (rows, cols)
        The truth on the cells of `window`, as for `draw_difference`.
    window : GridWindow
        The part of the grid to show.
    routes : sequence of (str, array_like of shape (n, 2) [m, map], float [m])
        Label, waypoints and footprint radius of each route that was found.
    failed : sequence of (str, array_like of shape (2,), array_like of shape (2,)) [m, map]
        Label, start and goal of each query without a route.
    trajectory : array_like, shape (n, 3)
        x, y [m, map] and yaw [rad] of the camera.
    title : str
    """
    rows, cols = window.count.shape
    place: dict[str, Any] = {"origin": window.origin, "resolution": window.resolution}
    figure, axes = _panels(cols * window.resolution, rows * window.resolution)
    figure.suptitle(title, fontsize=12)
    truth, mapped, difference = axes
    draw_truth(outline, visible=visible, **place, ax=truth)
    bounds = np.array([*truth.get_xlim(), *truth.get_ylim()])[[0, 2, 1, 3]]
    for scale in draw_grid(grid, bounds=bounds, ax=mapped)[1:3]:
        scale.remove()  # the ticks show the scale
    draw_difference(
        window.states(), nonfree=nonfree, visible=visible, behind=behind, **place, ax=difference
    )
    for ax, name in zip(axes, ("truth", "map", "map against truth [cells]"), strict=True):
        ax.set_title(name, fontsize=10, loc="left")
        if ax is not difference:
            draw_trajectory(trajectory, ax=ax)
            _draw_queries(routes, failed, ax=ax)
        _legend_below(ax)
    return figure


def _panels(width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with three panels for maps of a given size [m]."""
    from matplotlib.figure import Figure

    stacked = width > WIDE * height
    if stacked:
        size = (STACK + 0.8, 3 * (max(STACK * height / width, 0.8) + 1.1) + 0.4)
    else:
        wide = min(ROW, max(LONGEST * width / height, NARROWEST))
        size = (3 * wide + 1.5, min(wide * height / width, LONGEST) + 2.0)
    figure = Figure(figsize=size, layout="compressed")
    axes = list(figure.subplots(*((3, 1) if stacked else (1, 3))))
    for ax in axes:
        ax.set_xlabel("x [m]", fontsize=9)
        ax.tick_params(labelsize=8)
    for ax in axes if stacked else axes[:1]:
        ax.set_ylabel("y [m]", fontsize=9)
    return figure, axes


def _draw_queries(routes: Sequence[FoundRoute], failed: Sequence[FailedQuery], *, ax: Axes) -> None:
    """Draw routes; a plus and a cross at start and goal of queries without a route."""
    for number, (label, waypoints, footprint) in enumerate(routes, start=1):
        draw_route(waypoints, footprint=footprint, ax=ax)
        line = shapely.LineString(
            np.repeat(as_floats("waypoints", waypoints, (None, 2)), 2, axis=0)
        )
        # Labels of routes between the same two places are at different fractions of their length.
        middle = line.interpolate(number / (len(routes) + 1), normalized=True)
        _write(label, (middle.x, middle.y), ax=ax)
    for label, start, goal in failed:
        ends = np.array([as_floats("start", start, (2,)), as_floats("goal", goal, (2,))])
        ax.plot(*ends.T, color=ROUTE, linewidth=0.9, linestyle=":", zorder=4)
        marks = [
            ax.plot(
                *end, marker, color=ROUTE, markersize=9, markeredgecolor="white", zorder=6,
                linestyle="none", label=f"no route: {name}",
            )[0]
            for end, marker, name in zip(ends, "PX", ("start", "goal"), strict=True)
        ]  # fmt: skip
        add_to_legend(ax, marks)
        _write(label, ends[0], ax=ax)


def _write(label: str, place: npt.ArrayLike, *, ax: Axes) -> None:
    """Write a label beside a place [m], readable on any background."""
    from matplotlib.patheffects import withStroke

    x, y = as_floats("place", place, (2,))
    text = ax.annotate(label, (x, y), xytext=(5, 5), textcoords="offset points", zorder=8)
    text.set(color=ROUTE, fontsize=8, clip_on=True)
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _legend_below(ax: Axes) -> None:
    """Move the legend below the axes: each label once, in as many columns as fit."""
    from matplotlib.transforms import ScaledTranslation

    figure: Any = ax.figure
    before = ax.get_legend()
    handles = [] if before is None else [handle for handle in before.legend_handles if handle]
    named = {str(handle.get_label()): handle for handle in handles}
    below = ScaledTranslation(0.0, -LEGEND_DROP, figure.dpi_scale_trans)
    subplots: Any = ax.get_subplotspec()
    room = (figure.get_figwidth() - 1.0) / subplots.get_gridspec().ncols
    ax.legend(
        handles=list(named.values()),
        loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=ax.transAxes + below,
        ncols=max(1, int(room / LEGEND_COLUMN)), frameon=False, borderaxespad=0.0,
        fontsize=8.5, handlelength=1.6, columnspacing=1.2,
    )  # fmt: skip
