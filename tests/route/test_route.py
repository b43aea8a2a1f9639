"""Routes: their figures, their files."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from groundmap.arrays import Floats, Floats32
from groundmap.errors import InputError
from oracles_planning import BLOCKED, UNSEEN, free_field, grid_of
from planners import PlanningProblem, Route, plan
from planners.geometry.polyline import cross_cells, merge_collinear

KEYS = {
    "length",
    "cost",
    "bound",
    "headings",
    "min_clearance",
    "known_clearance",
    "min_confidence",
    "mean_confidence",
    "unknown_length",
    "start_unknown_area",
    "waypoints",
    "planner",
    "expanded",
    "seconds",
    "audit",
}
points = arrays(
    np.float64,
    st.tuples(st.integers(2, 6), st.just(2)),
    elements=st.integers(0, 12).map(lambda n: n / 4) | st.floats(0, 3).map(lambda v: round(v, 6)),
)


def straight(**options: object) -> Route:
    z = free_field(64, 64)
    z[:, 20:30] = -0.5
    z[20, 20] = BLOCKED
    values = {"start": (10.5, 8.5), "goal": (40.5, 8.5), "footprint": 1.0} | options
    return plan(PlanningProblem(grid_of(z), **values))  # type: ignore[arg-type]


def test_figures_of_a_straight_route() -> None:
    route = straight()
    assert route.waypoints.tolist() == [[10.5, 8.5], [40.5, 8.5]]
    assert route.length == 30.0
    assert route.min_clearance == 8.5
    assert route.mean_clearance == pytest.approx(8.5)
    assert route.min_confidence == 0.5
    assert route.mean_confidence == pytest.approx((20 + 10 * 0.5) / 30)
    assert (route.unknown_length, route.start_unknown_area) == (0.0, 0.0)
    assert (route.planner, route.audit, route.frame) == ("astar", "clean", "map")
    assert route.seconds > 0


def test_start_is_goal_gives_a_line_of_no_length() -> None:
    route = straight(goal=(10.5, 8.5))
    assert route.waypoints.tolist() == [[10.5, 8.5], [10.5, 8.5]]
    assert (route.length, route.expanded, route.mean_confidence) == (0.0, 0, 1.0)


def test_unknown_space_under_the_line_and_at_the_start_is_reported() -> None:
    z = free_field(64, 64)
    z[:, :12] = UNSEEN
    grid = grid_of(z)
    route = plan(PlanningProblem(grid, start=(11, 20.5), goal=(40, 20.5), footprint=1.0))
    assert route.unknown_length == pytest.approx(1.0)
    assert (route.min_confidence, math.copysign(1, route.min_confidence)) == (0.0, 1.0)
    # Centres of unknown cells within 1 m of the line from (11, 20.5): three in column 11
    # (rows 19 to 21), one in column 10.
    assert route.start_unknown_area == 4.0
    allowed = plan(
        PlanningProblem(grid, start=(1, 20.5), goal=(40, 20.5), footprint=0.5, unknown="allow")
    )
    assert allowed.unknown_length == pytest.approx(11.0)
    assert allowed.min_clearance == math.inf
    assert allowed.to_dict()["min_clearance"] is None


def test_to_dict_holds_plain_values_and_every_promised_key() -> None:
    values = straight().to_dict()
    assert values.keys() >= KEYS
    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_geojson_comes_back_as_it_was(tmp_path: Path) -> None:
    route = straight(goal=(40.5, 30.25))
    route.save_geojson(tmp_path / "route.geojson")
    text = (tmp_path / "route.geojson").read_text(encoding="utf-8")
    feature = json.loads(text)
    assert feature == route.to_geojson()
    assert (feature["type"], feature["geometry"]["type"]) == ("Feature", "LineString")
    line = shapely.from_geojson(text)
    np.testing.assert_array_equal(shapely.get_coordinates(line), route.waypoints)
    assert feature["properties"]["length"] == route.length


def test_a_missing_folder_is_an_oserror(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        straight().save_geojson(tmp_path / "nowhere" / "route.geojson")


@given(points)
def test_crossed_cells_share_out_the_length(line: Floats) -> None:
    cells, lengths = cross_cells(line)
    total = np.hypot(*np.diff(line, axis=0).T).sum()
    assert lengths.sum() == pytest.approx(total, abs=1e-9)
    for row, col in np.unique(cells, axis=0):
        inside = sum(
            shapely.intersection(
                shapely.LineString([a, b]), shapely.box(col, row, col + 1, row + 1)
            ).length
            for a, b in pairwise(line)
        )
        there = lengths[(cells == (row, col)).all(axis=1)].sum()
        assert there <= inside + 1e-9


@given(points)
def test_merging_keeps_the_line_and_its_ends(line: Floats) -> None:
    short = merge_collinear(line)
    assert 2 <= len(short) <= len(line)
    np.testing.assert_array_equal(short[[0, -1]], line[[0, -1]])
    old, new = shapely.linestrings(line), shapely.linestrings(short)
    assert new.length == pytest.approx(old.length, abs=1e-8)
    if new.length > 1e-6:
        assert shapely.hausdorff_distance(old, new) < 1e-8


def test_headings_follow_the_line_and_end_in_the_requested_yaw() -> None:
    route = straight(goal=(20.5, 18.5))
    assert route.headings.tolist() == [math.pi / 4] * 2
    turned = straight(goal=(20.5, 18.5, -1.0))
    assert turned.headings.tolist() == [math.pi / 4, -1.0]


def test_a_csv_has_a_line_for_each_waypoint(tmp_path: Path) -> None:
    route = straight(goal=(30.5, 18.5))
    route.save(tmp_path / "route.csv")
    lines = (tmp_path / "route.csv").read_text().splitlines()
    assert lines[0] == "x,y,yaw,distance"
    table = np.loadtxt(lines[1:], delimiter=",")
    np.testing.assert_array_equal(table[:, :2], route.waypoints)
    np.testing.assert_array_equal(table[:, 2], route.headings)
    assert table[-1, 3] == pytest.approx(route.length)


def test_a_path_message_has_a_pose_for_each_waypoint(tmp_path: Path) -> None:
    route = straight(goal=(30.5, 18.5))
    route.save(tmp_path / "route.yaml")
    message = yaml.safe_load((tmp_path / "route.yaml").read_text())
    assert message == route.to_path()
    assert message["header"]["frame_id"] == "map"
    for pose, (x, y), yaw in zip(message["poses"], route.waypoints, route.headings, strict=True):
        assert (pose["pose"]["position"]["x"], pose["pose"]["position"]["y"]) == (x, y)
        turn = pose["pose"]["orientation"]
        assert 2 * math.atan2(turn["z"], turn["w"]) == pytest.approx(yaw)


def test_a_route_is_saved_as_its_name_ends_or_not_at_all(tmp_path: Path) -> None:
    straight().save(tmp_path / "route.geojson")
    assert json.loads((tmp_path / "route.geojson").read_text())["type"] == "Feature"
    with pytest.raises(InputError, match=r"path: expected a name that ends in \.geojson, "):
        straight().save(tmp_path / "route.txt")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["route.geojson"]


def test_the_known_clearance_counts_unknown_cells_that_were_cleared() -> None:
    z = free_field(64, 64)
    z[10, 10] = UNSEEN
    ends = {"start": (9.3, 8.5), "goal": (40.5, 8.5)}
    route = straight_over(z, **ends)
    assert route.start_unknown_area == 0.0
    assert route.known_clearance == pytest.approx(1.5)
    assert route.min_clearance == 8.5
    z[8, 9] = UNSEEN
    assert straight_over(z, **ends).known_clearance == 0.0
    assert straight_over(z, **ends).min_clearance == 8.5


def test_without_cleared_cells_the_known_clearance_is_the_clearance() -> None:
    z = free_field(64, 64)
    z[30:32, 30:32] = UNSEEN
    for options in ({}, {"unknown": "allow"}, {"clear_start": False}):
        route = straight_over(z, **options)
        assert route.known_clearance == route.min_clearance


def straight_over(z: Floats32, **options: object) -> Route:
    values = {"start": (10.5, 8.5), "goal": (40.5, 8.5), "footprint": 1.0} | options
    return plan(PlanningProblem(grid_of(z), **values))  # type: ignore[arg-type]


def test_a_route_without_blocked_cells_has_no_clearance_in_files() -> None:
    z = free_field(64, 64)
    values = straight_over(z, unknown="allow").to_dict()
    assert values["min_clearance"] is values["known_clearance"] is None
