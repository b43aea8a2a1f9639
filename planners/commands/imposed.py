"""Options of `plan` and `plot` for areas that are not to be entered, whatever the map says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import shapely
import typer

from groundmap import CellSet, ConfidenceGrid
from planners.problem.keep_out_file import read_keep_out

RecentOption = Annotated[
    bool,
    typer.Option(
        "--recent", help="Also avoid what the last views before the map was saved saw as non-free."
    ),
]
KeepOutOption = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FILE",
        help="GeoJSON file with polygons [m, map] that the footprint must not enter; can be"
        " repeated.",
    ),
]


class Imposed(NamedTuple):
    """Areas that are not to be entered."""

    recent: CellSet | None  #: what the newest views saw as non-free
    keep_out: list[shapely.Polygon]


def imposed(*, recent: bool, keep_out: list[Path] | None, grid: ConfidenceGrid) -> Imposed:
    """Return the areas that the options stand for.

    Parameters
    ----------
    recent : bool
        Whether to include what the newest views saw as non-free.
    keep_out : list of Path or None
        GeoJSON files.
    grid : ConfidenceGrid
        The map.
    """
    polygons = [polygon for path in keep_out or () for polygon in read_keep_out(path)]
    return Imposed(grid.recent if recent else None, polygons)
