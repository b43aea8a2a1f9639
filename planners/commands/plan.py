"""``groundmap plan``: plan a route on a map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import numpy as np
import typer

from groundmap import ConfidenceGrid
from groundmap.draw import check_picture, known_bounds
from groundmap.files.archive import check_writable
from groundmap.io import files_of, load_map
from groundmap.io.map_images import BlockedMap, grid_of
from planners.commands.console import (
    MAP_HELP,
    JsonOption,
    emit,
    emit_rows,
    numbers,
    show_progress,
    show_waiting,
)
from planners.commands.imposed import Imposed, KeepOutOption, RecentOption, imposed
from planners.commands.options import assignments, outline
from planners.commands.plot import draw_map, draw_voxels
from planners.errors import NoRouteError, ProblemError
from planners.planning import plan
from planners.problem.costs import CostSettings
from planners.problem.problem import PLAIN, PlanningProblem, Unknown
from planners.registry import OWN_PLANNERS, get_planner
from planners.route.route import Route
from planners.route.route_files import format_of
from planners.route.shortcut import shortcut
from planners.route.smooth import smooth
from planners.search.graph import Graph

ALL = "all"  # instead of a planner's name
COLUMNS = ("length", "cost", "bound", "min_clearance", "mean_clearance", "min_confidence",
           "mean_confidence", "expanded", "seconds")  # fmt: skip
SETTINGS = "; ".join(
    f"{name}: {', '.join(own)}"
    for name, entry in sorted(OWN_PLANNERS.items())
    if (own := [key for key in entry.settings.model_fields if key != "time_limit"])
)


def plan_command(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help=MAP_HELP)],
    start: Annotated[
        str, typer.Option(metavar="X,Y[,YAW]", help="Start [m, rad; map]; on a 3-D map: X,Y,Z.")
    ],
    goal: Annotated[
        str,
        typer.Option(
            metavar="X,Y[,YAW]",
            help="Goal [m, rad; map]; on a 3-D map: X,Y,Z. hybrid_astar needs a yaw of both.",
        ),
    ],
    footprint: Annotated[
        str,
        typer.Option(
            metavar="R | 'X,Y X,Y X,Y ...'",
            help="Radius of the robot [m], or corners of its outline [m, base_link].",
        ),
    ],
    planner: Annotated[
        str,
        typer.Option(
            help=f"Planner: {', '.join(sorted(OWN_PLANNERS))}; all, to compare these; or a planner"
            " of OMPL such as rrtconnect, if ompl is installed."
        ),
    ] = "astar",
    out: Annotated[
        Path | None, typer.Option(help="File of the route: .geojson, .csv, or .yaml (ROS path).")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Picture of map and route: .png, .pdf or .svg.")
    ] = None,
    unknown: Annotated[
        str, typer.Option(help="Unknown and contested space: avoid, allow or penalise.")
    ] = "avoid",
    clear_start: Annotated[
        bool,
        typer.Option(
            help="Treat unknown cells near the start as free (for a disc, within twice its radius)."
            " known_clearance is the distance of the route to these cells and to obstacles."
        ),
    ] = True,
    clear_start_radius: Annotated[
        float | None,
        typer.Option(help="Distance from the start of unknown cells that are free [m]."),
    ] = None,
    recent: RecentOption = False,
    keep_out: KeepOutOption = None,
    clearance_weight: Annotated[
        float, typer.Option(help="Extra cost per metre of a route that touches obstacles [m/m].")
    ] = PLAIN.clearance_weight,
    inflation_radius: Annotated[
        float, typer.Option(help="Clearance from which on there is no extra cost [m].")
    ] = PLAIN.inflation_radius,
    confidence_weight: Annotated[
        float, typer.Option(help="Extra cost per metre at confidence 0 [m/m].")
    ] = PLAIN.confidence_weight,
    unknown_weight: Annotated[
        float,
        typer.Option(help="With --unknown penalise: extra cost per metre in unknown space [m/m]."),
    ] = PLAIN.unknown_weight,
    time_limit: Annotated[float, typer.Option(help="Time limit of planning [s].")] = 30.0,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help=f"Setting of the planner; can be repeated. {SETTINGS}; planners of OMPL: space,"
            " seed, iterations, goals and others, see docs/settings.md.",
        ),
    ] = None,
    straighten: Annotated[bool, typer.Option("--shortcut", help="Shorten the route.")] = False,
    turning_radius: Annotated[
        float | None,
        typer.Option(
            "--smooth", metavar="R", help="Shorten the route and round it to this radius [m]."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Plan a collision-free route on a map."""
    _check_files(map_file, out=out, plot=plot)
    if planner == ALL and (out or settings or straighten or turning_radius is not None):
        options = "--out, --set, --shortcut and --smooth"
        raise typer.BadParameter(f"{options} are for one planner, not {ALL}")
    if inflation_radius != PLAIN.inflation_radius and clearance_weight == 0:
        raise typer.BadParameter("--inflation-radius needs a --clearance-weight above 0")
    grid = _load_map(map_file, draws=plot is not None)
    areas = imposed(recent=recent, keep_out=keep_out, grid=grid)
    problem = PlanningProblem(
        grid,
        start=numbers("start", start, 2, 3),
        goal=numbers("goal", goal, 2, 3),
        footprint=outline(footprint),
        unknown=cast(Unknown, unknown),  # other values raise in PlanningProblem
        clear_start=clear_start,
        clear_start_radius=clear_start_radius,
        recent=areas.recent,
        keep_out=areas.keep_out,
        costs=CostSettings(
            clearance_weight=clearance_weight,
            inflation_radius=inflation_radius,
            confidence_weight=confidence_weight,
            unknown_weight=unknown_weight,
        ),
    )
    if planner == ALL:
        _compare(problem, plot, time_limit, as_json=as_json, title=f"routes on {map_file}")
        return
    with show_waiting("planning (the first use of a planner compiles it)"):
        chosen = {"time_limit": time_limit, **assignments(settings or [])}
        get_planner(planner).settings(**chosen)  # refuses the names of parameters of `plan`
        planned = plan(problem, planner, **chosen)
        route = _shorten(problem, planned, straighten=straighten, turning_radius=turning_radius)
    if out is not None:
        route.save(out)
    if plot is not None:
        _draw(problem, route, planned.graph, plot)
    emit(route.to_dict(), as_json=as_json, title=f"route of {planner} on {map_file}")


def _check_files(map_file: Path, *, out: Path | None, plot: Path | None) -> None:
    """Check that the files of route and picture can be written, and are none of the map's."""
    if out is not None:
        format_of(out)
        check_writable(out, sources=files_of(map_file))
    if plot is not None:
        check_picture(plot, sources=files_of(map_file))


def _load_map(map_file: Path, *, draws: bool) -> ConfidenceGrid:
    """Load a map; if it is to be drawn, refuse one that can't be before the search."""
    grid = load_map(map_file)
    if draws:
        known_bounds(grid)  # raises for a map too large to draw
    return grid


def _shorten(
    problem: PlanningProblem, route: Route, *, straighten: bool, turning_radius: float | None
) -> Route:
    """Return the route that ``--smooth`` or ``--shortcut`` gives; without them, the same route."""
    if turning_radius is not None:
        return smooth(problem, route, turning_radius=turning_radius)
    return shortcut(problem, route) if straighten else route


def _draw(problem: PlanningProblem, route: Route, graph: Graph | None, plot: Path) -> None:
    if problem.grid.ndim == 3:
        routes = {"route": route.waypoints}
        draw_voxels(problem.grid, plot, routes=routes, footprint=problem.radius)
        return
    draw_map(
        problem.grid,
        plot,
        waypoints=route.waypoints,
        footprint=problem.shape.to_value(),
        headings=route.headings,
        graph=graph,
        areas=_areas_of(problem),
    )


def _areas_of(problem: PlanningProblem) -> Imposed:
    return Imposed(problem.recent_set, list(problem.keep_out_areas.areas))


def _compare(
    problem: PlanningProblem, plot: Path | None, time_limit: float, *, as_json: bool, title: str
) -> None:
    """Plan with every planner of `OWN_PLANNERS`; report why a planner fails, and continue."""
    routes: dict[str, Route] = {}
    refused: dict[str, str] = {}
    failures: list[NoRouteError | ProblemError] = []
    names = sorted(OWN_PLANNERS)
    for name in show_progress(names, total=len(names), what="planners"):
        _warm_up(name)  # the seconds in the table do not include compilation
        try:
            routes[name] = plan(problem, name, time_limit=time_limit)
        except (NoRouteError, ProblemError) as error:
            refused[name] = str(error)
            failures.append(error)
    if not routes:
        raise next((e for e in failures if isinstance(e, NoRouteError)), failures[0])
    if plot is not None:
        lines = {name: route.waypoints for name, route in routes.items()}
        if problem.grid.ndim == 3:
            draw_voxels(problem.grid, plot, routes=lines, footprint=problem.radius)
        else:
            draw_map(problem.grid, plot, lines=lines, areas=_areas_of(problem))
    if as_json:
        by_name = {name: route.to_dict() for name, route in routes.items()}
        emit({"routes": by_name, "refused": refused}, as_json=True, title=title)
        return
    rows = {name: {key: getattr(route, key) for key in COLUMNS} for name, route in routes.items()}
    emit_rows(rows, title=title)
    for name, reason in refused.items():
        print(f"{name}: {reason}")


def _warm_up(planner: str) -> None:
    """Compile the kernels that a planner needs."""
    field = grid_of(BlockedMap(np.zeros((9, 9), bool), np.zeros((9, 9), bool), 1.0, (0.0, 0.0)))
    plan(PlanningProblem(field, start=(2, 2, 0), goal=(7, 5, 0), footprint=0.5), planner)
