"""``groundmap scenario`` end to end: JSON keys, exit codes, the report, a new scenario."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from test_scenario_run import HALL, query, write

from command_line import Ran, run, run_process
from planners.scenario.case import load_scenario

PASSES = HALL + query() + "[bounds]\nfree_recall = { min = 0.9 }\n"
FAILS = HALL + "[bounds]\nfree_recall = { min = 2 }\nunknown = { max = 1 }\n"
SKIPPED = 'why = "A drive."\n[log]\npath = "no-log"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three scenarios: one that passes, one that fails, one that is skipped."""
    write(tmp_path / "cases" / "clear", PASSES)
    write(tmp_path / "cases" / "deep" / "strict", FAILS)
    write(tmp_path / "cases" / "gone", SKIPPED)
    return tmp_path / "cases"


def refuse(word: str) -> None:
    """Refuse NaN and Infinity, which are not JSON."""
    raise AssertionError(word)


def cases(ran: Ran) -> dict[str, dict[str, Any]]:
    """Return the cases by name, without their time."""
    return {
        case["name"]: {key: value for key, value in case.items() if key != "seconds"}
        for case in ran.json["cases"]
    }


def assert_refused(ran: Ran, sentence: str) -> None:
    """Check for exit code 2, one sentence on stderr, and the same as JSON alone on stdout."""
    assert ran.code == 2
    assert ran.err.startswith("groundmap: ")
    assert ran.err.count("\n") == 1
    assert set(ran.json) == {"error", "reason"}
    assert ran.err == f"groundmap: {ran.json['reason']}\n"
    assert sentence in ran.json["reason"]


def test_run_prints_one_object_and_exits_1_if_a_bound_is_missed(folder: Path) -> None:
    ran = run("scenario", "run", folder, "--json", "--jobs", "1")
    assert ran.code == 1
    json.loads(ran.out, parse_constant=refuse)
    assert set(ran.json) == {"passed", "failed", "skipped", "cases"}
    assert [ran.json[key] for key in ("passed", "failed", "skipped")] == [1, 1, 1]
    found = cases(ran)
    assert list(found) == ["clear", "strict", "gone"]  # as their paths are sorted
    assert found["clear"]["passed"] is True
    assert found["clear"]["missed"] == []
    assert found["clear"]["figures"]["free_recall"] >= 0.9
    assert found["clear"]["figures"]["along.outcome"] == "route"
    assert found["strict"]["passed"] is False
    recall = f"{found['strict']['figures']['free_recall']:.4g}"
    assert found["strict"]["missed"] == [f"free_recall is {recall}, not ≥ 2"]
    assert found["gone"]["passed"] is None
    assert found["gone"]["skipped"].startswith("there is no log ")


def test_run_exits_0_if_all_pass_or_are_skipped(folder: Path) -> None:
    ran = run("scenario", "run", folder / "clear", folder / "gone", "--json", "--jobs", "1")
    assert ran.code == 0
    assert [ran.json[key] for key in ("passed", "failed", "skipped")] == [1, 0, 1]


def test_parallel_and_serial_runs_have_equal_results(folder: Path) -> None:
    one = run("scenario", "run", folder, "--json", "--jobs", "1")
    two = run_process("scenario", "run", folder, "--json", "--jobs", "2")
    assert one.code == two.code == 1
    assert list(cases(two)) == list(cases(one))
    assert cases(two) == cases(one)


def test_the_table_has_a_line_per_case_and_its_missed_bounds(folder: Path) -> None:
    ran = run("scenario", "run", folder, "--jobs", "1")
    assert ran.code == 1
    lines = ran.out.splitlines()
    assert re.match(r"clear +passed +\d", lines[0])
    assert re.match(r"strict +FAILED +\d", lines[1])
    assert re.match(r"    free_recall is .*, not ≥ 2$", lines[2])
    assert lines[-1].startswith("1 passed, 1 failed, 1 skipped in ")


def test_a_world_that_cannot_be_mapped_does_not_stop_the_others(folder: Path) -> None:
    write(folder / "blind", SKIPPED.replace("no-log", "."))
    ran = run("scenario", "run", folder / "blind", folder / "clear", "--json", "--jobs", "1")
    assert (ran.code, ran.json["passed"], ran.json["failed"]) == (1, 1, 1)
    assert cases(ran)["blind"]["missed"][0].startswith("FileFormatError: ")


def test_the_default_folder_is_scenarios(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "scenarios" / "gone", SKIPPED)
    monkeypatch.chdir(tmp_path)
    assert list(cases(run("scenario", "run", "--json"))) == ["gone"]


def test_the_report_is_one_file_with_every_case_in_it(folder: Path) -> None:
    report = folder / "report.html"
    ran = run("scenario", "run", folder, "--report", report, "--jobs", "1")
    assert ran.code == 1
    page = report.read_text(encoding="utf-8")
    for name in ("clear", "strict", "gone"):
        assert f">{name}</a>" in page
        assert f">{name} <span" in page
    for sentence in ("1 passed, 1 failed, 1 skipped", "not ≥ 2", "there is no log", "A tiny hall"):
        assert sentence in page
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert sum(source.startswith("data:image/png;base64,") for source in sources) == 3
    assert all(source.startswith(("data:", "#")) for source in sources)
    assert not re.search(r"https?:|@import|<script|<link", page)


def test_a_report_that_cannot_be_written_is_refused_before_anything_runs(folder: Path) -> None:
    ran = run("scenario", "run", folder, "--report", folder / "no" / "r.html", "--json")
    assert_refused(ran, "no")


def test_a_bad_file_is_refused_before_anything_runs(folder: Path) -> None:
    # It is the last of them: the mistake in it shows all the same before the first one runs.
    bad = write(folder / "z", PASSES.replace("free_recall", "free_recall = { mn = 1 }\nx"))
    ran = run("scenario", "run", folder, "--json", "--jobs", "1")
    assert_refused(ran, f"{bad}: expected mn to be a setting of BoundSettings")
    assert "passed" not in ran.out


def test_no_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    wanted = "expected a folder with scenario.toml files in it, got none."
    assert_refused(run("scenario", "run", "--json"), f"scenarios: {wanted}")
    assert_refused(run("scenario", "run", tmp_path, "--json"), f"{tmp_path}: {wanted}")


@pytest.mark.parametrize("jobs", ["0", "-1", "many"])
def test_jobs_are_one_or_more(folder: Path, jobs: str) -> None:
    assert_refused(run("scenario", "run", folder, "--jobs", jobs, "--json"), "--jobs")


def test_a_new_scenario_runs_and_passes_as_it_is(tmp_path: Path) -> None:
    place = tmp_path / "cases"
    ran = run("scenario", "new", "mine", "--folder", place, "--json")
    path = place / "mine" / "scenario.toml"
    assert (ran.code, ran.json) == (0, {"scenario": str(path)})
    assert load_scenario(path).name == "mine"
    assert f"groundmap scenario run {place / 'mine'}" in path.read_text(encoding="utf-8")
    found = run("scenario", "run", place, "--json")
    assert (found.code, found.json["passed"], found.json["failed"]) == (0, 1, 0)


def test_a_new_scenario_names_every_kind_of_world(tmp_path: Path) -> None:
    assert run("scenario", "new", "mine", "--folder", tmp_path).code == 0
    text = (tmp_path / "mine" / "scenario.toml").read_text(encoding="utf-8")
    assert "corridor, empty, forest, image, parking, rooms, spiral, warehouse" in text


def test_a_new_scenario_does_not_replace_another(tmp_path: Path) -> None:
    path = write(tmp_path / "mine", SKIPPED)
    ran = run("scenario", "new", "mine", "--folder", tmp_path, "--json")
    assert_refused(ran, f"{path}: expected no scenario there yet, got one. Give another name.")
    assert path.read_text(encoding="utf-8") == SKIPPED


def test_help_names_the_commands_and_their_options() -> None:
    ran = run("scenario", "--help")
    assert (ran.code, ran.err) == (0, "")
    assert "\n  run " in ran.out
    assert "\n  new " in ran.out
    text = " ".join(run("scenario", "run", "--help").out.split())
    for part in ("scenario.toml", "[./scenarios]", "--report", "--jobs", "--json", "exit 1"):
        assert part in text
    assert "FOLDER/NAME/scenario.toml" in " ".join(run("scenario", "new", "--help").out.split())


def test_the_file_to_start_with_gives_the_units(tmp_path: Path) -> None:
    assert run("scenario", "new", "mine", "--folder", tmp_path).code == 0
    text = (tmp_path / "mine" / "scenario.toml").read_text(encoding="utf-8")
    for unit in ("Metres, radians", "seconds", "[1/m²]", "[px]", "[deg]"):
        assert unit in text


@pytest.mark.parametrize("name", ["../up", "a/b", "..", ""])
def test_a_new_scenario_stays_in_its_folder(tmp_path: Path, name: str) -> None:
    refused = run("scenario", "new", name, "--folder", tmp_path / "cases")
    assert refused.code == 2
    assert refused.err == f"groundmap: name: expected the name of one folder, got {name!r}.\n"
    assert list(tmp_path.iterdir()) == []
