"""Figures, scale bars and legends, which all pictures share."""

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
FINEST = 1e-9  # least side of a box relative to its coordinates: axis labels need it
LONG_SIDE = 11.0  # [inch]


def new_figure(bounds: npt.ArrayLike) -> tuple[Figure, Axes]:
    """Return a figure with the aspect ratio of a box of the map; it opens no window.

    Parameters
    ----------
    bounds : array_like, shape (4,)
        xmin, ymin, xmax, ymax [m, map].

    Raises
    ------
    InputError
        Bounds that are not finite, or an empty box.
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
        expected = f"a box within {LARGEST_BOX:g} m, with sides above {FINEST:g} of its coordinates"
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

    Parameters
    ----------
    figure : matplotlib Figure
    path : path
    dpi : int, default 130
        Resolution of raster images [pixels per inch].

    Raises
    ------
    InputError
        Another suffix.
    """
    check_picture(path)
    suffix = Path(path).suffix.lower()
    write_atomically(path, lambda stream: figure.savefig(stream, format=suffix[1:], dpi=dpi))


def figure_png(figure: Figure, dpi: int = 110) -> bytes:
    """Return the bytes of a PNG file of a figure.

    Parameters
    ----------
    figure : matplotlib Figure
    dpi : int, default 110
        Resolution [pixels per inch].
    """
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    return stream.getvalue()


def check_picture(
    path: str | PathLike[str], *, sources: Iterable[str | PathLike[str]] = ()
) -> None:
    """Check that a picture can be written to a path, before the work that it will show.

    Parameters
    ----------
    path : path
    sources : iterable of path
        Files that the work reads, which the picture must not replace.

    Raises
    ------
    InputError
        A suffix other than .png, .pdf and .svg.
    FileFormatError
        The folder does not exist, or the path is a folder or one of `sources`.
    """
    if Path(path).suffix.lower() not in PICTURE_FORMATS:
        raise InputError("plot", f"a file name ending in {', '.join(PICTURE_FORMATS)}", str(path))
    check_writable(path, sources=sources)


def scale_bar(ax: Axes) -> list[Artist]:
    """Draw a bar of a round number of metres, about a sixth of the axes wide."""
    xmin, xmax = ax.get_xlim()
    target = (xmax - xmin) / 6.0
    power = 10.0 ** np.floor(np.log10(target))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= target)
    transform = ax.get_xaxis_transform()  # x in metres, y as a share of the axes
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
    """Add handles to the legend above the axes, beside those it contains.

    Parameters
    ----------
    ax : matplotlib Axes
    handles : list of matplotlib Artist
        With labels.
    """
    legend = ax.get_legend()
    present = [] if legend is None else list(legend.legend_handles)
    return ax.legend(
        handles=[*(handle for handle in present if handle is not None), *handles],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.01),
        ncols=6,
        frameon=False,
        borderaxespad=0.0,
        fontsize=9,
        handlelength=1.6,
        columnspacing=1.2,
    )
