"""The clearance kernel against shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from groundmap.arrays import Bools, Floats
from oracles_planning import masks, union_of_squares
from planners.geometry.kernels.clearance import line_clearance, segment_clearance, square_distance

# Quarters hit corners, edges and centres; other numbers hit the rest.
quarters = st.integers(-4, 40).map(lambda i: i / 4)
others = st.integers(-997, 9970).map(lambda i: i / 997)
coordinates = quarters | others
lines = arrays(np.float64, st.tuples(st.integers(2, 5), st.just(2)), elements=coordinates)


@given(lines)
def test_distance_to_a_square_is_shapelys(points: Floats) -> None:
    a, b = points[:2]
    line = shapely.Point(a) if (a == b).all() else shapely.LineString([a, b])
    expected = shapely.distance(line, shapely.box(3, 5, 4, 6))
    assert square_distance(a[0], a[1], b[0], b[1], 3, 5) == pytest.approx(expected, abs=1e-9)


@given(masks(), lines)
@settings(deadline=None)
def test_clearance_of_a_line_is_shapelys(blocked: Bools, points: Floats) -> None:
    line = shapely.Point(points[0]) if (points == points[0]).all() else shapely.LineString(points)
    expected = shapely.distance(line, union_of_squares(blocked))
    assert line_clearance(blocked, points) == pytest.approx(expected, abs=1e-9)


def test_clearance_is_infinite_without_blocked_cells_and_bounded_by_the_limit() -> None:
    nothing = np.zeros((4, 4), dtype=np.bool_)
    assert line_clearance(nothing, np.array([[1.0, 1.0], [2.0, 2.0]])) == np.inf
    assert segment_clearance(nothing, 1.0, 1.0, 2.0, 2.0, 0.75) == 0.75
