"""``groundmap bench motions``: compiled motion validation against a Python lambda per state."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap.io.map_images import BlockedMap, grid_of
from groundmap.io.movingai_scen import MovingAIQuery
from planners.bench.motions import compare_motions
from planners.bench.movingai import find_workloads, read_map
from planners.commands.console import JsonOption, emit, emit_rows, show_waiting
from planners.commands.options import outline
from planners.errors import ProblemError
from planners.problem.problem import Pose


def motions_command(
    scen: Annotated[
        Path, typer.Argument(metavar="SCEN", help="Queries of the MovingAI benchmark: .scen.")
    ],
    footprint: Annotated[
        str,
        typer.Option(
            metavar="R | 'X,Y X,Y X,Y ...'",
            help="Radius [m] for r2, or corners [m, base_link] for se2; the side of a cell is 1 m.",
        ),
    ] = "0",
    queries: Annotated[
        int, typer.Option(min=1, help="Number of queries, evenly spaced in the file.")
    ] = 5,
    seeds: Annotated[int, typer.Option(min=1, help="Searches per query and check.")] = 3,
    time_limit: Annotated[float, typer.Option(min=0.1, help="Time limit of a search [s].")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """Check the motions of RRT-Connect by a compiled call and by a Python lambda per state."""
    (work, *_) = find_workloads(scen, limit=queries)
    blocked_map = read_map(work)
    if not isinstance(blocked_map, BlockedMap):
        raise ProblemError("SCEN", "queries on a 2-D map", str(scen))
    with show_waiting("searching with both checks"):
        rows = compare_motions(
            grid_of(blocked_map),
            footprint=outline(footprint),
            queries=[_ends(query) for query in work.queries],
            seeds=seeds,
            time_limit=time_limit,
        )
    if as_json:
        emit({"map": work.name, "rows": rows}, as_json=True, title="")
        return
    shown = {f"{row['workload']}: {row['system']}": _figures(row) for row in rows}
    emit_rows(shown, title=f"motions on {work.name}")


def _figures(row: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name not in ("workload", "system")}


def _ends(query: MovingAIQuery) -> tuple[Pose, Pose]:
    """Return start and goal at the centres of their cells, headed from the start to the goal."""
    start, goal = ((col + 0.5, row + 0.5) for row, col in (query.start, query.goal))
    yaw = math.atan2(goal[1] - start[1], goal[0] - start[0])
    return (*start, yaw), (*goal, yaw)
