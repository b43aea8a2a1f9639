"""Costmap and half-cell lattice: exact clearance, allowed moves, the cleared start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats32
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import (
    BLOCKED,
    FREE,
    UNSEEN,
    drawing,
    free_field,
    grid_of,
    masks,
    move_allowed,
    union_of_squares,
)
from planners import CostSettings, PlanningProblem, ProblemError, distance_field, plan
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.distance import NOWHERE, squared_distances
from planners.costmap.kernels.moves import COLS, ROWS
from planners.costmap.moves import allowed_moves, squared_need
from planners.problem.problem import Unknown
from planners.search.kernels.lattice import squared_clearance


def standing(blocked: Bools, radius: float) -> Bools:
    """Return the cells on whose centre a disc fits."""
    return ~blocked & (squared_distances(blocked, NOWHERE) >= squared_need(radius, 1.0))


RADII = [0.0, 0.3, 0.5, np.sqrt(0.5), 0.9, 1.0, 1.5, np.sqrt(2.5), 2.2]


@given(masks())
def test_lattice_clearance_is_the_distance_to_the_union_of_blocked_squares(blocked: Bools) -> None:
    squared = squared_clearance(blocked)
    i, j = np.indices(squared.shape)
    expected = shapely.distance(shapely.points(j / 2.0, i / 2.0), union_of_squares(blocked))
    np.testing.assert_allclose(np.sqrt(squared) / 2.0, expected, rtol=0, atol=1e-12)


@given(masks(side=6), st.sampled_from(RADII))
@settings(max_examples=40, deadline=None)
def test_a_move_is_allowed_if_the_disc_fits_on_every_cell_of_its_block(
    blocked: Bools, radius: float
) -> None:
    moves = allowed_moves(standing(blocked, radius))
    for row, col in np.ndindex(blocked.shape):
        for k in range(8):
            there = (row + int(ROWS[k]), col + int(COLS[k]))
            expected = move_allowed(blocked, (row, col), there, radius)
            assert bool(moves[row, col] >> k & 1) == expected


@given(masks(side=7), st.sampled_from(RADII))
@settings(max_examples=60, deadline=None)
def test_allowed_moves_keep_the_distance_everywhere(blocked: Bools, radius: float) -> None:
    moves = allowed_moves(standing(blocked, radius))
    obstacles = union_of_squares(blocked)
    east, northeast, north = (np.argwhere(moves >> k & 1) + 0.5 for k in range(3))
    spans = [shapely.box(x, y, x + 1, y + 1) for y, x in northeast]
    spans += [shapely.LineString([(x, y), (x + 1, y)]) for y, x in east]
    spans += [shapely.LineString([(x, y), (x, y + 1)]) for y, x in north]
    assert (shapely.distance(np.array(spans, dtype=object), obstacles) >= radius - 1e-9).all()


@given(masks(side=14), st.sampled_from([0, 1, 5, 30, NOWHERE]))
def test_distances_of_centres_are_those_of_the_lattice_up_to_the_cap(
    blocked: Bools, cap: int
) -> None:
    centres = squared_clearance(blocked)[1::2, 1::2]
    np.testing.assert_array_equal(squared_distances(blocked, cap), np.minimum(centres, cap))


@given(masks())
def test_moves_are_symmetric(blocked: Bools) -> None:
    moves = allowed_moves(~blocked)
    for k in range(4):
        forth = np.argwhere(moves >> k & 1)
        back = forth + np.array([ROWS[k], COLS[k]])
        assert (moves[tuple(back.T)] >> (k + 4) & 1).all()
        assert (moves >> k & 1).sum() == (moves >> (k + 4) & 1).sum()


def test_a_map_without_blocked_cells_is_infinitely_clear() -> None:
    assert (squared_clearance(np.zeros((2, 3), dtype=np.bool_)) == NOWHERE).all()
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(5, 5), goal=(9, 9), footprint=2, unknown="allow"
    )
    assert np.isinf(Costmap.of(problem).clearance).all()


@pytest.mark.parametrize(("radius", "need"), [(0.3, 36), (0.9, 324), (0.0, 0), (0.301, 37)])
def test_the_needed_clearance_is_exact_despite_rounding(radius: float, need: int) -> None:
    assert squared_need(radius, 0.1) == need


def test_everything_beyond_the_observed_tiles_is_blocked() -> None:
    problem = PlanningProblem(
        grid_of(free_field(64, 64)), start=(9, 9), goal=(20, 20), footprint=1.0
    )
    costmap = Costmap.of(problem)
    assert costmap.blocked.sum() == costmap.blocked.size - 64 * 64
    assert costmap.clearance_of((9.0, 3.0)) == pytest.approx(3.0, abs=1e-12)


def test_clear_start_clears_unknown_cells_within_reach_only() -> None:
    z = free_field(32, 32)
    z[:, :10] = UNSEEN
    problem = PlanningProblem(grid_of(z), start=(11, 16), goal=(30, 16), footprint=1.0)
    costmap = Costmap.of(problem)
    rows, cols = np.nonzero(costmap.cleared)
    squares = shapely.box(*np.array([cols, rows, cols + 1, rows + 1], dtype=float))
    near = shapely.distance(squares, shapely.points(costmap.to_cells((11, 16))))
    assert near.max() <= 2.0
    # Four squares of column 9, which is 1 m away, and two of column 8, which is 2 m away.
    assert len(rows) == 6


def test_clear_start_never_clears_nonfree_or_contested_cells() -> None:
    z = np.full((16, 16), UNSEEN, dtype=np.float32)
    z[8, 9] = BLOCKED
    grid = grid_of(z)
    grid.tile((0, 0)).confidence[8, 6] = 0.001
    grid.tile((0, 0)).count[8, 6] = 2
    costmap = Costmap.of(PlanningProblem(grid, start=(8, 8.5), goal=(12, 12), footprint=2.0))
    for xy, cleared in (((9.5, 8.5), False), ((6.5, 8.5), False), ((7.5, 8.5), True)):
        row, col = costmap.window.world_to_cell(xy)[0]
        assert costmap.cleared[row, col] == cleared
        assert costmap.blocked[row, col] != cleared


def test_drop_offs_are_nonfree() -> None:
    grid = grid_of(free_field(8, 8))
    # Sight over the hole, however often it was free, says nothing about what is below it.
    hole = np.ones((1, 1), np.float32), np.full((1, 1), -0.5, np.float32)
    for _ in range(2):
        grid.fuse(np.array([3, 3]), *hole)
    costmap = Costmap.of(PlanningProblem(grid, start=(1, 1), goal=(6, 6), footprint=0.2))
    assert costmap.nonfree.sum() == 1


def test_allowing_unknown_space_leaves_nonfree_cells_blocked() -> None:
    grid = grid_of(drawing("?#. ... ..?"))
    problem = PlanningProblem(grid, start=(0, 0), goal=(2, 2), footprint=0.0, unknown="allow")
    assert Costmap.of(problem).blocked.sum() == 1


@st.composite
def edits(draw: st.DrawFn) -> tuple[Floats32, list[tuple[int, int, float]]]:
    """Draw evidence of 64 x 64 cells and what later views say of some of its cells."""
    seed = draw(st.integers(0, 2**16))
    rng = np.random.default_rng(seed)
    z = rng.choice([FREE, FREE, FREE, BLOCKED, UNSEEN], size=(64, 64)).astype(np.float32)
    cells = st.tuples(st.integers(0, 63), st.integers(0, 63), st.sampled_from([FREE, BLOCKED]))
    return z, draw(st.lists(cells, min_size=1, max_size=5))


@given(edits(), st.sampled_from([0.0, 0.6, 1.7]), st.sampled_from(["avoid", "penalise"]))
@settings(max_examples=30, deadline=None)
def test_an_updated_costmap_is_the_one_made_from_scratch(
    drawn: tuple[Floats32, list[tuple[int, int, float]]], radius: float, unknown: Unknown
) -> None:
    z, changes = drawn
    grid = grid_of(z)
    costs = CostSettings(clearance_weight=1.5, confidence_weight=1.0, inflation_radius=2.5)
    problem = PlanningProblem(
        grid, start=(9, 9), goal=(50, 50), footprint=radius, unknown=unknown, costs=costs
    )
    costmap = Costmap.of(problem)
    for row, col, value in changes:
        grid.fuse(np.array([row, col]), np.full((1, 1), value, dtype=np.float32))
        grid.fuse(np.array([row, col]), np.full((1, 1), value, dtype=np.float32))
    updated = costmap.with_changes([change[:2] for change in changes])
    for name in ("blocked", "nonfree", "cleared", "squared", "costs"):
        np.testing.assert_array_equal(
            getattr(updated, name), getattr(Costmap.of(problem), name), err_msg=name
        )
    np.testing.assert_array_equal(
        updated.window.confidence,
        grid.window(
            np.concatenate(
                [
                    updated.window.origin + 0.5,
                    updated.window.origin + np.array(updated.blocked.shape)[::-1] - 0.5,
                ]
            )
        ).confidence,
    )


def test_a_map_that_has_grown_is_read_completely() -> None:
    grid = grid_of(free_field(64, 64))
    problem = PlanningProblem(grid, start=(9, 9), goal=(50, 50), footprint=1.0)
    costmap = Costmap.of(problem)
    grid.fuse(np.array([10, 70]), free_field(4, 4))
    updated = costmap.with_changes([(10, 70), (13, 73)])
    assert updated.blocked.shape == (68, 132)
    np.testing.assert_array_equal(updated.blocked, Costmap.of(problem).blocked)


def test_nothing_changed_changes_nothing() -> None:
    costmap = Costmap.of(
        PlanningProblem(grid_of(free_field(9, 9)), start=(2, 2), goal=(5, 5), footprint=1.0)
    )
    assert costmap.with_changes(np.empty((0, 2), dtype=np.int64)) is costmap


@pytest.mark.parametrize("inflation", [1.35, 1.5, 1.8, 2.7])
def test_beyond_the_inflation_radius_no_clearance_costs(inflation: float) -> None:
    grid = ConfidenceGrid(resolution=0.15)  # in whose half cells 1.8 m are 24, up to rounding
    grid.fuse(np.array([0, 0]), free_field(64, 64))
    near = CostSettings(clearance_weight=5.0, inflation_radius=inflation, cost_scaling_factor=0.5)
    places: dict[str, Any] = {"start": (4.8, 4.8), "goal": (4.8, 4.8), "footprint": 0.3}
    costmap = Costmap.of(PlanningProblem(grid, **places, costs=near))
    assert (costmap.costs[costmap.clearance > inflation + 1e-9] == 0).all()
    assert (costmap.costs[costmap.clearance < inflation - 1e-9] > 0).all()


def test_cells_exactly_within_the_clear_radius_are_cleared_in_any_window() -> None:
    rng = np.random.default_rng(0)
    for resolution in (0.05, 0.1, 0.15, 0.1524):
        grid = ConfidenceGrid(resolution=resolution, origin=(-3.3, 0.0))
        field = np.where(rng.random((64, 64)) < 0.5, FREE, UNSEEN).astype(np.float32)
        grid.fuse(np.array([0, 0]), field)
        start = tuple((grid.origin + 31 * resolution).tolist())  # a corner of cells
        for cells in range(4, 20):
            problem = PlanningProblem(
                grid, start=start, goal=start, footprint=0.1, clear_start_radius=cells * resolution
            )
            costmap = Costmap.of(problem)
            changed = rng.integers(20, 44, (2, 2))
            for cell in changed:
                grid.fuse(cell, np.full((1, 1), BLOCKED, dtype=np.float32))
            updated, anew = costmap.with_changes(changed), Costmap.of(problem)
            np.testing.assert_array_equal(updated.cleared, anew.cleared)
            np.testing.assert_array_equal(updated.costs, anew.costs)


@pytest.mark.parametrize("changed", [[1, 2, 3, 4], [[1, 2, 3, 4]], [[1.5, 2.0]], "ab"])
def test_changed_cells_are_rows_of_two_integers(changed: Any) -> None:
    problem = PlanningProblem(grid_of(free_field(8, 8)), start=(4, 4), goal=(4, 4), footprint=1.0)
    with pytest.raises(ProblemError, match=r"changed: expected whole numbers \[row, col\]"):
        Costmap.of(problem).with_changes(changed)


# Sums


MOST_EXPENSIVE = CostSettings(
    clearance_weight=1000.0,
    confidence_weight=1000.0,
    inflation_radius=100.0,
    cost_scaling_factor=0.0,
)


def serpentine(side: int) -> PlanningProblem:
    """Return the problem to drive all of a corridor, one cell wide, that fills a square map.

    All of it is at the walls and hardly known to be free: a cell costs 250 of 252.
    """
    assert side % 4 == 3
    z = np.full((side, side), BLOCKED, dtype=np.float32)
    z[::2] = z[1::4, -1] = z[3::4, 0] = -1 / 64
    return PlanningProblem(
        grid_of(z),
        start=(0.5, 0.5),
        goal=(0.5, side - 0.5),
        footprint=0.0,
        clear_start=False,
        costs=MOST_EXPENSIVE,
    )


@pytest.mark.parametrize("planner", ["astar", "dijkstra", "weighted_astar", "ara", "dstar_lite"])
def test_the_sums_of_the_highest_costs_are_exact(planner: str) -> None:
    route = plan(serpentine(99), planner)
    assert route.length > 99 * 49
    factor = 1.0 + 2000.0 * 250 / 252
    assert route.cost == pytest.approx(factor * route.length, rel=1e-9)


@pytest.mark.parametrize("planner", ["astar", "dijkstra", "weighted_astar", "ara", "dstar_lite"])
def test_weights_whose_sums_would_overflow_are_refused(planner: str) -> None:
    # 1.1 million cells at 1985 each: more than the 2^31 cells that the integers hold.
    with pytest.raises(
        ProblemError, match=r"costs: expected a total cost of the 1\d+ traversable cells of at most"
    ):
        plan(serpentine(1499), planner)


def test_a_distance_field_whose_sums_would_overflow_is_refused() -> None:
    asked = serpentine(1499)
    with pytest.raises(ProblemError, match="Use smaller weights"):
        distance_field(asked, asked.start)


def test_the_highest_weights_are_accepted_if_few_cells_are_expensive() -> None:
    few = CostSettings(clearance_weight=1000.0, inflation_radius=3.0)
    asked = PlanningProblem(
        grid_of(free_field(1024, 1024)),
        start=(9.5, 9.5),
        goal=(99.5, 9.5),
        footprint=0.0,
        costs=few,
    )
    assert plan(asked).cost == pytest.approx(90.0)


@given(masks(side=12), st.integers(1, 4))
@settings(max_examples=60)
def test_the_clearance_of_few_cells_is_that_of_the_whole_map(blocked: Bools, reach: int) -> None:
    z = np.where(blocked, BLOCKED, FREE)
    asked = PlanningProblem(grid_of(z), start=(1, 1), goal=(1, 1), footprint=0.0, unknown="allow")
    costmap, whole = Costmap.of(asked), Costmap.of(asked).clearance
    cells = np.argwhere(~costmap.blocked)[:: 7 * reach]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planners.costmap.map_space.FIRST_REACH", reach)
        np.testing.assert_array_equal(costmap.clearance_at(cells), whole[tuple(cells.T)])
    assert "all_squared" not in vars(costmap)
