"""``groundmap demo``: map the bundled log of a courtyard and plan a route through its doorway."""

from __future__ import annotations

import os
import shlex
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap import CellState, ConfidenceGrid, GroundMapper, fit_ground, read_views
from groundmap.errors import FileFormatError
from groundmap.files.archive import check_writable
from planners.commands.console import JsonOption, emit, show_progress
from planners.commands.plot import draw_map
from planners.commands.settings_file import ModeOption
from planners.planning import plan
from planners.problem.problem import PlanningProblem
from planners.route.route import Route

GOAL = (20.5, 2.5)  # [m, map], behind the doorway and the skip
FOOTPRINT = 0.35  # [m]
DOUBTFUL = 0.5  # its rig is narrow: single views are less sure than the default expects
MAP, VOXELS, ROUTE, PICTURE = "map.npz", "map3d.npz", "route.geojson", "map.png"


def demo_command(
    out: Annotated[Path, typer.Option(help="Folder for map, route and picture.")] = Path(
        "groundmap-demo"
    ),
    mode: ModeOption = None,
    as_json: JsonOption = False,
) -> None:
    """Map the bundled sample log, plan a route on the map, draw both.

    With --mode 3d the route is planned on the collapse of the 3-D map, which is saved beside it.
    """
    _check_folder(out)
    mapper = map_courtyard(**({} if mode is None else {"mode": mode}))
    grid = mapper.grid.collapse(doubtful=DOUBTFUL)
    start = grid.trajectory[0, :2]
    route = plan(PlanningProblem(grid, start=start, goal=GOAL, footprint=FOOTPRINT))
    out.mkdir(exist_ok=True)
    grid.save(out / MAP)
    if mapper.grid.ndim == 3:
        mapper.grid.save(out / VOXELS)
    route.save_geojson(out / ROUTE)
    draw_map(grid, out / PICTURE, waypoints=route.waypoints, footprint=FOOTPRINT)
    result = _summary(mapper, grid, route, out)
    commands = _next_commands(out, route)
    if as_json:
        emit({**result, "next": commands}, as_json=True, title="")
        return
    emit(result, as_json=False, title="a courtyard, mapped and crossed")
    print("\nLook at the picture, then try:", *commands, sep="\n  ")


def map_courtyard(**settings: Any) -> GroundMapper:
    """Return a mapper with all views of the bundled sample log.

    Parameters
    ----------
    **settings
        Fields of `groundmap.MapperSettings`.
    """
    mapper = GroundMapper(**settings)
    with as_file(files("planners") / "demo_data") as folder:
        log = read_views(folder)
        for view in show_progress(fit_ground(log), total=len(log), what="mapping views"):
            mapper.integrate(view)
    return mapper


def _check_folder(out: Path) -> None:
    """Check that the files can be written, or that a new folder can be created."""
    if os.path.isfile(out):  # unlike Path's methods, os.path's accept any name without an error
        raise FileFormatError(out, "a folder, or the name of a new one", "a file")
    if not os.path.isdir(out):
        check_writable(out)
        return
    for name in (MAP, VOXELS, ROUTE, PICTURE):
        check_writable(out / name)


def _summary(mapper: GroundMapper, grid: ConfidenceGrid, route: Route, out: Path) -> dict[str, Any]:
    values = route.to_dict()
    shown = ("length", "min_clearance", "mean_confidence", "unknown_length", "audit", "waypoints")
    return {
        "views": mapper.stats.views,
        "features_used": mapper.stats.features_used,
        "area_free_m2": grid.area(CellState.FREE),
        "area_nonfree_m2": grid.area(CellState.NONFREE),
        "footprint": FOOTPRINT,
        **{name: values[name] for name in shown},
        "map": str(out / MAP),
        **({"voxels": str(out / VOXELS)} if mapper.grid.ndim == 3 else {}),
        "route": str(out / ROUTE),
        "picture": str(out / PICTURE),
    }


def _next_commands(out: Path, route: Route) -> list[str]:
    """Return commands to try next, quoted for a shell."""
    folder = out.as_posix()
    grid, line, doorway = (shlex.quote(f"{folder}/{name}") for name in (MAP, ROUTE, "doorway.png"))
    back, start = ("{:g},{:g}".format(*route.waypoints[end]) for end in (-1, 0))
    return [
        f"groundmap info {grid}",
        f"groundmap plan {grid} --start {back} --goal {start} --footprint 0.3",
        f"groundmap plot {grid} --route {line} --footprint {FOOTPRINT} "
        f"--bounds 10,5,18,14 --out {doorway}",
    ]
