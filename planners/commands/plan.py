"""``groundmap plan``: from a map to a route."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer

from groundmap import ConfidenceGrid
from groundmap.archive import check_writable
from groundmap.draw import check_picture
from planners.commands.plot import draw_map
from planners.console import JsonOption, emit, numbers
from planners.problem import PlanningProblem, Unknown
from planners.registry import PLANNERS, plan


def plan_command(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="A map that `map` wrote.")],
    start: Annotated[str, typer.Option(metavar="X,Y[,YAW]", help="Start [m, rad; map].")],
    goal: Annotated[str, typer.Option(metavar="X,Y[,YAW]", help="Goal [m, rad; map].")],
    footprint: Annotated[float, typer.Option(help="Radius of the robot [m].")],
    planner: Annotated[
        str, typer.Option(help=f"Planner: {', '.join(sorted(PLANNERS))}.")
    ] = "astar",
    out: Annotated[Path | None, typer.Option(help="Write the route as GeoJSON.")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw map and route: .png, .pdf or .svg.")
    ] = None,
    unknown: Annotated[
        str, typer.Option(help="Unknown and contested space: avoid, allow or penalise.")
    ] = "avoid",
    clear_start: Annotated[
        bool, typer.Option(help="Count unknown cells near the start as free.")
    ] = True,
    time_limit: Annotated[float, typer.Option(help="Give up after [s].")] = 30.0,
    as_json: JsonOption = False,
) -> None:
    """Plan a collision-free route on a map."""
    if out is not None:
        check_writable(out, source=map_file)
    if plot is not None:
        check_picture(plot)
    problem = PlanningProblem(
        ConfidenceGrid.load(map_file),
        start=numbers("start", start, 2, 3),
        goal=numbers("goal", goal, 2, 3),
        footprint=footprint,
        unknown=cast(Unknown, unknown),  # the problem refuses others, in its own words
        clear_start=clear_start,
    )
    route = plan(problem, planner=planner, time_limit=time_limit)
    if out is not None:
        route.save_geojson(out)
    if plot is not None:
        draw_map(problem.grid, plot, waypoints=route.waypoints, footprint=footprint)
    emit(route.to_dict(), as_json=as_json, title=f"route of {planner} on {map_file}")
