"""Footprints: discs and polygons, what bounds them, what is none, and what they touch."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings

from groundmap.arrays import Bools, Floats
from oracles_curves import drive, placed_at
from oracles_planning import union_of_squares
from planners.costmap.swept_footprint import shape_of
from planners.errors import ProblemError
from planners.geometry.kernels.swept_footprint import Ground, cuts, motion_clear, pose_clear
from planners.geometry.rounding import SLACK
from planners.problem.footprint import Footprint
from strategies import rngs

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
ELL = [(-1.0, -1.0), (2.0, -1.0), (2.0, 0.5), (0.5, 0.5), (0.5, 2.0), (-1.0, 2.0)]


def corners(footprint: Footprint) -> Floats:
    assert footprint.polygon is not None
    return footprint.polygon


def star(rng: np.random.Generator) -> Floats:
    """Return a simple polygon around the origin, mostly a concave one."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 12)))
    reach = rng.uniform(0.5, 3.0, len(angles))
    return np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])


@pytest.mark.parametrize("radius", [0, 0.9, np.float32(0.5), np.array(2.0)])
def test_a_number_is_a_disc(radius: float) -> None:
    disc = Footprint.of(radius)
    assert disc.is_disc
    assert disc.radius == disc.inscribed_radius == disc.to_value() == float(radius)
    assert disc.width == 2 * float(radius)


def test_a_polygon_has_covering_discs_and_a_width() -> None:
    square = Footprint.of(SQUARE)
    assert (square.radius, square.inscribed_radius) == (math.sqrt(2), 1.0)
    assert square.width == pytest.approx(2.0)
    ahead = Footprint.of([(x + 5.0, y) for x, y in SQUARE])
    assert ahead.inscribed_radius == 0.0
    assert ahead.radius == pytest.approx(math.hypot(6, 1))


def test_a_closing_corner_is_dropped_and_a_clockwise_polygon_turned() -> None:
    plain = Footprint.of(SQUARE)
    assert Footprint.of([*SQUARE, SQUARE[0]]).to_value() == plain.to_value()
    turned = Footprint.of(SQUARE[::-1])
    assert shapely.is_ccw(shapely.LinearRing(corners(turned)))
    assert shapely.Polygon(corners(turned)).equals(shapely.Polygon(SQUARE))


@given(rngs())
@settings(max_examples=40)
def test_discs_and_width_are_those_of_the_polygon(rng: np.random.Generator) -> None:
    polygon = shapely.Polygon(star(rng))
    assume(polygon.is_valid)
    footprint = Footprint.of(shapely.get_coordinates(polygon))
    origin = shapely.Point(0, 0)
    assert footprint.radius == pytest.approx(origin.hausdorff_distance(polygon))
    outside = shapely.box(-9, -9, 9, 9).difference(polygon)
    assert footprint.inscribed_radius == pytest.approx(origin.distance(outside))
    angles = np.linspace(0, np.pi, 3000)
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    extents = np.ptp(normals @ corners(footprint).T, axis=1)
    assert extents.min() - 1e-2 <= footprint.width <= extents.min() + 1e-9


@given(rngs())
@settings(max_examples=20)
def test_written_values_can_be_read(rng: np.random.Generator) -> None:
    points = star(rng)
    assume(shapely.Polygon(points).is_valid)
    written = Footprint.of(points).to_value()
    again = Footprint.of(written)
    assert again.to_value() == written


def test_corners_cannot_be_changed() -> None:
    points = np.array(SQUARE)
    footprint = Footprint.of(points)
    points[:] = 0.0
    assert footprint.to_value() == [list(point) for point in SQUARE]
    with pytest.raises(ValueError, match="read-only"):
        corners(footprint)[0, 0] = 3.0


@pytest.mark.parametrize(
    ("value", "got"),
    [
        (-0.1, r"-0\.1"),
        (math.nan, "nan"),
        (math.inf, "inf"),
        ("wide", "'wide'"),
        ([(0, 0), (1, 0)], "2 different points"),
        ([(0, 0), (1, 0), (1, 0), (0, 0)], "2 different points"),
        ([(0, 0), (1, 1), (2, 2)], "points on one line"),
        ([(0, 0), (math.nan, 1), (2, 2)], "a number that is not finite"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], r"a self-intersection at \(0\.5, 0\.5\)"),
        ([(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)], r"a self-intersection at \(1, 0\)"),
        ([1.0, 2.0, 3.0], r"shape \(3,\)"),
        (np.zeros((4, 3)), r"shape \(4, 3\)"),
    ],
)
def test_invalid_footprints_are_refused(value: Any, got: str) -> None:
    with pytest.raises(ProblemError, match=f"footprint: expected a radius .*, got {got}"):
        Footprint.of(value)


def test_an_ell_is_a_footprint() -> None:
    ell = Footprint.of(ELL)
    assert shapely.Polygon(corners(ell)).area == pytest.approx(1.5 * 3 + 1.5 * 1.5)
    assert ell.inscribed_radius == pytest.approx(math.hypot(0.5, 0.5))


def ground_of(blocked: Bools) -> Ground:
    before = np.zeros((len(blocked), blocked.shape[1] + 1), dtype=np.int64)
    np.cumsum(blocked, axis=1, out=before[:, 1:])
    centres = [shapely.Point(col + 0.5, row + 0.5) for row, col in np.ndindex(blocked.shape)]
    clearance = shapely.distance(centres, union_of_squares(blocked)).reshape(blocked.shape)
    return Ground(blocked, before, np.where(np.isnan(clearance), np.inf, clearance))


def polygons(rng: np.random.Generator) -> Footprint:
    points = star(rng)
    return Footprint.of(points if shapely.Polygon(points).is_valid else SQUARE)


def poses(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return a pose on a map of 12 by 12 cells, often one at which sides lie on cells' borders."""
    x, y, yaw = rng.uniform((3, 3, -4), (9, 9, 4)).tolist()
    if rng.random() < 0.4:
        return round(2 * x) / 2, round(2 * y) / 2, round(yaw) * math.pi / 2
    return x, y, yaw


def masks_of(rng: np.random.Generator) -> Bools:
    blocked: Bools = rng.random((12, 12)) < rng.choice([0.02, 0.05, 0.1])
    return blocked


@given(rngs())
@settings(max_examples=40)
def test_parts_and_discs_cover_the_polygon_and_parts_no_more(rng: np.random.Generator) -> None:
    footprint = polygons(rng)
    whole = shapely.Polygon(corners(footprint))
    parts = shapely.polygons([shapely.linearrings(part) for part in footprint.convex_parts()])
    assert shapely.area(shapely.symmetric_difference(shapely.union_all(parts), whole)) < 1e-9
    for part in parts:
        assert shapely.is_ccw(part.exterior)
        assert part.convex_hull.area == pytest.approx(part.area)
    discs = [shapely.Point(x, y).buffer(1.001 * r, 64) for x, y, r in footprint.covering_discs()]
    assert shapely.union_all(discs).contains(whole)


@given(rngs())
@settings(max_examples=100)
def test_a_pose_is_clear_if_no_blocked_square_is_overlapped(rng: np.random.Generator) -> None:
    blocked, footprint, (x, y, yaw) = masks_of(rng), polygons(rng), poses(rng)
    if rng.random() < 0.3:
        footprint = Footprint.of(SQUARE if rng.random() < 0.5 else ELL)
    placed = placed_at(shapely.Polygon(corners(footprint)), (x, y, yaw))
    overlap = placed.intersection(union_of_squares(blocked)).area
    assume(not 1e-12 < overlap < 1e-7)  # rounding decides
    got = pose_clear(blocked, corners(footprint), x, y, math.cos(yaw), math.sin(yaw), SLACK)
    assert got == (overlap < 1e-9)


@given(rngs())
@settings(max_examples=100)
def test_a_clear_motion_touches_nothing_and_a_refused_one_nearly_does(
    rng: np.random.Generator,
) -> None:
    blocked, pose = masks_of(rng), poses(rng)
    footprint = Footprint.of(1.2) if rng.random() < 0.2 else polygons(rng)
    curvature, length = rng.choice([-1, 0, 1]) / rng.uniform(1, 6), rng.uniform(-2, 2)
    shape = shape_of(footprint, 1.0)._replace(bulge=0.01, spike=1.0)
    got = motion_clear(ground_of(blocked), shape, *pose, curvature, length)
    squares = union_of_squares(blocked)
    steps = cuts(shape, curvature, length)
    cut = [drive(pose, curvature, length * i / steps) for i in range(steps + 1)]
    fine = [drive(pose, curvature, length * i / 40) for i in range(41)]
    if footprint.is_disc:
        line = shapely.LineString([(x, y) for x, y, _ in cut])
        clearance = shapely.distance(line, squares) if blocked.any() else math.inf
        assert got == (clearance >= 1.2) or abs(clearance - 1.2) <= 0.011
        assert not got or clearance >= 1.2 - 1e-8
        return
    whole = shapely.Polygon(corners(footprint))
    touched = [placed_at(whole, pose).intersection(squares).area for pose in fine]
    if got:
        assert max(touched) < 1e-8
        return
    hulls = []
    for part in map(shapely.Polygon, footprint.convex_parts()):
        placed = [placed_at(part, pose) for pose in cut]
        hulls += [shapely.union(a, b).convex_hull.buffer(0.015) for a, b in pairwise(placed)]
    assert shapely.union_all(hulls).intersects(squares)


@given(rngs())
@settings(max_examples=40)
def test_no_point_leaves_the_chords_of_a_cut_motion_by_more_than_the_bulge(
    rng: np.random.Generator,
) -> None:
    pose, footprint = poses(rng), polygons(rng)
    curvature, length = 1 / rng.uniform(0.5, 6), rng.uniform(-3, 3)
    steps = cuts(shape_of(footprint, 1.0)._replace(bulge=0.01, spike=1.0), curvature, length)
    assert abs(length) / steps <= 0.5
    ends = [drive(pose, curvature, length * i / steps) for i in range(steps + 1)]
    for (a, b), i in zip(pairwise(ends), range(steps), strict=True):
        halfway = drive(pose, curvature, length * (i + 0.5) / steps)
        first, middle, last = (
            shapely.get_coordinates(placed_at(shapely.MultiPoint(corners(footprint)), at))
            for at in (a, halfway, b)
        )
        assert np.hypot(*((first + last) / 2 - middle).T).max() <= 0.01 + 1e-12
