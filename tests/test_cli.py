"""The command end to end: JSON keys, exit codes, one sentence on stderr, nothing else on stdout."""

from __future__ import annotations

import itertools
import json
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import Ran, run, run_process
from groundmap import CellState, ConfidenceGrid, read_views, write_views
from planners.commands.app import app

VIEWS = 12
# The plain square below: 32 x 32 m, a ring of walls in it, and a strip that no view saw.
RESOLUTION = 0.5
INSIDE_RING, ON_RING, IN_STRIP, BEYOND = "12.5,12.5", "10.25,12.5", "28,5", "90,5"


@pytest.fixture(scope="session")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small log in our own format: the first views of the demo's."""
    folder = tmp_path_factory.mktemp("log") / "views"
    demo = read_views(str(files("planners") / "demo_data"))
    write_views(itertools.islice(demo, VIEWS), folder)
    return folder


@pytest.fixture(scope="session")
def mapped(log: Path) -> Ran:
    return run_process("map", log, "--out", log.parent / "map.npz", "--json")


@pytest.fixture(scope="session")
def map_file(mapped: Ran) -> Path:
    return Path(mapped.json["out"])


@pytest.fixture(scope="session")
def square(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map on which it is known what is where."""
    z = np.full((64, 64), -1.0, dtype=np.float32)
    z[20:31, 20:31] = 1.0
    z[21:30, 21:30] = -1.0
    z[:, 52:60] = 0.0
    grid = ConfidenceGrid(resolution=RESOLUTION)
    grid.fuse(np.array([0, 0]), z)
    path = tmp_path_factory.mktemp("square") / "map.npz"
    grid.save(path)
    return path


def plan(square: Path, *options: str | Path, goal: str = "20,3") -> Ran:
    return run(
        "plan", square, "--start", "3,3", "--goal", goal, "--footprint", "0.4", *options, "--json"
    )


def test_map_prints_what_it_did(mapped: Ran, log: Path) -> None:
    assert mapped.code == 0
    result = mapped.json
    assert result["views"] == VIEWS == len(read_views(log))
    assert result["views_per_s"] > 0
    assert result["features_used"] > 1000
    assert all(count > 0 for count in result["features_dropped"].values())
    assert result["seen_through"] >= 0
    grid = ConfidenceGrid.load(result["out"])
    assert result["resolution"] == grid.resolution == 0.1524
    assert result["area_free_m2"] == grid.area(CellState.FREE) > 10
    assert result["area_nonfree_m2"] == grid.area(CellState.NONFREE) > 1
    assert len(grid.trajectory) == VIEWS


@pytest.fixture
def swapped(tmp_path: Path) -> Path:
    """A log with uL and uR in the wrong columns."""
    folder = tmp_path / "swapped"
    folder.mkdir()
    (folder / "rig.toml").write_text(
        'world = "optical"\nfx = 700\nfy = 700\ncx = 620\ncy = 190\nbaseline = 0.54\n'
    )
    (folder / "poses.txt").write_text("".join(f"{n} 0 0 {n} 0 0 0 1\n" for n in range(6)))
    rows = [f"{view},{row},{300 + row},{330 + row},250" for view in range(6) for row in range(50)]
    (folder / "points.csv").write_text("\n".join(["view,id,uL,uR,v", *rows]) + "\n")
    return folder


def test_map_names_the_likely_cause_where_there_is_no_ground(swapped: Path) -> None:
    ran = run("map", swapped, "--out", swapped / "map.npz", "--json")
    assert ran.code == 2
    assert "(dropped: 300 no_disparity)" in ran.err
    assert "uL and uR may be swapped" in ran.err
    assert "--camera-height" not in ran.err


def test_map_warns_of_a_map_without_a_free_cell_and_names_the_likely_cause(swapped: Path) -> None:
    ran = run("map", swapped, "--out", swapped / "map.npz", "--camera-height", "1.5", "--json")
    assert ran.code == 0
    assert ran.json["area_free_m2"] < 6.0  # that of six poses
    empty, cause = ran.json["warnings"]
    assert empty == (
        "the map has no free cell but where the robot stood: 0 of 300 features of 6 views were "
        "used (dropped: 300 no_disparity)."
    )
    assert "uL and uR may be swapped" in cause
    assert ran.err.splitlines()[-2:] == [f"warning: {empty}", f"warning: {cause}"]


def test_map_of_a_sound_log_has_no_warnings(mapped: Ran) -> None:
    assert mapped.json["warnings"] == []
    assert "warning" not in mapped.err


def test_evaluate_takes_the_cameras_height(log: Path) -> None:
    ran = run("evaluate", log, "--camera-height", "-1", "--json")
    assert ran.code == 2
    assert "camera_height: expected a number above 0 [m]" in ran.err


def test_the_stages_of_map_add_up_to_the_wall_time(mapped: Ran) -> None:
    stages = mapped.json["stages_s"]
    assert min(stages.values()) >= 0
    assert sum(stages.values()) == pytest.approx(mapped.json["wall_s"], rel=0.05)
    assert {"read", "ground", "triangulate", "surfaces", "sight", "fuse", "save"} <= set(stages)


def test_map_takes_its_settings_from_options_and_a_file(log: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text("[mapper]\nresolution = 0.4\nmax_range = 8.0\n")
    config = ("--config", tmp_path / "settings.toml")
    coarse = run("map", log, "--out", tmp_path / "coarse.npz", *config, "--json").json
    assert coarse["resolution"] == 0.4
    assert coarse["features_dropped"]["out_of_range"] > 0
    finer = ("--resolution", "0.2")
    fine = run("map", log, "--out", tmp_path / "fine.npz", *config, *finer, "--json").json
    assert fine["resolution"] == 0.2


def test_an_unknown_key_of_the_settings_file_names_the_nearest(log: Path, tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text("[mapper]\nresolutoin = 0.4\n")
    config = ("--config", tmp_path / "settings.toml")
    ran = run("map", log, "--out", tmp_path / "map.npz", *config, "--json")
    assert_refused(ran, 2, "SettingsError", "Did you mean 'resolution'?")
    assert not (tmp_path / "map.npz").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--resolution", "0"), "resolution: expected greater than 0"),
        (
            ("--fusion", "median"),
            "fusion: expected 'average', 'capped', 'exponential', 'log_odds' or 'absolute', got "
            "'median'",
        ),
        (("--format", "vslam"), "format: expected one of"),
        (("--poses", "nowhere.txt"), "nowhere.txt: expected a readable file"),
        (("--config", "nowhere.toml"), "nowhere.toml: expected a settings file"),
        (("--max-range", "far"), "--max-range"),
    ],
)
def test_map_refuses_bad_options(
    log: Path, tmp_path: Path, options: tuple[str, ...], sentence: str
) -> None:
    ran = run("map", log, "--out", tmp_path / "map.npz", *options, "--json")
    assert_refused(ran, 2, None, sentence)


def test_map_refuses_what_is_no_log(tmp_path: Path) -> None:
    ran = run("map", tmp_path, "--out", tmp_path / "map.npz", "--json")
    assert_refused(ran, 2, "FileFormatError", "expected the files of a known format")
    ran = run("map", tmp_path / "nowhere", "--out", tmp_path / "map.npz", "--json")
    assert_refused(ran, 2, "FileFormatError", "expected a folder or file of views, got nothing")


def test_plan_prints_the_route_and_writes_it(square: Path, tmp_path: Path) -> None:
    out, plot = tmp_path / "route.geojson", tmp_path / "route.png"
    ran = plan(square, "--out", out, "--plot", plot)
    assert ran.code == 0
    result = ran.json
    assert result["audit"] == "clean"
    assert result["planner"] == "astar"
    assert 17.0 <= result["length"] < 17.5
    assert result["min_clearance"] >= 0.4
    assert result["min_confidence"] == result["mean_confidence"] == pytest.approx(1.0)
    assert result["unknown_length"] == result["start_unknown_area"] == 0.0
    assert result["expanded"] > 0
    assert result["seconds"] > 0
    assert result["waypoints"][0] == [3.0, 3.0]
    assert result["waypoints"][-1] == [20.0, 3.0]
    assert json.loads(out.read_text())["geometry"]["coordinates"] == result["waypoints"]
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_plan_counts_unknown_space_where_that_is_allowed(square: Path) -> None:
    ran = plan(square, "--unknown", "allow", goal=IN_STRIP)
    assert ran.code == 0
    assert ran.json["unknown_length"] == pytest.approx(2.0, abs=0.6)
    assert ran.json["min_confidence"] == 0.0


@pytest.mark.parametrize(
    ("goal", "options", "error", "sentence"),
    [
        (
            BEYOND,
            (),
            "OutsideMapError",
            "goal (90.00, 5.00) is outside the map: expected a point on an observed tile",
        ),
        (ON_RING, (), "NonFreeError", "overlaps non-free space"),
        (IN_STRIP, (), "UnknownSpaceError", "overlaps unknown or contested space"),
        (INSIDE_RING, (), "EnclosedError", "the goal is enclosed"),
        ("20,3", ("--time-limit", "1e-9"), "TimeLimitError", "no route within time_limit"),
    ],
)
def test_plan_says_why_there_is_no_route(
    square: Path, goal: str, options: tuple[str, ...], error: str, sentence: str
) -> None:
    assert_refused(plan(square, *options, goal=goal), 3, error, sentence)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--start", "nan,3"), "start: expected x, y [m] and optionally yaw [rad], all finite"),
        (("--goal", "3"), "expected 2 or 3 numbers separated by commas, got '3'"),
        (("--goal", "here"), "expected 2 or 3 numbers separated by commas, got 'here'"),
        (("--footprint", "-1"), "footprint: expected a radius of 0 or more [m], or"),
        (("--footprint", "nan"), "footprint: expected a radius of 0 or more [m], or"),
        (("--footprint", "wide"), "--footprint"),
        (("--planner", "teleport"), "planner: expected one of"),
        (("--unknown", "maybe"), "unknown: expected 'avoid', 'allow' or 'penalise', got 'maybe'"),
        (("--time-limit", "nan"), "time_limit: expected a finite number"),
        (("--speed", "3"), "No such option: --speed"),
        (("--out", "route.txt"), "path: expected a name that ends in .geojson, .json, .csv, .yaml"),
        (("--footprint", "0,0 1,1"), "footprint: expected a radius of 0 or more [m], or 3 or more"),
        (("--footprint", "0,0 1,1 1"), "expected 2 numbers separated by commas, got '1'"),
        (("--set", "weight"), "expected NAME=VALUE, each name once, got 'weight'"),
        (("--set", "weight=3"), "weight: expected a setting of AStarSettings"),
        (("--clearance-weight", "-1"), "clearance_weight: expected greater than or equal to 0"),
        (
            ("--planner", "all", "--set", "weight=3"),
            "are for one planner, not all",
        ),
    ],
)
def test_plan_refuses_bad_options(square: Path, options: tuple[str, ...], sentence: str) -> None:
    assert_refused(plan(square, *options), 2, None, sentence)


@pytest.mark.parametrize(("option", "name"), [("--out", "route.csv"), ("--plot", "route.png")])
def test_plan_looks_at_the_folder_before_the_work(tmp_path: Path, option: str, name: str) -> None:
    nowhere = tmp_path / "not" / "there" / name
    ran = plan(tmp_path / "no-map.npz", option, nowhere)  # the map is not even looked for
    assert_refused(ran, 2, "FileFormatError", "expected a file in a folder that exists")


@pytest.mark.parametrize("command", ["info", "plot", "plan"])
def test_maps_that_can_not_be_read_are_refused(command: str, tmp_path: Path) -> None:
    (tmp_path / "garbage.npz").write_bytes(b"PK\x03\x04 this is no archive")
    rest = ("--start", "0,0", "--goal", "1,1", "--footprint", "0.3") if command == "plan" else ()
    for name, got in (
        ("missing.npz", "no file of that name"),
        ("garbage.npz", "something else"),
        ("", "a folder"),
    ):
        out = ("--out", tmp_path / "out.png") if command == "plot" else ()
        ran = run(command, tmp_path / name, *rest, *out, "--json")
        sentence = f"expected a groundmap-grid file, got {got}"
        if command == "info" and not name:  # it describes sources of views as well
            sentence = "expected the files of a known format"
        assert_refused(ran, 2, "FileFormatError", sentence)


def test_info_tells_what_a_map_holds(map_file: Path, mapped: Ran) -> None:
    ran = run("info", map_file, "--json")
    assert ran.code == 0
    assert ran.json["resolution"] == 0.1524
    assert ran.json["poses"] == VIEWS
    for key in ("area_free_m2", "area_nonfree_m2", "first_pose", "last_pose", "map_bytes"):
        assert ran.json[key] == mapped.json[key]


def test_plot_writes_a_picture(map_file: Path, tmp_path: Path) -> None:
    picture = tmp_path / "map.png"
    ran = run("plot", map_file, "--out", picture, "--json")
    assert (ran.code, ran.json) == (0, {"out": str(picture)})
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_plot_draws_the_route_that_plan_wrote(square: Path, tmp_path: Path) -> None:
    route, picture = tmp_path / "route.geojson", tmp_path / "part.svg"
    assert plan(square, "--out", route).code == 0
    part = ("--route", route, "--footprint", "0.4", "--bounds", "0,0,25,8")
    assert run("plot", square, "--out", picture, *part).code == 0
    assert b"<svg" in picture.read_bytes()


@pytest.mark.parametrize("bounds", ["nan,3,1,1", "0,0,inf,1", "5,0,1,9", "0,0,0,0"])
def test_plot_refuses_bounds_that_hold_nothing(square: Path, tmp_path: Path, bounds: str) -> None:
    ran = run("plot", square, "--bounds", bounds, "--out", tmp_path / "p.png", "--json")
    assert_refused(ran, 2, "InputError", "bounds: expected")


def test_a_picture_of_another_kind_is_refused_before_the_route_is_written(
    square: Path, tmp_path: Path
) -> None:
    ran = plan(square, "--out", tmp_path / "r.geojson", "--plot", tmp_path / "r.bmp", "--json")
    assert_refused(ran, 2, "InputError", "a file name ending in .png, .pdf, .svg")
    assert list(tmp_path.iterdir()) == []


def test_names_with_brackets_are_printed_as_they_are(square: Path, tmp_path: Path) -> None:
    ran = run("convert", square, tmp_path / "y[m].npz")
    assert ran.code == 0
    assert str(tmp_path / "y[m].npz") in ran.out


def test_convert_writes_dense_arrays(map_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "dense.npz"
    assert run("convert", map_file, out, "--json").json == {"out": str(out)}
    grid = ConfidenceGrid.load(map_file)
    window = grid.window()
    with np.load(out, allow_pickle=False) as arrays:
        assert {"confidence", "count", "resolution", "origin"} <= set(arrays)
        np.testing.assert_array_equal(arrays["confidence"], window.confidence)
        np.testing.assert_array_equal(arrays["count"], window.count)
        np.testing.assert_array_equal(arrays["origin"], window.origin)
        assert arrays["resolution"] == grid.resolution


def test_convert_writes_a_map_for_nav2(map_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "nav2.yaml"
    assert run("convert", map_file, out).code == 0
    assert "image: nav2.pgm\n" in out.read_text()
    assert "resolution: 0.1524\n" in out.read_text()
    assert (tmp_path / "nav2.pgm").read_bytes().startswith(b"P5\n")


def test_convert_refuses_other_forms(map_file: Path, tmp_path: Path) -> None:
    ran = run("convert", map_file, tmp_path / "map.tif", "--json")
    assert_refused(ran, 2, "InputError", "expected a file that ends in .npz or .yaml")


def test_people_get_a_table(square: Path) -> None:
    ran = run("info", square)
    assert (ran.code, ran.err) == (0, "")
    assert "area free m2" in ran.out


def test_an_unknown_command_is_refused_in_a_shell_as_well() -> None:
    assert_refused(run_process("fly", "--json"), 2, None, "No such command 'fly'")


def test_without_json_a_refusal_leaves_stdout_empty() -> None:
    ran = run("info", "nowhere.npz")
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == (
        "groundmap: nowhere.npz: expected a groundmap-grid file, got no file of that name.\n"
    )


def test_without_arguments_it_prints_help() -> None:
    ran = run()
    assert (ran.code, ran.err) == (0, "")
    for command in ("demo", "map", "plan", "plot", "info", "collapse", "convert"):
        assert f"\n  {command} " in ran.out


@pytest.mark.parametrize(
    ("command", "units"),
    [
        ("demo", ()),
        ("map", ("cell [m]", "features [m]", "ground [m]")),
        ("plan", ("Start [m, rad; map]", "Goal [m, rad; map]", "robot [m]", "planning [s]")),
        ("plot", ("draw [m]", "route [m]")),
        ("info", ("areas [m²]", "bounds [m]")),
        ("collapse", ("over [m]", "robot [m]", "height [m]")),
        ("convert", ()),
    ],
)
def test_help_gives_the_units(command: str, units: tuple[str, ...]) -> None:
    ran = run(command, "--help")
    assert (ran.code, ran.err) == (0, "")
    text = " ".join(ran.out.split())
    assert "--json" in text
    assert [unit for unit in units if unit not in text] == []


def test_every_command_has_a_name_and_a_sentence() -> None:
    names = [command.name for command in app.registered_commands]
    assert len(names) == len(set(names)) >= 6
    assert all((command.callback.__doc__ or "").strip() for command in _with_callback())


def _with_callback() -> list[Any]:
    return [command for command in app.registered_commands if command.callback is not None]


def assert_refused(ran: Ran, code: int, error: str | None, sentence: str) -> None:
    """Check the exit code, the reason in JSON alone on stdout, the same on stderr in one line."""
    assert ran.code == code
    assert set(ran.json) == {"error", "reason"}
    assert error in (None, ran.json["error"])
    assert sentence in ran.json["reason"]
    assert ran.err == f"groundmap: {ran.json['reason']}\n"
    assert "\n" not in ran.json["reason"]


def test_the_version_is_that_of_the_package() -> None:
    ran = run("--version")
    assert (ran.code, ran.out) == (0, f"groundmap {version('groundmap')}\n")


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder that root can't write to")
def test_no_command_works_for_what_it_cannot_write(square: Path, tmp_path: Path) -> None:
    ends = ("--start", "3,3", "--goal", "20,3", "--footprint", "0.4")
    taken = tmp_path / "taken.pgm"
    taken.mkdir()
    long = "x" * 300
    # What each of them reads first does not exist: it is not read.
    gone = tmp_path / "gone.npz"
    commands: list[tuple[str | Path, ...]] = [
        ("map", tmp_path, "--out", "/proc/map.npz"),
        ("map", tmp_path, "--out", tmp_path / long),
        ("plan", gone, *ends, "--out", "/proc/route.csv"),
        ("plan", gone, *ends, "--plot", "/proc/route.png"),
        ("plot", gone, "--out", "/proc/map.png"),
        ("plot", gone, "--out", tmp_path / f"{long}.png"),
        ("convert", gone, "/proc/map.yaml"),
        ("convert", square, tmp_path / "taken.yaml"),
        ("evaluate", gone, "--plot", "/proc/map.png"),
        ("scenario", "run", gone, "--report", "/proc/report.html"),
        ("bench", "planning", "--samplers", "--map", gone, "--plot", "/proc/races.png"),
        ("demo", "--out", "/proc/demo"),
        ("demo", "--out", tmp_path / long),
    ]
    for command in commands:
        ran = run(*command, "--json")
        assert_refused(ran, 2, "FileFormatError", "expected a file")
    assert list(tmp_path.iterdir()) == [taken]


def test_names_with_control_characters_are_printed_escaped(square: Path, tmp_path: Path) -> None:
    path = tmp_path / "a\x1b[2J\udcff.npz"
    path.write_bytes(square.read_bytes())
    ran = run_process("info", path)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("map ")
    assert r"a\x1b[2J\udcff.npz" in ran.out
    ran = run("plan", path, "--\x1b[31m")
    assert ran.code == 2
    assert "\x1b" not in ran.err
