"""Jumps of the poses: each is reported once, and real drives have none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from command_line import run
from groundmap import GroundMapper, fit_ground, pose_jumps, read_views, write_views
from groundmap.arrays import Floats
from groundmap.errors import InputError
from sample_views import few_views
from strategies import rngs

DATA = Path(__file__).parents[3] / "shared" / "data"


def driven(speeds: Floats, heading: float = 0.3) -> Floats:
    """Return the positions of a drive with these steps [m], in a slow curve."""
    turned = heading + np.cumsum(np.full(len(speeds), 0.02))
    steps = np.stack([speeds * np.cos(turned), speeds * np.sin(turned)], axis=1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def test_a_single_displaced_view_is_one_jump() -> None:
    places = driven(np.full(30, 0.8))
    places[12] += (0.0, 900.0)
    (jump,) = pose_jumps(places)
    assert jump.view == 12
    assert jump.typical_step == pytest.approx(0.8)
    assert jump.step == pytest.approx(900.0, abs=1.0)


def test_a_permanent_jump_is_reported_at_its_first_view() -> None:
    places = driven(np.full(30, 0.8))
    places[12:] += (40.0, 0.0)
    places[20:] -= (0.0, 25.0)
    assert [jump.view for jump in pose_jumps(places)] == [12, 20]


@pytest.mark.parametrize("last", [2, 3, 8])
def test_the_last_of_few_views_may_jump(last: int) -> None:
    places = driven(np.full(last - 1, 0.5))
    places[-1] += (0.0, 500.0)
    assert [jump.view for jump in pose_jumps(places)] == [last - 1]


@pytest.mark.parametrize("places", [np.empty((0, 2)), np.zeros((1, 3)), np.zeros((5, 2))])
def test_no_view_one_view_and_a_standing_robot_do_not_jump(places: Floats) -> None:
    assert pose_jumps(places) == []


@given(rngs(), st.booleans())
@settings(max_examples=200)
def test_drives_with_pauses_and_changes_of_speed_do_not_jump(
    rng: np.random.Generator, timed: bool
) -> None:
    """From 0 to 15 m/s within the acceleration of a car, with pauses, ten views a second or one."""
    per_second = float(rng.choice([1.0, 10.0]))
    change = rng.uniform(-4.0, 4.0, 80).repeat(int(per_second) + 2)[:120] / per_second
    speeds = np.abs(np.cumsum(change)).clip(max=15.0)
    speeds[rng.integers(0, 100) :][: rng.integers(0, 40)] = rng.uniform(0.0, 0.02)
    places = driven(speeds / per_second)
    times = np.arange(len(places)) / per_second if timed else None
    assert pose_jumps(places, times) == []


def test_a_loop_that_closes_does_not_jump() -> None:
    turn = np.linspace(0.0, 4 * np.pi, 200)
    assert pose_jumps(20 * np.stack([np.cos(turn), np.sin(turn)], axis=1)) == []


def test_a_gap_in_time_lets_a_robot_drive_on() -> None:
    places, times = driven(np.full(30, 0.8)), 0.1 * np.arange(31)
    places[15:] += (60.0, 0.0)
    assert [jump.view for jump in pose_jumps(places, times)] == [15]
    times[15:] += 8.0  # 60 m in 8 s, where 8 m/s are usual
    assert pose_jumps(places, times) == []
    times[15:] = times[14]  # all at once
    assert [jump.view for jump in pose_jumps(places, times)] == [15]


def test_as_many_times_as_positions_are_required() -> None:
    with pytest.raises(InputError, match=r"^times: expected shape \(4,\), got shape \(3,\)"):
        pose_jumps(np.zeros((4, 2)), [0.0, 1.0, 2.0])
    with pytest.raises(InputError, match=r"^positions: expected finite numbers, got nan"):
        pose_jumps([(0.0, 0.0), (np.nan, 0.0)])


@pytest.mark.parametrize("name", ["kitti00_vo", "kitti_raw_vo", "kitti06_features"])
def test_recorded_drives_do_not_jump(name: str) -> None:
    if not (DATA / name).is_dir():
        pytest.skip(f"the recorded drive {name} is not beside the checkout")
    views = list(read_views(DATA / name))
    places = [view.T_map_base[:3, 3] for view in views]
    assert pose_jumps(places) == []
    if name == "kitti06_features":
        assert pose_jumps(places, [view.timestamp or 0.0 for view in views]) == []


def moved(offsets: dict[int, float], folder: Path) -> Path:
    """Write a log of 12 views 0.5 m apart, some of them moved sideways."""
    views = []
    for number, view in enumerate(few_views(12)):
        pose = np.eye(4)
        pose[:2, 3] = 0.5 * number, offsets.get(number, 0.0)
        views.append(
            type(view)(T_map_base=pose, rig=view.rig, points=view.points, timestamp=number)
        )
    write_views(views, folder)
    return folder


def test_mapping_warns_of_a_jump_and_lists_it(tmp_path: Path) -> None:
    log = moved({7: 2000.0}, tmp_path / "log")
    done = run("map", log, "--out", tmp_path / "map.npz", "--json")
    assert done.code == 0
    (jump,) = done.json["pose_jumps"]
    assert jump == {
        "view": 7,
        "step": pytest.approx(2000.0),
        "typical_step": pytest.approx(0.5),
    }
    assert "warning: the pose of view 7 is 2000 m from that of view 6" in done.err
    assert "steps are 0.5 m" in done.err


def test_mapping_does_not_warn_without_a_jump(tmp_path: Path) -> None:
    done = run("map", moved({}, tmp_path / "log"), "--out", tmp_path / "map.npz", "--json")
    assert done.json["pose_jumps"] == []
    assert "warning" not in done.err


def test_a_jumped_pose_maps_what_the_others_see(tmp_path: Path) -> None:
    mapper = GroundMapper()
    for view in fit_ground(read_views(moved({7: 2000.0}, tmp_path / "log"))):
        mapper.integrate(view)
    assert mapper.grid.nbytes < 2e6
