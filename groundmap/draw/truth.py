"""Pictures of a map beside the truth: the world as it is, the map, and where the two differ."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt
import shapely
from scipy import ndimage
from shapely.geometry.polygon import orient

from groundmap.arrays import Bools, Bytes, Floats, as_floats
from groundmap.draw.figure import add_to_legend
from groundmap.draw.maps import SHADES, draw_grid, draw_trajectory
from groundmap.draw.routes import ROUTE, draw_route
from groundmap.errors import InputError
from groundmap.grid import ConfidenceGrid
from groundmap.window import CellState, GridWindow

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path

FoundRoute: TypeAlias = tuple[str, npt.ArrayLike, float]  # label, waypoints [m], footprint [m]
FailedQuery: TypeAlias = tuple[str, npt.ArrayLike, npt.ArrayLike]  # label, start, goal [m]


class Finding(IntEnum):
    """What the truth says of a cell of the map, from harmless to dangerous."""

    UNSEEN = 0  #: the map does not know it, and it was not in sight
    FREE = 1  #: free, and it is
    NONFREE = 2  #: non-free, and it is, or a cell beside it
    MISSED = 3  #: ground in plain sight that the map does not know
    FALSE_NONFREE = 4  #: non-free, but nothing is there or beside it
    FALSE_FREE = 5  #: free, but non-free in truth, or behind a surface


# Label and colour: the worse, the darker; what is right is the lightest or nearly black.
FINDINGS: dict[Finding, tuple[str, tuple[float, float, float]]] = {
    Finding.FREE: ("free, right", SHADES[CellState.FREE][1]),
    Finding.NONFREE: ("non-free, right", SHADES[CellState.NONFREE][1]),
    Finding.FALSE_FREE: ("FALSE FREE", (0.84, 0.03, 0.09)),
    Finding.FALSE_NONFREE: ("false non-free", (0.93, 0.45, 0.03)),
    Finding.MISSED: ("visible, not known", (0.60, 0.70, 0.81)),
    Finding.UNSEEN: ("not in sight", SHADES[CellState.UNKNOWN][1]),
}
GROUND, OBSTACLE, UNSEEN = (
    FINDINGS[finding][1] for finding in (Finding.FREE, Finding.NONFREE, Finding.UNSEEN)
)

WIDE = 2.0  # maps this many times as wide as tall have their panels one below the other
ROW, STACK, LONGEST = 4.0, 10.8, 8.5  # [inch], a panel's width in a row, in a stack; its height
NARROWEST = 2.9  # [inch], of a panel: room for its legend
LEGEND_COLUMN, LEGEND_DROP = 1.5, 0.45  # [inch], wide; below the axes, past the ticks and x [m]


def findings(states: Bytes, *, nonfree: Bools, visible: Bools, behind: Bools) -> Bytes:
    """Return the `Finding` of every cell, as uint8.

    Parameters
    ----------
    states : ndarray of uint8, shape (rows, cols)
        `CellState` of the map's cells.
    nonfree : ndarray of bool, shape (rows, cols)
        Where an obstacle truly is.
    visible : ndarray of bool, shape (rows, cols)
        Ground that was truly in sight.
    behind : ndarray of bool, shape (rows, cols)
        What a surface hides.

    Raises
    ------
    InputError
        Arrays of different shapes.

    Examples
    --------
    >>> states = np.array([[CellState.FREE, CellState.FREE, CellState.UNKNOWN]])
    >>> wall, seen = np.array([[False, True, False]]), np.array([[True, False, False]])
    >>> found = findings(states, nonfree=wall, visible=seen, behind=~seen)
    >>> [Finding(cell).name for cell in found[0]]
    ['FREE', 'FALSE_FREE', 'UNSEEN']
    """
    for name, cells in (("nonfree", nonfree), ("visible", visible), ("behind", behind)):
        if cells.shape != states.shape:
            raise InputError(name, f"shape {states.shape}, as the map", f"shape {cells.shape}")
    free, occupied = states == CellState.FREE, states == CellState.NONFREE
    beside = ndimage.binary_dilation(nonfree, structure=np.ones((3, 3), dtype=np.bool_))
    found = np.full(states.shape, Finding.UNSEEN, dtype=np.uint8)
    found[visible] = Finding.MISSED
    found[free] = Finding.FREE
    found[free & (nonfree | behind)] = Finding.FALSE_FREE
    found[occupied] = Finding.FALSE_NONFREE
    found[occupied & beside] = Finding.NONFREE
    return found


def draw_truth(
    outline: shapely.Geometry,
    *,
    visible: Bools,
    origin: npt.ArrayLike,
    resolution: float,
    ax: Axes,
) -> list[Artist]:
    """Draw the world as it is: obstacles, and the ground that was in sight.

    Parameters
    ----------
    outline : shapely.Geometry [m, map]
        Polygons, holes allowed, or nothing.
    visible : ndarray of bool, shape (rows, cols)
        Ground that was truly in sight.
    origin : array_like, shape (2,) [m, map]
        Outer corner of cell (0, 0).
    resolution : float [m]
    ax : matplotlib axes
    """
    from matplotlib.patches import PathPatch

    picture = _paint(np.where(visible[..., None], GROUND, UNSEEN), origin, resolution, ax)
    # The edge keeps walls thinner than a pixel in the picture.
    solid = PathPatch(_path_of(outline), facecolor=OBSTACLE, edgecolor=OBSTACLE, zorder=1)
    solid.set_linewidth(0.6)
    ax.add_patch(solid)
    names = {"obstacle": OBSTACLE, "ground in sight": GROUND, "not in sight": UNSEEN}
    return [picture, solid, _name_colors(names, ax=ax)]


def draw_difference(
    states: Bytes,
    *,
    nonfree: Bools,
    visible: Bools,
    behind: Bools,
    origin: npt.ArrayLike,
    resolution: float,
    ax: Axes,
) -> list[Artist]:
    """Draw the `Finding` of every cell, and how many there are of each in the legend.

    False free cells are dots as well, so that no scale makes them vanish.

    Parameters
    ----------
    states, nonfree, visible, behind : ndarray, shape (rows, cols)
        As for `findings`.
    origin : array_like, shape (2,) [m, map]
        Outer corner of cell (0, 0).
    resolution : float [m]
    ax : matplotlib axes
    """
    found = findings(states, nonfree=nonfree, visible=visible, behind=behind)
    palette = np.array([FINDINGS[finding][1] for finding in Finding])
    picture = _paint(palette[found], origin, resolution, ax)
    rows, cols = np.nonzero(found == Finding.FALSE_FREE)
    x, y = as_floats("origin", origin, (2,))
    (dots,) = ax.plot(
        x + (cols + 0.5) * resolution, y + (rows + 0.5) * resolution, "s",
        color=FINDINGS[Finding.FALSE_FREE][1], markersize=2.4, markeredgewidth=0.0, zorder=1,
    )  # fmt: skip
    names = {
        f"{label}: {np.count_nonzero(found == finding)}": color
        for finding, (label, color) in FINDINGS.items()
    }
    return [picture, dots, _name_colors(names, ax=ax)]


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
    """Draw the truth, the map and the difference of the two; below each other if they are wide.

    Parameters
    ----------
    grid : ConfidenceGrid
    outline : shapely.Geometry [m, map]
        True obstacles.
    nonfree, visible, behind : ndarray of bool, shape (rows, cols)
        The truth in the cells of `window`, as for `findings`.
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
        scale.remove()  # the ticks say it already
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


def figure_png(figure: Figure, dpi: int = 110) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    return stream.getvalue()


def _paint(image: Floats, origin: npt.ArrayLike, resolution: float, ax: Axes) -> Artist:
    """Show a colour per cell, and nothing but these cells."""
    rows, cols = image.shape[:2]
    x, y = as_floats("origin", origin, (2,))
    extent = (x, x + cols * resolution, y, y + rows * resolution)
    # Antialiased only where cells are smaller than a few pixels: a thin wall pales, but stays.
    picture = ax.imshow(image, origin="lower", extent=extent, interpolation="antialiased", zorder=0)
    ax.set_xlim(extent[:2])
    ax.set_ylim(extent[2:])
    return picture


def _name_colors(colors: Mapping[str, tuple[float, float, float]], *, ax: Axes) -> Artist:
    from matplotlib.patches import Patch

    return add_to_legend(
        ax,
        [
            Patch(facecolor=color, edgecolor="0.4", linewidth=0.6, label=label)
            for label, color in colors.items()
        ],
    )


def _path_of(outline: shapely.Geometry) -> Path:
    """Return the rings of polygons as one path: holes turn the other way, so they stay empty."""
    from matplotlib.path import Path

    polygons = [orient(part) for part in shapely.get_parts(outline) if part.area > 0]
    rings = [ring for polygon in polygons for ring in (polygon.exterior, *polygon.interiors)]
    paths = [Path(np.asarray(ring.coords), closed=True) for ring in rings]
    return Path.make_compound_path(*paths) if paths else Path(np.empty((0, 2)))


def _panels(width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with three panels for maps of that size [m]."""
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
    """Draw routes, and a plus and a cross where one was asked for in vain."""
    for number, (label, waypoints, footprint) in enumerate(routes, start=1):
        draw_route(waypoints, footprint=footprint, ax=ax)
        line = shapely.LineString(
            np.repeat(as_floats("waypoints", waypoints, (None, 2)), 2, axis=0)
        )
        # Routes between the same two places have their labels at different shares of the way.
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
    """Write a label beside a place [m], readable on any ground."""
    from matplotlib.patheffects import withStroke

    x, y = as_floats("place", place, (2,))
    text = ax.annotate(label, (x, y), xytext=(5, 5), textcoords="offset points", zorder=8)
    text.set(color=ROUTE, fontsize=8, clip_on=True)
    text.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


def _legend_below(ax: Axes) -> None:
    """Move the legend below the axes, each label once, in as many columns as there is room for."""
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
