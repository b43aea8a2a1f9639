"""All commands of ``groundmap``, and the message and exit code of each exception."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from typing import Annotated

import typer
from typer.exceptions import TyperException

from groundmap.errors import GroundmapError
from groundmap.printable import printable
from planners.commands.bench import bench_app
from planners.commands.collapse import collapse_command
from planners.commands.console import print_message
from planners.commands.convert import convert_command
from planners.commands.demo import demo_command
from planners.commands.evaluate import evaluate_command
from planners.commands.info import info_command
from planners.commands.map import map_command
from planners.commands.plan import plan_command
from planners.commands.plot import plot_command
from planners.commands.scenario import scenario_app
from planners.errors import AuditError, NoRouteError, PlanningError

DONE, MISSED, BAD_INPUT, NO_ROUTE, INTERRUPTED = 0, 1, 2, 3, 130

app = typer.Typer(
    name="groundmap",
    add_completion=False,
    rich_markup_mode=None,  # rich would read units such as [m] as markup
    pretty_exceptions_enable=False,
)


def _print_version(requested: bool) -> None:
    if requested:
        print(f"groundmap {version('groundmap')}")
        raise typer.Exit


@app.callback()
def _root(
    _: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Map sparse stereo features and plan routes on the map. Units: metres, radians, seconds."""


app.command("demo")(demo_command)
app.command("map")(map_command)
app.command("plan")(plan_command)
app.command("plot")(plot_command)
app.command("info")(info_command)
app.command("collapse")(collapse_command)
app.command("convert")(convert_command)
app.command("evaluate")(evaluate_command)
app.add_typer(scenario_app)
app.add_typer(bench_app)


def run(argv: Sequence[str]) -> int:
    """Run a command and return its exit code; an error is reported by one sentence on stderr.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C or SIGTERM.
    """
    try:
        code = app(argv or ["--help"], standalone_mode=False) or DONE
    except NoRouteError as error:
        return _report(error, str(error), NO_ROUTE, argv)
    except AuditError as error:
        return _report(error, f"{error} This is a bug: please report it.", MISSED, argv)
    except (GroundmapError, PlanningError, OSError) as error:
        return _report(error, str(error), BAD_INPUT, argv)
    except TyperException as error:
        return _report(error, error.format_message(), BAD_INPUT, argv)
    except typer.Abort as error:
        raise KeyboardInterrupt from error
    if code == INTERRUPTED:  # typer replaces KeyboardInterrupt by this exit code
        raise KeyboardInterrupt
    return int(code)


def _report(error: Exception, reason: str, code: int, argv: Sequence[str]) -> int:
    """Print the reason on stderr, with ``--json`` also as JSON on stdout; return the code."""
    reason = printable(reason, lines=True)
    print_message(f"groundmap: {reason}")
    if "--json" in argv:
        print(json.dumps({"error": type(error).__name__, "reason": reason}))
    return code
