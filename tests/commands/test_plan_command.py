"""``groundmap plan``: planners, settings, outlines, files and pictures."""

from __future__ import annotations

import csv
import json
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from command_line import Ran, run
from groundmap import ConfidenceGrid
from groundmap.grid.recent_views import RecentView
from planners import OWN_PLANNERS, max_curvature
from planners.commands.console import show_waiting


@pytest.fixture(scope="session")
def wall(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of 30 x 12.8 m: a wall at x = 14 to 15 m, with a door of 2 m in it."""
    z = np.full((64, 150), -1.0, dtype=np.float32)
    z[:, 70:75] = 1.0
    z[40:50, 70:75] = -1.0
    grid = ConfidenceGrid(resolution=0.2)
    grid.fuse(np.array([0, 0]), z)
    path = tmp_path_factory.mktemp("wall") / "map.npz"
    grid.save(path)
    return path


def plan(
    wall: Path, *options: str | Path, start: str = "3,3", goal: str = "26,3", footprint: str = "0.5"
) -> Ran:
    places = ("--start", start, "--goal", goal, "--footprint", footprint)
    return run("plan", wall, *places, *options, "--json")


@pytest.mark.parametrize("planner", ["auto", "polyanya"])
def test_a_planner_is_chosen_by_name(wall: Path, planner: str) -> None:
    ran = plan(wall, "--planner", planner)
    assert ran.code == 0  # stderr may speak of compiling
    assert ran.json["planner"] == {"auto": "jps"}.get(planner, planner)
    assert ran.json["bound"] == 1.0


def test_all_planners_are_compared(wall: Path, tmp_path: Path) -> None:
    picture = tmp_path / "all.png"
    ran = plan(wall, "--planner", "all", "--plot", picture, start="3,3,0", goal="26,3,0")
    assert ran.code == 0
    assert sorted(ran.json["routes"]) == sorted(OWN_PLANNERS)
    assert ran.json["refused"] == {}
    with Image.open(picture) as image:
        assert min(image.size) > 300


def test_a_planner_that_refuses_the_problem_is_named_and_the_others_continue(wall: Path) -> None:
    ran = plan(wall, "--planner", "all", "--clearance-weight", "2")
    assert ran.code == 0
    assert set(ran.json["routes"]) | set(ran.json["refused"]) == set(OWN_PLANNERS)
    assert "uniform costs" in ran.json["refused"]["jps"]
    assert "yaw" in ran.json["refused"]["hybrid_astar"]
    table = run(
        *("plan", wall, "--start", "3,3", "--goal", "26,3", "--footprint", "0.5"),
        *("--planner", "all", "--clearance-weight", "2"),
    )
    assert "min clearance" in table.out
    assert "jps: planner: expected uniform costs" in table.out


def test_without_any_route_the_reason_is_reported(wall: Path) -> None:
    ran = plan(wall, "--planner", "all", footprint="1.2")
    assert ran.code == 3
    assert "the footprint needs 2.40 m" in ran.json["reason"]


def test_settings_reach_the_planner(wall: Path) -> None:
    assert plan(wall, "--planner", "weighted_astar", "--set", "weight=4").json["bound"] == 4.0
    ran = plan(wall, "--planner", "weighted_astar", "--set", "wait=4")
    assert ran.code == 2
    assert "Did you mean 'weight'?" in ran.json["reason"]


def test_a_clearance_weight_gives_a_longer_route(wall: Path) -> None:
    plain, wide = plan(wall), plan(wall, "--clearance-weight", "5", "--inflation-radius", "1.5")
    assert wide.json["length"] > plain.json["length"]
    assert wide.json["mean_clearance"] > plain.json["mean_clearance"]
    assert wide.json["cost"] > wide.json["length"]


def test_a_car_passes_where_its_outline_fits(wall: Path, tmp_path: Path) -> None:
    outline = "-0.6,-0.8 2.4,-0.8 2.4,0.8 -0.6,0.8"
    ends = {"start": "4,9,0", "goal": "24,9,0"}
    assert plan(wall, footprint=outline, **ends).code == 3
    picture, out = tmp_path / "car.png", tmp_path / "car.csv"
    ran = plan(
        wall, "--planner", "hybrid_astar", "--set", "turning_radius=3", "--set", "motion=dubins",
        "--plot", picture, "--out", out, footprint=outline, **ends,
    )  # fmt: skip
    assert (ran.code, ran.json["audit"]) == (0, "clean")
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert len(rows) == len(ran.json["waypoints"])
    assert float(rows[-1]["yaw"]) == 0.0
    assert picture.is_file()


def test_a_route_can_be_shortened_and_rounded(wall: Path) -> None:
    plain, tight = plan(wall), plan(wall, "--shortcut")
    assert tight.json["length"] < plain.json["length"] - 0.5
    rounded = plan(wall, "--smooth", "1.0")
    assert max_curvature(np.array(rounded.json["waypoints"])) <= 1.0
    hopeless = plan(wall, "--smooth", "50")
    assert hopeless.code == 3
    assert "can't be rounded with a turning radius of 50.00 m" in hopeless.json["reason"]


def test_a_path_for_ros_is_written(wall: Path, tmp_path: Path) -> None:
    out = tmp_path / "path.yaml"
    ran = plan(wall, "--out", out)
    message = yaml.safe_load(out.read_text())
    assert len(message["poses"]) == len(ran.json["waypoints"])


@pytest.mark.parametrize("name", ["hall.yaml", "hall.yml"])
def test_a_map_of_map_server_can_be_planned_on(tmp_path: Path, name: str) -> None:
    Image.fromarray(np.full((40, 60), 254, dtype=np.uint8)).save(tmp_path / "hall.pgm")
    (tmp_path / name).write_text(
        "image: hall.pgm\nresolution: 0.1\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    ran = plan(tmp_path / name, start="0,0", goal="4,1", footprint="0.3")
    assert ran.code == 0
    alone = plan(tmp_path / "hall.pgm", start="0,0", goal="4,1", footprint="0.3")
    assert alone.code == 2
    assert "Give the .yaml that names it" in alone.json["reason"]


def test_a_voxel_map_can_be_planned_on(tmp_path: Path) -> None:
    (tmp_path / "box.3dmap").write_text("voxel 16 16 16\n7 7 7\n")
    ran = plan(tmp_path / "box.3dmap", start="2.5,2.5,2.5", goal="13.5,2.5,9.5", footprint="1")
    assert ran.code == 0
    assert np.shape(ran.json["waypoints"])[1] == 3
    out = tmp_path / "route.geojson"
    assert plan(
        tmp_path / "box.3dmap", "--out", out, start="2.5,2.5,2.5", goal="9.5,2.5,9.5", footprint="1"
    ).code == 0  # fmt: skip
    assert len(json.loads(out.read_text())["geometry"]["coordinates"][0]) == 3
    picture = plan(
        *(tmp_path / "box.3dmap", "--plot", tmp_path / "route.png"),
        start="2.5,2.5,2.5",
        goal="9.5,2.5,9.5",
    )
    assert picture.code == 0
    assert (tmp_path / "route.png").read_bytes().startswith(b"\x89PNG")
    drawn = run("plot", tmp_path / "box.3dmap", "--route", out, "--height", "7.5", "--json")
    assert drawn.code == 0
    assert (tmp_path / "box.png").read_bytes().startswith(b"\x89PNG")
    outside = run("plot", tmp_path / "box.3dmap", "--height", "17", "--json")
    assert "height: expected a z from 0 to 16 m, got 17" in outside.json["reason"]
    described = run("info", tmp_path / "box.3dmap", "--json").json
    assert (described["voxels_free"], described["voxels_nonfree"]) == (4095, 1)
    assert (described["voxels_in_bounds"], described["volume_nonfree_m3"]) == (4096, 1.0)
    ran = plan(tmp_path / "box.3dmap", "--planner", "jps", start="2,2,2", goal="9,2,9")
    assert ran.code == 2
    assert "planner: expected one that supports 3-D maps: astar, auto" in ran.json["reason"]


def test_a_long_wait_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    with show_waiting("counting stars", every=0.01):
        time.sleep(0.3)
    assert capsys.readouterr().err.startswith("counting stars ...\n")
    with show_waiting("counting cows", every=60.0):
        pass
    assert capsys.readouterr().err == ""


def test_the_files_of_the_map_are_not_overwritten(tmp_path: Path) -> None:
    image = tmp_path / "hall.png"
    Image.fromarray(np.full((40, 60), 254, dtype=np.uint8)).save(image)
    (tmp_path / "hall.yaml").write_text(
        "image: hall.png\nresolution: 0.1\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    before = image.read_bytes()
    for options in (("--plot", image), ("--out", tmp_path / "hall.yaml")):
        ran = plan(tmp_path / "hall.yaml", *options, start="0,0", goal="4,1", footprint="0.3")
        assert ran.code == 2
        assert "expected a file other than the input" in ran.json["reason"]
    assert run("plot", tmp_path / "hall.yaml", "--out", image).code == 2
    assert image.read_bytes() == before


def test_an_inflation_radius_without_a_weight_is_refused(wall: Path) -> None:
    ran = plan(wall, "--inflation-radius", "2")
    assert ran.code == 2
    assert "--inflation-radius needs a --clearance-weight" in ran.json["reason"]


def test_a_ros_path_has_no_references(wall: Path, tmp_path: Path) -> None:
    out = tmp_path / "path.yml"
    assert plan(wall, "--out", out).code == 0
    assert "&id" not in out.read_text()


def test_the_time_limit_can_be_a_setting(wall: Path) -> None:
    assert plan(wall, "--set", "time_limit=none").code == 0
    ran = plan(wall, "--time-limit", "5", "--set", "time_limit=0")
    assert (ran.code, ran.json["error"]) == (3, "TimeLimitError")


def test_an_unknown_setting_is_refused_by_its_name(wall: Path) -> None:
    ran = plan(wall, "--set", "planner=jps")
    assert ran.code == 2
    assert "planner: expected a setting of AStarSettings, got an unknown key" in ran.err


@pytest.mark.parametrize("option", [["--shortcut"], ["--smooth", "1"], ["--set", "weight=2"]])
def test_options_for_one_planner_are_refused_with_all(wall: Path, option: list[str]) -> None:
    ran = plan(wall, "--planner", "all", *option)
    assert ran.code == 2
    assert "--out, --set, --shortcut and --smooth are for one planner, not all" in ran.err


def test_if_all_planners_refuse_the_problem_the_first_reason_is_reported(tmp_path: Path) -> None:
    grid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    grid.fuse(np.array([0, 0, 0]), np.full((16, 16, 16), -1.0, dtype=np.float32))
    grid.save(tmp_path / "solid.npz")
    ends = ("--start", "3,3,3", "--goal", "5,5,5", "--footprint", "0.5")
    options = ("--planner", "all", "--clearance-weight", "2")
    ran = run("plan", tmp_path / "solid.npz", *ends, *options)
    assert ran.code == 2
    assert "costs: expected no costs except length on a 3-D map" in ran.err


def test_keep_out_areas_of_a_file_close_the_door(wall: Path, tmp_path: Path) -> None:
    areas, route, picture = (tmp_path / name for name in ("door.geojson", "r.geojson", "r.png"))
    ring = [[14.2, 7.9], [14.8, 7.9], [14.8, 10.1], [14.2, 10.1], [14.2, 7.9]]
    areas.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    ran = plan(wall, "--keep-out", areas)
    assert ran.code == 3
    assert ran.json["error"] == "EnclosedError"
    assert "Without the keep-out areas they are connected" in ran.json["reason"]
    ring[0][0] = ring[3][0] = ring[4][0] = 14.0
    aside = [[[x, y - 6] for x, y in ring]]
    areas.write_text(json.dumps({"type": "Polygon", "coordinates": aside}))
    ran = plan(wall, "--keep-out", areas, "--out", route, "--plot", picture)
    assert ran.code == 0
    properties = json.loads(route.read_text())["properties"]
    assert 0.5 <= properties["keep_out_clearance"] == ran.json["keep_out_clearance"]
    assert properties["recent_clearance"] is None
    assert run("plot", wall, "--keep-out", areas, "--recent", "--out", picture).code == 0
    areas.write_text('{"type": "Point", "coordinates": [1, 2]}')
    ran = plan(wall, "--keep-out", areas)
    assert ran.code == 2
    assert "expected a GeoJSON file with polygons" in ran.err


def test_a_saved_map_is_planned_on_with_what_was_there_when_asked(tmp_path: Path) -> None:
    grid = ConfidenceGrid(resolution=0.2)
    grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    wall = np.array([[(6.1, -0.1), (6.1, 12.9)]])
    none = np.empty((0, 2), dtype=np.int64)
    grid.recent_views.add(RecentView(wall, np.array([False]), none, np.array([1.0, 6.0])))
    path = tmp_path / "map.npz"
    grid.save(path)
    assert plan(path, start="3,3", goal="12,3").code == 0
    ran = plan(path, "--recent", start="3,3", goal="12,3")
    assert ran.code == 3
    assert "Without what the newest views saw as non-free they are connected" in ran.json["reason"]
