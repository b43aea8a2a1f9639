"""Worlds: refused values, places of solids over time, obstacles to a robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import translate

from groundmap.errors import InputError
from groundmap.simulate.world import Hole, Solid, World
from strategies import rngs

UNIT = shapely.box(0, 0, 1, 1)
BOUNDS = (0.0, 0.0, 10.0, 10.0)
STEP, ROBOT = 0.15, 2.0


def square(x: float, y: float, side: float = 1.0) -> shapely.Polygon:
    return shapely.box(x, y, x + side, y + side)


def world_of(*solids: Solid, holes: tuple[Hole, ...] = ()) -> World:
    return World(bounds=BOUNDS, solids=solids, holes=holes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"top": 0.0}, r"^top: expected a height above the bottom \[m\], got 0.0 to 0.0"),
        ({"top": 1.0, "bottom": 1.0}, r"^top: expected a height above the bottom"),
        ({"top": 1.0, "bottom": 2.0}, r"^top: expected a height above the bottom"),
        ({"top": math.inf}, r"^top: expected a height above the bottom"),
        ({"top": 1.0, "bottom": -math.inf}, r"^bottom: expected a height below the top"),
        ({"top": math.nan}, r"^top: expected a height above the bottom"),
        ({"top": 1.0, "texture": -1.0}, r"^texture: expected a number of 0 or more, got -1.0"),
        ({"top": 1.0, "lines": math.nan}, r"^lines: expected a number of 0 or more"),
        ({"top": 1.0, "repeat": math.inf}, r"^repeat: expected a number of 0 or more"),
        ({"top": 1.0, "present": (5.0, 5.0)}, r"^present: expected \(from, until\) \[s\]"),
        ({"top": 1.0, "present": (math.nan, 5.0)}, r"^present: expected \(from, until\)"),
    ],
)
def test_an_invalid_solid_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Solid(UNIT, **options)


@pytest.mark.parametrize(
    "outline",
    [
        shapely.Polygon(),
        shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]),  # a bow tie
        shapely.Polygon([(0, 0), (1, 0), (2, 0)]),
    ],
)
def test_an_outline_without_an_inside_is_refused(outline: shapely.Polygon) -> None:
    with pytest.raises(InputError, match=r"^outline: expected a polygon with an area"):
        Solid(outline, top=1.0)
    with pytest.raises(InputError, match=r"^outline: expected a polygon with an area"):
        Hole(outline, depth=1.0)


@pytest.mark.parametrize("outline", [shapely.LineString([(0, 0), (1, 1)]), UNIT.bounds, None])
def test_an_outline_that_is_not_a_polygon_is_refused(outline: Any) -> None:
    with pytest.raises(InputError, match=r"^outline: expected a shapely.Polygon"):
        Solid(outline, top=1.0)
    with pytest.raises(InputError, match=r"^outline: expected a shapely.Polygon"):
        Hole(outline, depth=1.0)


@pytest.mark.parametrize("depth", [0.0, -1.0, math.inf, math.nan])
def test_a_hole_that_is_not_deep_is_refused(depth: float) -> None:
    with pytest.raises(InputError, match=r"^depth: expected a number above 0 \[m\]"):
        Hole(UNIT, depth=depth)


@pytest.mark.parametrize(
    "bounds", [(0, 0, 0, 1), (0, 1, 1, 1), (2, 0, 1, 1), (0, 0, math.inf, 1), (math.nan, 0, 1, 1)]
)
def test_empty_bounds_are_refused(bounds: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match=r"^bounds: expected XMIN < XMAX and YMIN < YMAX"):
        World(bounds=bounds)


@pytest.mark.parametrize("name", ["ground_texture", "ground_lines"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_a_negative_density_of_ground_features_is_refused(name: str, value: float) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(InputError, match=rf"^{name}: expected a number of 0 or more \[1/m²\]"):
        World(bounds=BOUNDS, **options)


@pytest.mark.parametrize("clockwise", [False, True])
def test_outlines_are_oriented_and_keep_their_area(clockwise: bool) -> None:
    ring = shapely.Polygon(square(0, 0, 4).exterior, [square(1, 1).exterior])
    given_ring = shapely.orient_polygons(ring, exterior_cw=clockwise)
    for outline in (Solid(given_ring, top=1.0).outline, Hole(given_ring, depth=1.0).outline):
        assert outline.exterior.is_ccw
        assert not outline.interiors[0].is_ccw
        assert outline.equals(ring)


def test_a_solid_is_there_from_its_first_moment_until_before_its_last() -> None:
    passing = Solid(UNIT, top=1.0, present=(2.0, 5.0))
    there = [passing.is_there(time) for time in (1.999, 2.0, 4.999, 5.0)]
    assert there == [False, True, True, False]
    world = world_of(passing, Solid(square(3, 3), top=1.0))
    assert [len(world.at(time).solids) for time in (0.0, 3.0, 5.0)] == [1, 2, 1]


@given(rngs(), st.floats(-100.0, 100.0))
def test_a_moving_solid_follows_its_velocity(rng: np.random.Generator, time: float) -> None:
    vx, vy = rng.normal(size=2)
    moving = Solid(square(*rng.normal(size=2)), top=1.0, velocity=(vx, vy), texture=3.0)
    then = world_of(moving, Solid(UNIT, top=2.0)).at(time)
    expected = translate(moving.outline, vx * time, vy * time)
    assert then.solids[0].outline.equals_exact(expected, 1e-9)
    assert then.solids[0].velocity == (0.0, 0.0)
    assert (then.solids[0].top, then.solids[0].texture) == (1.0, 3.0)
    assert then.solids[1].outline.equals(UNIT)
    assert then.at(17.0).solids[0].outline.equals_exact(expected, 1e-9)  # at rest


def test_a_world_at_another_time_does_not_change_the_world() -> None:
    world = world_of(
        Solid(UNIT, top=1.0, velocity=(1.0, 0.0)), holes=(Hole(square(5, 5), depth=1),)
    )
    world.at(4.0)
    assert world.solids[0].outline.equals(UNIT)
    assert world.at(4.0).holes == world.holes
    assert world.at(4.0).bounds == world.bounds


@pytest.mark.parametrize(
    ("bottom", "top", "in_the_way"),
    [
        (0.0, 1.0, True),
        (0.0, STEP, False),  # a kerb that the robot drives over
        (0.0, STEP + 0.01, True),
        (0.7, 0.75, True),  # a table top
        (ROBOT, 2.5, False),  # overhead
        (ROBOT - 0.01, 2.5, True),
    ],
)
def test_solids_at_the_height_of_the_robot_are_obstacles(
    bottom: float, top: float, in_the_way: bool
) -> None:
    for opaque in (False, True):
        found = world_of(Solid(UNIT, bottom=bottom, top=top)).obstacles(STEP, ROBOT, opaque=opaque)
        assert found.equals(UNIT) if in_the_way else found.is_empty


def test_glass_is_an_obstacle_but_does_not_end_sight() -> None:
    world = world_of(Solid(UNIT, top=2.0, transparent=True), Solid(square(4, 4), top=2.0))
    assert world.obstacles(STEP, ROBOT).area == pytest.approx(2.0)
    assert world.obstacles(STEP, ROBOT, opaque=True).equals(square(4, 4))


def test_holes_deeper_than_a_step_are_obstacles_but_do_not_end_sight() -> None:
    holes = Hole(UNIT, depth=1.0), Hole(square(4, 4), depth=STEP)
    world = world_of(holes=holes)
    assert world.obstacles(STEP, ROBOT).equals(UNIT)
    assert world.obstacles(STEP, ROBOT, opaque=True).is_empty


@given(rngs())
def test_obstacles_are_the_union_of_all_outlines(rng: np.random.Generator) -> None:
    corners = rng.uniform(0.0, 5.0, (rng.integers(0, 6), 2))
    outlines = [shapely.box(x, y, x + 2.0, y + 2.0) for x, y in corners]
    found = world_of(*(Solid(outline, top=1.0) for outline in outlines)).obstacles(STEP, ROBOT)
    x, y = rng.uniform(0.0, 8.0, (2, 200))
    expected = np.zeros(200, dtype=np.bool_)
    for xmin, ymin, xmax, ymax in (outline.bounds for outline in outlines):
        expected |= (xmin < x) & (x < xmax) & (ymin < y) & (y < ymax)
    np.testing.assert_array_equal(shapely.contains_xy(found, x, y), expected)


def test_the_top_of_a_ramp_is_its_highest_point() -> None:
    ramp = Solid(shapely.box(2, 0, 6, 1), top=1.0, slope=(-0.25, 0.0), velocity=(1.0, 0.0))
    places = np.array([(2.0, 0.5), (6.0, 0.5), (4.0, 0.0)])
    assert ramp.top_at(places).tolist() == [1.0, 0.0, 0.5]
    assert ramp.at(2.0).top_at(places + np.array([2.0, 0.0])).tolist() == [1.0, 0.0, 0.5]


def test_a_slope_to_below_the_bottom_is_refused() -> None:
    with pytest.raises(InputError, match=r"slope: .* lowest point .* got -0\.2"):
        Solid(shapely.box(2, 0, 6, 1), top=1.0, slope=(-0.3, 0.0))
