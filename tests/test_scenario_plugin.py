"""Scenarios under pytest, in a process of its own: a test for each, and no traceback."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from test_scenario_command import FAILS, PASSES, SKIPPED
from test_scenario_run import write


def run_pytest(folder: Path, *options: str) -> tuple[int, str]:
    """Run pytest with the plugin, as a user would; return exit code and output."""
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-p", "planners.scenario.pytest_plugin"),
            *("-p", "no:cacheprovider", "--color=no", "-rs", *options, str(folder)),
        ],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four scenarios, one of them no scenario, and a file that is none."""
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    write(tmp_path / "clear", PASSES)
    write(tmp_path / "deep" / "strict", FAILS)
    write(tmp_path / "gone", SKIPPED)
    (tmp_path / "clear" / "other.toml").write_text("not = 'a scenario'")
    return tmp_path


def test_there_is_one_test_for_each_scenario_called_by_its_name(folder: Path) -> None:
    code, out = run_pytest(folder, "--collect-only", "-q")
    assert code == 0
    assert [line for line in out.splitlines() if "::" in line] == [
        "clear/scenario.toml::clear",
        "deep/strict/scenario.toml::strict",
        "gone/scenario.toml::gone",
    ]


def test_scenarios_pass_fail_and_are_skipped(folder: Path) -> None:
    code, out = run_pytest(folder, "-v")
    assert code == 1
    assert "clear/scenario.toml::clear PASSED" in out
    assert "deep/strict/scenario.toml::strict FAILED" in out
    assert "gone/scenario.toml::gone SKIPPED" in out
    assert f"there is no log {folder / 'gone' / 'no-log'}" in out
    assert "1 failed, 1 passed, 1 skipped" in out
    # What failed says why it exists and which bound it missed, and nothing of how that was found.
    assert re.search(r"\nstrict: A tiny hall.*\nfree_recall is 0\.\d+, not ≥ 2\n", out)
    assert "unknown is" not in out
    assert_no_traceback(out)


def test_a_scenario_is_chosen_by_its_name(folder: Path) -> None:
    code, out = run_pytest(folder, "-k", "clear")
    assert code == 0
    assert "1 passed, 2 deselected" in out


def test_a_file_that_is_no_scenario_fails_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    path = write(tmp_path / "bad", SKIPPED + "[maper]\n")
    code, out = run_pytest(tmp_path)
    assert code == 1
    assert f"{path}: expected maper to be a setting" in out
    assert "Did you mean 'mapper'?" in out
    assert_no_traceback(out)


def assert_no_traceback(out: str) -> None:
    assert "Traceback" not in out
    assert ".py:" not in out
    assert "raise " not in out
