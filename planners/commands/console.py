"""Results, messages and progress on the console, as all commands print them."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from groundmap.printable import printable

T = TypeVar("T")

# Left out of the printed table: a route's file holds the first two, stderr shows the warnings.
LISTS = ("waypoints", "headings", "warnings")
PROGRESS_INTERVAL = 2.0  # [s], between two lines of progress without a terminal
TABLE_WIDTH = 100_000  # characters: wider than any table, so that no cell is wrapped or cut

MAP_HELP = "A map: .npz, .yaml (map_server), .map, .3dmap."
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object, and nothing else, on stdout.")
]


def emit(result: Mapping[str, Any], *, as_json: bool, title: str) -> None:
    """Print a result on stdout: one JSON object, or a title and a table of names and values."""
    if as_json:
        print(json.dumps(result))
        return
    table = _new_table(show_header=False)
    for name, value in result.items():
        if name not in LISTS:
            table.add_row(_words(name), printable(_format(value)))
    print(printable(title), *format_table(table), sep="\n")


def emit_rows(rows: Mapping[str, Mapping[str, Any]], *, title: str) -> None:
    """Print a title and a table: one row per item of `rows`, one column per key of an item."""
    keys = list(next(iter(rows.values())))
    table = _new_table()
    table.add_column("")
    for key in keys:
        table.add_column(_words(key), justify="right")
    for name, row in rows.items():
        table.add_row(printable(name), *(_format(row[key]) for key in keys))
    print(printable(title), *format_table(table), sep="\n")


def emit_columns(columns: Mapping[str, Mapping[str, Any]], *, title: str) -> None:
    """Print a title and a table: one column per item of `columns`, one row per key of an item."""
    keys = list(next(iter(columns.values())))
    rows = {_words(key): {name: column[key] for name, column in columns.items()} for key in keys}
    emit_rows(rows, title=title)


def format_table(table: Table) -> list[str]:
    """Return the lines of a table, as wide as its cells and without trailing spaces."""
    console = Console(width=TABLE_WIDTH, markup=False, highlight=False, emoji=False)
    with console.capture() as captured:
        console.print(table)
    return [line.rstrip() for line in captured.get().splitlines()]


def print_message(message: str) -> None:
    """Print a message on stderr."""
    print(printable(message, lines=True), file=sys.stderr)


def show_progress(items: Iterable[T], *, total: int, what: str) -> Iterator[T]:
    """Yield `items` and show progress on stderr: a bar, or a line every 2 s without a terminal."""
    console = Console(stderr=True)
    if console.is_terminal:
        yield from track(items, total=total, description=what, console=console, transient=True)
        return
    printed = time.monotonic()
    for number, item in enumerate(items, start=1):
        yield item
        if time.monotonic() - printed > PROGRESS_INTERVAL:
            print_message(f"{what}: {number} of {total}")
            printed = time.monotonic()


@contextmanager
def show_waiting(what: str, *, every: float = PROGRESS_INTERVAL) -> Iterator[None]:
    """Print a line on stderr every few seconds [s] while the body of ``with`` runs."""
    over = threading.Event()

    def remind() -> None:
        while not over.wait(every):
            print_message(f"{what} ...")

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield
    finally:
        over.set()
        reminder.join()


def seconds_since_start() -> float:
    """Return the age of this process [s]; it includes the start of Python and all imports."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
        started = ticks / os.sysconf("SC_CLK_TCK")
        return time.clock_gettime(time.CLOCK_BOOTTIME) - started
    except (OSError, AttributeError, ValueError, IndexError):
        return time.process_time()  # without /proc: the processor time, which is slightly less


def numbers(name: str, text: str, *lengths: int) -> tuple[float, ...]:
    """Return the numbers of an option such as ``X,Y[,YAW]``.

    Raises
    ------
    typer.BadParameter
        Not numbers, or a count of numbers that is not one of `lengths`.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in lengths:
        expected = " or ".join(str(length) for length in lengths)
        raise typer.BadParameter(
            f"expected {expected} numbers separated by commas, got {text!r}",
            param_hint=f"--{name}",
        )
    return values


def _new_table(*, show_header: bool = True) -> Table:
    return Table(box=None, padding=(0, 0, 0, 2), show_header=show_header)


def _words(name: str) -> str:
    return printable(name.replace("_", " "))


def _format(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_format(part)}" for key, part in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_format(part) for part in value) or "none"
    return printable(str(value))
