"""``groundmap bench``: benchmarks of planners and of motion checks."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from planners.bench.benchmark_problems import WORKLOADS
from planners.bench.benchmark_runner import ANY_ANGLE, figures
from planners.bench.movingai import WorkloadResult, find_workloads, run
from planners.commands.bench_motions import motions_command
from planners.commands.bench_samplers import SamplerOptions, compare_samplers
from planners.commands.console import JsonOption, emit, emit_rows, print_message, show_progress

MISMATCH = 1  # exit code
COLUMNS = ("queries", "solved", "mismatches", "median_ms", "p95_ms", "setup_ms")
SHOWN = 5  # mismatches that are listed one by one

bench_app = typer.Typer(
    name="bench",
    help="Benchmark planners: their speed, and their lengths compared with published ones.",
)


@bench_app.callback()
def bench_group() -> None:
    """Benchmark planners: their speed, and their lengths compared with published ones."""


bench_app.command("motions")(motions_command)


@bench_app.command("planning")
def planning_command(
    movingai: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder with maps and .scen files of the MovingAI benchmark, or one such file.",
        ),
    ] = None,
    samplers: Annotated[
        bool,
        typer.Option("--samplers", help="Compare OMPL's planners: success, times and costs."),
    ] = False,
    planner: Annotated[
        list[str] | None,
        typer.Option(
            help="Planner. With --samplers: can be repeated; default: all. With --movingai: one;"
            " default: astar, the only one for voxel maps."
        ),
    ] = None,
    limit: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of queries per file, evenly spaced in the file; default: all."
        ),
    ] = None,
    space: Annotated[
        list[str] | None,
        typer.Option(help="With --samplers: r2, se2, dubins, reeds_shepp, r3; default: all."),
    ] = None,
    workload: Annotated[
        list[str] | None,
        typer.Option(
            help=f"With --samplers: {', '.join(WORKLOADS)}; default: all, or none with --map."
        ),
    ] = None,
    map_file: Annotated[
        list[Path] | None,
        typer.Option(
            "--map", metavar="FILE | DIR", help="With --samplers: maps to plan on, as for `plan`."
        ),
    ] = None,
    footprint: Annotated[
        str | None,
        typer.Option(
            metavar="R | 'X,Y X,Y X,Y ...'",
            help="With --map: radius [m], or corners [m, base_link]; default: a cart of"
            " 0.9 x 0.6 m.",
        ),
    ] = None,
    turning_radius: Annotated[
        float, typer.Option(min=0.01, help="With --map: minimum turning radius of base_link [m].")
    ] = 1.0,
    seeds: Annotated[
        int, typer.Option(min=1, help="With --samplers: attempts per planner and query.")
    ] = 20,
    time_limit: Annotated[
        float, typer.Option(min=0.1, help="With --samplers: time limit of an attempt [s].")
    ] = 10.0,
    improve_for: Annotated[
        float,
        typer.Option(
            min=0, help="With --samplers: time to keep improving after the first route [s]."
        ),
    ] = 1.0,
    jobs: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="With --samplers: number of processes; default: one per processor. Times are"
            " most accurate with one.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="With --samplers: draw costs over time: .png, .pdf or .svg."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run the MovingAI benchmark (exit 1 if a length mismatches), or compare sampling planners.

    With --samplers, the output names each planner that does not support a space, with the reason;
    a missing route counts against its planner, and the exit code stays 0.
    """
    if movingai is not None:
        for_samplers = {
            "--space": space,
            "--workload": workload,
            "--map": map_file,
            "--footprint": footprint,
            "--jobs": jobs,
            "--plot": plot,
        }
        _check_movingai(for_samplers, planner or [], samplers=samplers)
        _run_queries(movingai, (planner or ["astar"])[0], limit, as_json=as_json)
        return
    _check_samplers(limit, samplers=samplers)
    options = SamplerOptions(
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
    compare_samplers(options, as_json=as_json)


def _check_movingai(for_samplers: dict[str, Any], planners: list[str], *, samplers: bool) -> None:
    """Refuse options that do not apply to the MovingAI benchmark."""
    if samplers:
        raise typer.BadParameter("expected --movingai or --samplers, got both")
    for option, value in for_samplers.items():
        if value is not None and value != []:
            raise typer.BadParameter(
                "expected it with --samplers, got it with --movingai", param_hint=option
            )
    if len(planners) > 1:
        raise typer.BadParameter(
            f"expected one with --movingai, got {', '.join(planners)}", param_hint="--planner"
        )


def _check_samplers(limit: int | None, *, samplers: bool) -> None:
    """Refuse options that do not apply to the comparison of sampling planners."""
    if not samplers:
        raise typer.BadParameter(
            "expected a folder with maps and queries of the MovingAI benchmark, got none"
            " (or use --samplers)",
            param_hint="--movingai",
        )
    if limit is not None:
        raise typer.BadParameter(
            "expected it with --movingai, got it with --samplers", param_hint="--limit"
        )


def _run_queries(movingai: Path, planner: str, limit: int | None, *, as_json: bool) -> None:
    """Run the queries of the MovingAI benchmark with one planner."""
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
        _report_mismatches(results)
        raise typer.Exit(MISMATCH)


def _row(result: WorkloadResult, planner: str) -> dict[str, Any]:
    return {
        "workload": result.workload.name,
        "system": planner,
        **figures(result.answers),
        "setup_ms": result.setup_ms,
    }


def _print_table(results: list[WorkloadResult], total: dict[str, Any], planner: str) -> None:
    """Print one row per map and a row for all maps."""
    rows = {result.workload.name: _row(result, planner) for result in results}
    rows["all"] = {**total, "setup_ms": sum(row["setup_ms"] for row in rows.values())}
    shown = {name: {key: row[key] for key in COLUMNS} for name, row in rows.items()}
    emit_rows(shown, title=f"{planner} on the MovingAI benchmark")
    if planner in ANY_ANGLE:
        print(f"{planner} plans at any angle: only routes longer than published are mismatches")


def _report_mismatches(results: list[WorkloadResult]) -> None:
    """Print the first mismatches on stderr, and how many more there are."""
    mismatches = [
        (result.workload.scen, answer)
        for result in results
        for answer in result.answers
        if not answer.agrees
    ]
    for scen, (query, length, _, _) in mismatches[:SHOWN]:
        expected = f"a length of {query.length:g}" if query.solvable else "no route"
        got = "no route" if length is None else f"{length:g}"
        print_message(f"{scen}:{query.line}: expected {expected}, got {got}")
    if len(mismatches) > SHOWN:
        print_message(f"... and {len(mismatches) - SHOWN} more")
