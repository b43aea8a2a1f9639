"""Running scenarios: bounds that hold pass, missed bounds and errors are sentences."""

from __future__ import annotations

import itertools
import math
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from groundmap import read_views, write_views
from groundmap.errors import FileFormatError
from planners.scenario.outcome import Bound, Figure, Outcome
from planners.scenario.run import run_scenario

# A hall with a box in it, seen by an ideal sensor from one corner.
HALL = """
why = "A tiny hall with a box."
seed = 1
level_ground = true
[world]
bounds = [0, 0, 6, 4]
[[world.solids]]
wall = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
[[world.solids]]
box = [2.5, 1.5, 3.5, 2.2]
[scan]
bearing = 0.5
ground = 0.15
[drive]
stops = [[1, 1, 0], [1, 1, 60]]
every_turn = 2
"""
# Two rooms and no door; the robot is carried from one to the other.
ROOMS = """
why = "Two rooms without a door."
level_ground = true
[world]
bounds = [0, 0, 6, 4]
[[world.solids]]
wall = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]
[[world.solids]]
wall = [[3, 0], [3, 4]]
[scan]
bearing = 0.5
ground = 0.15
[drive]
stops = [[0.4, 2, 0], [2.6, 2, 180], [5.8, 2, 180]]
every = 10
every_turn = 4
"""
MATCHED = "[sensor]\nmissing = 0.2\nfalse_matches = 0.05\n"


def write(folder: Path, text: str) -> Path:
    """Write a scenario into a folder, which is created if necessary."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scenario.toml"
    path.write_text(text, encoding="utf-8")
    return path


def query(
    name: str = "along",
    *,
    start: tuple[float, float] = (1.5, 1.0),
    goal: tuple[float, float] = (4.0, 1.0),
    footprint: float = 0.3,
    more: str = "",
) -> str:
    """Return a query's table."""
    places = f"start = {list(start)}\ngoal = {list(goal)}\nfootprint = {footprint}\n"
    return f'[[queries]]\nname = "{name}"\n{places}{more}\n'


def number(outcome: Outcome, name: str) -> float:
    """Return a figure that is a number."""
    value = outcome.figures[name]
    assert isinstance(value, float | int)
    return value


def test_a_tiny_world_satisfies_its_bounds(tmp_path: Path) -> None:
    bounds = (
        "[bounds]\nfree_recall = { min = 0.95 }\nfalse_free_beyond = { max = 0 }\n"
        '"along.length" = { min = 2.4, max = 2.6 }\n'
    )
    text = HALL + query(more="robot_radius = 0.25\nmax_ratio = 1.1") + bounds
    outcome = run_scenario(write(tmp_path / "hall", text))
    assert (outcome.name, outcome.why) == ("hall", "A tiny hall with a box.")
    assert (outcome.passed, outcome.missed, outcome.skipped) == (True, (), "")
    assert list(outcome.bounds) == [
        *("free_recall", "false_free_beyond", "along.length"),
        *("along.outcome", "along.collisions", "along.ratio"),
    ]
    assert all(bound.holds(outcome.figures[name]) for name, bound in outcome.bounds.items())
    assert number(outcome, "visible_m2") > 5.0
    assert outcome.picture.startswith(b"\x89PNG")
    assert outcome.seconds > 0


def test_a_missed_bound_is_reported_with_figure_and_bound(tmp_path: Path) -> None:
    bounds = (
        "[bounds]\nfree_recall = { min = 2 }\nvisible_m2 = { max = 1 }\n"
        "false_free_beyond = { min = 0.3, max = 0.4 }\nfree_precision = { min = 0.9 }\n"
    )
    outcome = run_scenario(write(tmp_path, HALL + bounds))
    assert outcome.passed is False
    recall, visible = (f"{number(outcome, name):.4g}" for name in ("free_recall", "visible_m2"))
    assert outcome.missed == (
        f"free_recall is {recall}, not ≥ 2",
        f"visible_m2 is {visible}, not ≤ 1",
        "false_free_beyond is 0, not ≥ 0.3 and ≤ 0.4",
    )


def test_a_bound_on_an_unknown_figure_lists_the_known_ones(tmp_path: Path) -> None:
    bounds = '[bounds]\nfree_recal = { min = 0 }\n"along.lenght" = { max = 9 }\n'
    outcome = run_scenario(write(tmp_path, HALL + query() + bounds))
    there = ", ".join(outcome.figures)
    assert outcome.missed == (
        f"there is no figure free_recal; there are {there}",
        f"there is no figure along.lenght; there are {there}",
    )
    assert "free_recall, free_precision, " in there
    assert "along.length" in there


def test_expected_errors_pass(tmp_path: Path) -> None:
    queries = (
        query("closed", start=(1.5, 2), goal=(5, 2), more='expect = "EnclosedError"'),
        query("wall", start=(1.5, 2), goal=(2.8, 2), more='expect = "NonFreeError"'),
        query("away", start=(1.5, 2), goal=(60, 2), more='expect = "OutsideMapError"'),
        query("unseen", start=(1.5, 2), goal=(0.3, 0.3), more='expect = "UnknownSpaceError"'),
    )
    outcome = run_scenario(write(tmp_path, ROOMS + "".join(queries)))
    assert (outcome.passed, outcome.missed) == (True, ())
    assert [
        outcome.figures[f"{name}.outcome"] for name in ("closed", "wall", "away", "unseen")
    ] == [
        "EnclosedError",
        "NonFreeError",
        "OutsideMapError",
        "UnknownSpaceError",
    ]
    assert "closed.length" not in outcome.figures


def test_an_unexpected_error_fails_with_its_reason(tmp_path: Path) -> None:
    text = ROOMS + query("closed", start=(1.5, 2), goal=(5, 2))
    outcome = run_scenario(write(tmp_path, text))
    assert outcome.passed is False
    (missed,) = outcome.missed
    assert missed.startswith("closed.outcome is EnclosedError, not = route (")
    assert "enclosed" in missed


def test_the_message_of_an_error_matches_the_expected_reason(tmp_path: Path) -> None:
    expected = 'expect = "EnclosedError"\nreason = '
    into: dict[str, Any] = {"start": (1.5, 2), "goal": (5, 2)}
    right = query("right", **into, more=expected + r"'enclosed in .* \d+\.\d m²'")
    wrong = query("wrong", **into, more=expected + '"too narrow"')
    outcome = run_scenario(write(tmp_path, ROOMS + right + wrong))
    assert str(outcome.figures["right.reason"]).startswith("no route: the goal is enclosed in ")
    (missed,) = outcome.missed
    assert re.fullmatch(r"wrong\.reason is no route: .*, not a match of 'too narrow'", missed)


def test_time_limit_and_unknown_space_are_settings_of_a_query(tmp_path: Path) -> None:
    unseen: dict[str, Any] = {"start": (1.5, 2), "goal": (0.5, 0.5)}
    queries = (
        query("hurried", more='expect = "TimeLimitError"\ntime_limit = 0.0'),
        query("known", **unseen, footprint=0.1, more='expect = "UnknownSpaceError"'),
        query("guess", **unseen, footprint=0.1, more='unknown = "allow"'),
    )
    assert run_scenario(write(tmp_path, HALL + "".join(queries))).missed == ()


def test_an_outline_can_be_the_footprint(tmp_path: Path) -> None:
    outline = [[-0.1, -0.1], [0.5, -0.1], [0.5, 0.1], [-0.1, 0.1]]
    text = HALL + query().replace("footprint = 0.3", f"footprint = {outline}")
    outcome = run_scenario(write(tmp_path, text))
    assert outcome.missed == ()
    assert number(outcome, "along.min_clearance") >= math.hypot(0.5, 0.1) - 1e-9


def test_a_route_where_an_error_is_expected_fails(tmp_path: Path) -> None:
    text = HALL + query(more='expect = "EnclosedError"')
    outcome = run_scenario(write(tmp_path, text))
    assert outcome.missed == ("along.outcome is route, not = EnclosedError",)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('planner = "astra"', "expected queries.planner to be one of .*astar, .*, got 'astra'"),
        ('expect = "Enclosed"', "expected expect to be .*'EnclosedError'.*, got 'Enclosed'"),
        ('reason = "why"', "expected queries.reason to be none where a route is expected"),
        (
            'expect = "EnclosedError"\nreason = "("',
            r"expected queries.reason to be a regular expression \(.*\), got '\('",
        ),
        ('unknown = "perhaps"', "expected unknown to be 'avoid', 'allow' or 'penalise'"),
        ("time_limit = -1", "expected time_limit to be greater than or equal to 0"),
    ],
)
def test_a_query_with_an_unknown_planner_or_setting_is_refused(
    tmp_path: Path, line: str, message: str
) -> None:
    with pytest.raises(FileFormatError, match=message):
        run_scenario(write(tmp_path, HALL + query(more=line)))


@pytest.mark.parametrize(
    ("footprint", "got"),
    [("-0.1", "-0.1"), ("[[0, 0], [1, 1], [1, 0], [0, 1]]", "a self-intersection at .*")],
)
def test_a_query_with_an_invalid_footprint_is_refused(
    tmp_path: Path, footprint: str, got: str
) -> None:
    text = HALL + query().replace("footprint = 0.3", f"footprint = {footprint}")
    with pytest.raises(FileFormatError, match=f"expected queries.footprint to be .*, got {got}"):
        run_scenario(write(tmp_path, text))


def test_a_route_that_touches_the_true_world_collides(tmp_path: Path) -> None:
    # Planned for a slim robot, between a wall and a box 1.4 m apart; driven by one of 1 m.
    text = HALL + query(footprint=0.1, more="robot_radius = 1.0\nmax_ratio = 2")
    outcome = run_scenario(write(tmp_path, text))
    clearance = number(outcome, "along.true_clearance")
    assert 0.1 <= clearance < 1.0
    assert outcome.figures["along.outcome"] == "route"
    assert number(outcome, "along.collisions") == 2  # the wall and the box
    assert "along.collisions is 2, not ≤ 0" in outcome.missed
    # Such a robot can't go there at all, so that there is nothing to compare with.
    assert (outcome.figures["along.optimum"], outcome.figures["along.ratio"]) == (None, None)
    assert "along.ratio is None, not ≤ 2" in outcome.missed
    slim = run_scenario(write(tmp_path, HALL + query(footprint=0.1)))  # as large as planned for
    assert (slim.passed, slim.figures["along.collisions"]) == (True, 0)


@pytest.mark.parametrize("goal", [(4.0, 1.0), (1.5, 3.0), (2.2, 2.8)])
def test_no_route_is_much_shorter_than_the_best_in_the_true_world(
    tmp_path: Path, goal: tuple[float, float]
) -> None:
    outcome = run_scenario(write(tmp_path, HALL + query(goal=goal)))
    length, optimum = (number(outcome, f"along.{name}") for name in ("length", "optimum"))
    straight = math.dist((1.5, 1.0), goal)
    assert length >= straight - 1e-9
    assert optimum >= straight - 1e-9
    assert number(outcome, "along.ratio") == pytest.approx(length / optimum)
    assert 0.95 <= length / optimum <= 1.2


def test_a_world_without_solids_has_no_true_clearance(tmp_path: Path) -> None:
    wall = "[[world.solids]]\nwall = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]\n"
    box = "[[world.solids]]\nbox = [2.5, 1.5, 3.5, 2.2]\n"
    outcome = run_scenario(write(tmp_path, HALL.replace(wall, "").replace(box, "") + query()))
    assert outcome.passed is True
    assert outcome.figures["along.true_clearance"] is None
    assert outcome.figures["along.collisions"] == 0
    assert outcome.figures["nonfree_recall"] is None


def test_a_missing_figure_misses_every_bound(tmp_path: Path) -> None:
    text = (
        'why = "Nothing stands there."\nlevel_ground = true\n[world]\nbounds = [0, 0, 6, 4]\n'
        "[scan]\nground = 0.2\n[drive]\nstops = [[1, 2, 0]]\n[bounds]\nnonfree_recall = { min = 0 }"
    )
    outcome = run_scenario(write(tmp_path, text))
    assert outcome.missed == ("nonfree_recall is None, not ≥ 0",)


@pytest.mark.parametrize("level", ["true", "false"])
def test_a_world_without_features_fails_with_the_error(tmp_path: Path, level: str) -> None:
    scan = "[scan]\nbearing = 0.5\nground = 0.15\n"
    blind = HALL.replace(scan, "[sensor]\nmax_points = 0\nmax_segments = 0\n")
    text = blind.replace("level_ground = true", f"level_ground = {level}")
    outcome = run_scenario(write(tmp_path, text + query() + "[bounds]\nunknown = { max = 1 }\n"))
    assert outcome.passed is False
    assert outcome.missed == (
        "InputError: grid: expected at least one known cell, got an empty map.",
    )
    assert (outcome.figures, outcome.picture) == ({}, b"")


def test_a_missing_map_fails_with_the_error(tmp_path: Path) -> None:
    text = 'why = "No map."\n[world]\nkind = "image"\npath = "no.map"\n[drive]\nstops = [[0, 0, 0]]'
    outcome = run_scenario(write(tmp_path, text))
    assert outcome.passed is False
    [sentence] = outcome.missed
    assert sentence.startswith(f"FileFormatError: {tmp_path / 'no.map'}: expected a readable file")


def test_a_missing_log_is_skipped_with_its_path(tmp_path: Path) -> None:
    text = 'why = "A drive."\n[log]\npath = "no-log"\n[bounds]\n"views.ground_free" = { min = 2 }'
    outcome = run_scenario(write(tmp_path / "drive", text))
    assert (outcome.name, outcome.passed, outcome.missed) == ("drive", None, ())
    assert outcome.skipped == f"there is no log {tmp_path / 'drive' / 'no-log'}"
    assert outcome.figures == {}


def test_a_log_is_judged_by_held_out_features(tmp_path: Path) -> None:
    demo = read_views(str(files("planners") / "demo_data"))
    write_views(itertools.islice(demo, 8), tmp_path / "views")
    text = (
        'why = "A drive."\n[log]\npath = "../views"\n[bounds]\n"views.ground_free" = { min = 0.5 }'
        '\n"views.ground_fre" = { min = 0.5 }\n'
    ) + query(start=(0, 0), goal=(2, 0), footprint=0.2, more='expect = "OutsideMapError"')
    outcome = run_scenario(write(tmp_path / "drive", text))
    about = {name.partition(".")[0] for name in outcome.figures}
    assert about == {"views", "ids", "thin", "stamping", "along"}
    assert 0.5 < number(outcome, "views.ground_free") <= 1.0
    assert outcome.picture.startswith(b"\x89PNG")
    assert "along.collisions" not in outcome.bounds  # the true world is unknown
    missing, *others = outcome.missed
    assert missing.startswith("there is no figure views.ground_fre; there are views.")
    assert all(sentence.startswith("along.outcome is ") for sentence in others)


def test_an_invalid_log_fails_with_the_error(tmp_path: Path) -> None:
    (tmp_path / "views").mkdir()
    outcome = run_scenario(write(tmp_path, 'why = "A drive."\n[log]\npath = "views"\n'))
    assert outcome.passed is False
    assert outcome.missed[0].startswith(f"FileFormatError: {tmp_path / 'views'}: expected ")


def test_the_same_seed_gives_the_same_figures_and_another_gives_others(tmp_path: Path) -> None:
    scan = "[scan]\nbearing = 0.5\nground = 0.15\n"
    text = HALL.replace(scan, MATCHED) + query()
    first, again = (run_scenario(write(tmp_path / name, text)) for name in ("a", "b"))
    other = run_scenario(write(tmp_path / "c", text.replace("seed = 1", "seed = 2")))
    assert first.figures == again.figures
    assert other.figures["free_recall"] != first.figures["free_recall"]


def test_an_invalid_scenario_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"scenario\.toml: expected a \[world\] or a \[log\]"):
        run_scenario(write(tmp_path, 'why = "Nothing."'))


@pytest.mark.parametrize(
    ("bound", "value", "holds"),
    [
        (Bound(min=0.5), 0.5, True),
        (Bound(min=0.5), 0.49, False),
        (Bound(min=0.5), math.inf, True),
        (Bound(max=0.5), 0.5, True),
        (Bound(max=0.5), 0.51, False),
        (Bound(max=0), 0, True),
        (Bound(max=0), 1, False),
        (Bound(min=1, max=2), 1.5, True),
        (Bound(min=1, max=2), 0.5, False),
        (Bound(min=1, max=2), 2.5, False),
        (Bound(equals="route"), "route", True),
        (Bound(equals="route"), "EnclosedError", False),
        (Bound(equals="route"), None, False),
        (Bound(matches=r"\d m wide"), "a gap 2 m wide", True),
        (Bound(matches=r"\d m wide"), "a wide gap", False),
        (Bound(matches="."), None, False),
        (Bound(equals=0), 0, True),
        (Bound(equals=0), None, False),
        (Bound(min=0.0), None, False),
        (Bound(max=1.0), None, False),
        (Bound(min=0.0), math.nan, False),
        (Bound(max=1.0), math.nan, False),
        (Bound(min=-math.inf, max=math.inf), math.nan, False),
        (Bound(min=0.0), "route", False),
    ],
)
def test_a_bound_holds_for_values_in_it_and_not_for_missing_ones(
    bound: Bound, value: Figure, holds: bool
) -> None:
    assert bound.holds(value) is holds


def test_a_bound_as_text() -> None:
    bounds = Bound(min=0.97), Bound(max=0), Bound(min=1, max=2.5), Bound(equals="route")
    assert [str(bound) for bound in bounds] == ["≥ 0.97", "≤ 0", "≥ 1 and ≤ 2.5", "= route"]
    assert str(Bound(matches="enclosed")) == "a match of 'enclosed'"


def test_a_world_of_too_many_cells_fails_with_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planners.scenario.simulated.MOST_CELLS", 100.0)
    outcome = run_scenario(write(tmp_path, HALL))
    assert outcome.passed is False
    (missed,) = outcome.missed
    assert missed.startswith("InputError: world: expected 100 cells at most, got ")
    assert missed.endswith("Give smaller bounds [m], or a coarser resolution [m].")
