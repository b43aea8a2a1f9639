"""Drives: distances of views, and logs with the drift and noise of the settings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import InputError, SettingsError
from groundmap.simulate.drive import Drive, DriveSettings, drive, to_transforms
from strategies import rngs

Stops = tuple[tuple[float, float, float], ...]

AHEAD: Stops = ((0, 0, 0), (40, 0, 0))


@st.composite
def tours(draw: st.DrawFn) -> Stops:
    rng = draw(rngs())
    stops = rng.uniform((-9, -9, -180), (9, 9, 180), (rng.integers(1, 7), 3))
    turns_only = rng.random(len(stops)) < 0.3
    for row in np.flatnonzero(turns_only)[1:]:
        stops[row, :2] = stops[row - 1, :2]
    return tuple((float(x), float(y), float(yaw)) for x, y, yaw in stops)


def places(transforms: Floats) -> Floats:
    xy: Floats = transforms[:, :2, 3]
    return xy


def yaws(transforms: Floats) -> Floats:
    return np.arctan2(transforms[:, 1, 0], transforms[:, 0, 0])


def apart(a: Floats, b: Floats) -> Floats:
    """Return the angles between two yaws, -π to π."""
    turn: Floats = np.angle(np.exp(1j * (a - b)))
    return turn


def moved(stops: Stops, seed: int = 1, **options: Any) -> Drive:
    return drive(DriveSettings(stops=stops, **options), np.random.default_rng(seed))


def lengths(transforms: Floats) -> Floats:
    steps: Floats = np.hypot(*np.diff(places(transforms), axis=0).T)
    return steps


@given(tours(), st.floats(0.2, 3.0), st.floats(0.1, 1.0))
def test_views_are_at_most_the_set_distance_apart(stops: Stops, every: float, turn: float) -> None:
    true = moved(stops, every=every, every_turn=turn).true
    assert (lengths(true) <= every + 1e-9).all()
    assert (np.abs(apart(yaws(true)[1:], yaws(true)[:-1])) <= turn + 1e-9).all()


@given(tours(), st.floats(0.2, 3.0))
def test_a_drive_calls_at_every_stop_and_goes_straight_between(stops: Stops, every: float) -> None:
    true = moved(stops, every=every).true
    wanted = np.array(stops)
    visited = 0
    for place, yaw in zip(places(true), yaws(true), strict=True):
        x, y, degrees = wanted[min(visited, len(wanted) - 1)]
        at = np.hypot(*(place - (x, y))) < 1e-9
        visited += int(at and abs(apart(yaw, np.radians(degrees))) < 1e-9)
    assert visited >= len(wanted)
    driven = np.hypot(*np.diff(wanted[:, :2], axis=0).T).sum()
    assert lengths(true).sum() == pytest.approx(driven, abs=1e-9)


def test_turns_take_the_shorter_way() -> None:
    true = moved(((0, 0, 170), (0, 0, -170))).true
    assert np.abs(yaws(true)).min() >= np.radians(170) - 1e-9
    assert len(true) == 2


def test_one_stop_is_one_view() -> None:
    moves = moved(((1, 2, 90),), drift=0.1, yaw_drift=0.1)
    assert moves.true.shape == moves.logged.shape == (1, 4, 4)
    np.testing.assert_allclose(places(moves.logged), [(1, 2)])
    assert moves.times.tolist() == [0.0]


@given(tours())
def test_a_perfect_log_has_the_true_poses(stops: Stops) -> None:
    moves = moved(stops)
    np.testing.assert_allclose(moves.logged, moves.true, atol=1e-9)


@given(tours())
def test_poses_are_rigid_and_on_the_ground(stops: Stops) -> None:
    for transforms in moved(stops, position_noise=0.3, yaw_noise=0.2)[:2]:
        turn = transforms[:, :3, :3]
        eyes = np.broadcast_to(np.eye(3), turn.shape)
        np.testing.assert_allclose(turn @ np.swapaxes(turn, 1, 2), eyes, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(turn), 1.0)
        np.testing.assert_array_equal(turn[:, 2], eyes[:, 2])
        assert (transforms[:, 2, 3] == 0).all()
        np.testing.assert_array_equal(transforms[:, 3], np.tile((0, 0, 0, 1), (len(turn), 1)))


def test_views_are_evenly_spaced_in_time() -> None:
    moves = moved(AHEAD, seconds_per_view=0.25)
    np.testing.assert_allclose(moves.times, 0.25 * np.arange(41))


@given(tours(), st.floats(-0.3, 0.3))
def test_drift_scales_the_driven_distance(stops: Stops, drift: float) -> None:
    moves = moved(stops, drift=drift)
    np.testing.assert_allclose(lengths(moves.logged), (1 + drift) * lengths(moves.true), atol=1e-9)
    np.testing.assert_allclose(apart(yaws(moves.logged), yaws(moves.true)), 0.0, atol=1e-9)
    scaled = places(moves.true)[0] + (1 + drift) * (places(moves.true) - places(moves.true)[0])
    np.testing.assert_allclose(places(moves.logged), scaled, atol=1e-9)


@given(tours(), st.floats(-0.05, 0.05))
def test_yaw_drift_grows_with_distance_but_not_with_turns(stops: Stops, yaw_drift: float) -> None:
    moves = moved(stops, yaw_drift=yaw_drift)
    driven = np.cumsum([0.0, *lengths(moves.true)])
    off = apart(yaws(moves.logged), yaws(moves.true))
    np.testing.assert_allclose(apart(off, yaw_drift * driven), 0.0, atol=1e-9)
    np.testing.assert_allclose(lengths(moves.logged), lengths(moves.true), atol=1e-9)


@given(tours(), st.floats(-0.05, 0.05))
def test_in_the_frame_of_each_view_the_log_has_the_true_next_move(
    stops: Stops, yaw_drift: float
) -> None:
    moves = moved(stops, yaw_drift=yaw_drift)
    steps = [
        (np.linalg.inv(poses[:-1]) @ poses[1:])[:, :2, 3] for poses in (moves.true, moves.logged)
    ]
    np.testing.assert_allclose(steps[0], steps[1], atol=1e-9)


@settings(max_examples=10)
@given(rngs())
def test_noise_has_the_set_standard_deviation(rng: np.random.Generator) -> None:
    seed = int(rng.integers(2**32))
    moves = moved(AHEAD, seed, every=0.02, position_noise=0.2, yaw_noise=0.03)
    tolerance = 5.0 / np.sqrt(2 * len(moves.times))
    off = places(moves.logged) - places(moves.true)
    np.testing.assert_allclose(off.std(axis=0), 0.2, rtol=tolerance)
    turned = apart(yaws(moves.logged), yaws(moves.true))
    np.testing.assert_allclose(turned.std(), 0.03, rtol=tolerance)


def test_the_same_seed_makes_the_same_drive() -> None:
    one, same, other = (moved(AHEAD, seed, position_noise=0.1, yaw_noise=0.1) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.logged, same.logged)
    np.testing.assert_array_equal(one.true, other.true)
    assert not np.allclose(one.logged, other.logged)


def test_a_drive_with_invalid_settings_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"^stops: expected"):
        DriveSettings(stops=())
    with pytest.raises(SettingsError, match=r"^stops\.0\.1: expected"):
        DriveSettings(stops=((0, float("nan"), 0),))
    with pytest.raises(SettingsError, match=r"^every: expected greater than 0"):
        DriveSettings(stops=AHEAD, every=0.0)
    with pytest.raises(SettingsError, match=r"Did you mean 'yaw_drift'\?"):
        moved(AHEAD, yawdrift=0.1)


def test_invalid_poses_are_refused() -> None:
    with pytest.raises(InputError, match=r"^poses: expected shape \(n, 3\)"):
        to_transforms([(0, 0)])
    with pytest.raises(InputError, match=r"^poses: expected finite numbers"):
        to_transforms([(0, 0, np.nan)])


def test_a_drive_climbs_pitches_and_rolls_between_its_stops() -> None:
    settings = DriveSettings(
        stops=((0, 0, 90), (0, 4, 90)), heights=(0, 2), pitches=(0, -20), rolls=(10, 30), every=3
    )
    moves = drive(settings, np.random.default_rng(1))
    np.testing.assert_array_equal(moves.true, moves.logged)
    first, middle, last = moves.true
    assert middle[:3, 3].tolist() == [0.0, 2.0, 1.0]
    # At the last stop, base_link looks along +y, upwards by 20 degrees, and leans right by 30.
    cos, sin = np.cos(np.radians(20)), np.sin(np.radians(20))
    np.testing.assert_allclose(last[:3, 0], (0.0, cos, sin), atol=1e-12)
    np.testing.assert_allclose(last[2, 1], cos * np.sin(np.radians(30)))  # its left side is higher
    np.testing.assert_allclose(first[:3, :3] @ first[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("name", ["heights", "pitches", "rolls"])
def test_another_number_of_heights_or_tilts_than_of_stops_is_refused(name: str) -> None:
    options: dict[str, Any] = {name: (1.0,)}
    settings = DriveSettings(stops=((0, 0, 0), (1, 0, 0)), **options)
    with pytest.raises(InputError, match=f"{name}: expected a number for each of the 2 stops"):
        drive(settings, np.random.default_rng(1))
