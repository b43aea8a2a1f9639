"""Ground strips: where points are relative to them, and which are refused."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.view.ground_strip import GroundStrip

UP = (0.0, 0.0, 1.0)


def ramp(angle: float) -> GroundStrip:
    """Return level ground for 10 m along x, then a ramp of 10 m, with normals across each."""
    cos, sin = np.cos(angle), np.sin(angle)
    uphill = (-sin, 0.0, cos)
    places = [(0, 0, 0), (10, 0, 0), (10 + 1e-2 * cos, 0, 1e-2 * sin), (10 + 10 * cos, 0, 10 * sin)]
    return GroundStrip(
        places=np.array(places, dtype=float), normals=np.array([UP, UP, uphill, uphill])
    )


@given(st.floats(-0.3, 0.3), st.integers(0, 2**32 - 1))
def test_points_on_a_ramp_have_their_height_above_the_ramp(angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    along, left, up = rng.uniform((0, -4, -1), (9, 4, 1), (20, 3)).T
    cos, sin = np.cos(angle), np.sin(angle)
    before = np.stack([9.0 - along, left, up], axis=1)
    there = 1.0 + along  # beyond the reach of the level ground below 1 m
    after = np.stack([10 + there * cos - up * sin, left, there * sin + up * cos], axis=1)
    for points, station in ((before, 9.0 - along), (after, 10.0 + there)):
        located = ramp(angle).locate(points)
        npt.assert_allclose(located.height, up, atol=1e-9)
        npt.assert_allclose(located.offset, left, atol=1e-9)
        npt.assert_allclose(located.station, station, atol=1e-9)


def test_the_first_and_the_last_piece_continue_without_end() -> None:
    strip = ramp(0.1)
    npt.assert_allclose(strip.height(np.array([(-50.0, 3.0, 0.2)])), 0.2)
    far = (10 + 80 * np.cos(0.1), 0.0, 80 * np.sin(0.1))
    npt.assert_allclose(strip.height(np.array([far])), 0.0, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_a_simplified_strip_has_the_same_ends_and_nearly_the_same_heights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.arange(0.0, 20.0, 0.5)
    places = np.column_stack([x, 0.0 * x, 0.3 * np.sin(x / rng.uniform(4, 8))])
    strip = GroundStrip(places=places, normals=np.array([UP] * len(x)))
    simple = strip.simplified()
    assert len(simple.places) < len(places)
    npt.assert_array_equal(simple.places[[0, -1]], places[[0, -1]])
    npt.assert_allclose(simple.height(places), 0.0, atol=0.0101)


def test_heights_do_not_depend_on_the_frame() -> None:
    turn = np.array([(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    shift = np.array([3.0, -2.0, 1.0])
    points: Floats = np.random.default_rng(1).uniform(-5, 15, (50, 3))
    moved = ramp(0.2).transformed(turn, shift)
    npt.assert_allclose(moved.height(points @ turn.T + shift), ramp(0.2).height(points), atol=1e-9)


def test_the_normal_at_a_point_is_that_of_its_place() -> None:
    npt.assert_allclose(ramp(0.2).normal_at(np.array([4.0, 1.0, 0.5])), UP)
    npt.assert_allclose(
        ramp(0.2).normal_at(np.array([16.0, 0.0, 1.0])), (-np.sin(0.2), 0.0, np.cos(0.2))
    )


@pytest.mark.parametrize(
    ("places", "normals", "message"),
    [
        ([(0, 0, 0)], [UP], r"^places: expected at least two, 0\.001 m apart, got 1 places"),
        ([(0, 0, 0)] * 2, [UP] * 2, r"^places: expected at least two, 0\.001 m apart, got 0 m"),
        (
            [(0, 0, 0), (1, 0, 0)],
            [UP, (0, 0, 2)],
            r"normals: expected vectors of length 1, got off by 1",
        ),
        ([(0, 0, 0), (1, 0, np.nan)], [UP] * 2, r"places"),
        ([(0, 0, 0), (1, 0, 0)], [UP], r"^normals: expected .* \(2, 3\)"),
    ],
)
def test_a_strip_without_direction_or_normals_is_refused(
    places: list[tuple[float, ...]], normals: list[tuple[float, ...]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        GroundStrip(places=np.array(places, dtype=float), normals=np.array(normals, dtype=float))
