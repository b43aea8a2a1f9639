"""Figures, scale bars, legends: what every picture has."""

from __future__ import annotations

import io
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import as_floats, check_finite
from groundmap.errors import InputError
from groundmap.files.archive import check_writable, write_atomically

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE_FORMATS = (".png", ".pdf", ".svg")
SMALLEST_BOX, LARGEST_BOX = 1e-3, 1e12  # [m]
FINEST = 1e-9  # least side of a box, as a share of its coordinates: axes can't label less
LONG_SIDE = 11.0  # [inch]


def new_figure(bounds: npt.ArrayLike) -> tuple[Figure, Axes]:
    """Return a figure shaped like a box of the map, without a window on any screen.

    Parameters
    ----------
    bounds : array_like, shape (4,)
        xmin, ymin, xmax, ymax [m, map].

    Raises
    ------
    InputError
        Bounds that are not finite, or hold nothing.
    """
    from matplotlib.figure import Figure

    box = as_floats("bounds", bounds, (4,))
    check_finite("bounds", box)
    xmin, ymin, xmax, ymax = box
    width, height = xmax - xmin, ymax - ymin
    if not (width > 0 and height > 0):
        raise InputError("bounds", "XMIN < XMAX and YMIN < YMAX [m]", str(box.tolist()))
    largest = max(float(np.abs(box).max()), SMALLEST_BOX)
    if min(width, height) < FINEST * largest or largest > LARGEST_BOX:
        expected = f"a box within {LARGEST_BOX:g} m, of which coordinates tell the sides apart"
        raise InputError("bounds", expected, str(box.tolist()))
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


def save_figure(figure: Figure, path: str | PathLike[str], *, dpi: int = 130) -> None:
    """Write a figure to a .png, .pdf or .svg file, atomically.

    Raises
    ------
    InputError
        Another kind of file.
    """
    check_picture(path)
    suffix = Path(path).suffix.lower()
    write_atomically(path, lambda stream: figure.savefig(stream, format=suffix[1:], dpi=dpi))


def figure_png(figure: Figure, dpi: int = 110) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    return stream.getvalue()


def check_picture(
    path: str | PathLike[str], *, sources: Iterable[str | PathLike[str]] = ()
) -> None:
    """Check that a picture can be written there, before the work that it is to show.

    Raises
    ------
    InputError
        Another suffix than .png, .pdf or .svg.
    FileFormatError
        The folder does not exist, or the path is a folder itself, or one of the files `sources`
        that the work reads.
    """
    if Path(path).suffix.lower() not in PICTURE_FORMATS:
        raise InputError("plot", f"a file name ending in {', '.join(PICTURE_FORMATS)}", str(path))
    check_writable(path, sources=sources)


def scale_bar(ax: Axes) -> list[Artist]:
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


def add_to_legend(ax: Axes, handles: list[Any]) -> Artist:
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
