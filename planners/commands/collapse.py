"""``groundmap collapse``: the 2-D map of a band of heights of a 3-D map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundmap import CellState, ConfidenceGrid
from groundmap.files.archive import check_writable
from planners.commands.console import JsonOption, emit


def collapse_command(
    map_file: Annotated[Path, typer.Argument(metavar="IN", help="A 3-D map: .npz.")],
    out: Annotated[Path, typer.Argument(help="File of the 2-D map: .npz.")],
    low: Annotated[
        float, typer.Option(help="Height above the ground that the robot can drive over [m].")
    ] = 0.15,
    high: Annotated[float, typer.Option(help="Height of the robot [m].")] = 2.0,
    free_below: Annotated[
        float, typer.Option(help="A cell is free if it was seen free below this height [m].")
    ] = 0.5,
    as_json: JsonOption = False,
) -> None:
    """Collapse a 3-D map to the 2-D map of a band of heights above the local ground."""
    check_writable(out, sources=[map_file])
    flat = ConfidenceGrid.load(map_file).collapse(low=low, high=high, free_below=free_below)
    flat.save(out)
    result = {
        "area_free_m2": flat.area(CellState.FREE),
        "area_nonfree_m2": flat.area(CellState.NONFREE),
        "out": str(out),
    }
    emit(result, as_json=as_json, title=f"collapse of {map_file}")
