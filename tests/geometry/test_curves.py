"""Dubins' and Reeds and Shepp's curves: they end at the goal, and none is shorter."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.errors import InputError
from oracles_curves import Pose, drive, end_of, gap, searched_length
from planners.errors import ProblemError
from planners.geometry.curves import Curve, dubins, reeds_shepp, sample

CurveTo = Callable[..., Curve]
CURVES = [dubins, reeds_shepp]
ORIGIN = (0.0, 0.0, 0.0)

poses = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-7, 7))
# Where words begin, end or coincide: turning circles that touch, straights of no length.
quarters = st.integers(-4, 4).map(lambda k: k * math.pi / 2)
corners = st.tuples(st.integers(-4, 4), st.integers(-4, 4), quarters)
radii = st.floats(0.2, 4)


@pytest.mark.parametrize("curve_to", CURVES)
@given(start=poses | corners, goal=poses | corners, radius=radii)
@settings(max_examples=150)
def test_a_curve_ends_at_the_goal_and_turns_no_tighter(
    curve_to: CurveTo, start: Pose, goal: Pose, radius: float
) -> None:
    curve = curve_to(start, goal, radius=radius)
    end = end_of(start, zip(curve.curvatures.tolist(), curve.lengths.tolist(), strict=True))
    assert gap(end, goal) < 1e-9
    assert (np.abs(curve.curvatures) <= 1 / radius).all()
    assert curve.length >= math.dist(start[:2], goal[:2]) - 1e-9


@pytest.mark.parametrize(("curve_to", "gears"), [(dubins, [1]), (reeds_shepp, [1, -1])])
@given(goal=poses | corners, length=st.floats(0, 3), turn=st.sampled_from([-1, 0, 1]))
@settings(max_examples=200)
def test_no_first_move_makes_a_curve_shorter(
    curve_to: CurveTo, gears: list[int], goal: Pose, length: float, turn: int
) -> None:
    # Shortest curves consist of such moves: if none of them, of whatever length, gains more than
    # it costs, then no way at all to the goal is shorter than the curve.
    straight_away = curve_to(ORIGIN, goal, radius=1.0).length
    for gear in gears:
        there = drive(ORIGIN, turn, gear * length)
        assert straight_away <= length + curve_to(there, goal, radius=1.0).length + 1e-9


@given(poses | corners, poses | corners, radii)
@settings(max_examples=150)
def test_both_ways_is_no_longer_than_forward_and_the_same_from_either_end(
    a: Pose, b: Pose, radius: float
) -> None:
    both = reeds_shepp(a, b, radius=radius).length
    assert both <= dubins(a, b, radius=radius).length + 1e-9
    assert both == pytest.approx(reeds_shepp(b, a, radius=radius).length, abs=1e-9)


@pytest.mark.parametrize(("curve_to", "forward"), [(dubins, True), (reeds_shepp, False)])
def test_a_blind_search_finds_nothing_shorter(curve_to: CurveTo, forward: bool) -> None:
    goal = (3.0, 2.0, 0.3) if forward else (1.5, -0.4, 2.0)
    found = searched_length(goal, forward=forward, seed=1)
    assert curve_to(ORIGIN, goal, radius=1.0).length == pytest.approx(found, abs=1e-5)


@pytest.mark.parametrize(
    ("goal", "forward", "both"),
    [
        ((3.0, 0.0, 0.0), 3.0, 3.0),
        ((-2.0, 0.0, 0.0), 2 * math.pi + 2.0, 2.0),
        ((0.0, 2.0, math.pi), math.pi, math.pi),
        ((0.0, 0.0, math.pi), 7 * math.pi / 3, math.pi),
        ((1.0, 1.0, math.pi / 2), math.pi / 2, math.pi / 2),
        ((0.0, 0.0, 0.0), 0.0, 0.0),
        ((0.0, 0.0, 2 * math.pi), 0.0, 0.0),
    ],
)
def test_known_lengths(goal: Pose, forward: float, both: float) -> None:
    for radius in (1.0, 2.5):
        scaled = (goal[0] * radius, goal[1] * radius, goal[2])
        assert dubins(ORIGIN, scaled, radius=radius).length == pytest.approx(radius * forward)
        assert reeds_shepp(ORIGIN, scaled, radius=radius).length == pytest.approx(radius * both)


@pytest.mark.parametrize("curve_to", CURVES)
@given(start=poses, goal=poses, step=st.floats(0.05, 2))
@settings(max_examples=40)
def test_samples_follow_the_curve(curve_to: CurveTo, start: Pose, goal: Pose, step: float) -> None:
    curve = curve_to(start, goal, radius=1.3)
    sampled, gears = sample(curve, step)
    assert tuple(sampled[0]) == start
    assert tuple(sampled[-1]) == goal
    chords = np.diff(sampled, axis=0)
    distances = np.hypot(chords[:, 0], chords[:, 1])
    assert distances.max() <= step + 1e-9
    assert distances.sum() <= curve.length + 1e-9
    turns = np.remainder(chords[:, 2] + np.pi, 2 * np.pi) - np.pi
    middle = sampled[:-1, 2] + turns / 2
    ahead = chords[:, 0] * np.cos(middle) + chords[:, 1] * np.sin(middle)
    np.testing.assert_allclose(ahead, gears * distances, atol=1e-9)
    if curve_to is dubins:
        assert (gears == 1).all()


def test_no_way_to_go_is_two_equal_poses() -> None:
    sampled, gears = sample(dubins((1, 2, 3), (1, 2, 3), radius=1.0), 0.1)
    assert sampled.tolist() == [[1, 2, 3], [1, 2, 3]]
    assert gears.tolist() == [1]


def test_invalid_curves_are_refused() -> None:
    with pytest.raises(ProblemError, match=r"radius: expected a turning radius above 0 \[m\]"):
        dubins(ORIGIN, ORIGIN, radius=0.0)
    with pytest.raises(ProblemError, match=r"radius: expected .*, got inf"):
        reeds_shepp(ORIGIN, ORIGIN, radius=math.inf)
    with pytest.raises(InputError, match=r"goal: expected shape \(3,\)"):
        reeds_shepp(ORIGIN, (1, 2), radius=1.0)
    with pytest.raises(InputError, match="start: expected finite numbers"):
        dubins((0, 0, math.nan), ORIGIN, radius=1.0)
    with pytest.raises(ProblemError, match=r"step: expected a length above 0 \[m\]"):
        sample(dubins(ORIGIN, (1, 0, 0), radius=1.0), 0.0)
