"""``groundmap bench``: how fast planners are, on published maps and queries."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from planners.bench.benchmark_problems import WORKLOADS
from planners.bench.benchmark_runner import ANY_ANGLE, figures
from planners.bench.movingai import WorkloadResult, find_workloads, run
from planners.commands.bench_motions import motions_command
from planners.commands.bench_samplers import Entry, race_samplers
from planners.commands.console import JsonOption, emit, emit_rows, say, show_progress

MISMATCH = 1  # exit code
COLUMNS = ("queries", "solved", "mismatches", "median_ms", "p95_ms", "setup_ms")
SHOWN = 5  # mismatches that are said one by one

bench_app = typer.Typer(
    name="bench",
    help="How fast planners are, and whether they find what others published.",
)


@bench_app.callback()
def bench_group() -> None:
    """How fast planners are, and whether they find what others published."""


bench_app.command("motions")(motions_command)


@bench_app.command("planning")
def planning_command(
    movingai: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder with maps and .scen files, or one such file."),
    ] = None,
    samplers: Annotated[
        bool,
        typer.Option("--samplers", help="Let OMPL's planners compete: who solves what, how soon."),
    ] = False,
    planner: Annotated[
        list[str] | None,
        typer.Option(
            help="Planner; with --samplers as often as you like, all unless told; with --movingai"
            " one, astar unless told (on voxels, no other)."
        ),
    ] = None,
    limit: Annotated[
        int | None,
        typer.Option(min=1, help="Queries of each file, evenly spread over it; all unless told."),
    ] = None,
    space: Annotated[
        list[str] | None,
        typer.Option(help="With --samplers: r2, se2, dubins, reeds_shepp, r3; all unless told."),
    ] = None,
    workload: Annotated[
        list[str] | None,
        typer.Option(help=f"With --samplers: {', '.join(WORKLOADS)}; all, or --map, unless told."),
    ] = None,
    map_file: Annotated[
        list[Path] | None,
        typer.Option(
            "--map", metavar="FILE | DIR", help="With --samplers: maps to cross, as for `plan`."
        ),
    ] = None,
    footprint: Annotated[
        str | None,
        typer.Option(
            metavar="R | 'X,Y X,Y X,Y ...'",
            help="On --map: radius [m], or corners [m, base_link]; a cart of 0.9 x 0.6 m unless"
            " told.",
        ),
    ] = None,
    turning_radius: Annotated[
        float, typer.Option(min=0.01, help="On --map: tightest turn of base_link [m].")
    ] = 1.0,
    seeds: Annotated[int, typer.Option(min=1, help="Attempts of each planner at a query.")] = 20,
    time_limit: Annotated[float, typer.Option(min=0.1, help="Of an attempt [s].")] = 10.0,
    improve_for: Annotated[
        float,
        typer.Option(min=0, help="So long go on planners that better their route [s]."),
    ] = 1.0,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Processes at a time; as many as processors unless told. One is best for times.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="With --samplers: draw costs over time: .png, .pdf or .svg."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Put published queries to a planner (exit 1 if a length mismatches), or let samplers compete.

    With --samplers, planners that are refused somewhere are named with the reason, and routes that
    are not found count against their planner: exit 0.
    """
    if samplers and movingai is not None:
        raise typer.BadParameter("expected --movingai or --samplers, got both")
    if not samplers and movingai is None:
        raise typer.BadParameter(
            "expected a folder with maps and queries of the MovingAI benchmark, got none"
            " (or take --samplers)",
            param_hint="--movingai",
        )
    if samplers and limit is not None:
        raise typer.BadParameter("expected it with --movingai, got it with --samplers",
                                 param_hint="--limit")  # fmt: skip
    if movingai is not None:
        others = {"--space": space, "--workload": workload, "--map": map_file,
                  "--footprint": footprint, "--jobs": jobs, "--plot": plot}  # fmt: skip
        for option, value in others.items():
            if value is not None and value != []:
                raise typer.BadParameter("expected it with --samplers, got it with --movingai",
                                         param_hint=option)  # fmt: skip
        if len(planner or []) > 1:
            got = ", ".join(planner or [])
            raise typer.BadParameter(
                f"expected one with --movingai, got {got}", param_hint="--planner"
            )
        _put_queries(movingai, (planner or ["astar"])[0], limit, as_json=as_json)
        return
    entry = Entry(
        workloads=workload or [],
        maps=map_file or [],
        planners=planner or [],
        spaces=space or [],
        footprint=footprint,
        turning_radius=turning_radius,
        seeds=seeds,
        time_limit=time_limit,
        improve_for=improve_for,
        jobs=jobs,
        plot=plot,
    )
    race_samplers(entry, as_json=as_json)


def _put_queries(movingai: Path, planner: str, limit: int | None, *, as_json: bool) -> None:
    """Put the queries of the MovingAI benchmark to a planner."""
    began = time.perf_counter()
    workloads = find_workloads(movingai, limit=limit)

    def watch(steps: list[Any]) -> Any:
        return show_progress(steps, total=len(steps), what=f"{planner}: queries")

    results = run(workloads, planner, watch=watch)
    total = figures([answer for result in results for answer in result.answers])
    if as_json:
        rows = [_row(result, planner) for result in results]
        seconds = time.perf_counter() - began
        emit(
            {"planner": planner, **total, "seconds": seconds, "rows": rows}, as_json=True, title=""
        )
    else:
        _print_table(results, total, planner)
    if total["mismatches"]:
        _say_mismatches(results)
        raise typer.Exit(MISMATCH)


def _row(result: WorkloadResult, planner: str) -> dict[str, Any]:
    return {
        "workload": result.workload.name,
        "system": planner,
        **figures(result.answers),
        "setup_ms": result.setup_ms,
    }


def _print_table(results: list[WorkloadResult], total: dict[str, Any], planner: str) -> None:
    """Print a line for each map, and one for all."""
    rows = {result.workload.name: _row(result, planner) for result in results}
    rows["all"] = {**total, "setup_ms": sum(row["setup_ms"] for row in rows.values())}
    shown = {name: {key: row[key] for key in COLUMNS} for name, row in rows.items()}
    emit_rows(shown, title=f"{planner} on the MovingAI benchmark")
    if planner in ANY_ANGLE:
        print(f"{planner} may cut short: only routes longer than published are mismatches")


def _say_mismatches(results: list[WorkloadResult]) -> None:
    wrong = [
        (result.workload.scen, answer)
        for result in results
        for answer in result.answers
        if not answer.agrees
    ]
    for scen, (query, length, _, _) in wrong[:SHOWN]:
        expected = f"a length of {query.length:g}" if query.solvable else "no route"
        got = "no route" if length is None else f"{length:g}"
        say(f"{scen}:{query.line}: expected {expected}, got {got}")
    if len(wrong) > SHOWN:
        say(f"... and {len(wrong) - SHOWN} more")
