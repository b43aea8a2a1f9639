"""``groundmap info``: the contents of a map file, or of a source of views."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from groundmap import CellState
from groundmap.io import FORMATS, LOADERS, load_map
from groundmap.io.align import AlignedViews, align
from groundmap.io.readers.base import SparseMapLog
from planners.commands.console import JsonOption, emit, print_message
from planners.commands.sources import FormatOption, GuessOption, describe_map, open_source


def info_command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH",
            help="A map (.npz, .yaml of map_server, .map, .3dmap), or a source of views: a log, or "
            "the map of a SLAM or SfM system.",
        ),
    ],
    format: FormatOption = None,
    guess_visibility: GuessOption = False,
    as_json: JsonOption = False,
) -> None:
    """Summarise a map (areas [m²], bounds [m], update rule, poses), or a source of views."""
    if format is None and path.suffix.lower() in LOADERS and not path.is_dir():
        emit(_describe_grid(path), as_json=as_json, title=f"map {path}")
        return
    source = open_source(path, format=format, guess_visibility=guess_visibility, level=False)
    result = _describe_source(source.log.path, source.views, metric=source.metric)
    emit(result, as_json=as_json, title=f"views of {path}")
    print_message(f"next: {result['next']}")


def _describe_grid(path: Path) -> dict[str, Any]:
    grid = load_map(path)
    poses = grid.trajectory
    extent, unit = ("area", "m2") if grid.ndim == 2 else ("volume", "m3")
    return {
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


def _describe_source(path: Path, views: AlignedViews, *, metric: bool) -> dict[str, Any]:
    log = views.log
    result: dict[str, Any] = {
        "format": next(name for name, kind in FORMATS.items() if type(log) is kind),
        "views": len(log),
        "metric": metric,
    }
    if isinstance(log, SparseMapLog):
        result |= describe_map(log)
    centres = np.array([view.T_map_camera[:3, 3] for view in log])
    result["path_length"] = float(np.linalg.norm(np.diff(centres, axis=0), axis=1).sum())
    ground = align(log, level=True).ground
    result["camera_height"] = None if ground is None else ground.camera_height
    scale = "" if metric else " --camera-height METRES"
    result["next"] = f"groundmap map {path}{scale} --out map.npz"
    return result
