"""Shapes by name: their areas follow formulas, and invalid shapes are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from groundmap.errors import InputError
from groundmap.simulate.shapes import LEG, POLE_SIDES, SLAB, box, pole, table, wall
from groundmap.simulate.world import Solid
from strategies import rngs

lengths = st.floats(0.1, 20.0)


@given(rngs(), st.booleans(), st.booleans())
def test_a_box_is_the_same_from_any_two_opposite_corners(
    rng: np.random.Generator, across: bool, down: bool
) -> None:
    (x0, x1), (y0, y1) = np.sort(rng.uniform(-9.0, 9.0, (2, 2)), axis=1)
    corners = (x1, x0) if across else (x0, x1), (y1, y0) if down else (y0, y1)
    outline = box(corners[0][0], corners[1][0], corners[0][1], corners[1][1])
    assert outline.bounds == (x0, y0, x1, y1)
    assert outline.area == pytest.approx((x1 - x0) * (y1 - y0))


@pytest.mark.parametrize("corners", [(0, 0, 0, 1), (0, 1, 1, 1), (2, 2, 2, 2)])
def test_a_box_without_area_is_refused(corners: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match=r"^box: expected two opposite corners \[m\]"):
        box(*corners)


@given(lengths, st.floats(0.05, 1.0), st.floats(-np.pi, np.pi))
def test_a_straight_wall_is_as_long_and_as_thick_as_told(
    length: float, thickness: float, yaw: float
) -> None:
    end = length * np.cos(yaw), length * np.sin(yaw)
    outline = wall([(0, 0), end], thickness=thickness)
    assert outline.area == pytest.approx(length * thickness)
    assert outline.length == pytest.approx(2 * (length + thickness))


@given(rngs(), st.floats(0.05, 0.4))
def test_a_corner_of_a_wall_is_mitred(rng: np.random.Generator, thickness: float) -> None:
    a, b = rng.uniform(2.0, 9.0, 2)
    outline = wall([(0, 0), (a, 0), (a, b)], thickness=thickness)
    # The centre line's length times the thickness: the mitre adds outside what is shared inside.
    assert outline.area == pytest.approx((a + b) * thickness)
    assert outline.covers(shapely.Point(a + 0.499 * thickness, -0.499 * thickness))
    assert outline.covers(shapely.LineString([(0, 0), (a, 0), (a, b)]))


def test_a_wall_all_around_has_a_room_in_it() -> None:
    corners = [(0, 0), (6, 0), (6, 4), (0, 4), (0, 0)]
    outline = wall(corners, thickness=0.2)
    assert len(outline.interiors) == 1
    assert outline.area == pytest.approx(6.2 * 4.2 - 5.8 * 3.8, abs=0.011)  # but for a notch
    assert Solid(outline, top=2.0).outline.area == outline.area


@pytest.mark.parametrize("points", [[(0, 0, 0), (1, 1, 1)], 5.0, "wall", [("a", "b"), ("c", "d")]])
def test_a_wall_along_no_polyline_is_refused(points: Any) -> None:
    with pytest.raises(InputError, match=r"^wall: expected"):
        wall(points)


@pytest.mark.parametrize("points", [[(1, 1)], [(0, 0), (np.nan, 1)], [(0, 0), (np.inf, 0)]])
def test_a_wall_of_one_place_or_to_nowhere_is_refused(points: Any) -> None:
    with pytest.raises(InputError, match=r"^wall: expected"):
        wall(points)


def test_a_wall_without_thickness_or_length_becomes_no_solid() -> None:
    for outline in (wall([(0, 0), (1, 0)], thickness=0.0), wall([(1, 1), (1, 1)])):
        with pytest.raises(InputError, match=r"^outline: expected a polygon with an area"):
            Solid(outline, top=1.0)


@given(rngs(), st.floats(0.01, 2.0))
def test_a_pole_is_a_regular_polygon_around_its_place(
    rng: np.random.Generator, radius: float
) -> None:
    place = rng.uniform(-9.0, 9.0, 2)
    outline = pole(*place, radius=radius)
    corners = shapely.get_coordinates(outline.exterior)[:-1]
    assert len(corners) == POLE_SIDES == 12
    np.testing.assert_allclose(np.hypot(*(corners - place).T), radius)
    assert outline.area == pytest.approx(3.0 * radius**2)  # n/2 sin(2π/n) r²
    np.testing.assert_allclose(shapely.get_coordinates(outline.centroid)[0], place, atol=1e-9)


def test_a_pole_without_a_radius_becomes_no_solid() -> None:
    with pytest.raises(InputError, match=r"^outline: expected a polygon with an area"):
        Solid(pole(1, 1, radius=0.0), top=1.0)


@given(rngs(), st.floats(0.4, 1.2))
def test_a_table_is_a_top_on_four_legs_below_it(rng: np.random.Generator, height: float) -> None:
    x0, y0 = rng.uniform(-5.0, 5.0, 2)
    width, depth = rng.uniform(0.6, 3.0, 2)
    top, *legs = table(x0 + width, y0, x0, y0 + depth, height=height, texture=2.0)
    assert top.outline.area == pytest.approx(width * depth)
    assert [top.bottom, top.top] == pytest.approx([height - SLAB, height])
    assert len(legs) == 4
    for leg in legs:
        assert [leg.bottom, leg.top] == [0.0, top.bottom]
        assert leg.outline.area == pytest.approx(LEG**2)
        assert top.outline.buffer(-0.1499).covers(leg.outline)
    union = shapely.union_all([leg.outline for leg in legs])
    assert union.area == pytest.approx(4 * LEG**2)  # they stand apart
    inner = np.array(union.bounds) - top.outline.bounds
    np.testing.assert_allclose(inner, (0.15, 0.15, -0.15, -0.15))
    assert {solid.texture for solid in (top, *legs)} == {2.0}


def test_a_table_lower_than_its_slab_is_refused() -> None:
    with pytest.raises(InputError, match=r"^top: expected a height above the bottom"):
        table(0, 0, 1, 1, height=SLAB)


def test_a_table_without_area_is_refused() -> None:
    with pytest.raises(InputError, match=r"^box: expected two opposite corners"):
        table(0, 0, 0, 1)
