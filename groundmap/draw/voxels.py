"""Pictures of 3-D maps: surfaces, a layer, a section along a route."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, as_floats, as_number, check_finite
from groundmap.draw.figure import LARGEST_BOX, add_to_legend
from groundmap.draw.maps import MOST_DRAWN, draw_states, known_bounds, shade
from groundmap.draw.routes import COLOURS, FOOTPRINT, ROUTE
from groundmap.errors import InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellBox, CellState, GridWindow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_FACES = 40_000  # of a picture: matplotlib sorts them by their depth
MOST_CUBES = 2**21  # cubes that faces are looked for in
MOST_PLACES = 4_000  # along a route, in a section
LIGHT = {0: 1.0, 1: 0.82, 2: 0.68}  # of faces across z, y and x
SEEN_FROM = {"elev": 38.0, "azim": -62.0}  # [deg]


def voxel_figure(
    grid: ConfidenceGrid,
    *,
    bounds: npt.ArrayLike | None = None,
    height: float | None = None,
    routes: Mapping[str, npt.ArrayLike] | None = None,
    footprint: float = 0.0,
) -> Figure:
    """Return a picture of a 3-D map: its surfaces, a layer, and a section along the first route.

    Parameters
    ----------
    grid : ConfidenceGrid
        In 3-D.
    bounds : array_like, shape (6,), optional [m, map]
        Lower then upper corner of the part to draw; default: all observed voxels.
    height : float, optional [m, map]
        z of the layer; default: that of the first route where most is non-free above and below
        it, or the middle of the bounds.
    routes : mapping of str to array_like, shape (n, 3), optional [m, map]
        Waypoints by name.
    footprint : float, default 0 [m]
        Radius of the ball that moves along the routes.

    Raises
    ------
    InputError
        A 2-D map, invalid bounds, a layer beyond them, or routes that are not in 3-D.
    """
    from matplotlib.figure import Figure

    box = _bounds(grid, bounds)
    footprint = as_number("footprint", footprint, "a radius of 0 or more [m]", least=0.0)
    lines = {name: _line(name, points) for name, points in (routes or {}).items()}
    section = _section_along(grid, box, next(iter(lines.values()))) if lines else None
    middle = 0.5 * (box[2] + box[5]) if section is None else section.telling_height
    z = as_number("height", middle if height is None else height, "a number [m]")
    if not box[2] <= z <= box[5]:
        raise InputError("height", f"a z from {box[2]:g} to {box[5]:g} m", f"{z:g}")
    figure = Figure(figsize=(13.0, 5.5 if section is None else 9.0))
    figure.set_layout_engine("constrained", wspace=0.08)
    rows = figure.add_gridspec(1 if section is None else 2, 2)
    surfaces = figure.add_subplot(rows[0, 0], projection="3d", computed_zorder=False)
    _draw_surfaces(grid, box, surfaces)
    layer = figure.add_subplot(rows[0, 1])
    _draw_layer(grid, box, z, layer)
    for number, (name, line) in enumerate(lines.items()):
        colour = ROUTE if len(lines) == 1 else COLOURS[number % len(COLOURS)]
        _draw_line(line, line, colour, surfaces)
        layer.plot(*line[:, :2].T, ":", color=colour, linewidth=1.5, zorder=4)
        near = _places_along(line, grid.resolution)
        near[np.abs(near[:, 2] - z) > max(footprint, grid.resolution)] = np.nan
        core = _draw_line(near[:, :2], line[:, :2], colour, layer)
        core.set_label(name)
        add_to_legend(layer, [core])
    if section is not None:
        rows.set_height_ratios([3.0, 1.3])
        _draw_section(section, footprint, figure.add_subplot(rows[1, :]))
    return figure


def _draw_line(points: Floats, line: Floats, colour: str, ax: Any) -> Any:
    """Draw points of a route, and its ends, in 2-D or 3-D; return the line drawn."""
    ax.plot(*points.T, color="white", linewidth=4.0, zorder=5)
    core = ax.plot(*points.T, color=colour, linewidth=1.8, zorder=6)[0]
    ax.plot(*line[[0, -1]].T, "o", color="white", markeredgecolor=colour, zorder=7)
    return core


def _bounds(grid: ConfidenceGrid, bounds: npt.ArrayLike | None) -> Floats:
    """Return the lower and the upper corner of what is drawn, shape (6,) [m]."""
    if grid.ndim != 3:
        raise InputError("grid", "a 3-D map", f"one of {grid.ndim}-D")
    box = known_bounds(grid, margin=0.0) if bounds is None else as_floats("bounds", bounds, (6,))
    check_finite("bounds", box)
    if not (box[:3] < box[3:]).all() or np.abs(box).max() > LARGEST_BOX:
        expected = f"an upper corner above the lower one, within {LARGEST_BOX:g} m"
        raise InputError("bounds", expected, str(box.tolist()))
    return box


def _line(name: str, points: npt.ArrayLike) -> Floats:
    line = as_floats(f"route {name}", points, (None, 3))
    check_finite(f"route {name}", line)
    if not len(line):
        raise InputError(f"route {name}", "one or more points x, y, z [m]", "0")
    farthest = float(np.abs(line).max())
    if farthest > LARGEST_BOX:
        raise InputError(f"route {name}", f"points within {LARGEST_BOX:g} m", f"{farthest:g} m")
    return line


def _draw_surfaces(grid: ConfidenceGrid, box: Floats, ax: Any) -> None:
    """Draw the faces of non-free voxels, coloured by height and shaded by direction."""
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    faces, axis, side = _faces_of(grid, grid.box(box, most_cells=MOST_DRAWN[3]))
    level = (faces[:, :, 2].mean(axis=1) - box[2]) / (box[5] - box[2])
    colours = colormaps["viridis"](0.1 + 0.8 * np.clip(level, 0.0, 1.0))
    colours[:, :3] *= np.array([LIGHT[int(k)] for k in axis]).reshape(-1, 1)
    colours[:, 3] = 0.4
    ax.add_collection3d(Poly3DCollection(faces, facecolors=colours, edgecolors="none", zorder=1))
    for k, name in enumerate("xyz"):
        ax.set(**{f"{name}lim": (box[k], box[k + 3]), f"{name}label": f"{name} [m]"})
    ax.set_box_aspect(box[3:] - box[:3], zoom=0.88)  # the labels are outside
    ax.view_init(**SEEN_FROM)
    ax.locator_params(axis="z", nbins=4)
    shown = "non-free surfaces" + (f", in cubes of {side:.3g} m" if side > grid.resolution else "")
    ax.set_title(shown, fontsize=10)


def _faces_of(grid: ConfidenceGrid, cells: CellBox) -> tuple[Floats, Floats, float]:
    """Return the faces of non-free cubes, the axis that each is across, and the side of a cube.

    Cubes are voxels, or larger ones where these have too many faces.
    """
    step = max(1, math.ceil((math.prod(cells.shape) / MOST_CUBES) ** (1.0 / 3.0)))
    while True:
        cubes = _coarse(grid, cells, step)
        padded = np.pad(cubes, 1)
        count = sum(int(np.count_nonzero(np.diff(padded, axis=axis))) for axis in range(3))
        if count <= MOST_FACES or max(cubes.shape) == 1:
            break
        step += 1
    side = step * grid.resolution
    quads, across = [np.empty((0, 4, 3))], [np.empty(0)]
    for axis in range(3):
        at = np.argwhere(np.diff(padded, axis=axis)).astype(np.float64)
        at -= 1.0  # of the padding
        at[:, axis] += 1.0  # a face lies at the upper border of the first of two cubes
        one, other = (k for k in range(3) if k != axis)
        corners = np.repeat(at[:, None], 4, axis=1)
        corners[:, 1:3, one] += 1.0
        corners[:, 2:4, other] += 1.0
        quads.append(cells.origin + corners[..., ::-1] * side)
        across.append(np.full(len(at), axis))
    return np.concatenate(quads), np.concatenate(across), side


def _coarse(grid: ConfidenceGrid, cells: CellBox, step: int) -> Bools:
    """Return which cubes of `step` voxels a side hold a non-free voxel."""
    layers = []
    for slab in cells.slabs(step * math.prod(cells.shape[1:])):
        nonfree = grid.read(slab).states() == CellState.NONFREE
        plane = np.logical_or.reduce(nonfree, axis=0)
        plane = np.pad(plane, [(0, -side % step) for side in plane.shape])
        rows, cols = (side // step for side in plane.shape)
        layers.append(plane.reshape(rows, step, cols, step).any(axis=(1, 3)))
    return np.array(layers)


def _draw_layer(grid: ConfidenceGrid, box: Floats, z: float, ax: Axes) -> None:
    """Draw the states of the voxels at a height."""
    middle = math.floor((z - grid.origin[2]) / grid.resolution) + 0.5
    level = grid.origin[2] + middle * grid.resolution
    inside = 0.25 * grid.resolution
    low, high = (*box[:2], level - inside), (*box[3:5], level + inside)
    window = grid.window(np.concatenate([low, high]), most_cells=MOST_DRAWN[2])
    flat = GridWindow(window.confidence[0], window.count[0], window.origin[:2], window.resolution)
    draw_states(flat, box[[0, 1, 3, 4]], ax=ax)
    ax.set(xlabel=f"x [m], in the layer at z = {level:.2f} m", ylabel="y [m]", aspect="equal")


class _Section(NamedTuple):
    """The voxels above and below a route."""

    line: Floats  #: shape (n, 3) [m], waypoints
    along: Floats  #: shape (n,) [m], distance in plan from the first to each waypoint
    window: GridWindow  #: rows are heights, columns are places along the route
    heights: Floats  #: shape (rows,) [m], of the centres
    places: Floats  #: shape (cols,) [m], along the route

    @property
    def telling_height(self) -> float:
        """Height of the route where most of the voxels above and below it are non-free [m]."""
        blocked = (self.window.states() == CellState.NONFREE).sum(axis=0)
        where = self.places[int(blocked.argmax())]
        return float(np.interp(where, self.along, self.line[:, 2]))


def _section_along(grid: ConfidenceGrid, box: Floats, line: Floats) -> _Section:
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1)))
    length = max(float(along[-1]), grid.resolution)
    count = min(math.ceil(2.0 * length / grid.resolution) + 1, MOST_PLACES)
    places = (np.arange(count) + 0.5) * length / count
    heights = np.arange(box[2] + 0.5 * grid.resolution, box[5], grid.resolution)
    points = np.empty((len(heights), count, 3))
    for axis in range(2):
        points[..., axis] = np.interp(places, along, line[:, axis])
    points[..., 2] = heights[:, None]
    flat = points.reshape(-1, 3)
    shape = points.shape[:2]
    confidence = np.asarray(grid.confidence_at(flat)).reshape(shape)
    views = np.asarray(grid.count_at(flat)).reshape(shape)
    window = GridWindow(confidence, views, np.zeros(2), grid.resolution)
    return _Section(line, along, window, heights, places)


def _draw_section(section: _Section, footprint: float, ax: Axes) -> None:
    """Draw the states of the voxels above and below a route, over the distance along it."""
    line, along, half = section.line, section.along, 0.5 * section.window.resolution
    low, high = section.heights[0] - half, section.heights[-1] + half
    end = section.places[-1] + section.places[0]
    ax.imshow(
        shade(section.window), origin="lower", extent=(0.0, end, low, high), aspect="auto",
        interpolation="nearest", zorder=0,
    )  # fmt: skip
    if footprint > 0.0:
        band = line[:, 2] - footprint, line[:, 2] + footprint
        ax.fill_between(along, *band, color=FOOTPRINT, alpha=0.3, linewidth=0.0, zorder=3)
    heights = np.column_stack([along, line[:, 2]])
    _draw_line(heights, heights, ROUTE, ax)
    ax.set(xlabel="distance along the route, in plan [m]", ylabel="z [m]", ylim=(low, high))
    ax.set_title("section along the route", fontsize=10, loc="left")


def _places_along(line: Floats, step: float) -> Floats:
    """Return places along a line at most `step` [m] apart, at most `MOST_PLACES`, shape (n, 3)."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    count = min(math.ceil(along[-1] / step) + 1, MOST_PLACES)
    stops = np.union1d(np.linspace(0.0, along[-1], count), along)
    return np.column_stack([np.interp(stops, along, line[:, axis]) for axis in range(3)])
