"""The demo: its log is what the generator makes, its map is true, its route takes the doorway."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import shlex
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
import shapely
from scipy import ndimage

from command_line import Ran, run
from groundmap import CellState, ConfidenceGrid, StereoRig
from groundmap.arrays import Bools, Floats
from groundmap.io.folder import FolderLog
from groundmap.settings import MapperSettings
from groundmap.simulate.measures import measure
from groundmap.simulate.truth import truth_of

GENERATOR = Path(__file__).parents[2] / "tools" / "make_demo.py"
DATA = Path(str(files("planners") / "demo_data"))
FILES = ["map.npz", "map.png", "route.geojson"]
# The demo's stereo tells the range of a wall 5 m away to 0.2 m: this is three of that.
WALL_NOISE = 0.6  # [m]


@pytest.fixture(scope="module")
def courtyard() -> Any:
    """The generator, and with it the world as it truly is."""
    spec = importlib.util.spec_from_file_location("make_demo", GENERATOR)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demo") / "made here"


@pytest.fixture(scope="module")
def ran(folder: Path) -> Ran:
    return run("demo", "--out", folder, "--json")


@pytest.fixture(scope="module")
def grid(ran: Ran) -> ConfidenceGrid:
    return ConfidenceGrid.load(ran.json["map"])


def test_the_demo_exits_with_0_and_a_summary_in_json(ran: Ran, folder: Path) -> None:
    assert ran.code == 0
    result = ran.json
    assert result["views"] == len(FolderLog(DATA))
    assert result["audit"] == "clean"
    assert result["length"] > 15.0
    assert result["min_clearance"] >= 0.35
    assert [result[key] for key in ("map", "picture", "route")] == [str(folder / f) for f in FILES]


def test_it_writes_exactly_three_files(ran: Ran, folder: Path) -> None:
    assert ran.code == 0
    assert sorted(path.name for path in folder.iterdir()) == FILES
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")


def test_the_route_passes_the_doorway_without_collision(ran: Ran, courtyard: Any) -> None:
    feature = json.loads(Path(ran.json["route"]).read_text())
    line = shapely.LineString(feature["geometry"]["coordinates"])
    assert line.crosses(shapely.LineString(courtyard.DOOR))
    truth = _obstacles(courtyard)
    assert shapely.distance(line, truth) > 0.2  # by the map it is 0.35 m, of noisy features


def test_the_halves_are_connected_by_the_doorway_only(grid: ConfidenceGrid, courtyard: Any) -> None:
    free, centres = _free_cells(grid)
    assert _joined(free, centres, (3.0, 3.4), (20.5, 2.5))
    (x, y0), (_, y1) = courtyard.DOOR
    across, along = centres[..., 0] - x, centres[..., 1]
    door = (np.abs(across) < 0.5) & (y0 - 0.3 < along) & (along < y1 + 0.3)
    assert not _joined(free & ~door, centres, (3.0, 3.4), (20.5, 2.5))


def test_the_map_agrees_with_the_courtyard(grid: ConfidenceGrid, courtyard: Any) -> None:
    free, centres = _free_cells(grid)
    points = shapely.points(centres)
    truth = _obstacles(courtyard)
    yard = shapely.box(0.0, 0.0, 24.0, 16.0)
    open_space = shapely.contains(yard, points) & (shapely.distance(truth, points) > WALL_NOISE)
    assert free[open_space].mean() > 0.8
    deep_inside = shapely.contains(truth.buffer(-0.3), points)
    assert free[deep_inside].mean() < 0.25  # what one false match says of a box's inside stays
    assert free[shapely.distance(yard, points) > WALL_NOISE].mean() < 0.01


def test_the_map_has_most_of_the_visible_space(grid: ConfidenceGrid, courtyard: Any) -> None:
    window = grid.window()
    truth = truth_of(
        courtyard.COURTYARD, courtyard.moves(), courtyard.SENSOR, window, MapperSettings()
    )
    measures = measure(window, truth)
    assert (measures.free_recall or 0.0) > 0.85
    assert (measures.nonfree_recall or 0.0) > 0.95
    assert measures.false_free_beyond is not None
    assert measures.false_free_beyond < 0.005
    assert measures.boundary_p95 is not None
    assert measures.boundary_p95 < 1.0  # [m], what stereo tells the range of a wall 12 m away to


def test_the_bundled_log_equals_the_generated_one(courtyard: Any) -> None:
    with np.load(DATA / "features.npz", allow_pickle=False) as shipped:
        for kind, rows in courtyard.tables(courtyard.views()).items():
            assert shipped[kind].dtype == np.float32
            npt.assert_array_equal(shipped[kind][:, :2], rows[:, :2])
            npt.assert_allclose(shipped[kind][:, 2:], rows[:, 2:], rtol=0, atol=0.011)
    log = FolderLog(DATA)
    poses = [view.T_map_base for view in log]
    npt.assert_allclose(poses, courtyard.moves().logged, rtol=0, atol=1e-6)
    assert [view.timestamp for view in log] == courtyard.moves().times.tolist()
    _check_rig(log.rig, courtyard.SENSOR.rig)


def test_the_log_is_small() -> None:
    assert sum(path.stat().st_size for path in DATA.iterdir()) < 500_000


def test_a_second_run_replaces_the_files(ran: Ran, folder: Path) -> None:
    geojson = (folder / "route.geojson").read_bytes()
    for name in FILES:
        (folder / name).write_bytes(b"something older")
    again = run("demo", "--out", folder, "--json")
    assert again.code == 0
    assert again.json["length"] == ran.json["length"]
    properties = json.loads((folder / "route.geojson").read_text())["properties"]
    assert properties["length"] == json.loads(geojson)["properties"]["length"]
    assert ConfidenceGrid.load(folder / "map.npz").area(CellState.FREE) > 0
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")


def test_the_commands_it_suggests_work(ran: Ran) -> None:
    commands = [shlex.split(command) for command in ran.json["next"]]
    assert [command[:2] for command in commands] == [
        ["groundmap", name] for name in ("info", "plan", "plot")
    ]
    assert [run(*command[1:]).code for command in commands] == [0, 0, 0]


def test_the_output_has_a_summary_and_commands_to_try(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = run("demo")
    assert ran.code == 0
    assert "audit" in ran.out
    assert "  groundmap info groundmap-demo/map.npz\n" in ran.out
    assert sorted(path.name for path in (tmp_path / "groundmap-demo").iterdir()) == FILES


def test_a_folder_that_can_not_be_created_is_refused_before_mapping(tmp_path: Path) -> None:
    ran = run("demo", "--out", tmp_path / "not" / "there")
    assert (ran.code, ran.out) == (2, "")
    assert "expected a file in a folder that exists" in ran.err
    (tmp_path / "taken").write_text("")
    ran = run("demo", "--out", tmp_path / "taken")
    assert ran.code == 2
    assert "expected a folder, or the name of a new one, got a file." in ran.err


def _check_rig(rig: StereoRig, expected: StereoRig) -> None:
    for name, value in dataclasses.asdict(expected).items():
        npt.assert_allclose(getattr(rig, name), value, rtol=0, atol=1e-12, err_msg=name)


def _obstacles(courtyard: Any) -> shapely.Geometry:
    settings = MapperSettings()
    truth: shapely.Geometry = courtyard.COURTYARD.obstacles(
        settings.step_height, settings.robot_height
    )
    return truth


def _free_cells(grid: ConfidenceGrid) -> tuple[Bools, Floats]:
    """Return which cells are free, and their centres, shape (rows, cols, 2) [m, map]."""
    window = grid.window()
    free: Bools = window.states() == CellState.FREE
    centres = window.cell_to_world(np.argwhere(np.ones_like(free)))
    return free, centres.reshape(*free.shape, 2)


def _joined(
    free: Bools, centres: Floats, one: tuple[float, float], other: tuple[float, float]
) -> bool:
    """Return whether free cells, touching by a corner at least, lead from one place to another."""
    labels, _ = ndimage.label(free, structure=np.ones((3, 3)))
    places = [
        np.unravel_index(np.hypot(*(centres - xy).transpose(2, 0, 1)).argmin(), free.shape)
        for xy in (one, other)
    ]
    assert all(labels[place] for place in places)
    return bool(labels[places[0]] == labels[places[1]])
