"""Pictures of anytime planners: time to the first route, cost over time, seeds solved."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import InputError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinct for colour-blind people (with a darker yellow); markers.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#221122")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h", "p", "d", "*", "8", "H")
ALL, SOME, NONE = "#dbe9f4", "#fbe3c8", "#f2b8a0"  # seeds that were solved
RATIOS = (1.0, 1.02, 1.05, 1.1, 1.2, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0)
FEW = 5  # most ratios at the ticks of a panel
PANEL, LINE = (3.3, 2.5), 0.21  # [inch]: size of a panel; height of a row of the table


class Progress(NamedTuple):
    """The results of one planner.

    Attributes
    ----------
    points : sequence or ndarray, shape (n, 2)
        Seconds, ascending, and the ratio of the cost to the optimum. The last row is the returned
        route. Planners that do not improve their route have one row; no route: no row.
    solved, asked : int
        Number of seeds solved, and in total.
    """

    points: Sequence[Sequence[float]] | Floats
    solved: int
    asked: int


class Style(NamedTuple):
    """Colour and marker of a planner."""

    color: str
    marker: str
    lined: bool  #: whether it improves its routes


class Panel(NamedTuple):
    """Results of planners, by name, on one workload in one space."""

    title: str
    progress: Mapping[str, Progress]
    note: str = ""  #: the reference of the ratio


def styles(panels: Sequence[Panel]) -> dict[str, Style]:
    """Return a style for each planner: first those that improve their routes, by name.

    Colours differ while there are enough of them; no two planners share both colour and marker.

    Examples
    --------
    >>> once, better = Progress([(1, 2)], 1, 1), Progress([(1, 2), (3, 1)], 1, 1)
    >>> for name, style in styles([Panel("", {"rrt": once, "bitstar": better})]).items():
    ...     print(name, *style)
    bitstar #0072b2 o True
    rrt #d55e00 s False
    """
    names = {name for panel in panels for name in panel.progress}
    lined = {
        name for panel in panels for name, done in panel.progress.items() if len(done.points) > 1
    }
    ordered = [*sorted(lined), *sorted(names - lined)]
    return {
        name: Style(COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], name in lined)
        for i, name in enumerate(ordered)
    }


def draw_anytime(
    progress: Mapping[str, Progress], *, style: Mapping[str, Style], ax: Axes
) -> list[Artist]:
    """Draw cost over time: a line for each planner that improves its route, else a marker.

    A line ends in the marker of its planner, at the returned route. A hollow marker means that not
    every seed was solved.

    Parameters
    ----------
    progress : mapping of str to Progress
    style : mapping of str to Style
        As `styles` returns it.
    ax : matplotlib Axes

    Raises
    ------
    InputError
        Points of another shape, or not finite.
    """
    artists: list[Artist] = []
    highest = 1.0
    for name, (values, solved, asked) in progress.items():
        points = as_floats(name, values, (None, 2)) if np.size(values) else np.empty((0, 2))
        check_finite(name, points)
        if len(points) == 0:
            continue
        color, marker, _ = style[name]
        artists += ax.plot(
            *points.T, color=color, marker=marker, markevery=[len(points) - 1], linewidth=1.5,
            markersize=6.5, markeredgewidth=1.3, alpha=0.9, drawstyle="steps-post",
            markerfacecolor=color if solved == asked else "white", label=name, zorder=3,
        )  # fmt: skip
        highest = max(highest, float(points[:, 1].max()))
    _axes_of(ax, highest)
    return artists


def draw_success(panels: Sequence[Panel], *, style: Mapping[str, Style], ax: Axes) -> list[Artist]:
    """Draw a table of the numbers of solved seeds: a row for each planner, with its marker.

    Parameters
    ----------
    panels : sequence of Panel
        The columns.
    style : mapping of str to Style
        The rows.
    ax : matplotlib Axes
    """
    from matplotlib.patches import Rectangle

    artists: list[Artist] = []
    for row, (name, (color, marker, lined)) in enumerate(style.items()):
        artists += ax.plot(
            [-2.6, -2.25, -1.9], [row] * 3, color=color, marker=marker, markevery=[2],
            markersize=6.5, linewidth=1.5 if lined else 0.0,
        )  # fmt: skip
        artists.append(ax.text(-1.7, row, name, va="center", fontsize=8.5))
        for column, panel in enumerate(panels):
            done = panel.progress.get(name)
            shade, entry = ("white", "-") if done is None else (_shade(done), f"{done.solved}")
            box = Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor=shade, edgecolor="white")
            artists.append(ax.add_patch(box))
            artists.append(ax.text(column, row, entry, ha="center", va="center", fontsize=8.5))
    for column, panel in enumerate(panels):
        title = panel.title.replace(", ", "\n")
        artists.append(ax.text(column, -0.7, title, ha="center", va="bottom", fontsize=8))
    ax.set_xlim(-2.8, len(panels) - 0.5)
    ax.set_ylim(len(style) - 0.5, -2.4)
    ax.set_axis_off()
    return artists


def anytime_figure(panels: Sequence[Panel], *, columns: int) -> Figure:
    """Return a figure of all panels, with the table of solved seeds below them.

    Parameters
    ----------
    panels : sequence of Panel
    columns : int
        Panels in a row.

    Raises
    ------
    InputError
        No panels.
    """
    from matplotlib.figure import Figure

    if not panels:
        raise InputError("panels", "at least one", "none")
    style = styles(panels)
    rows = -(-len(panels) // columns)
    heights = [rows * PANEL[1], (len(style) + 3.5) * LINE]
    width = max(PANEL[0] * columns, 0.75 * len(panels) + 2.0, 6.0)
    figure = Figure(figsize=(width, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=heights)
    above, below = parts
    grid = above.subplots(rows, columns, squeeze=False)
    for panel, ax in zip(panels, grid.flat, strict=False):
        draw_anytime(panel.progress, style=style, ax=ax)
        ax.set_title(panel.title, fontsize=9.5, loc="left")
        ax.set_title(panel.note, fontsize=8, loc="right", color="0.35")
    for ax in grid.flat[len(panels) :]:
        ax.set_axis_off()
    _same_times(grid.flat[: len(panels)])
    for ax in grid[:, 0]:
        ax.set_ylabel("cost / optimum", fontsize=9)
    for ax in grid.flat[max(len(panels) - columns, 0) : len(panels)]:
        ax.set_xlabel("time [s]", fontsize=9)
    table = below.subplots()
    draw_success(panels, style=style, ax=table)
    asked = max(done.asked for panel in panels for done in panel.progress.values())
    table.set_title(
        f"seeds solved, of {asked} (a line: the median of all seeds; hollow: some unsolved)",
        fontsize=9, loc="left",
    )  # fmt: skip
    return figure


def _shade(done: Progress) -> str:
    if done.solved == done.asked:
        return ALL
    return SOME if 2 * done.solved >= done.asked else NONE


def _axes_of(ax: Axes, highest: float) -> None:
    """Make both axes logarithmic; that of the ratios starts just below 1 and has few ticks."""
    top = max(1.05, highest**1.08)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(top**-0.05, top)
    within = [ratio for ratio in RATIOS if ratio <= top]
    spread = [
        min(within, key=lambda ratio: abs(np.log(ratio) - at))
        for at in np.linspace(0.0, np.log(within[-1]), FEW)
    ]
    ticks = sorted(set(spread))
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.tick_params(labelsize=8)
    ax.axhline(1.0, color="0.5", linewidth=0.8, zorder=1)
    ax.grid(color="0.92", linewidth=0.8, zorder=0)


def _same_times(axes: Iterable[Axes]) -> None:
    """Set the same range of times on all panels."""
    every = list(axes)
    times = np.concatenate([line.get_xdata() for ax in every for line in ax.lines[:-1]] or [[1.0]])
    low, high = float(np.min(times)), float(np.max(times))
    for ax in every:
        ax.set_xlim(low / 1.5, high * 1.5)
        ax.xaxis.set_major_formatter("{x:g}")
