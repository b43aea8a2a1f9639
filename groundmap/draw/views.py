"""Pictures of the processing steps of one view."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.surfaces import SurfaceKind
from groundmap.evidence.ground_plane.view_parts import ViewParts
from groundmap.grid.grid import ConfidenceGrid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GROUND, DROP_OFF, SEEN_END = "#6a9a3b", "#d62728", "#1f5f8b"
SURFACES = {
    SurfaceKind.SEGMENT: ("#221122", 2.2, "segments"),
    SurfaceKind.LINK: ("#a04050", 1.6, "links"),
    SurfaceKind.LONE: ("#d08030", 2.2, "lone points"),
}


def draw_view(parts: ViewParts, grid: ConfidenceGrid, *, title: str = "") -> Figure:
    """Draw features, triangulation, sight fan and evidence of one view, side by side.

    The first three are in the view's ground frame: the camera at the origin looks along x.

    Parameters
    ----------
    parts : ViewParts
        As `groundmap.GroundMapper.explain` returns them.
    grid : ConfidenceGrid
        The mapper's grid, for its cells.
    title : str, default ""
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 10.0), layout="constrained")
    axes = figure.subplots(2, 2)
    figure.suptitle(title)
    for ax, draw in zip(
        axes.ravel()[:3], (draw_features, draw_triangulation, draw_fan), strict=True
    ):
        draw(parts, ax=ax)
        ax.plot(0.0, 0.0, "^", color="0.1", markersize=8)
        ax.set_xlabel("x [m, view]")
        ax.set_ylabel("y [m, view]")
        ax.legend(loc="upper left", fontsize=8, framealpha=0.9)
    low, high = _reach(parts)
    for ax in axes.ravel()[:3]:
        ax.set_xlim(low[0], high[0])
        ax.set_ylim(low[1], high[1])
        ax.set_aspect("equal")
    draw_evidence(parts, grid, ax=axes[1, 1])
    return figure


def _reach(parts: ViewParts) -> tuple[Floats, Floats]:
    ground_view = parts.ground_view
    places = np.concatenate(
        [np.zeros((1, 2)), ground_view.points, ground_view.supports, ground_view.drop_offs]
    )
    return places.min(axis=0) - 1.0, places.max(axis=0) + 1.0


def draw_features(parts: ViewParts, *, ax: Axes) -> None:
    """Draw obstacle features by height, ground features, and features below the ground.

    Parameters
    ----------
    parts : ViewParts
    ax : matplotlib Axes
    """
    ground_view = parts.ground_view
    points = ax.scatter(
        ground_view.points[:, 0],
        ground_view.points[:, 1],
        c=ground_view.heights,
        s=14,
        cmap="plasma_r",
        vmin=0.0,
        label="obstacles",
    )
    ax.figure.colorbar(points, ax=ax, label="height above ground [m]", shrink=0.7)
    for a, b in ground_view.segments.tolist():
        ax.plot(*ground_view.points[[a, b]].T, color="0.3", linewidth=1.0)
    ax.plot(*ground_view.supports.T, ".", color=GROUND, markersize=4, label="ground")
    ax.plot(*ground_view.drop_offs.T, "v", color=DROP_OFF, markersize=5, label="below ground")
    dropped = ", ".join(
        f"{count} {reason}" for reason, count in sorted(ground_view.dropped.items())
    )
    ax.set_title(
        f"features by height; left out: {dropped.replace('_', ' ') or 'none'}", fontsize=10
    )


def draw_triangulation(parts: ViewParts, *, ax: Axes) -> None:
    """Draw the edges of the triangulation: surfaces and frontiers.

    Parameters
    ----------
    parts : ViewParts
    ax : matplotlib Axes
    """
    from matplotlib.collections import LineCollection

    frontiers = LineCollection(
        list(parts.surfaces.frontiers), colors="0.75", linewidths=0.6, linestyles="--"
    )
    frontiers.set_label("frontiers: longer than a link")
    ax.add_collection(frontiers)
    draw_surfaces(parts, ax=ax)
    ax.set_title("constrained Delaunay triangulation", fontsize=10)


def draw_surfaces(parts: ViewParts, *, ax: Axes) -> None:
    """Draw segments, links and lone points.

    Parameters
    ----------
    parts : ViewParts
    ax : matplotlib Axes
    """
    from matplotlib.collections import LineCollection

    for kind, (color, width, label) in SURFACES.items():
        ends = parts.surfaces.ends[parts.surfaces.kind == kind]
        if len(ends):
            lines = LineCollection(list(ends), colors=color, linewidths=width)
            lines.set_label(label)
            ax.add_collection(lines)


def draw_fan(parts: ViewParts, *, ax: Axes) -> None:
    """Draw the triangles of visible free space, by the kind of their end, and the surfaces.

    Parameters
    ----------
    parts : ViewParts
    ax : matplotlib Axes
    """
    from matplotlib.collections import LineCollection, PolyCollection

    fan = parts.fan
    viewpoint = np.zeros((len(fan.free), 1, 2))
    triangles = np.concatenate([viewpoint, fan.free], axis=1)
    on_ground = fan.surface < 0
    for rows, color, label in (
        (~on_ground, "#dbe9f4", "free up to a surface"),
        (on_ground, "#e3efd6", "free up to the last ground feature"),
    ):
        pieces = PolyCollection(list(triangles[rows]), facecolors=color, edgecolors="none")
        pieces.set_label(label)
        ax.add_collection(pieces)
    ends = LineCollection(list(fan.ends), colors=SEEN_END, linewidths=0.8)
    ends.set_label("end of sight")
    ax.add_collection(ends)
    draw_surfaces(parts, ax=ax)
    ax.set_title(f"sight fan: {len(fan.free)} triangles, {fan.area:.0f} m²", fontsize=10)


def draw_evidence(parts: ViewParts, grid: ConfidenceGrid, *, ax: Axes) -> None:
    """Draw the evidence z of the cells that the view observed.

    Parameters
    ----------
    parts : ViewParts
    grid : ConfidenceGrid
        The mapper's grid, for its cells.
    ax : matplotlib Axes
    """
    lower, z = parts.evidence[:2]
    x, y = grid.origin + lower[::-1] * grid.resolution
    rows, cols = z.shape
    picture = ax.imshow(
        np.where(z == 0, np.nan, z),
        origin="lower",
        extent=(x, x + cols * grid.resolution, y, y + rows * grid.resolution),
        cmap="PuOr_r",
        vmin=-1.0,
        vmax=1.0,
        interpolation="nearest",
    )
    ax.figure.colorbar(picture, ax=ax, label="z: negative free, positive non-free", shrink=0.7)
    ax.set_facecolor("0.8")
    ax.set_xlabel("x [m, map]")
    ax.set_ylabel("y [m, map]")
    ax.set_title(f"evidence: {int((z != 0).sum())} cells", fontsize=10)
