"""Pictures of grids and routes: the only module that imports matplotlib, and only when called.

Every function draws on `ax`, or on new axes, and returns the artists it made. The four states keep
apart in greyscale, too: free is the lightest, unknown darker, contested darker still, non-free
nearly black.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.archive import write_atomically
from groundmap.arrays import Floats, as_floats
from groundmap.errors import InputError
from groundmap.grid import ConfidenceGrid
from groundmap.window import EPSILON, CellState, GridWindow

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Each state from its faintest to its surest confidence, RGB.
SHADES: dict[CellState, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    CellState.UNKNOWN: ((0.80, 0.80, 0.79), (0.80, 0.80, 0.79)),
    CellState.FREE: ((0.90, 0.94, 0.97), (0.98, 0.99, 1.00)),
    CellState.NONFREE: ((0.50, 0.36, 0.36), (0.13, 0.07, 0.10)),
    CellState.CONTESTED: ((0.87, 0.62, 0.25), (0.87, 0.62, 0.25)),
}
LABELS = {
    CellState.FREE: "free",
    CellState.NONFREE: "non-free",
    CellState.CONTESTED: "contested",
    CellState.UNKNOWN: "unknown",
}
ROUTE, FOOTPRINT, TRAJECTORY = "#c2185b", "#f06292", "#1f5f8b"
PICTURE_FORMATS = (".png", ".pdf", ".svg")
LONG_SIDE = 11.0  # [inch]


def new_figure(bounds: npt.ArrayLike) -> tuple[Figure, Axes]:
    """Return a figure shaped like a box of the map, without a window on any screen.

    Parameters
    ----------
    bounds : array_like, shape (4,)
        xmin, ymin, xmax, ymax [m, map].
    """
    from matplotlib.figure import Figure

    xmin, ymin, xmax, ymax = as_floats("bounds", bounds, (4,))
    width, height = xmax - xmin, ymax - ymin
    scale = LONG_SIDE / max(width, height)
    figure = Figure(
        figsize=(max(width * scale, 4.5) + 0.9, max(height * scale, 3.0) + 1.3),
        layout="constrained",
    )
    axes = figure.add_subplot()
    axes.set_xlim(xmin, xmax)
    axes.set_ylim(ymin, ymax)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    return figure, axes


def known_bounds(grid: ConfidenceGrid, *, margin: float = 1.0) -> Floats:
    """Return the box around all cells that were spoken of, shape (4,) [m, map].

    Raises
    ------
    InputError
        The grid is empty.
    """
    window = grid.window()
    rows, cols = np.nonzero(window.count)
    if len(rows) == 0:
        raise InputError("grid", "at least one known cell", "an empty map")
    low = window.origin + np.array([cols.min(), rows.min()]) * window.resolution
    high = window.origin + np.array([cols.max() + 1, rows.max() + 1]) * window.resolution
    return np.concatenate([low - margin, high + margin])


def draw_grid(
    grid: ConfidenceGrid,
    *,
    bounds: npt.ArrayLike | None = None,
    epsilon: float = EPSILON,
    ax: Axes | None = None,
) -> list[Artist]:
    """Draw the four states, shaded by confidence, with a scale bar and a legend.

    Parameters
    ----------
    grid : ConfidenceGrid
    bounds : array_like, shape (4,), optional
        xmin, ymin, xmax, ymax [m, map]; all that is known unless told.
    epsilon : float
        Confidence below which a cell is contested.
    ax : matplotlib axes, optional
    """
    from matplotlib.patches import Patch

    box = known_bounds(grid) if bounds is None else as_floats("bounds", bounds, (4,))
    ax = ax or new_figure(box)[1]
    window = grid.window(box)
    rows, cols = window.count.shape
    x, y = window.origin
    picture = ax.imshow(
        _shaded(window, epsilon),
        origin="lower",
        extent=(x, x + cols * window.resolution, y, y + rows * window.resolution),
        interpolation="nearest",
        zorder=0,
    )
    ax.set_xlim(box[0], box[2])
    ax.set_ylim(box[1], box[3])
    patches = [
        Patch(facecolor=SHADES[state][1], edgecolor="0.4", linewidth=0.6, label=label)
        for state, label in LABELS.items()
    ]
    return [picture, *_scale_bar(ax), _legend(ax, patches)]


def draw_trajectory(poses: npt.ArrayLike, *, ax: Axes) -> list[Artist]:
    """Draw where the views were taken: a dashed line from a dot, arrows the way they looked.

    Parameters
    ----------
    poses : array_like, shape (n, 3)
        x, y [m, map] and yaw [rad].
    """
    x, y, yaw = as_floats("poses", poses, (None, 3)).T
    if len(x) == 0:
        return []
    line = ax.plot(x, y, color=TRAJECTORY, linewidth=1.3, linestyle=(0, (5, 2)), zorder=3)[0]
    line.set_label("camera")
    start = ax.plot(x[:1], y[:1], "o", color=TRAJECTORY, markersize=4.5, zorder=3)[0]
    every = max(1, len(x) // 8)
    arrows = ax.quiver(
        x[::every], y[::every], np.cos(yaw[::every]), np.sin(yaw[::every]),
        color=TRAJECTORY, angles="xy", scale=45, width=0.0025, headwidth=5, zorder=3,
    )  # fmt: skip
    _legend(ax, [line])
    return [line, start, arrows]


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
    _legend(ax, [core, *artists[:1]])
    return [*artists, casing, core, ends]


def draw_verdicts(
    grid: ConfidenceGrid, *, obstacles: npt.ArrayLike, grounds: npt.ArrayLike, ax: Axes
) -> list[Artist]:
    """Draw held-out features by what the map says of them: triangles obstacles, dots ground.

    Green where the map agrees, red where it contradicts, yellow where it does not know.

    Parameters
    ----------
    grid : ConfidenceGrid
    obstacles, grounds : array_like, shape (n, 2) [m, map]
    """
    window = grid.window()
    states = window.states()
    artists: list[Artist] = []
    for name, points, marker, right in (
        ("obstacle", obstacles, "^", CellState.NONFREE),
        ("ground", grounds, "o", CellState.FREE),
    ):
        places = as_floats(name, points, (None, 2))
        cells = window.world_to_cell(places) if len(places) else np.empty((0, 2), dtype=np.int64)
        inside = window.contains(cells)
        found = np.full(len(places), CellState.UNKNOWN, dtype=np.uint8)
        found[inside] = states[tuple(cells[inside].T)]
        known = (found == CellState.FREE) | (found == CellState.NONFREE)
        for label, color, mask in (
            (f"{name}: agrees", "#2e9e5b", known & (found == right)),
            (f"{name}: contradicts", "#d62728", known & (found != right)),
            (f"{name}: unknown", "#e6b800", ~known),
        ):
            artist = ax.plot(*places[mask].T, marker, color=color, markersize=3.2, zorder=5)[0]
            artist.set(label=label, markeredgecolor="white", markeredgewidth=0.3)
            artists.append(artist)
    _legend(ax, artists)
    return artists


def save_figure(figure: Figure, path: str | PathLike[str], *, dpi: int = 130) -> None:
    """Write a figure to a .png, .pdf or .svg file, atomically.

    Raises
    ------
    InputError
        Another kind of file.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in PICTURE_FORMATS:
        raise InputError("plot", f"a file name ending in {', '.join(PICTURE_FORMATS)}", str(path))
    write_atomically(path, lambda stream: figure.savefig(stream, format=suffix[1:], dpi=dpi))


def _shaded(window: GridWindow, epsilon: float) -> Floats:
    states = window.states(epsilon=epsilon)
    sure = np.abs(window.confidence).astype(np.float64)[..., None]
    image = np.zeros((*states.shape, 3))
    for state, (faint, full) in SHADES.items():
        mask = states == state
        image[mask] = np.array(faint) + (np.array(full) - np.array(faint)) * sure[mask]
    return image


def _scale_bar(ax: Axes) -> list[Artist]:
    """Draw a bar of a round number of metres, about a sixth of the picture wide."""
    xmin, xmax = ax.get_xlim()
    target = (xmax - xmin) / 6.0
    power = 10.0 ** np.floor(np.log10(target))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= target)
    transform = ax.get_xaxis_transform()  # x in metres, y as a share of the picture
    left = xmin + 0.03 * (xmax - xmin)
    bar: Any = ax.plot(
        [left, left + length], [0.05, 0.05], color="0.1", linewidth=3.0,
        solid_capstyle="butt", transform=transform, zorder=7,
    )[0]  # fmt: skip
    text = ax.text(
        left + length / 2, 0.07, f"{length:g} m", ha="center", va="bottom",
        transform=transform, zorder=7, color="0.1",
    )  # fmt: skip
    return [bar, text]


def _legend(ax: Axes, handles: list[Any]) -> Artist:
    """Add to the legend above the picture, keeping what it holds."""
    before = ax.get_legend()
    held = [] if before is None else list(before.legend_handles)
    return ax.legend(
        handles=[*(handle for handle in held if handle is not None), *handles],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01),
        ncols=6,
        frameon=False,
        borderaxespad=0.0,
        fontsize=9,
        handlelength=1.6,
        columnspacing=1.2,
    )
