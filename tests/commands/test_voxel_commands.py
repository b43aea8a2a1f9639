"""Commands that make and use 3-D maps."""

from __future__ import annotations

import itertools
from importlib.resources import files
from pathlib import Path

import pytest

from command_line import Ran, run
from groundmap import ConfidenceGrid, read_views, write_views


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first views of the demo's log."""
    folder = tmp_path_factory.mktemp("log") / "views"
    write_views(itertools.islice(read_views(str(files("planners") / "demo_data")), 8), folder)
    return folder


@pytest.fixture(scope="module")
def mapped(log: Path) -> Ran:
    return run("map", log, "--out", log.parent / "map.npz", "--mode", "3d", "--json")


def test_map_makes_a_map_of_voxels(mapped: Ran) -> None:
    assert mapped.code == 0
    assert mapped.json["volume_free_m3"] > 10.0
    assert mapped.json["volume_nonfree_m3"] > 0.5
    grid = ConfidenceGrid.load(mapped.json["out"])
    assert grid.ndim == 3
    assert len(grid.planes) == mapped.json["views"] == 8


def test_collapse_writes_a_map_in_2d(mapped: Ran, tmp_path: Path) -> None:
    ran = run("collapse", mapped.json["out"], tmp_path / "flat.npz", "--json")
    assert ran.code == 0
    flat = ConfidenceGrid.load(tmp_path / "flat.npz")
    assert flat.ndim == 2
    assert ran.json["area_free_m2"] > 10.0


def test_collapse_refuses_to_replace_its_input(mapped: Ran) -> None:
    ran = run("collapse", mapped.json["out"], mapped.json["out"])
    assert ran.code == 2
    assert "expected a file other than the input" in ran.err


def test_collapse_refuses_a_band_without_voxels(mapped: Ran, tmp_path: Path) -> None:
    band = ("--low", "50", "--high", "60", "--free-below", "55")
    ran = run("collapse", mapped.json["out"], tmp_path / "flat.npz", *band)
    assert ran.code == 2
    assert "50 to 60 m" in ran.err


def test_an_unknown_mode_is_refused(log: Path, tmp_path: Path) -> None:
    ran = run("map", log, "--out", tmp_path / "map.npz", "--mode", "4d")
    assert ran.code == 2
    assert "mode: expected '2d' or '3d', got '4d'" in ran.err


def test_evaluate_judges_the_collapse_of_a_3d_map(tmp_path: Path) -> None:
    demo = read_views(str(files("planners") / "demo_data"))
    write_views(itertools.islice(demo, 5), tmp_path / "log")
    ran = run("evaluate", tmp_path / "log", "--mode", "3d", "--json")
    assert ran.code == 0
    assert ran.json["views"]["ground_free"] > 0.2


def test_the_demo_in_3d_plans_on_the_collapsed_map(tmp_path: Path) -> None:
    ran = run("demo", "--out", tmp_path / "demo", "--mode", "3d", "--json")
    assert ran.code == 0
    assert ran.json["audit"] == "clean"
    assert ConfidenceGrid.load(ran.json["voxels"]).ndim == 3
    assert ConfidenceGrid.load(ran.json["map"]).ndim == 2
