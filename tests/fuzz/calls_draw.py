"""Calls of `groundmap.draw`: pictures of odd values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fuzz.calls import Call
from fuzz.draw import Draw
from fuzz.problems import footprint, grid
from fuzz.values import array, number
from groundmap import ConfidenceGrid
from groundmap import draw as pictures

LINE = np.array([[1.0, 1.0], [3.0, 1.0], [4.0, 3.0]])


def maps(draw: Draw, _folder: Path) -> None:
    """Draw a map and what lies on it."""
    on = grid(draw)
    box = np.concatenate([on.origin, on.origin + 24 * on.resolution])
    figure, ax = pictures.new_figure(draw.noted("figure", array(draw, box, 0.3)))
    bounds = draw.noted("bounds", array(draw, box, 0.3))
    pictures.draw_grid(on, bounds=bounds, epsilon=number(draw, 0.001, 0.1, 0.1), ax=ax)
    poses = np.column_stack([LINE, [0.0, 1.0, 2.0]])
    pictures.draw_trajectory(draw.noted("poses", array(draw, poses, 0.3)), ax=ax)
    pictures.draw_verdicts(
        on, obstacles=array(draw, LINE, 0.2), grounds=array(draw, LINE, 0.2), ax=ax
    )
    if draw.chance(0.02):
        pictures.figure_png(figure, dpi=30)


def lines(draw: Draw, _folder: Path) -> None:
    """Draw routes and graphs."""
    _, ax = pictures.new_figure((0, 0, 5, 5))
    options: dict[str, Any] = {"footprint": draw.noted("footprint", footprint(draw, 0.5))}
    if draw.chance(0.5):
        options["headings"] = draw.noted("headings", array(draw, np.zeros(3), 0.4))
    pictures.draw_route(draw.noted("waypoints", array(draw, LINE, 0.4)), **options, ax=ax)
    other = draw.noted("other", array(draw, LINE[::-1], 0.4))
    pictures.draw_routes({"one": LINE, "two": other}, ax=ax)
    edges = draw.noted("edges", array(draw, np.array([[0, 1], [1, 2]]), 0.4))
    pictures.draw_graph(draw.noted("vertices", array(draw, LINE, 0.4)), edges, ax=ax)


def curves(draw: Draw, _folder: Path) -> None:
    """Draw curves."""
    rows = np.array([[10, 100, 1000], [0.2, 0.5, 0.9], [0.1, 0.05, 0.0]])
    from matplotlib.figure import Figure  # noqa: PLC0415 (loaded by who draws, as in the package)

    axes = Figure().subplots(1, 2)
    pictures.draw_curves({"a": draw.noted("rows", array(draw, rows, 0.8))}, ax=axes)


def voxels(draw: Draw, _folder: Path) -> None:
    """Draw a 3-D map and a route on it."""
    on = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    z = draw.numpy.choice([-1.0, 0.0, 1.0], (8, 10, 12)).astype(np.float32)
    on.fuse(np.zeros(3, dtype=np.int64), z)
    line = np.column_stack([LINE, [1.0, 2.0, 1.0]])
    options: dict[str, Any] = {
        "bounds": array(draw, np.array([0, 0, 0, 6, 5, 4.0]), 0.3),
        "height": number(draw, 0.0, 4.0, 0.2),
        "routes": {"route": array(draw, line, 0.3)},
        "footprint": number(draw, 0.0, 1.0, 0.2),
    }
    chosen = {name: value for name, value in options.items() if draw.chance(0.6)}
    pictures.voxel_figure(on, **draw.noted("options", chosen))


DRAW_CALLS: tuple[Call, ...] = (
    Call("draw-map", maps, weight=0.3),
    Call("draw-lines", lines, weight=0.3),
    Call("draw-curves", curves, weight=0.1),
    Call("draw-voxels", voxels, weight=0.05),
)
