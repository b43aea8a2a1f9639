"""``groundmap scenario``: worlds that are known, and how well they are mapped."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated

import typer

from groundmap.archive import check_writable
from groundmap.simulate.worlds import GENERATORS
from planners.console import JsonOption, emit, watched
from planners.scenario.case import find_scenarios, load_scenario
from planners.scenario.outcome import Outcome
from planners.scenario.report import write_report
from planners.scenario.run import run_scenario
from planners.scenario.table import print_table
from planners.scenario.template import write_template
from planners.scenario.why import why_one_triangulates

BOUND_MISSED = 1  # exit code

scenario_app = typer.Typer(
    name="scenario", help="Simulated worlds: map them, plan, compare with the truth."
)


@scenario_app.command("run")
def run_command(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Folders with scenario.toml files, at any depth [./scenarios]."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Write a self-contained HTML report with a picture of each case."),
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=1, help="How many to run at once; one per core unless told.")
    ] = os.cpu_count() or 1,
    as_json: JsonOption = False,
) -> None:
    """Run scenarios; exit 1 if a bound is missed."""
    if report is not None:
        check_writable(report)
    paths = find_scenarios(folders or [Path("scenarios")])
    for path in paths:  # a typing mistake in the last one should not show after minutes
        load_scenario(path)
    found = dict(watched(_run(paths, jobs), total=len(paths), what="running scenarios"))
    outcomes = [found[path] for path in paths]
    if report is not None:
        write_report(report, outcomes, sections=[why_one_triangulates()])
    failed = sum(outcome.passed is False for outcome in outcomes)
    if as_json:
        skipped = sum(outcome.passed is None for outcome in outcomes)
        emit(
            {
                "passed": len(outcomes) - failed - skipped,
                "failed": failed,
                "skipped": skipped,
                "cases": [outcome.to_dict() for outcome in outcomes],
            },
            as_json=True,
            title="",
        )
    else:
        print_table(outcomes)
    if failed:
        raise typer.Exit(BOUND_MISSED)


@scenario_app.command("new")
def new_command(
    name: Annotated[str, typer.Argument(help="What to call it.")],
    folder: Annotated[Path, typer.Option(help="Where scenarios live.")] = Path("scenarios"),
    as_json: JsonOption = False,
) -> None:
    """Start a scenario: writes a commented FOLDER/NAME/scenario.toml that runs as it is."""
    path = write_template(folder, name, sorted(GENERATORS))
    emit({"scenario": str(path)}, as_json=as_json, title=f"edit {path}, then run it")


def _run(paths: list[Path], jobs: int) -> Iterator[tuple[Path, Outcome]]:
    """Yield outcomes as they come."""
    if jobs == 1 or len(paths) == 1:
        for path in paths:
            yield path, run_scenario(path)
        return
    with ProcessPoolExecutor(min(jobs, len(paths)), mp_context=get_context("spawn")) as pool:
        running = {pool.submit(run_scenario, path): path for path in paths}
        try:
            for done in as_completed(running):
                yield running[done], done.result()
        finally:
            pool.shutdown(cancel_futures=True)
