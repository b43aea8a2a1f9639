"""``groundmap scenario``: worlds that are known, and how well they are mapped."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from groundmap.errors import GroundmapError
from groundmap.files.archive import check_writable
from groundmap.simulate.worlds import GENERATORS
from planners.bench.worker_pool import worker_pool
from planners.commands.console import JsonOption, emit, show_progress
from planners.errors import PlanningError
from planners.scenario.case import find_scenarios, load_scenario
from planners.scenario.outcome import Outcome
from planners.scenario.recall_section import why_one_triangulates
from planners.scenario.report import write_report
from planners.scenario.run import run_scenario
from planners.scenario.table import print_table
from planners.scenario.template import write_template

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
    found = dict(show_progress(_run(paths, jobs), total=len(paths), what="running scenarios"))
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
    workers = worker_pool(
        paths, _outcome, jobs=min(jobs, len(paths)), patience=math.inf, lost=_lost
    )
    with closing(workers):
        for path, outcome in workers:
            if not isinstance(outcome, Outcome):
                raise outcome
            yield path, outcome


def _outcome(path: Path) -> Outcome | GroundmapError | PlanningError | OSError:
    """Return what a scenario gives, or what it raises: a worker's exceptions stay with it."""
    try:
        return run_scenario(path)
    except (GroundmapError, PlanningError, OSError) as error:
        return error


def _lost(path: Path, reason: str) -> Outcome:
    """Return the outcome of a scenario whose process ended."""
    scenario = load_scenario(path)
    return Outcome(scenario.name, scenario.why, passed=False, missed=(reason,))
