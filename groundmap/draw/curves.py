"""Curves of the free space that single views find, over their number of features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from groundmap.arrays import as_floats, check_finite
from groundmap.draw.figure import figure_png
from groundmap.errors import InputError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# Distinct in greyscale, too, by marker and dashes.
STYLES = (("#1f5f8b", "o", "-"), ("#221122", "s", "-"), ("#d08030", "^", "--"))
RECALL, FALSE = "truly free and in sight: free on the map", "free on the map: wrong by over 0.3 m"
MOST_FEATURES = 1e12
NEAREST = 0.13  # of a decade: least distance between two ticks


def draw_curves(curves: Mapping[str, npt.ArrayLike], *, ax: Sequence[Axes]) -> list[Artist]:
    """Draw the share of free space found, and the share of found free space that is false.

    Parameters
    ----------
    curves : mapping of str to array_like, shape (3, n)
        By label: numbers of features, share of free space found, share of it that is false.
    ax : sequence of two matplotlib Axes

    Raises
    ------
    InputError
        Arrays of another shape, numbers of features below 1, or shares outside [0, 1].
    """
    lines: list[Artist] = []
    values = {name: as_floats(name, rows, (3, None)) for name, rows in curves.items()}
    for number, (name, rows) in enumerate(values.items()):
        check_finite(name, rows)
        if not ((rows[0] >= 1.0) & (rows[0] <= MOST_FEATURES)).all():
            raise InputError(name, f"numbers of features from 1 to {MOST_FEATURES:g}", "others")
        if not ((rows[1:] >= 0.0) & (rows[1:] <= 1.0)).all():
            raise InputError(name, "shares from 0 to 1", "others")
        color, marker, dashes = STYLES[number % len(STYLES)]
        for axes, shares in zip(ax, rows[1:], strict=True):
            lines += axes.plot(
                rows[0], shares, color=color, marker=marker, linestyle=dashes,
                markersize=5, linewidth=1.6, label=name,
            )  # fmt: skip
    counts = np.unique(np.concatenate([np.empty(0), *(rows[0] for rows in values.values())]))
    for axes, title in zip(ax, (RECALL, FALSE), strict=True):
        _count_axis(axes, counts)
        axes.set_title(title, fontsize=10, loc="left")
        axes.set_ylabel("share")
        axes.legend(fontsize=9)
    ax[0].set_ylim(top=1.0)
    ax[1].set_ylim(bottom=0.0)
    return lines


def _count_axis(ax: Axes, counts: npt.NDArray[np.float64]) -> None:
    """Make x logarithmic, with ticks at those counts that fit."""
    ticks: list[float] = []
    for count in counts.tolist():
        if not ticks or np.log10(count / ticks[-1]) >= NEAREST:
            ticks.append(count)
    ax.set_xscale("log")
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_xticks([], minor=True)
    ax.set_xlabel("features in the view")
    ax.grid(color="0.9", linewidth=0.8)


def curves_png(curves: Mapping[str, npt.ArrayLike], *, dpi: int = 100) -> bytes:
    """Return the bytes of a PNG file of `draw_curves` on two axes side by side.

    Parameters
    ----------
    curves : mapping of str to array_like, shape (3, n)
        As for `draw_curves`.
    dpi : int, default 100
        Resolution [pixels per inch].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    draw_curves(curves, ax=figure.subplots(1, 2))
    return figure_png(figure, dpi=dpi)
