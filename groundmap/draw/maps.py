"""Pictures of grids: the four states, the trajectory of the camera, held-out features."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Floats, as_floats, as_number, check_finite
from groundmap.draw.figure import add_to_legend, new_figure, scale_bar
from groundmap.errors import InputError
from groundmap.grid.cell_set import CellSet
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import EPSILON, CellState, GridWindow

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# RGB of each state at its lowest and highest confidence.
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
#: Cells of a picture by dimension. In 2-D, each takes about 50 bytes, and no screen shows more.
MOST_DRAWN = {2: 2**25, 3: 2**27}
TRAJECTORY = "#1f5f8b"
NOW, KEEP_OUT = "#e8542f", "#7b1fa2"


def known_bounds(grid: ConfidenceGrid, *, margin: float = 1.0) -> Floats:
    """Return the box around all observed cells, shape (4,), of a 3-D map (6,) [m, map].

    Parameters
    ----------
    grid : ConfidenceGrid
    margin : float, default 1 [m]
        Added on each side.

    Raises
    ------
    InputError
        The grid is empty, or its tiles lie too far apart for one picture.
    """
    grid.check_extent(MOST_DRAWN[grid.ndim])
    # Tile by tile, since a dense window would need memory for the whole bounding box.
    observed = (
        np.array(index) * grid.tile_shape + np.argwhere(tile.count) for index, tile in grid.tiles()
    )
    boxes = [(cells.min(axis=0), cells.max(axis=0) + 1) for cells in observed if len(cells)]
    if not boxes:
        raise InputError("grid", "at least one known cell", "an empty map")
    lowest, highest = np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]
    # From the corner of the first tile, with the rounding of a window around the observed tiles.
    first = grid.cell_bounds()[0]
    corner = grid.origin + first[::-1] * grid.resolution
    low = corner + (lowest - first)[::-1] * grid.resolution
    high = corner + (highest - first)[::-1] * grid.resolution
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
        xmin, ymin, xmax, ymax [m, map]; default: all observed cells.
    epsilon : float
        Confidence below which a cell is contested.
    ax : matplotlib Axes, optional
        Default: new axes.

    Raises
    ------
    InputError
        Invalid bounds, or bounds with more than 2**25 cells.
    """
    epsilon = as_number("epsilon", epsilon, "a number above 0", above=0.0)
    box = known_bounds(grid) if bounds is None else as_floats("bounds", bounds, (4,))
    ax = ax or new_figure(box)[1]
    return draw_states(grid.window(box, most_cells=MOST_DRAWN[2]), box, epsilon=epsilon, ax=ax)


def draw_states(
    window: GridWindow, box: Floats, *, epsilon: float = EPSILON, ax: Axes
) -> list[Artist]:
    """Draw the states of the cells of a window as `draw_grid` does.

    Parameters
    ----------
    window : GridWindow
        In 2-D.
    box : ndarray, shape (4,) [m, map]
        What the axes show.
    epsilon : float
        Confidence below which a cell is contested.
    ax : matplotlib Axes

    Raises
    ------
    InputError
        A window without a cell.
    """
    from matplotlib.patches import Patch

    rows, cols = window.count.shape
    if rows * cols == 0:  # a float's step at these coordinates is larger than the box
        raise InputError("bounds", "a box that holds a cell", str(box.tolist()))
    x, y = window.origin
    picture = ax.imshow(
        shade(window, epsilon=epsilon),
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
    return [picture, *scale_bar(ax), add_to_legend(ax, patches)]


def draw_trajectory(poses: npt.ArrayLike, *, ax: Axes) -> list[Artist]:
    """Draw the poses of views: a dashed line from a dot, with arrows in viewing direction.

    Parameters
    ----------
    poses : array_like, shape (n, 3)
        x, y [m, map] and yaw [rad].
    ax : matplotlib Axes
    """
    rows = as_floats("poses", poses, (None, 3))
    check_finite("poses", rows)
    x, y, yaw = rows.T
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
    add_to_legend(ax, [line])
    return [line, start, arrows]


def draw_cells(cells: CellSet, *, label: str, color: str = NOW, ax: Axes) -> list[Artist]:
    """Draw cells in one colour, such as those that the newest views saw as non-free.

    Parameters
    ----------
    cells : CellSet
        Of a 2-D map.
    label : str
        Name in the legend.
    color : str, optional
        A colour of matplotlib.
    ax : matplotlib Axes
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Patch

    if len(cells) == 0:
        return []
    corners = cells.origin + cells.cells[:, ::-1] * cells.resolution
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]) * cells.resolution
    squares = PolyCollection(list(corners[:, None] + square), facecolor=color, zorder=1.5)
    ax.add_collection(squares, autolim=False)
    add_to_legend(ax, [Patch(facecolor=color, label=label)])
    return [squares]


def draw_keep_out(areas: Sequence[shapely.Polygon], *, ax: Axes) -> list[Artist]:
    """Draw keep-out areas, hatched.

    Parameters
    ----------
    areas : sequence of shapely.Polygon [m, map]
    ax : matplotlib Axes
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    artists: list[Artist] = []
    for area in areas:
        rings = [np.asarray(ring.coords)[:, :2] for ring in (area.exterior, *area.interiors)]
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        patch = PathPatch(path, zorder=1.8, label="keep-out area")
        patch.set(facecolor="none", edgecolor=KEEP_OUT, linewidth=1.0, hatch="////")
        artists.append(ax.add_patch(patch))
    if artists:
        add_to_legend(ax, artists[:1])
    return artists


def draw_verdicts(
    grid: ConfidenceGrid, *, obstacles: npt.ArrayLike, grounds: npt.ArrayLike, ax: Axes
) -> list[Artist]:
    """Draw held-out features by the state of their cells: obstacles as triangles, ground as dots.

    Green: the map agrees; red: the map contradicts; yellow: the cell is unknown or contested.

    Parameters
    ----------
    grid : ConfidenceGrid
    obstacles, grounds : array_like, shape (n, 2) [m, map]
    ax : matplotlib Axes
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
        at = np.full(len(places), CellState.UNKNOWN, dtype=np.uint8)
        at[inside] = states[tuple(cells[inside].T)]
        known = (at == CellState.FREE) | (at == CellState.NONFREE)
        for label, color, mask in (
            (f"{name}: agrees", "#2e9e5b", known & (at == right)),
            (f"{name}: contradicts", "#d62728", known & (at != right)),
            (f"{name}: unknown", "#e6b800", ~known),
        ):
            artist = ax.plot(*places[mask].T, marker, color=color, markersize=3.2, zorder=5)[0]
            artist.set(label=label, markeredgecolor="white", markeredgewidth=0.3)
            artists.append(artist)
    add_to_legend(ax, artists)
    return artists


def shade(window: GridWindow, *, epsilon: float = EPSILON) -> Floats:
    """Return the colours of the states of a window, shape (rows, cols, 3).

    Parameters
    ----------
    window : GridWindow
        In 2-D.
    epsilon : float
        Confidence below which a cell is contested.
    """
    states = window.states(epsilon=epsilon)
    certainty = np.abs(window.confidence).astype(np.float64)[..., None]
    image = np.zeros((*states.shape, 3))
    for state, (faint, full) in SHADES.items():
        mask = states == state
        image[mask] = np.array(faint) + (np.array(full) - np.array(faint)) * certainty[mask]
    return image
