"""What every command does with its results, its progress and its time."""

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

from groundmap.printable import printable

T = TypeVar("T")

# Not in the table for people: of a route, these are in its file; warnings are on stderr.
LISTS = ("waypoints", "headings", "warnings")
SAY_EVERY = 2.0  # [s], between two lines of progress where there is no terminal

JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")
]


def emit(result: Mapping[str, Any], *, as_json: bool, title: str) -> None:
    """Print a result on stdout: one JSON object, or a table for people."""
    if as_json:
        print(json.dumps(result))
        return
    shown = {name.replace("_", " "): _format(result[name]) for name in result if name not in LISTS}
    width = max(map(len, shown))
    rows = (f"  {name:<{width}}  {value}" for name, value in shown.items())
    print(printable(title), *map(printable, rows), sep="\n")


def emit_columns(columns: Mapping[str, Mapping[str, Any]], *, title: str) -> None:
    """Print results side by side for people: a column for each, a row for each of their keys."""
    keys = list(next(iter(columns.values())))
    width = max(map(len, keys))
    print(printable(title))
    print(" " * width, *(f"{name:>10}" for name in columns), sep="  ")
    for key in keys:
        cells = (f"{_format(column[key]):>10}" for column in columns.values())
        print(f"{key.replace('_', ' '):<{width}}", *cells, sep="  ")


def emit_rows(rows: Mapping[str, Mapping[str, Any]], *, title: str) -> None:
    """Print results for people: a row for each, a column for each of their keys."""
    keys = list(next(iter(rows.values())))
    heads = [key.replace("_", " ") for key in keys]
    cells = {name: [_format(row[key]) for key in keys] for name, row in rows.items()}
    first = max(map(len, cells))
    widths = [
        max(len(head), *(len(row[i]) for row in cells.values())) for i, head in enumerate(heads)
    ]
    print(printable(title))
    for name, row in {"": heads, **cells}.items():
        padded = (f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True))
        print(f"  {name:<{first}}", *padded, sep="  ")


def say(message: str) -> None:
    """Print a message on stderr."""
    print(printable(message, lines=True), file=sys.stderr)


def show_progress(items: Iterable[T], *, total: int, what: str) -> Iterator[T]:
    """Yield `items` with a progress bar on stderr, or a line now and then without a terminal."""
    console = Console(stderr=True)
    if console.is_terminal:
        yield from track(items, total=total, description=what, console=console, transient=True)
        return
    spoke = time.monotonic()
    for number, item in enumerate(items, start=1):
        yield item
        if time.monotonic() - spoke > SAY_EVERY:
            say(f"{what}: {number} of {total}")
            spoke = time.monotonic()


@contextmanager
def patiently(what: str, *, every: float = SAY_EVERY) -> Iterator[None]:
    """Say on stderr, each so many seconds, that something still goes on."""
    over = threading.Event()

    def remind() -> None:
        while not over.wait(every):
            say(f"{what} ...")

    reminder = threading.Thread(target=remind, daemon=True)
    reminder.start()
    try:
        yield
    finally:
        over.set()
        reminder.join()


def seconds_since_start() -> float:
    """Return how long this process has run: starting Python and loading libraries takes time."""
    try:
        ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
        started = ticks / os.sysconf("SC_CLK_TCK")
        return time.clock_gettime(time.CLOCK_BOOTTIME) - started
    except (OSError, AttributeError, ValueError, IndexError):
        return time.process_time()  # elsewhere: the time on the processor, which is nearly it


def numbers(name: str, text: str, *lengths: int) -> tuple[float, ...]:
    """Return the numbers of an option such as ``X,Y[,YAW]``.

    Raises
    ------
    typer.BadParameter
        Not numbers, or another count of them than `lengths` allows.
    """
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in lengths:
        wanted = " or ".join(str(length) for length in lengths)
        raise typer.BadParameter(
            f"expected {wanted} numbers with commas between, got {text!r}", param_hint=f"--{name}"
        )
    return values


def _format(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_format(part)}" for key, part in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(_format(part) for part in value) or "none"
    return printable(str(value))
