"""Printed tables: aligned, neither wrapped nor cut, without markup and control characters."""

from __future__ import annotations

from typing import Any

import pytest
from rich.cells import cell_len

from planners.commands.console import LISTS, emit, emit_columns, emit_rows
from planners.commands.scenario import print_outcomes
from planners.scenario.outcome import Outcome

Captured = pytest.CaptureFixture[str]
OUTCOMES = [
    Outcome("room", "A room with four walls.", True, seconds=1.25),
    Outcome(
        "glass & <b>steel</b>",
        "Sight passes.",
        False,
        missed=("false_free: 0.25, expected ≤ 0.01", "clearance was not measured"),
        seconds=12.0,
    ),
    Outcome("drive", "A log.", None, skipped="The log is not here."),
]


@pytest.fixture(autouse=True)
def narrow_console(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let rich assume a console of 20 columns."""
    monkeypatch.setenv("COLUMNS", "20")


def test_a_result_is_a_title_and_a_line_per_value(capsys: Captured) -> None:
    emit(
        {"length": 1 / 3, "pose_jumps": [], "stages_s": {"read": 0.5, "save": 2.0}, "views": 7},
        as_json=False,
        title="map of log",
    )
    assert capsys.readouterr().out.splitlines() == [
        "map of log",
        "  length      0.3333",
        "  pose jumps  none",
        "  stages s    read 0.5, save 2",
        "  views       7",
    ]


def test_long_lists_are_left_out_of_the_table(capsys: Captured) -> None:
    emit({"length": 1.0, **{key: [1.0] for key in LISTS}}, as_json=False, title="route")
    assert capsys.readouterr().out.splitlines() == ["route", "  length  1"]


def test_rows_are_aligned_and_not_wrapped_on_a_narrow_console(capsys: Captured) -> None:
    rows: dict[str, dict[str, Any]] = {
        "hybrid_astar": {"length": 24.91, "min_clearance": 0.4034, "cost": None},
        "jps": {"length": 1234.5, "min_clearance": 0.381, "cost": 24},
    }
    emit_rows(rows, title="routes on map.npz")
    assert capsys.readouterr().out.splitlines() == [
        "routes on map.npz",
        "                length  min clearance  cost",
        "  hybrid_astar   24.91         0.4034  None",
        "  jps             1234          0.381    24",
    ]


def test_columns_are_the_rows_transposed(capsys: Captured) -> None:
    emit_columns({"views": {"ground_free": 0.957}, "thin": {"ground_free": 1.0}}, title="of log")
    assert capsys.readouterr().out.splitlines() == [
        "of log",
        "               views  thin",
        "  ground free  0.957     1",
    ]


def test_a_value_of_thousands_of_characters_stays_on_its_line(capsys: Captured) -> None:
    emit({"warnings_of": "word " * 500 + "end"}, as_json=False, title="map")
    _, line = capsys.readouterr().out.splitlines()
    assert line == "  warnings of  " + "word " * 500 + "end"


def test_markup_emoji_codes_and_control_characters_are_printed_as_text(capsys: Captured) -> None:
    emit({"out": "[red]y[m] :car:\x1b[2J"}, as_json=False, title="[bold]map")
    emit_rows({"[red]a\x1b.map": {"ms": 1.0}}, title="")
    assert capsys.readouterr().out.splitlines() == [
        "[bold]map",
        r"  out  [red]y[m] :car:\x1b[2J",
        "",
        "                  ms",
        r"  [red]a\x1b.map   1",
    ]


def test_wide_characters_are_aligned_by_their_width(capsys: Captured) -> None:
    emit_rows({"地図": {"ms": 1.5}, "map": {"ms": 10.5}}, title="maps")
    _, _, *lines = capsys.readouterr().out.splitlines()
    assert [cell_len(line) for line in lines] == [12, 12]


def test_outcomes_are_aligned_with_their_remarks_below(capsys: Captured) -> None:
    print_outcomes(OUTCOMES)
    assert capsys.readouterr().out.splitlines() == [
        "room                  passed    1.2 s",
        "glass & <b>steel</b>  FAILED   12.0 s",
        "    false_free: 0.25, expected ≤ 0.01",
        "    clearance was not measured",
        "drive                 skipped   0.0 s",
        "    The log is not here.",
        "1 passed, 1 failed, 1 skipped in 13.2 s",
    ]


def test_no_outcomes_print_their_count(capsys: Captured) -> None:
    print_outcomes([])
    assert capsys.readouterr().out == "0 passed, 0 failed, 0 skipped in 0.0 s\n"
