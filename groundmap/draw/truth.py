"""Pictures of the true world, and of the differences of a map from it."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely
from scipy import ndimage
from shapely.geometry.polygon import orient

from groundmap.arrays import Bools, Bytes, Floats, as_floats
from groundmap.draw.figure import add_to_legend
from groundmap.draw.maps import SHADES
from groundmap.errors import InputError
from groundmap.grid.window import CellState

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.path import Path


class Finding(IntEnum):
    """The result of comparing a cell of the map with the truth, from harmless to dangerous."""

    UNSEEN = 0  #: unknown on the map, and not in sight
    FREE = 1  #: free on the map and in truth
    NONFREE = 2  #: non-free on the map and in truth, there or beside it
    MISSED = 3  #: ground in sight that is unknown on the map
    FALSE_NONFREE = 4  #: non-free on the map, without an obstacle there or beside it
    FALSE_FREE = 5  #: free on the map, but non-free in truth or behind a surface


# Label and colour: worse findings are darker; right ones are the lightest or nearly black.
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


def findings(states: Bytes, *, nonfree: Bools, visible: Bools, behind: Bools) -> Bytes:
    """Return the `Finding` of every cell, as uint8.

    Parameters
    ----------
    states : ndarray of uint8, shape (rows, cols)
        `CellState` of the map's cells.
    nonfree : ndarray of bool, shape (rows, cols)
        Cells with an obstacle in truth.
    visible : ndarray of bool, shape (rows, cols)
        Ground that was truly in sight.
    behind : ndarray of bool, shape (rows, cols)
        Cells that a surface hides.

    Raises
    ------
    InputError
        Arrays of different shapes.

    Examples
    --------
    >>> states = np.array([[CellState.FREE, CellState.FREE, CellState.UNKNOWN]])
    >>> wall, seen = np.array([[False, True, False]]), np.array([[True, False, False]])
    >>> compared = findings(states, nonfree=wall, visible=seen, behind=~seen)
    >>> [Finding(cell).name for cell in compared[0]]
    ['FREE', 'FALSE_FREE', 'UNSEEN']
    """
    for name, cells in (("nonfree", nonfree), ("visible", visible), ("behind", behind)):
        if cells.shape != states.shape:
            raise InputError(name, f"the shape {states.shape} of the map", f"shape {cells.shape}")
    free, occupied = states == CellState.FREE, states == CellState.NONFREE
    beside = ndimage.binary_dilation(nonfree, structure=np.ones((3, 3), dtype=np.bool_))
    compared = np.full(states.shape, Finding.UNSEEN, dtype=np.uint8)
    compared[visible] = Finding.MISSED
    compared[free] = Finding.FREE
    compared[free & (nonfree | behind)] = Finding.FALSE_FREE
    compared[occupied] = Finding.FALSE_NONFREE
    compared[occupied & beside] = Finding.NONFREE
    return compared


def draw_truth(
    outline: shapely.Geometry,
    *,
    visible: Bools,
    origin: npt.ArrayLike,
    resolution: float,
    ax: Axes,
) -> list[Artist]:
    """Draw the true world: obstacles, and the ground that was in sight.

    Parameters
    ----------
    outline : shapely.Geometry [m, map]
        Polygons, which may have holes; may be empty.
    visible : ndarray of bool, shape (rows, cols)
        Ground that was truly in sight.
    origin : array_like, shape (2,) [m, map]
        Outer corner of cell (0, 0).
    resolution : float [m]
    ax : matplotlib Axes
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
    """Draw the `Finding` of every cell; the legend states the number of each.

    False free cells are marked with dots as well, so that they are visible at any scale.

    Parameters
    ----------
    states, nonfree, visible, behind : ndarray, shape (rows, cols)
        As for `findings`.
    origin : array_like, shape (2,) [m, map]
        Outer corner of cell (0, 0).
    resolution : float [m]
    ax : matplotlib Axes
    """
    compared = findings(states, nonfree=nonfree, visible=visible, behind=behind)
    palette = np.array([FINDINGS[finding][1] for finding in Finding])
    picture = _paint(palette[compared], origin, resolution, ax)
    rows, cols = np.nonzero(compared == Finding.FALSE_FREE)
    x, y = as_floats("origin", origin, (2,))
    (dots,) = ax.plot(
        x + (cols + 0.5) * resolution, y + (rows + 0.5) * resolution, "s",
        color=FINDINGS[Finding.FALSE_FREE][1], markersize=2.4, markeredgewidth=0.0, zorder=1,
    )  # fmt: skip
    names = {
        f"{label}: {np.count_nonzero(compared == finding)}": color
        for finding, (label, color) in FINDINGS.items()
    }
    return [picture, dots, _name_colors(names, ax=ax)]


def _paint(image: Floats, origin: npt.ArrayLike, resolution: float, ax: Axes) -> Artist:
    """Draw a colour per cell, and limit the axes to these cells."""
    rows, cols = image.shape[:2]
    x, y = as_floats("origin", origin, (2,))
    extent = (x, x + cols * resolution, y, y + rows * resolution)
    # Antialiased only if cells are smaller than a few pixels: thin walls fade but remain visible.
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
    """Return the rings of polygons as one path; holes run clockwise, so they are not filled."""
    from matplotlib.path import Path

    polygons = [orient(part) for part in shapely.get_parts(outline) if part.area > 0]
    rings = [ring for polygon in polygons for ring in (polygon.exterior, *polygon.interiors)]
    paths = [Path(np.asarray(ring.coords), closed=True) for ring in rings]
    return Path.make_compound_path(*paths) if paths else Path(np.empty((0, 2)))
