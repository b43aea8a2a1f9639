"""``groundmap convert``: a map for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundmap.archive import check_writable
from groundmap.io import export, files_of, load_map
from planners.console import JsonOption, emit


def convert_command(
    map_file: Annotated[
        Path, typer.Argument(metavar="IN", help="A map: .npz, .yaml (map_server), .map, .3dmap.")
    ],
    out: Annotated[
        Path,
        typer.Argument(help=".npz: dense arrays; .yaml: Nav2's map_server (with a .pgm beside)."),
    ],
    as_json: JsonOption = False,
) -> None:
    """Write a map in another program's form."""
    check_writable(out, sources=files_of(map_file))
    export(load_map(map_file), out)
    emit({"out": str(out)}, as_json=as_json, title=f"converted {map_file}")
