"""``groundmap convert``: export a map for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundmap.files.archive import check_writable
from groundmap.io import export, files_of, files_written, load_map
from planners.commands.console import MAP_HELP, JsonOption, emit, numbers


def convert_command(
    map_file: Annotated[Path, typer.Argument(metavar="IN", help=MAP_HELP)],
    out: Annotated[
        Path,
        typer.Argument(help=".npz: dense arrays; .yaml and .pgm: a map of Nav2's map_server."),
    ],
    bounds: Annotated[
        str | None,
        typer.Option(
            metavar="XMIN,YMIN,XMAX,YMAX",
            help="Part to write [m], for a 3-D map with ZMIN and ZMAX; default: all.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Convert a map to the format of another program."""
    sources = files_of(map_file)
    for file in files_written(out):
        check_writable(file, sources=sources)
    box = None if bounds is None else numbers("bounds", bounds, 4, 6)
    export(load_map(map_file), out, bounds=box)
    emit({"out": str(out)}, as_json=as_json, title=f"converted {map_file}")
