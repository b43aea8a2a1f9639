"""Settings of solids and holes: each shape gives its outline; ambiguous ones are refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely

from groundmap.errors import InputError, SettingsError
from groundmap.simulate.shapes import LEG, SLAB
from groundmap.simulate.world import World
from groundmap.simulate.world_file import HoleSettings, SolidSettings

BOX = (1.0, 2.0, 4.0, 3.0)
CORNERS = ((0.0, 0.0), (4.0, 0.0), (0.0, 3.0))
BENT = ((0.0, 0.0), (5.0, 0.0), (5.0, 3.0))
WAYS: dict[str, Any] = {
    "box": BOX,
    "polygon": CORNERS,
    "wall": BENT,
    "pole": (2.0, 1.0),
    "table": BOX,
}


@pytest.mark.parametrize("corners", [BOX, (4.0, 3.0, 1.0, 2.0), (1.0, 3.0, 4.0, 2.0)])
def test_a_box_is_the_rectangle_between_two_opposite_corners(
    corners: tuple[float, float, float, float],
) -> None:
    [solid] = SolidSettings(box=corners).solids()
    assert solid.outline.equals(shapely.box(*BOX))


def test_a_polygon_has_the_given_corners() -> None:
    [solid] = SolidSettings(polygon=CORNERS).solids()
    assert solid.outline.equals(shapely.Polygon(CORNERS))
    assert solid.outline.area == 6.0


@pytest.mark.parametrize("thickness", [0.2, 0.5])
def test_a_wall_has_half_its_thickness_on_each_side_of_its_centre_line(thickness: float) -> None:
    [solid] = SolidSettings(wall=BENT, thickness=thickness).solids()
    half = thickness / 2
    assert solid.outline.bounds == pytest.approx((0.0, -half, 5.0 + half, 3.0))
    assert solid.outline.area == pytest.approx(8.0 * thickness)
    assert solid.outline.covers(shapely.LineString(BENT))


def test_a_wall_that_closes_is_a_ring() -> None:
    [solid] = SolidSettings(wall=((0, 0), (6, 0), (6, 4), (0, 4), (0, 0))).solids()
    assert len(solid.outline.interiors) == 1
    assert not solid.outline.contains(shapely.Point(3, 2))
    assert solid.outline.area == pytest.approx(20.0 * 0.2, abs=0.2**2)


def test_a_pole_is_round_about_its_middle() -> None:
    [solid] = SolidSettings(pole=(2.0, 1.0), radius=0.3).solids()
    corners = shapely.get_coordinates(solid.outline) - (2.0, 1.0)
    np.testing.assert_allclose(np.hypot(*corners.T), 0.3)
    assert solid.outline.centroid.distance(shapely.Point(2, 1)) < 1e-9


def test_a_table_is_a_slab_on_four_legs_below_it() -> None:
    slab, *legs = SolidSettings(table=BOX, top=1.0).solids()
    assert slab.outline.equals(shapely.box(*BOX))
    assert (slab.bottom, slab.top) == (1.0 - SLAB, 1.0)
    assert len(legs) == 4
    for leg in legs:
        assert (leg.bottom, leg.top) == (0.0, slab.bottom)
        assert slab.outline.contains(leg.outline)
        assert leg.outline.area == pytest.approx(LEG**2)


@pytest.mark.parametrize("way", WAYS)
def test_the_default_height_of_a_table_is_0_75_m_and_of_other_solids_2_5_m(way: str) -> None:
    tops = [solid.top for solid in SolidSettings(**{way: WAYS[way]}).solids()]
    assert max(tops) == (0.75 if way == "table" else 2.5)


@pytest.mark.parametrize("way", WAYS)
def test_a_given_height_replaces_the_default(way: str) -> None:
    assert SolidSettings(**{way: WAYS[way]}, top=1.1).solids()[0].top == 1.1


@pytest.mark.parametrize("way", WAYS)
def test_a_height_of_0_is_refused(way: str) -> None:
    with pytest.raises(InputError, match=r"^top: expected a height above the bottom \[m\]"):
        SolidSettings(**{way: WAYS[way]}, top=0.0).solids()


def test_an_underside_lifts_a_solid_off_the_ground() -> None:
    [solid] = SolidSettings(box=BOX, bottom=0.5, top=0.6).solids()
    assert (solid.bottom, solid.top) == (0.5, 0.6)


def test_a_solid_without_a_shape_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"^shape: expected one of box, polygon, wall, pole, table, got none\.$"
    ):
        SolidSettings(top=1.0).solids()
    with pytest.raises(InputError, match=r"^shape: expected one of box, polygon, got none\.$"):
        HoleSettings(depth=1.0).hole()


@pytest.mark.parametrize("other", [way for way in WAYS if way != "box"])
def test_a_solid_with_two_shapes_is_refused(other: str) -> None:
    with pytest.raises(InputError, match=rf"^shape: expected one of .*, got box and {other}\.$"):
        SolidSettings(**{"box": BOX, other: WAYS[other]}).solids()
    if other == "polygon":
        with pytest.raises(InputError, match=r"^shape: .*, got box and polygon\.$"):
            HoleSettings(box=BOX, polygon=CORNERS, depth=1.0).hole()


@pytest.mark.parametrize(
    ("key", "nearest"), [("tickness", "thickness"), ("textur", "texture"), ("vanish", "vanishes")]
)
def test_an_unknown_key_names_the_nearest(key: str, nearest: str) -> None:
    with pytest.raises(
        SettingsError, match=rf"^{key}: expected a setting of SolidSettings.* '{nearest}'\?$"
    ):
        SolidSettings(**dict[str, Any]({key: 1.0}))


def test_an_unknown_key_of_a_hole_names_the_nearest() -> None:
    with pytest.raises(SettingsError, match=r"^dept: expected a setting of HoleS.* 'depth'\?$"):
        HoleSettings(**dict[str, Any](box=BOX, dept=1.0))


@pytest.mark.parametrize(
    ("given", "there"),
    [
        ({}, (-math.inf, math.inf)),
        ({"appears": 5.0}, (5.0, math.inf)),
        ({"vanishes": 5.0}, (-math.inf, 5.0)),
        ({"appears": 2.0, "vanishes": 5.0}, (2.0, 5.0)),
        ({"appears": 0.0}, (0.0, math.inf)),
    ],
)
@pytest.mark.parametrize("way", ["box", "table"])
def test_a_solid_is_there_from_when_it_appears_until_it_vanishes(
    way: str, given: dict[str, Any], there: tuple[float, float]
) -> None:
    for solid in SolidSettings(**{way: WAYS["table"], **given}).solids():
        assert solid.present == there
        for time in (0.0, 1.9, 2.0, 4.9, 5.0):
            assert solid.is_there(time) is (there[0] <= time < there[1])


def test_a_solid_that_vanishes_before_it_appears_is_refused() -> None:
    with pytest.raises(InputError, match=r"^present: expected \(from, until\) \[s\]"):
        SolidSettings(box=BOX, appears=5.0, vanishes=2.0).solids()


@pytest.mark.parametrize("way", WAYS)
def test_options_of_a_table_apply_to_all_its_solids(way: str) -> None:
    given: dict[str, Any] = {
        "texture": 7.0,
        "lines": 1.5,
        "edges": False,
        "transparent": True,
        "repeat": 0.3,
        "velocity": (1.0, -0.5),
    }
    for solid in SolidSettings(**{way: WAYS[way]}, **given).solids():
        assert {name: getattr(solid, name) for name in given} == given


@pytest.mark.parametrize(
    ("key", "value"), [("thickness", 0.0), ("radius", -1.0), ("texture", -1.0), ("lines", -0.1)]
)
def test_a_value_out_of_its_range_is_refused(key: str, value: float) -> None:
    with pytest.raises(SettingsError, match=rf"^{key}: expected greater than .*, got {value}\.$"):
        SolidSettings(box=BOX, **dict[str, Any]({key: value}))


@pytest.mark.parametrize(
    ("way", "outline"), [("box", shapely.box(*BOX)), ("polygon", shapely.Polygon(CORNERS))]
)
def test_a_hole_has_its_outline_and_its_depth(way: str, outline: shapely.Polygon) -> None:
    hole = HoleSettings(**{way: WAYS[way]}, depth=0.5).hole()
    assert hole.outline.equals(outline)
    assert hole.depth == 0.5
    world = World(bounds=(0, 0, 9, 9), holes=(hole,))
    assert world.obstacles(0.15, 2.0).equals(outline)
    assert world.obstacles(0.6, 2.0).is_empty


def test_a_hole_is_below_the_ground() -> None:
    with pytest.raises(SettingsError, match=r"^depth: expected greater than 0, got 0\.0\.$"):
        HoleSettings(box=BOX, depth=0.0)
