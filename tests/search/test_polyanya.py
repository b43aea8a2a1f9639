"""Polyanya: the shortest lines of the region, by the visibility graph of all its points."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats
from oracles_planning import BLOCKED, FREE, drawing, free_field, grid_of
from oracles_visibility import (
    bitmaps,
    centre,
    costmap_of,
    full_squares,
    noise,
    region,
    visibility_lengths,
)
from planners import AStarSettings, PlanningProblem, ProblemError, TimeLimitError
from planners.audit.audit import audit
from planners.costmap.costmap import Costmap
from planners.costmap.moves import allowed_moves
from planners.costmap.navmesh import NavigationMesh
from planners.geometry.polyline import length_of
from planners.problem.costs import CostSettings
from planners.search.astar import AStar
from planners.search.kernels.polyanya_bound import through
from planners.search.kernels.sight import sight
from planners.search.polyanya import Polyanya, PolyanyaSettings
from planners.search.theta import LazyTheta, LazyThetaSettings, Theta, ThetaSettings

MAPS = Path(__file__).parents[3] / "shared" / "data" / "movingai"
SETTINGS = PolyanyaSettings()
choices = st.integers(0, 2**16)


def length(engine: Polyanya, start: tuple[float, float], goal: tuple[float, float]) -> float:
    """Return the length of the route; inf if there is none."""
    found = engine.search(start, goal, SETTINGS)
    return math.inf if found is None else length_of(found.waypoints)


@given(traversable=bitmaps(), chosen=st.lists(choices, min_size=6, max_size=6))
@settings(max_examples=80)
def test_routes_between_cells_are_the_shortest_and_all_legs_in_sight(
    traversable: Bools, chosen: list[int]
) -> None:
    cells, moves = np.argwhere(traversable), allowed_moves(traversable)
    engine = Polyanya(costmap_of(traversable))
    _, expected = visibility_lengths(traversable)
    for i, j in np.reshape(chosen, (-1, 2)) % len(cells):
        found = engine.search(centre(cells[i]), centre(cells[j]), SETTINGS)
        assert (found is not None) == np.isfinite(expected[i, j])
        if found is not None:
            assert length_of(found.waypoints) == pytest.approx(expected[i, j], rel=1e-12, abs=1e-9)
            turns = np.rint(found.waypoints - 0.5).astype(np.int64)[:, ::-1]
            assert all(sight(moves, *a, *b) for a, b in pairwise(turns))


@given(traversable=bitmaps(), data=st.data())
@settings(max_examples=50)
def test_routes_from_within_squares_are_the_shortest(
    traversable: Bools, data: st.DataObject
) -> None:
    squares = np.argwhere(full_squares(traversable))
    if len(squares) == 0:
        return
    share = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 0.25, 1 / 3, 0.5, 1.0]))
    inside = [
        squares[data.draw(choices) % len(squares)][::-1] + data.draw(st.tuples(share, share))
        for _ in range(4)
    ]
    points, expected = visibility_lengths(traversable, inside, margin=1e-9)
    engine = Polyanya(costmap_of(traversable))
    for i in range(len(points) - 4, len(points)):
        j = data.draw(choices) % len(points)
        (ax, ay), (bx, by) = (points[[i, j]] + 0.5).tolist()
        found = engine.search((ax, ay), (bx, by), SETTINGS)
        got = math.inf if found is None else length_of(found.waypoints)
        if found is not None and found.expanded == 0:  # straight, also beside the region
            assert got <= expected[i, j] + 1e-7
        else:
            assert got == pytest.approx(expected[i, j], rel=1e-7, abs=1e-7)


@given(bitmaps(), choices, choices)
@settings(max_examples=40)
def test_no_other_planner_finds_a_shorter_route(traversable: Bools, i: int, j: int) -> None:
    cells, costmap = np.argwhere(traversable), costmap_of(traversable)
    ends = centre(cells[i % len(cells)]), centre(cells[j % len(cells)])
    others = [
        AStar(costmap).search(*ends, AStarSettings()),
        Theta(costmap).search(*ends, ThetaSettings()),
        LazyTheta(costmap).search(*ends, LazyThetaSettings()),
    ]
    shortest = length(Polyanya(costmap), *ends)
    for other in others:
        assert shortest <= (math.inf if other is None else length_of(other.waypoints)) + 1e-9


@given(bitmaps(), choices, choices, choices)
@settings(max_examples=60)
def test_an_added_obstacle_shortens_no_route_and_a_reversed_one_is_as_long(
    traversable: Bools, i: int, j: int, k: int
) -> None:
    cells = np.argwhere(traversable)
    a, b, added = (cells[n % len(cells)] for n in (i, j, k))
    fewer = traversable.copy()
    fewer[tuple(added)] = False
    before = Polyanya(costmap_of(traversable))
    there = length(before, centre(a), centre(b))
    assert there == pytest.approx(length(before, centre(b), centre(a)), rel=1e-12)
    if fewer[tuple(a)] and fewer[tuple(b)]:
        assert length(Polyanya(costmap_of(fewer)), centre(a), centre(b)) >= there - 1e-9


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("###. ##.. #..# ..## .###", 7.0),  # stairs of one cell's width
        ("#.. ... ..#", math.sqrt(8)),  # straight through where two squares meet in a corner
        ("###. .... .###", 5.0),  # a corridor between two walls
        ("##... ##... ..... ...## ...##", math.sqrt(32)),  # a wide opening
        ("##.. ##.. ..## ..##", math.inf),  # none
    ],
)
def test_narrow_places_are_passed(text: str, expected: float) -> None:
    traversable = drawing(text) == FREE
    got = length(
        Polyanya(costmap_of(traversable)), centre((0, 0)), centre(np.array(traversable.shape) - 1)
    )
    assert got == pytest.approx(expected)


@given(bitmaps(side=12))
@settings(max_examples=60)
def test_polygons_tile_the_squares(traversable: Bools) -> None:
    mesh = NavigationMesh.of(traversable)
    rings = rings_of(mesh)
    assert sum(map(shapely.area, rings)) == full_squares(traversable).sum()
    assert all(shapely.covers(region(traversable), ring) for ring in rings)


@given(bitmaps(side=12))
@settings(max_examples=60)
def test_polygons_are_strictly_convex_and_link_their_neighbours(traversable: Bools) -> None:
    mesh = NavigationMesh.of(traversable)
    side = np.arange(len(mesh.corners))
    after = np.where(side + 1 < mesh.first[mesh.owner + 1], side + 1, mesh.first[mesh.owner])
    a, b = mesh.points[mesh.corners], mesh.points[mesh.corners[after]]
    c = b[after]
    turns = (b - a)[:, 0] * (c - b)[:, 1] - (b - a)[:, 1] * (c - b)[:, 0]
    assert (turns > 0).all()
    inner = np.flatnonzero(mesh.twins >= 0)
    twins = mesh.twins[inner]
    np.testing.assert_array_equal(mesh.twins[twins], inner)
    np.testing.assert_array_equal(mesh.corners[twins], mesh.corners[after[inner]])
    for vertex in range(len(mesh.points)):
        around = mesh.around[mesh.around_first[vertex] : mesh.around_first[vertex + 1]]
        assert sorted(around) == sorted(mesh.owner[mesh.corners == vertex])


@given(bitmaps(side=12), st.data())
@settings(max_examples=40)
def test_polygons_at_a_point_are_those_that_cover_it(
    traversable: Bools, data: st.DataObject
) -> None:
    mesh = NavigationMesh.of(traversable)
    rings = rings_of(mesh)
    quarters = [st.integers(0, 4 * (n - 1)).map(lambda n: n / 4) for n in traversable.shape[::-1]]
    for _ in range(5):
        x, y = data.draw(st.tuples(*quarters))
        covering = [i for i, ring in enumerate(rings) if shapely.covers(ring, shapely.Point(x, y))]
        assert sorted(mesh.polygons_at(x, y)) == covering
        assert mesh.holds(x, y) == bool(covering)


def rings_of(mesh: NavigationMesh) -> list[shapely.Polygon]:
    """Return the polygons of a mesh as shapes."""
    corners = np.split(mesh.points[mesh.corners], mesh.first[1:-1])
    return [shapely.Polygon(ring) for ring in corners if len(ring)]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_the_bound_is_the_shortest_line_through_the_interval(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = np.array([4.0, -3.0]), np.array([4.0, 5.0]) + rng.normal(size=2)
    root, (low, high) = rng.uniform(-2, 2, 2), np.sort(rng.uniform(0, 1, 2))
    right, left = a + low * (b - a), a + high * (b - a)
    cone = np.concatenate([left - root, right - root])
    target = np.array([[*rng.uniform(-9, 15, 2), 0.7]])
    on = right + np.linspace(0, 1, 4001)[:, None] * (left - right)
    lengths = np.hypot(*(on - root).T) + np.hypot(*(on - target[0, :2]).T) + 0.7
    got = through(root[0], root[1], cone, a[0], a[1], b[0], b[1], target)
    assert lengths.min() - 1e-3 <= got <= lengths.min() + 1e-9


def test_equally_long_paths_around_obstacles_are_followed_once() -> None:
    traversable = np.ones((62, 62), dtype=np.bool_)
    for i, j in np.ndindex(15, 15):
        traversable[4 * i + 1 : 4 * i + 3, 4 * j + 1 : 4 * j + 3] = False
    engine = Polyanya(costmap_of(traversable))
    found = engine.search(centre((0, 0)), centre((61, 61)), SETTINGS)
    assert found is not None
    assert found.expanded < 5 * len(engine.mesh.corners)


def test_slices_and_growing_room_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    costmap = costmap_of(noise(60, share=0.8))
    ends = centre((1, 1)), centre((58, 58))
    engine = Polyanya(costmap)
    whole = engine.search(*ends, SETTINGS)
    monkeypatch.setattr(Polyanya, "slice_size", 7)
    monkeypatch.setattr(Polyanya, "first_room", 9)
    sliced, again = Polyanya(costmap).search(*ends, SETTINGS), engine.search(*ends, SETTINGS)
    for other in (sliced, again):
        assert whole is not None
        assert other is not None
        np.testing.assert_array_equal(other.waypoints, whole.waypoints)
    assert whole is not None
    assert whole.bound == 1.0


@pytest.mark.parametrize("radius", [0.0, 0.2, 0.35])
def test_routes_from_anywhere_pass_the_audit_and_are_no_longer_than_astars(radius: float) -> None:
    rng = np.random.default_rng(7)
    grid = grid_of(np.where(rng.random((60, 60)) < 0.03, BLOCKED, FREE), resolution=0.1524)
    passed = 0
    for start, goal in rng.uniform(0.6, 8.5, (30, 2, 2)).tolist():
        problem = PlanningProblem(grid, start=start, goal=goal, footprint=radius)
        costmap = Costmap.of(problem)
        found = Polyanya(costmap).search(tuple(start), tuple(goal), SETTINGS)
        octile = AStar(costmap).search(tuple(start), tuple(goal), AStarSettings())
        assert (found is None) == (octile is None)
        if found is not None and octile is not None:
            audit(problem, found.waypoints)
            assert length_of(found.waypoints) <= length_of(octile.waypoints) * (1 + 1e-9)
            passed += 1
    assert passed > 0


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    engine = Polyanya(costmap_of(np.ones((5, 5), dtype=np.bool_)))
    with pytest.raises(TimeLimitError, match="polyanya: no route within time_limit = 0 s"):
        engine.search((0.5, 0.5), (4.5, 3.5), PolyanyaSettings(time_limit=0))


def test_non_uniform_costs_are_refused() -> None:
    costs = CostSettings(clearance_weight=1.0)
    grid = grid_of(free_field(8, 8))
    problem = PlanningProblem(grid, start=(4, 4), goal=(5, 5), footprint=1.0, costs=costs)
    with pytest.raises(ProblemError, match=r"which 'polyanya' needs.*Use 'astar'"):
        Polyanya(Costmap.of(problem))


@pytest.mark.skipif(not MAPS.is_dir(), reason="the MovingAI maps are not part of the project")
@pytest.mark.parametrize("name", ["dao/arena", "dao/den312d"])
def test_routes_are_no_longer_than_the_published_octile_ones(name: str) -> None:
    path = MAPS / f"{name}.map"
    lines = path.read_text(encoding="ascii").splitlines()
    traversable: Bools = np.array([[cell == "." for cell in line] for line in lines[4:]])
    engine = Polyanya(costmap_of(traversable))
    moves = engine.costmap.moves
    queries = path.with_suffix(".map.scen").read_text(encoding="ascii").splitlines()[1:]
    for i in np.random.default_rng(0).permutation(len(queries))[:40]:
        *ends, octile = (float(word) for word in queries[i].split()[-5:])
        found = engine.search(centre(ends[1::-1]), centre(ends[:1:-1]), SETTINGS)
        assert found is not None
        assert length_of(found.waypoints) <= octile + 1e-3  # published with few digits
        turns: Floats = engine.costmap.to_cells(found.waypoints) - 0.5
        cells = np.rint(turns).astype(np.int64)[:, ::-1]
        assert all(sight(moves, *a, *b) for a, b in pairwise(cells))
