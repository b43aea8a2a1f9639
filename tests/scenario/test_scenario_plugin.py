"""Scenarios under pytest in a separate process: one test per scenario, and no traceback."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from test_scenario_command import FAILS, PASSES, SKIPPED
from test_scenario_run import write


class Report(NamedTuple):
    """Result of pytest: exit code, the text of all failures, and the rest of its output."""

    code: int
    folder: Path
    failures: str
    rest: str


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """A scenario that passes, one that fails, one that is skipped, and an invalid file."""
    folder = tmp_path_factory.mktemp("cases")
    (folder / "pytest.ini").write_text("[pytest]\n")
    write(folder / "bad", SKIPPED + "[maper]\n")
    write(folder / "clear", PASSES)
    write(folder / "deep" / "strict", FAILS)
    write(folder / "gone", SKIPPED)
    (folder / "clear" / "other.toml").write_text("not = 'a scenario'")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-p", "planners.scenario.pytest_plugin"),
            *("-p", "no:cacheprovider", "--color=no", "-v", "-rs", str(folder)),
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert done.stderr == ""
    head, _, failures = done.stdout.partition("= FAILURES =")
    failures, _, tail = failures.partition("= short test summary info =")
    return Report(done.returncode, folder, failures, head + tail)


def test_there_is_one_test_per_scenario_with_its_name(report: Report) -> None:
    lines = [line.split()[:2] for line in report.rest.splitlines() if "::" in line]
    assert lines == [
        ["bad/scenario.toml::bad", "FAILED"],
        ["clear/scenario.toml::clear", "PASSED"],
        ["deep/strict/scenario.toml::strict", "FAILED"],
        ["gone/scenario.toml::gone", "SKIPPED"],
    ]
    assert report.code == 1
    assert "2 failed, 1 passed, 1 skipped" in report.rest


def test_a_failure_shows_the_purpose_and_the_missed_bounds(report: Report) -> None:
    text = r"\nstrict: A tiny hall with a box\.\nfree_recall is 0\.\d+, not ≥ 2\n"
    assert re.search(text, report.failures)
    assert "unknown is" not in report.failures  # a bound that holds


def test_an_invalid_file_fails_with_one_sentence(report: Report) -> None:
    path = report.folder / "bad" / "scenario.toml"
    assert f"\n{path}: expected maper to be a setting" in report.failures
    assert "Did you mean 'mapper'?" in report.failures


def test_there_is_no_traceback(report: Report) -> None:
    for word in ("Traceback", ".py:", "raise ", "\nE "):
        assert word not in report.failures


def test_a_scenario_with_a_missing_log_is_skipped(report: Report) -> None:
    assert f"there is no log {report.folder / 'gone' / 'no-log'}" in report.rest
