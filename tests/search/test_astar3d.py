"""A* in 3-D, the voxels it searches, and the audit of its routes."""

from __future__ import annotations

import itertools
import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import SLAB_CELLS
from planners import AuditError, CostSettings, PlanningProblem, ProblemError, TimeLimitError
from planners.audit.audit import audit
from planners.audit.obstacles import segment_boxes
from planners.costmap.kernels.distance import NOWHERE, squared_distances_3d
from planners.costmap.voxel_map import Voxels
from planners.geometry.kernels.clearance3d import cube_distance, line_clearance, squared_along
from planners.search.astar3d import AStar3D
from planners.search.base import SearchResult, SearchSettings
from planners.search.kernels.voxel_moves import COSTS, STEPS, around, bits_of, estimate
from strategies import rngs

RADII = [0.0, 0.4, 0.5, math.sqrt(0.5), math.sqrt(0.75), 1.0]


def cubes(blocked: Bools, *, resolution: float = 1.0) -> ConfidenceGrid:
    """Return a grid of non-free and free voxels from (0, 0, 0) on."""
    grid = ConfidenceGrid(resolution=resolution, origin=(0.0, 0.0, 0.0))
    grid.fuse(np.zeros(3, dtype=np.int64), np.where(blocked, 1.0, -1.0).astype(np.float32))
    return grid


def masks(*, side: int = 5) -> st.SearchStrategy[Bools]:
    """Draw blocked voxels."""
    shapes = st.tuples(*[st.integers(1, side)] * 3)
    cells = st.sampled_from([False, False, False, True])
    return shapes.flatmap(lambda shape: arrays(np.bool_, shape, elements=cells))


def ends(rng: np.random.Generator, blocked: Bools) -> tuple[Floats, Floats]:
    """Draw two places (x, y, z) in free voxels."""
    free = np.argwhere(~blocked)[:, ::-1]
    a, b = free[rng.integers(0, len(free), 2)] + rng.random((2, 3))
    return a, b


def posed(blocked: Bools, a: npt.ArrayLike, b: npt.ArrayLike, radius: float) -> PlanningProblem:
    return PlanningProblem(
        cubes(blocked), start=np.array(a), goal=np.array(b), footprint=radius, clear_start=False
    )


def search(problem: PlanningProblem) -> SearchResult | None:
    return AStar3D(Voxels.of(problem)).search(
        tuple(problem.start), tuple(problem.goal), SearchSettings()
    )


def shortest_lengths(traversable: Bools, source: tuple[int, ...]) -> Floats:
    """Return the lengths of the shortest paths from a voxel to all others; inf if there is none."""
    edges = []
    for a in np.ndindex(traversable.shape):
        for step in itertools.product((-1, 0, 1), repeat=3):
            b = tuple(i + j for i, j in zip(a, step, strict=True))
            inside = all(0 <= i < n for i, n in zip(b, traversable.shape, strict=True))
            box = itertools.product(*zip(a, b, strict=True))
            if any(step) and inside and all(traversable[voxel] for voxel in box):
                index = [int(np.ravel_multi_index(voxel, traversable.shape)) for voxel in (a, b)]
                edges.append((*index, math.hypot(*step)))
    tails, heads, costs = np.array(edges).reshape(-1, 3).T
    shape = (traversable.size, traversable.size)
    graph = coo_array((costs, (tails.astype(int), heads.astype(int))), shape=shape)
    begin = np.ravel_multi_index(source, traversable.shape)
    lengths: Floats = dijkstra(graph.tocsr(), indices=begin).reshape(traversable.shape)
    return lengths


def sampled_distance(a: Floats, b: Floats, lower: Floats, upper: Floats) -> float:
    """Return the distance of a segment to a box, at most 1/2000 of its length too large."""
    points = a + np.linspace(0.0, 1.0, 2001)[:, None] * (b - a)
    gaps = np.maximum(np.maximum(lower - points, points - upper), 0.0)
    return float(np.sqrt((gaps**2).sum(axis=1)).min())


# Voxels


@given(masks(), st.integers(1, 60) | st.just(NOWHERE))
@settings(max_examples=40)
def test_squared_distances_are_those_to_the_nearest_blocked_cube(blocked: Bools, cap: int) -> None:
    expected = np.full(blocked.shape, cap)
    for at in np.ndindex(blocked.shape):
        away = np.abs(np.argwhere(blocked) - at)
        halves = np.maximum(2 * away - 1, 0)
        expected[at] = min([cap, *(halves**2).sum(axis=1).tolist()])
    np.testing.assert_array_equal(squared_distances_3d(blocked, cap), expected)


@given(masks(), st.sampled_from(RADII))
@settings(max_examples=40)
def test_voxels_of_enough_clearance_are_traversable(blocked: Bools, radius: float) -> None:
    assume(not blocked.all())
    voxels = Voxels.of(posed(blocked, (0.5, 0.5, 0.5), (0.5, 0.5, 0.5), radius))
    assert voxels.blocked.sum() == voxels.blocked.size - (~blocked).sum()
    for at in np.argwhere(~voxels.blocked):
        clearance = voxels.clearance_of(voxels.window.cell_to_world(at))
        assert voxels.clearance_at(at[None]).tolist() == [clearance]
        assert voxels.traversable[tuple(at)] == (clearance >= radius - 1e-9)
    assert not voxels.traversable[voxels.blocked].any()


def test_unknown_voxels_near_the_start_count_as_free() -> None:
    grid = cubes(np.zeros((16, 16, 16), dtype=bool))
    grid.tile((0, 0, 0)).count[4:6, 8, 8] = 0
    problem = PlanningProblem(grid, start=(8.5, 8.5, 3.5), goal=(1, 1, 1), footprint=0.5)
    voxels = Voxels.of(problem)
    row, col, layer = (int(i) for i in voxels.window.world_to_cell((8.5, 8.5, 4.5))[0][[1, 2, 0]])
    assert voxels.cleared[layer : layer + 2, row, col].tolist() == [True, False]
    assert voxels.blocked[layer : layer + 2, row, col].tolist() == [False, True]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"grid": ConfidenceGrid(), "start": (0, 0), "goal": (1, 1)}, "grid: expected a 3-D map"),
        ({"unknown": "penalise"}, "unknown: expected 'avoid' or 'allow' on a 3-D map"),
        (
            {"costs": CostSettings(clearance_weight=1.0)},
            "costs: expected no costs except length on a 3-D",
        ),
        (
            {"clear_start_radius": 500.0},
            "footprint: expected at most 134217728 cells in the box around the map",
        ),
    ],
)
def test_problems_that_voxels_do_not_support_are_refused(
    changes: dict[str, Any], message: str
) -> None:
    asked: dict[str, Any] = {
        "grid": cubes(np.zeros((2, 2, 2), dtype=bool)),
        "start": (1, 1, 1),
        "goal": (1, 1, 1),
    }
    with pytest.raises(ProblemError, match=message):
        Voxels.of(PlanningProblem(**(asked | {"footprint": 0.0} | changes)))


# Distances


@given(rngs(), st.booleans())
@settings(max_examples=60)
def test_both_methods_find_the_distance_of_segment_and_cube(
    rng: np.random.Generator, along_axes: bool
) -> None:
    a, b = rng.uniform(-3, 3, (2, 3))
    if along_axes:
        a, b = np.round(a), np.round(b)
    corners = rng.integers(-3, 3, (8, 3))
    lower = corners.astype(float)
    distances, nearest = segment_boxes(a, b, lower, lower + 1.0)
    for corner, low, distance, point in zip(corners, lower, distances, nearest, strict=True):
        assert cube_distance(a, b, *corner.tolist()) == pytest.approx(distance, abs=1e-9)
        sampled = sampled_distance(a, b, low, low + 1.0)
        assert sampled - math.dist(a, b) / 2000 <= distance <= sampled + 1e-12
        assert np.linalg.norm(point - np.clip(point, low, low + 1.0)) == pytest.approx(distance)


@given(rngs())
@settings(max_examples=30)
def test_the_clearance_of_a_line_is_that_to_the_nearest_cube(rng: np.random.Generator) -> None:
    blocked = rng.random((6, 5, 7)) < 0.05
    points = rng.uniform(0, 5, (3, 3))
    lower = np.argwhere(blocked)[:, ::-1].astype(float)
    pairs = itertools.pairwise(points)
    distances = [segment_boxes(a, b, lower, lower + 1.0)[0] for a, b in pairs]
    expected = min([math.inf, *np.concatenate(distances).tolist()])
    assert line_clearance(blocked, points) == pytest.approx(expected, abs=1e-9)


# The search


@given(masks(), st.sampled_from(RADII), st.data())
@settings(max_examples=60)
def test_lengths_are_dijkstras_on_the_oracles_graph(
    blocked: Bools, radius: float, data: st.DataObject
) -> None:
    free = np.argwhere(~blocked)
    assume(len(free) > 0)
    start, goal = (free[data.draw(st.integers(0, len(free) - 1))] for _ in range(2))
    problem = posed(blocked, start[::-1] + 0.5, goal[::-1] + 0.5, radius)
    voxels = Voxels.of(problem)
    first = voxels.window.world_to_cell((0.5, 0.5, 0.5))[0]
    drawn = tuple(slice(i, i + n) for i, n in zip(first, blocked.shape, strict=True))
    found = search(problem)
    if (start == goal).all():
        assert found is None or found.cost == 0.0
        return
    expected = shortest_lengths(voxels.traversable[drawn], tuple(start))[tuple(goal)]
    assert (math.inf if found is None else found.cost) == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_pruned_moves_preserve_optimality(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocked = rng.random((9, 9, 9)) < rng.uniform(0.05, 0.4)
    blocked[0, 0, 0] = False
    lengths = shortest_lengths(~blocked, (0, 0, 0))
    engine = AStar3D(Voxels.of(posed(blocked, (0.5, 0.5, 0.5), (0.5, 0.5, 0.5), 0.0)))
    for goal in rng.permutation(np.argwhere(~blocked))[:60]:
        place = tuple((goal[::-1] + 0.5).tolist())
        found = engine.search((0.5, 0.5, 0.5), place, SearchSettings())
        length = math.inf if found is None else found.cost
        assert length == pytest.approx(lengths[tuple(goal)], abs=1e-9)


@given(masks(), rngs(), st.sampled_from(RADII))
@settings(max_examples=80)
def test_routes_pass_the_audit_and_cost_the_same_in_reverse(
    blocked: Bools, rng: np.random.Generator, radius: float
) -> None:
    assume(not blocked.all())
    a, b = ends(rng, blocked)
    there, back = posed(blocked, a, b, radius), posed(blocked, b, a, radius)
    found, reverse = search(there), search(back)
    assert (found is None) == (reverse is None)
    if found is not None and reverse is not None:
        audit(there, found.waypoints)
        audit(back, reverse.waypoints)
        assert found.cost == pytest.approx(reverse.cost, abs=1e-9)
        assert Voxels.of(there).clearance_of(found.waypoints) >= radius - 1e-9


def test_waypoints_turn_at_every_inner_point() -> None:
    rng = np.random.default_rng(11)
    blocked = rng.random((12, 12, 12)) < 0.3
    for _ in range(20):
        a, b = ends(rng, blocked)
        found = search(posed(blocked, a, np.floor(b) + 0.5, 0.0))
        if found is not None:
            steps = np.diff(found.waypoints, axis=0)
            steps /= np.linalg.norm(steps, axis=1)[:, None]
            assert (np.linalg.norm(np.cross(steps[:-1], steps[1:]), axis=1) > 1e-6).all()


def test_a_place_in_a_free_voxel_is_joined_to_its_centre() -> None:
    rng = np.random.default_rng(3)
    blocked = rng.random((6, 6, 6)) < 0.3
    for _ in range(20):
        a, _ = ends(rng, blocked)
        found = search(posed(blocked, a, np.floor(a) + 0.5, 0.0))
        assert found is not None
        assert found.waypoints.tolist() == [a.tolist(), (np.floor(a) + 0.5).tolist()]


@given(rngs())
@settings(max_examples=30)
def test_no_move_lowers_the_estimate_by_more_than_it_costs(rng: np.random.Generator) -> None:
    targets = np.column_stack([rng.integers(0, 9, (2, 3)), rng.integers(0, 2**33, 2)])
    layer, row, col = rng.integers(0, 9, 3)
    here = estimate(layer, row, col, targets)
    for (i, j, k), cost in zip(STEPS, COSTS, strict=True):
        assert abs(here - estimate(layer + i, row + j, col + k, targets)) <= cost


def test_slices_a_growing_heap_and_earlier_queries_change_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(7)
    blocked = rng.random((12, 12, 12)) < 0.4
    pairs = [ends(rng, blocked) for _ in range(15)]
    problem = posed(blocked, *pairs[0], 0.0)
    whole = [AStar3D(Voxels.of(problem)).search(*ask(pair), SearchSettings()) for pair in pairs]
    monkeypatch.setattr(AStar3D, "slice_size", 7)
    monkeypatch.setattr(AStar3D, "first_room", 30)
    engine = AStar3D(Voxels.of(problem))
    for pair, expected in zip(pairs, whole, strict=True):
        found = engine.search(*ask(pair), SearchSettings())
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert found.waypoints.tolist() == expected.waypoints.tolist()
            assert found.expanded == expected.expanded
    assert sum(found is not None for found in whole) > 5


def ask(pair: tuple[Floats, Floats]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    a, b = pair
    return tuple(a.tolist()), tuple(b.tolist())


def test_no_edge_and_no_corner_is_cut_at_radius_zero() -> None:
    for k in range(1, 7):  # every voxel of the box but its first and last
        blocked = np.zeros((2, 2, 2), dtype=bool)
        blocked[np.unravel_index(k, (2, 2, 2))] = True
        found = search(posed(blocked, (0.5, 0.5, 0.5), (1.5, 1.5, 1.5), 0.0))
        assert found is not None
        assert found.cost == pytest.approx(1.0 + math.sqrt(2.0))
    found = search(posed(np.zeros((2, 2, 2), dtype=bool), (0.5, 0.5, 0.5), (1.5, 1.5, 1.5), 0.0))
    assert found is not None
    assert found.cost == pytest.approx(math.sqrt(3.0))


def test_a_window_exactly_as_wide_as_the_ball_is_passed() -> None:
    blocked = np.zeros((9, 9, 16), dtype=bool)
    blocked[:, :, 8] = True
    blocked[3:6, 3:6, 8] = False
    a, b = (3.5, 4.5, 4.5), (12.5, 4.5, 4.5)
    found = search(posed(blocked, a, b, 1.5))
    assert found is not None
    assert found.waypoints.tolist() == [list(a), list(b)]
    assert search(posed(blocked, a, b, 1.501)) is None


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    problem = posed(np.zeros((3, 3, 3), dtype=bool), (0.5, 0.5, 0.5), (2.5, 2.5, 2.5), 0.0)
    with pytest.raises(TimeLimitError, match=r"astar: no route within time_limit = 0 s \(0 nodes"):
        AStar3D(Voxels.of(problem)).search(
            (0.5, 0.5, 0.5), (2.5, 2.5, 2.5), SearchSettings(time_limit=0)
        )


# The audit


def room() -> PlanningProblem:
    """Return a problem in 16 x 16 x 16 free voxels with a blocked one in the middle."""
    blocked = np.zeros((16, 16, 16), dtype=bool)
    blocked[8, 8, 8] = True
    return posed(blocked, (4, 8.5, 8.5), (13, 8.5, 8.5), 0.5)


@pytest.mark.parametrize(
    ("inner", "fault"),
    [
        (
            [],
            r"too close to a non-free cell at \(8.00, 8.50, 8.50\): expected 0.5 m, got 0 m",
        ),
        ([(8.5, 9.499, 8.5)], r"too close to a non-free cell .*: expected 0.5 m, got 0.37"),
        ([(8.5, 0.4, 8.5)], r"too close to an unknown cell .*: expected 0.5 m, got 0.4 m"),
        ([(8.5, np.nan, 8.5)], "the route is not finite"),
    ],
)
def test_a_line_that_comes_too_near_is_found(inner: list[tuple[float, ...]], fault: str) -> None:
    problem = room()
    with pytest.raises(AuditError, match=fault):
        audit(problem, np.array([problem.start, *inner, problem.goal]))


def test_a_line_that_keeps_its_distance_passes() -> None:
    problem = room()
    audit(problem, np.array([problem.start, (4, 9.5, 8.5), (13, 9.5, 8.5), problem.goal]))


@pytest.mark.parametrize(("end", "name"), [(0, "start"), (-1, "goal")])
def test_a_line_that_ends_at_another_place_is_found(end: int, name: str) -> None:
    problem = room()
    waypoints = np.array([problem.start, (4, 9.5, 8.5), (13, 9.5, 8.5), problem.goal])
    waypoints[end, 2] += 1e-6
    with pytest.raises(AuditError, match=f"the route misses the {name}"):
        audit(problem, waypoints)


def test_a_point_may_go_along_a_cube_and_not_through_it() -> None:
    blocked = np.zeros((16, 16, 16), dtype=bool)
    blocked[8, 8, 8] = True
    for z, passes in ((9.0, True), (9.0 - 1e-6, False), (8.0, True), (8.0 + 1e-6, False)):
        problem = posed(blocked, (4, 8.5, z), (13, 8.5, z), 0.0)
        line = np.array([problem.start, problem.goal])
        if passes:
            audit(problem, line)
        else:
            with pytest.raises(AuditError, match="too close to a non-free cell"):
                audit(problem, line)


def test_unknown_voxels_may_be_entered_if_requested() -> None:
    grid = cubes(np.zeros((16, 16, 16), dtype=bool))
    grid.tile((0, 0, 0)).count[8, 8, 8] = 0
    problem = PlanningProblem(
        grid, start=(4, 8.5, 8.5), goal=(13, 8.5, 8.5), footprint=0.5, clear_start_radius=3.9
    )
    line = np.array([problem.start, problem.goal])
    audit(replace(problem, unknown="allow"), line)
    audit(replace(problem, clear_start_radius=4.0), line)
    with pytest.raises(AuditError, match="too close to an unknown cell"):
        audit(problem, line)


# Memory


def test_a_query_sees_no_label_of_the_queries_before_it() -> None:
    blocked = np.random.default_rng(3).random((20, 30, 40)) < 0.2
    problem = posed(blocked, (0.5, 0.5, 0.5), (0.5, 0.5, 0.5), 0.0)
    used = AStar3D(Voxels.of(problem))
    rng = np.random.default_rng(4)
    for _ in range(20):
        start, goal = (tuple(place.tolist()) for place in ends(rng, blocked))
        answers = [
            engine.search(start, goal, SearchSettings())
            for engine in (used, AStar3D(Voxels.of(problem)))
        ]
        if answers[0] is None or answers[1] is None:
            assert answers == [None, None]
            continue
        assert answers[0].expanded == answers[1].expanded
        np.testing.assert_array_equal(answers[0].waypoints, answers[1].waypoints)


def test_voxels_are_read_without_a_dense_copy_of_the_map() -> None:
    grid = cubes(np.zeros((256, 96, 128), dtype=bool))
    problem = PlanningProblem(grid, start=(1, 1, 1), goal=(9, 9, 9), footprint=0.0)
    tracemalloc.start()
    voxels = Voxels.of(problem)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 3 * voxels.blocked.size + 24 * SLAB_CELLS


@given(masks(side=11), rngs())
@settings(max_examples=30)
def test_bits_around_a_voxel_are_those_of_the_voxels_beside_it(
    traversable: Bools, rng: np.random.Generator
) -> None:
    bits = bits_of(traversable)
    padded = np.pad(traversable, 1)
    at = [int(rng.integers(1, side + 1)) for side in traversable.shape]
    mask = around(bits.ravel(), *bits.strides[:2], *at)
    beside = padded[tuple(slice(i - 1, i + 2) for i in at)]
    assert [bool(mask >> k & 1) for k in range(27)] == beside.ravel().tolist()


@given(masks(side=9), rngs())
@settings(max_examples=60)
def test_squared_distances_along_voxels_are_those_of_the_whole_map(
    blocked: Bools, rng: np.random.Generator
) -> None:
    cells = np.column_stack([rng.integers(0, side, 12) for side in blocked.shape])
    expected = squared_distances_3d(blocked, NOWHERE)[tuple(cells.T)]
    np.testing.assert_array_equal(squared_along(blocked, cells, NOWHERE), expected)
