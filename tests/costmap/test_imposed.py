"""Areas that are not to be entered whatever the map says: every planner and the audit know them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import CellSet, ConfidenceGrid
from groundmap.arrays import Bools
from oracles_planning import BLOCKED, free_field, grid_of
from planners import (
    OWN_PLANNERS,
    AuditError,
    EnclosedError,
    IncrementalPlanner,
    KeepOutError,
    NonFreeError,
    PlanningProblem,
    plan,
    plan_many,
)
from planners.audit.audit import audit
from planners.costmap.costmap import Costmap

SIZE = 0.5  # [m]
FIELD = 40  # cells of a side
STRIP = shapely.box(8.1, 3.0, 9.3, 17.0)  # a wall with ways around both ends


def field() -> ConfidenceGrid:
    return grid_of(free_field(FIELD, FIELD), resolution=SIZE)


def across(**options: Any) -> PlanningProblem:
    return PlanningProblem(field(), start=(3, 9, 0), goal=(16, 11, 0), footprint=0.6, **options)


def reached(polygon: shapely.Polygon, *, depth: float = 1e-9) -> Bools:
    """Which cells of the field a polygon reaches into, by shapely."""
    rows, cols = np.mgrid[:FIELD, :FIELD] * SIZE
    squares = shapely.box(cols + depth, rows + depth, cols + SIZE - depth, rows + SIZE - depth)
    mask: Bools = shapely.intersects(squares, polygon)
    return mask


@given(
    st.lists(st.tuples(st.floats(-5, 25), st.floats(-5, 25)), min_size=3, max_size=7),
    st.booleans(),
)
@settings(max_examples=150, deadline=None)
def test_cells_that_a_polygon_reaches_into_are_blocked(
    corners: list[tuple[float, float]], on_lattice: bool
) -> None:
    points = np.round(np.array(corners) * 2) / 2 if on_lattice else np.array(corners)
    polygon = shapely.MultiPoint(points).convex_hull
    if polygon.geom_type != "Polygon" or polygon.area < 1e-6:
        return
    holed = polygon.difference(polygon.centroid.buffer(1.0))
    for area in (polygon, *shapely.get_parts(holed)):
        grid = field()
        problem = PlanningProblem(grid, start=(1, 1), goal=(2, 2), footprint=0.3, keep_out=area)
        costmap = Costmap.of(problem)
        assert costmap.kept_out is not None
        row, col = -costmap.lower_cell
        inner = costmap.kept_out[row : row + FIELD, col : col + FIELD]
        # A polygon that passes a corner within rounding may count or not.
        assert not (inner & ~reached(area, depth=0.0)).any()
        assert not (reached(area, depth=1e-7) & ~inner).any()


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))
@pytest.mark.parametrize("way", ["polygon", "cells", "recent"])
def test_routes_are_those_on_a_map_where_the_areas_are_non_free(planner: str, way: str) -> None:
    mask = reached(STRIP)
    cells = np.argwhere(mask)
    options: dict[str, Any] = {
        "polygon": {"keep_out": STRIP},
        "cells": {"keep_out": cells},
        "recent": {"recent": CellSet(cells, SIZE, np.zeros(2))},
    }[way]
    route = plan(across(**options), planner)
    z = np.where(mask, BLOCKED, free_field(FIELD, FIELD))
    drawn = replace(across(), grid=grid_of(z, resolution=SIZE), recent=None, keep_out=None)
    assert np.array_equal(route.waypoints, plan(drawn, planner).waypoints)
    assert shapely.LineString(route.waypoints).distance(STRIP) >= 0.6 - 1e-9
    assert route.min_clearance == min(route.keep_out_clearance, route.recent_clearance)


def test_sampling_planners_and_many_queries_keep_out() -> None:
    pytest.importorskip("ompl")
    problem = across(keep_out=STRIP)
    route = plan(problem, "rrtconnect", seed=1)
    assert shapely.LineString(route.waypoints).distance(STRIP) >= 0.6 - 1e-9
    [first, inside] = plan_many(problem, [((3, 9), (16, 11)), ((3, 9), (8.5, 9))], threads=1)
    assert not isinstance(first, Exception)
    assert shapely.LineString(first.waypoints).distance(STRIP) >= 0.6 - 1e-9
    assert isinstance(inside, KeepOutError)


@pytest.mark.parametrize("planner", ["astar", "hybrid_astar"])
def test_an_end_in_an_area_is_refused_with_the_reason(planner: str) -> None:
    on_start = shapely.box(2, 8, 4, 10)
    with pytest.raises(KeepOutError, match=r"start \(3.00, 9.00\): .* overlaps a keep-out area"):
        plan(across(keep_out=on_start), planner)
    on_goal = [[22, 32]]
    with pytest.raises(NonFreeError, match=r"goal .* space that the newest views saw as non-free"):
        plan(across(recent=on_goal), planner)


def test_the_reason_names_what_separates_start_and_goal() -> None:
    wall = shapely.box(8, -1, 9, 21)
    row = np.column_stack([np.arange(FIELD), np.full(FIELD, 24)])
    with pytest.raises(EnclosedError, match="Without the keep-out areas they are connected"):
        plan(across(keep_out=wall))
    with pytest.raises(EnclosedError, match="Without what the newest views saw as non-free they"):
        plan(across(recent=row))
    with pytest.raises(EnclosedError, match="Without the keep-out areas and what the newest"):
        plan(across(recent=row, keep_out=wall))
    z = free_field(FIELD, FIELD)
    z[:, 20] = BLOCKED
    walled = replace(across(keep_out=STRIP), grid=grid_of(z, resolution=SIZE))
    with pytest.raises(EnclosedError, match=r"however narrow the footprint\.$"):
        plan(walled)


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"keep_out": STRIP}, "too close to a keep-out area"),
        ({"keep_out": np.argwhere(reached(STRIP))}, "too close to a keep-out cell"),
        ({"recent": np.argwhere(reached(STRIP))}, "cell that the newest views saw as non-free"),
    ],
)
def test_the_audit_refuses_a_route_through_an_area(options: dict[str, Any], fault: str) -> None:
    problem = across(**options)
    line = np.array([problem.start[:2], problem.goal[:2]])
    with pytest.raises(AuditError, match=fault):
        audit(problem, line)
    with pytest.raises(AuditError, match=fault):
        audit(replace(problem, unknown="allow"), line)
    audit(replace(problem, keep_out=None, recent=None), line)


def test_the_audit_measures_polygons_themselves_also_for_outlines() -> None:
    problem = replace(
        across(keep_out=STRIP), footprint=[(-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)]
    )
    for last, fault in ((7.59, None), (7.61, "sweeps a keep-out area")):
        ends = replace(problem, goal=(last, 9, 0))
        line = np.array([(3.0, 9.0), (last, 9.0)])
        if fault is None:
            audit(ends, line, headings=np.zeros(2))
            continue
        with pytest.raises(AuditError, match=fault):
            audit(ends, line, headings=np.zeros(2))


def test_areas_beyond_the_map_count_where_unknown_space_is_traversable() -> None:
    below = shapely.box(6, -1.4, 9, -0.2)
    ends: dict[str, Any] = {"start": (2, 0.5), "goal": (16, 0.5), "unknown": "allow"}
    route = plan(replace(across(keep_out=below), **ends))
    assert shapely.LineString(route.waypoints).distance(below) >= 0.6 - 1e-9
    assert route.length > 14.0


def test_areas_hold_at_every_height_of_a_3d_map() -> None:
    grid = ConfidenceGrid(resolution=SIZE, origin=(0, 0, 0))
    grid.fuse(np.zeros(3, dtype=np.int64), np.full((16, 48, 48), -1.0, dtype=np.float32))
    problem = PlanningProblem(
        grid, start=(3, 9, 4), goal=(16, 11, 4), footprint=0.6, keep_out=STRIP, recent=[[8, 1, 20]]
    )
    route = plan(problem)
    assert shapely.LineString(route.waypoints[:, :2]).distance(STRIP) >= 0.6 - 1e-9
    with pytest.raises(AuditError, match="too close to a keep-out area"):
        audit(problem, np.array([problem.start, problem.goal]))


@given(st.integers(0, 2**32 - 1), st.sampled_from(["avoid", "allow"]))
@settings(max_examples=25, deadline=None)
def test_incremental_routes_follow_what_the_newest_views_saw(seed: int, unknown: Any) -> None:
    rng = np.random.default_rng(seed)
    problem = across(keep_out=shapely.box(5, 5, 6, 6), unknown=unknown)
    live = IncrementalPlanner(problem)
    for _ in range(5):
        cells = rng.integers(0, FIELD, (int(rng.integers(0, 30)), 2))
        live.update([], recent=cells)
        results = []
        for ask in (live.plan, lambda cells=cells: plan(replace(problem, recent=cells))):
            try:
                results.append(("", ask().cost))
            except (EnclosedError, NonFreeError) as error:
                results.append((type(error).__name__, 0.0))
        assert results[0][0] == results[1][0]
        assert results[0][1] == pytest.approx(results[1][1], rel=1e-12)
