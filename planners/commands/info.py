"""``groundmap info``: the contents of a map file, or of a source of views."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from groundmap import CellState
from groundmap.io import FORMATS, LOADERS, load_map
from groundmap.io.alignment import AlignedViews, align
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.sniffing import head_of
from planners.commands.console import MAP_HELP, JsonOption, emit, print_message
from planners.commands.sources import FormatOption, GuessOption, describe_map, open_source

ARCHIVE = b"PK\x03\x04"  # of a map with another suffix


def info_command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH",
            help=f"{MAP_HELP} Or a source of views: a log, or the map of a SLAM or SfM system.",
        ),
    ],
    format: FormatOption = None,
    guess_visibility: GuessOption = False,
    as_json: JsonOption = False,
) -> None:
    """Summarise a map (areas [m²] or voxels, bounds [m], rule, poses), or a source of views."""
    is_map = path.suffix.lower() in LOADERS or head_of(path).startswith(ARCHIVE)
    if format is None and is_map and not path.is_dir():
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
    cell = grid.resolution**grid.ndim
    areas = {
        state.name.lower(): grid.area(state)
        for state in (CellState.FREE, CellState.NONFREE, CellState.CONTESTED)
    }
    voxels = {f"voxels_{name}": round(area / cell) for name, area in areas.items()}
    lower, upper = grid.cell_bounds()
    dense = {"voxels_in_bounds": math.prod((upper - lower).tolist())}
    return {
        "resolution": grid.resolution,
        "frame": grid.frame,
        "rule": grid.rule.to_dict(),
        "bounds": grid.bounds().tolist(),
        "tiles": sum(1 for _ in grid.tiles()),
        "map_bytes": grid.nbytes,
        **{f"{extent}_{name}_{unit}": area for name, area in areas.items()},
        **(voxels | dense if grid.ndim == 3 else {}),
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
