"""``groundmap scenario``: map simulated worlds and compare the maps with the truth."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from groundmap.errors import GroundmapError
from groundmap.files.archive import check_writable
from groundmap.printable import printable
from groundmap.simulate.worlds import GENERATORS
from planners.bench.worker_pool import worker_pool
from planners.commands.console import JsonOption, emit, format_table, show_progress
from planners.errors import PlanningError
from planners.scenario.case import find_scenarios, load_scenario
from planners.scenario.outcome import Outcome
from planners.scenario.recall_section import triangulation_section
from planners.scenario.report import write_report
from planners.scenario.run import run_scenario
from planners.scenario.summary import reasons, remarks, summary, verdict
from planners.scenario.template import write_template

BOUND_MISSED = 1  # exit code

scenario_app = typer.Typer(
    name="scenario", help="Map simulated worlds, plan on the maps, compare with the truth."
)


@scenario_app.command("run")
def run_command(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Folders with scenario.toml files at any depth [./scenarios]."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Write a self-contained HTML report with a picture of each scenario."),
    ] = None,
    jobs: Annotated[
        int,
        typer.Option(
            min=1,
            show_default=False,
            help="Number of scenarios to run in parallel; default: one per processor.",
        ),
    ] = os.cpu_count() or 1,
    as_json: JsonOption = False,
) -> None:
    """Run scenarios; exit 1 if a bound is missed."""
    if report is not None:
        check_writable(report)
    paths = find_scenarios(folders or [Path("scenarios")])
    for path in paths:  # an error in the last file is reported before the first scenario runs
        load_scenario(path)
    by_path = dict(show_progress(_run(paths, jobs), total=len(paths), what="running scenarios"))
    outcomes = [by_path[path] for path in paths]
    if report is not None:
        write_report(report, outcomes, sections=[triangulation_section()])
    if as_json:
        _emit_outcomes(outcomes)
    else:
        print_outcomes(outcomes)
    if any(outcome.passed is False for outcome in outcomes):
        raise typer.Exit(BOUND_MISSED)


@scenario_app.command("new")
def new_command(
    name: Annotated[str, typer.Argument(help="Name of the scenario and of its folder.")],
    folder: Annotated[Path, typer.Option(help="Folder of all scenarios.")] = Path("scenarios"),
    as_json: JsonOption = False,
) -> None:
    """Write FOLDER/NAME/scenario.toml: a commented scenario that runs unchanged."""
    path = write_template(folder, name, sorted(GENERATORS))
    emit({"scenario": str(path)}, as_json=as_json, title=f"edit {path}, then run it")


def print_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print one line per outcome with its remarks below, then the counts.

    Remarks are missed bounds and the reasons why queries have no route.

    Examples
    --------
    >>> print_outcomes([
    ...     Outcome(
    ...         "room",
    ...         "a room",
    ...         True,
    ...         figures={"through.reason": "no route: the goal is fenced in."},
    ...         seconds=1.26,
    ...     ),
    ...     Outcome("glass door", "glass", False, missed=("false_free: 0.2, not ≤ 0.01",)),
    ...     Outcome("drive", "a log", None, skipped="no such file"),
    ... ])
    room        passed   1.3 s
        through: no route: the goal is fenced in.
    glass door  FAILED   0.0 s
        false_free: 0.2, not ≤ 0.01
    drive       skipped  0.0 s
        no such file
    1 passed, 1 failed, 1 skipped in 1.3 s
    """
    table = Table.grid("", "", "", padding=(0, 2))
    table.columns[-1].justify = "right"
    for outcome in outcomes:
        table.add_row(printable(outcome.name), verdict(outcome), f"{outcome.seconds:.1f} s")
    for outcome, line in zip(outcomes, format_table(table), strict=True):
        print(line)
        for sentence in (*remarks(outcome), *reasons(outcome)):
            print(f"    {sentence}")
    print(summary(outcomes))


def _emit_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print the outcomes as one JSON object."""
    verdicts = [outcome.passed for outcome in outcomes]
    result = {
        "passed": verdicts.count(True),
        "failed": verdicts.count(False),
        "skipped": verdicts.count(None),
        "cases": [outcome.to_dict() for outcome in outcomes],
    }
    emit(result, as_json=True, title="")


def _run(paths: list[Path], jobs: int) -> Iterator[tuple[Path, Outcome]]:
    """Yield each path with its outcome, as scenarios end."""
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
    """Return the outcome of a scenario, or the exception that it raised, for the main process."""
    try:
        return run_scenario(path)
    except (GroundmapError, PlanningError, OSError) as error:
        return error


def _lost(path: Path, reason: str) -> Outcome:
    """Return the outcome of a scenario whose process crashed."""
    scenario = load_scenario(path)
    return Outcome(scenario.name, scenario.why, passed=False, missed=(reason,))
