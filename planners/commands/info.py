"""``groundmap info``: the contents of a map file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from groundmap import CellState
from groundmap.io import load_map
from planners.commands.console import MAP_HELP, JsonOption, emit


def info_command(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help=MAP_HELP)],
    as_json: JsonOption = False,
) -> None:
    """Summarise a map file: areas [m²], bounds [m], update rule, poses."""
    grid = load_map(map_file)
    poses = grid.trajectory
    extent, unit = ("area", "m2") if grid.ndim == 2 else ("volume", "m3")
    result = {
        "resolution": grid.resolution,
        "frame": grid.frame,
        "rule": grid.rule.to_dict(),
        "bounds": grid.bounds().tolist(),
        "tiles": sum(1 for _ in grid.tiles()),
        "map_bytes": grid.nbytes,
        f"{extent}_free_{unit}": grid.area(CellState.FREE),
        f"{extent}_nonfree_{unit}": grid.area(CellState.NONFREE),
        f"{extent}_contested_{unit}": grid.area(CellState.CONTESTED),
        "poses": len(poses),
        "first_pose": poses[0].tolist() if len(poses) else None,
        "last_pose": poses[-1].tolist() if len(poses) else None,
    }
    emit(result, as_json=as_json, title=f"map {map_file}")
