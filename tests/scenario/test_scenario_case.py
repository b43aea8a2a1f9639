"""Scenario files: every setting is read, and errors name the file and the key."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from groundmap.errors import FileFormatError
from groundmap.settings import GroundSettings, MapperSettings
from groundmap.simulate.drive import DriveSettings
from groundmap.simulate.scan import ScanSettings
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.world_file import HoleSettings, SolidSettings
from groundmap.simulate.worlds import Corridor, Empty, MapImage
from planners.scenario.case import FILE, find_scenarios, load_scenario
from planners.scenario.outcome import Bound
from planners.scenario.queries import QuerySettings
from planners.scenario.simulated import build_world

SCENARIOS = Path(__file__).parents[2] / "scenarios"
FILES = sorted(SCENARIOS.rglob(FILE))

WHY = 'why = "A hall."\n'
WORLD = "[world]\nbounds = [0, 0, 6, 4]\n"
DRIVE = "[drive]\nstops = [[1, 1, 0]]\n"
SMALLEST = WHY + WORLD + DRIVE
ASKED = "[[queries]]\nname = 'a'\nstart = [1, 1]\ngoal = [5, 1]\nfootprint = 0.3\n"
FULL = """
why = '''
One reason,
on two lines.
'''
seed = 7
level_ground = true

[world]
kind = "empty"
bounds = [0, 0, 6, 4]
ground_texture = 9.0

[[world.solids]]
box = [2, 1, 3, 2]
top = 1.0
appears = 2.0

[[world.solids]]
pole = [5, 3]
radius = 0.1

[[world.holes]]
box = [4, 1, 5, 2]
depth = 0.4

[sensor]
fx = 500.0
missing = 0.1

[scan]
bearing = 0.5

[drive]
stops = [[1, 1, 0], [1, 3, 90]]
every = 0.7

[mapper]
resolution = 0.2

[ground]
window = 5

[[queries]]
name = "there"
start = [1, 1]
goal = [5, 1, 1.5]
footprint = 0.3
robot_radius = 0.25
expect = "EnclosedError"
reason = "enclosed"
unknown = "allow"
time_limit = 0.5
planner = "astar"
max_ratio = 1.2

[[queries]]
name = "back"
start = [5, 1]
goal = [1, 1]
footprint = [[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]]

[bounds]
free_recall = { min = 0.9 }
false_free = { max = 0.1 }
"there.length" = { min = 1, max = 9 }
"""


def write(folder: Path, text: str) -> Path:
    """Write a scenario into a folder, which is created if necessary."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILE
    path.write_text(text, encoding="utf-8")
    return path


def assert_refused(folder: Path, text: str, sentence: str) -> None:
    """Check that the message names the file and the error, and has nothing else."""
    path = write(folder / "case", text)
    with pytest.raises(FileFormatError, match=rf"^{re.escape(str(path))}: {sentence}$") as caught:
        load_scenario(path)
    assert caught.value.path == path


def test_every_setting_of_a_file_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "hall", FULL)
    scenario = load_scenario(path)
    assert (scenario.name, scenario.path) == ("hall", path)
    assert scenario.why == "One reason, on two lines."
    assert (scenario.seed, scenario.level_ground, scenario.log) == (7, True, None)
    assert scenario.world == Empty(bounds=(0, 0, 6, 4), ground_texture=9.0)
    assert scenario.solids == (
        SolidSettings(box=(2, 1, 3, 2), top=1.0, appears=2.0),
        SolidSettings(pole=(5, 3), radius=0.1),
    )
    assert scenario.holes == (HoleSettings(box=(4, 1, 5, 2), depth=0.4),)
    assert scenario.sensor == SensorSettings(fx=500.0, missing=0.1)
    assert scenario.scan == ScanSettings(bearing=0.5)
    assert scenario.drive == DriveSettings(stops=((1, 1, 0), (1, 3, 90)), every=0.7)
    assert scenario.mapper == MapperSettings(resolution=0.2)
    assert scenario.ground == GroundSettings(window=5)
    there, back = scenario.queries
    assert there == QuerySettings(
        name="there",
        start=(1, 1),
        goal=(5, 1, 1.5),
        footprint=0.3,
        robot_radius=0.25,
        expect="EnclosedError",
        reason="enclosed",
        unknown="allow",
        time_limit=0.5,
        planner="astar",
        max_ratio=1.2,
    )
    assert (back.expect, back.robot_radius, back.max_ratio) == ("route", None, None)
    assert (back.reason, back.unknown, back.time_limit) == (None, "avoid", None)
    assert there.radius == 0.3
    assert back.radius == pytest.approx(np.hypot(0.4, 0.2))
    assert scenario.bounds == {
        "free_recall": Bound(min=0.9),
        "false_free": Bound(max=0.1),
        "there.length": Bound(min=1.0, max=9.0),
    }


def test_the_world_has_generated_and_listed_solids(tmp_path: Path) -> None:
    world = build_world(load_scenario(write(tmp_path, FULL)))
    assert [solid.outline.bounds[:2] for solid in world.solids] == [(2.0, 1.0), (4.9, 2.9)]
    assert [hole.depth for hole in world.holes] == [0.4]
    made = WHY + '[world]\nkind = "corridor"\n' + DRIVE
    bare = build_world(load_scenario(write(tmp_path, made)))
    named = made.replace(DRIVE, "[[world.solids]]\nbox = [1, 1, 2, 2]\n" + DRIVE)
    scenario = load_scenario(write(tmp_path, named))
    assert isinstance(scenario.world, Corridor)
    more = build_world(scenario)
    assert len(more.solids) == len(bare.solids) + 1
    assert more.solids[-1].outline.bounds == (1.0, 1.0, 2.0, 2.0)


def test_a_minimal_file_has_defaults(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, SMALLEST))
    assert (scenario.seed, scenario.level_ground) == (0, False)
    assert (scenario.scan, scenario.solids, scenario.holes, scenario.queries) == (None, (), (), ())
    assert scenario.sensor == SensorSettings()
    assert scenario.mapper == MapperSettings()
    assert not scenario.bounds


def test_a_file_of_another_name_names_its_scenario(tmp_path: Path) -> None:
    path = write(tmp_path, SMALLEST).rename(tmp_path / "narrow.toml")
    assert load_scenario(path).name == "narrow"


@pytest.mark.parametrize("way", ["scenario.toml", "../hall/scenario.toml"])
def test_a_scenario_is_named_after_its_folder_from_every_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    write(tmp_path / "hall", SMALLEST)
    monkeypatch.chdir(tmp_path / "hall")
    assert load_scenario(Path(way)).name == "hall"


def test_the_path_of_a_log_is_relative_to_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "a" / "b", WHY + '[log]\npath = "../logs/drive"\n')
    log = load_scenario(path).log
    assert log is not None
    assert log.resolve() == (tmp_path / "a" / "logs" / "drive").resolve()
    path = write(tmp_path / "a", WHY + f'[log]\npath = "{tmp_path}/drive"\n')
    assert load_scenario(path).log == tmp_path / "drive"


def test_the_path_of_a_map_is_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "hook.map").write_text("type octile\nheight 2\nwidth 3\nmap\n@@.\n@..\n")
    world = '[world]\nkind = "image"\npath = "../hook.map"\nresolution = 0.5\n'
    scenario = load_scenario(write(tmp_path / "hook", WHY + world + DRIVE))
    assert isinstance(scenario.world, MapImage)
    [wall] = scenario.world.make(np.random.default_rng(0)).solids
    assert wall.outline.area == 0.75


@pytest.mark.parametrize("text", ["why = [", "why", "[world\n"])
def test_a_file_that_is_not_toml_is_refused(tmp_path: Path, text: str) -> None:
    assert_refused(tmp_path, text, r"expected a TOML file, got .*(line|end of document).*")


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_bytes(b"why = '\xff\xfe'")
    with pytest.raises(
        FileFormatError,
        match=r"scenario\.toml: expected TOML in UTF-8, got another encoding at line 1",
    ):
        load_scenario(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"none\.toml: expected a scenario file, got no file"):
        load_scenario(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (WHY, r"expected a \[world\] or a \[log\], got neither\."),
        (SMALLEST + '[log]\npath = "x"', r"expected a \[world\] or a \[log\], got both\."),
        (SMALLEST + "[log]", r"expected a \[world\] or a \[log\], got both\."),
        (WHY + WORLD, r"expected a \[drive\] through its \[world\], got none\."),
        (WORLD + DRIVE, r"expected why to be a value, got none\."),
        (SMALLEST.replace("A hall.", ""), r"expected why to be .*, got ''\."),
        (SMALLEST.replace("A hall.", "  "), r"expected why to be .*, got '  '\."),
        (WHY + "[log]", r"expected path to be a value, got none\."),
        (WHY + WORLD + "[drive]", r"expected stops to be a value, got none\."),
        (SMALLEST + "[[queries]]\nname = 'a'", r"expected start to be a value, got none\."),
    ],
)
def test_a_missing_table_or_key_is_named(tmp_path: Path, text: str, sentence: str) -> None:
    assert_refused(tmp_path, text, sentence)


@pytest.mark.parametrize(
    ("text", "key", "of", "nearest"),
    [
        (SMALLEST + "[maper]\n", "maper", "ScenarioSettings", "mapper"),
        ("sed = 1\n" + SMALLEST, "sed", "ScenarioSettings", "seed"),
        (SMALLEST.replace("bounds", "bonds"), "bonds", "Empty", "bounds"),
        (SMALLEST.replace("stops", "stop"), "stop", "DriveSettings", "stops"),
        (SMALLEST + "[sensor]\nbaselin = 1\n", "baselin", "SensorSettings", "baseline"),
        (SMALLEST + "[scan]\nbearng = 1\n", "bearng", "ScanSettings", "bearing"),
        (SMALLEST + "[mapper]\nresolutoin = 1\n", "resolutoin", "MapperSettings", "resolution"),
        (SMALLEST + "[ground]\nwindw = 1\n", "windw", "GroundSettings", "window"),
        (SMALLEST + "[[queries]]\nfotprint = 1\n", "fotprint", "QuerySettings", "footprint"),
        (SMALLEST + "[bounds]\nunknown = { mx = 1 }\n", "mx", "BoundSettings", "max"),
        (WHY + '[log]\npth = "x"\n', "pth", "LogSettings", "path"),
        (
            WHY + WORLD + "[[world.solids]]\ntextur = 1\n" + DRIVE,
            "textur",
            "SolidSettings",
            "texture",
        ),
        (WHY + WORLD + "[[world.holes]]\ndept = 1\n" + DRIVE, "dept", "HoleSettings", "depth"),
    ],
)
def test_an_unknown_key_names_the_nearest_in_every_table(
    tmp_path: Path, text: str, key: str, of: str, nearest: str
) -> None:
    sentence = rf"expected {key} to be a setting of {of}, got an unknown key\. Did you mean"
    assert_refused(tmp_path, text, rf"{sentence} '{nearest}'\?")


@pytest.mark.parametrize("kind", ['"room"', "3", '["rooms"]', '""'])
def test_an_unknown_kind_of_world_lists_the_known_ones(tmp_path: Path, kind: str) -> None:
    kinds = "corridor, empty, forest, image, parking, rooms, spiral, warehouse"
    got = re.escape(kind.replace('"', "'"))
    assert_refused(
        tmp_path,
        WHY + f"[world]\nkind = {kind}\n" + DRIVE,
        rf"expected world\.kind to be one of {kinds}, got {got}\.",
    )


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ("[world.solids]\nbox = [1, 1, 2, 2]", r"world\.solids to be \[\[world\.solids\]\] tables"),
        ("solids = 3", r"world\.solids to be \[\[world\.solids\]\] tables"),
        ("[world.holes]\ndepth = 1", r"world\.holes to be \[\[world\.holes\]\] tables"),
        ("holes = [3]", r"world\.holes to be \[\[world\.holes\]\] tables"),
        ("[[world.solids]]\ntop = 1", r"shape to be one of .*, got none"),
        ("[[world.solids]]\nbox=[1,1,2,2]\npole=[1,1]", r"shape to be one of .*, got box and pole"),
        ("[[world.solids]]\nbox = [1, 1, 1, 2]", r"box to be two opposite corners \[m\]"),
        ("[[world.solids]]\nbox = [1, 1, 2, 2]\ntop = -1", r"top to be a height above the bottom"),
        ("[[world.holes]]\ndepth = 1", r"shape to be one of box, polygon, got none"),
        ("[[world.solids]]\nbox = [1, 1, 2]", r"box\.3 to be a value, got none"),
    ],
)
def test_an_invalid_solid_or_hole_is_refused_before_anything_runs(
    tmp_path: Path, table: str, sentence: str
) -> None:
    assert_refused(tmp_path, WHY + WORLD + table + "\n" + DRIVE, rf"expected {sentence}.*\.")


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ("[mapper]\nresolution = 0", r"resolution to be greater than 0, got 0"),
        ("[sensor]\nbaseline = -1", r"baseline to be greater than 0, got -1"),
        ("[scan]\nground = 0", r"ground to be greater than 0, got 0"),
        ("[queries]\nname = 'a'", r"queries to be .*tuple.*"),
        ("[bounds]\nunknown = 1", r"bounds\.unknown to be .*dictionary, got 1"),
        ("[bounds]\nunknown = {}", r"bounds\.unknown to be min, max, or both, got neither"),
        ("[bounds]\n'a.b' = {}", r"bounds\.a\.b to be min, max, or both, got neither"),
        (
            "[bounds]\nunknown = { min = 2, max = 1 }",
            r"bounds\.unknown to be min not above max, got 2 and 1",
        ),
        (
            f"{ASKED}max_ratio = 1.1\n[bounds]\n'a.ratio' = {{ max = 1.5 }}",
            r"bounds\.a\.ratio to be no bound, .* ≤ 1\.1, got ≤ 1\.5\. .*max_ratio.*",
        ),
        (
            f"{ASKED}[bounds]\n'a.collisions' = {{ max = 2 }}",
            r"bounds\.a\.collisions to be no bound, .* ≤ 0, got ≤ 2\. .*robot_radius.*",
        ),
        (
            f"{ASKED}expect = 'EnclosedError'\n[bounds]\n'a.outcome' = {{ max = 0 }}",
            r"bounds\.a\.outcome to be no bound, .* = EnclosedError.*'expect' of the query",
        ),
    ],
)
def test_a_value_out_of_its_range_is_refused(tmp_path: Path, table: str, sentence: str) -> None:
    assert_refused(tmp_path, SMALLEST + table + "\n", rf"expected {sentence}\.")


@pytest.mark.parametrize("name", ["a.ratio", "a.length", "b.collisions"])
def test_a_figure_without_a_bound_of_a_query_can_have_one_in_bounds(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / FILE
    path.write_text(SMALLEST + ASKED + f"[bounds]\n'{name}' = {{ max = 1.5 }}\n")
    assert load_scenario(path).bounds == {name: Bound(max=1.5)}


def test_the_path_of_a_map_is_text(tmp_path: Path) -> None:
    text = WHY + '[world]\nkind = "image"\npath = 3\n' + DRIVE
    assert_refused(tmp_path, text, r"expected path to be .*path.*, got 3\.")


def test_queries_of_the_same_name_are_refused(tmp_path: Path) -> None:
    text = FULL.replace('"back"', '"there"')
    sentence = r"expected queries to be of different names, got there, there\."
    assert_refused(tmp_path, text, sentence)


def test_scenarios_are_found_at_any_depth_and_sorted(tmp_path: Path) -> None:
    paths = [write(tmp_path / part, SMALLEST) for part in ("a", "b/c/d", "b/c", "e")]
    assert find_scenarios([tmp_path]) == sorted(paths)
    assert find_scenarios([tmp_path / "b", tmp_path / "a"]) == [*sorted(paths[1:3]), paths[0]]


def test_a_single_file_is_found_whatever_its_name(tmp_path: Path) -> None:
    path = write(tmp_path, SMALLEST).rename(tmp_path / "narrow.toml")
    assert find_scenarios([path]) == [path]


def test_duplicate_paths_are_removed(tmp_path: Path) -> None:
    path = write(tmp_path / "a", SMALLEST)
    assert find_scenarios([tmp_path, path, tmp_path / "a"]) == [path]


@pytest.mark.parametrize("name", ["empty", "missing"])
def test_a_place_without_scenarios_is_refused(tmp_path: Path, name: str) -> None:
    write(tmp_path / "a", SMALLEST)
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        FileFormatError, match=rf"{name}: expected a folder with scenario\.toml files in it, got no"
    ):
        find_scenarios([tmp_path / "a", tmp_path / name])


@pytest.mark.skipif(not FILES, reason="the scenarios are with the sources")
@pytest.mark.parametrize("path", FILES, ids=[path.parent.name for path in FILES])
def test_every_scenario_of_the_project_has_a_purpose_and_bounds(path: Path) -> None:
    scenario = load_scenario(path)
    assert scenario.name == path.parent.name
    assert len(scenario.why.split()) >= 6
    assert scenario.why.endswith((".", ".)"))
    assert scenario.bounds or scenario.queries
    if scenario.world is not None:
        build_world(scenario)
