"""``groundmap bench``: how fast planners are, on published maps and queries."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from planners.bench.arena import ANY_ANGLE, figures
from planners.bench.movingai import Result, find_workloads, run
from planners.console import JsonOption, emit, emit_rows, say, watched

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


@bench_app.command("planning")
def planning_command(
    movingai: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder with maps and .scen files, or one such file."),
    ] = None,
    planner: Annotated[str, typer.Option(help="Planner; on voxels, astar.")] = "astar",
    limit: Annotated[
        int | None,
        typer.Option(min=1, help="Queries of each file, evenly spread over it; all unless told."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Put the queries of the MovingAI benchmark to a planner; exit 1 if a length mismatches."""
    if movingai is None:
        raise typer.BadParameter(
            "expected a folder with maps and queries of the MovingAI benchmark, got none",
            param_hint="--movingai",
        )
    began = time.perf_counter()
    workloads = find_workloads(movingai, limit=limit)

    def watch(steps: list[Any]) -> Any:
        return watched(steps, total=len(steps), what=f"{planner}: queries")

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


def _row(result: Result, planner: str) -> dict[str, Any]:
    return {
        "workload": result.workload.name,
        "system": planner,
        **figures(result.answers),
        "setup_ms": result.setup_ms,
    }


def _print_table(results: list[Result], total: dict[str, Any], planner: str) -> None:
    """Print a line for each map, and one for all."""
    rows = {result.workload.name: _row(result, planner) for result in results}
    rows["all"] = {**total, "setup_ms": sum(row["setup_ms"] for row in rows.values())}
    shown = {name: {key: row[key] for key in COLUMNS} for name, row in rows.items()}
    emit_rows(shown, title=f"{planner} on the MovingAI benchmark")
    if planner in ANY_ANGLE:
        print(f"{planner} may cut short: only routes longer than published are mismatches")


def _say_mismatches(results: list[Result]) -> None:
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
