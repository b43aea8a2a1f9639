"""Distances and reach from one place: those of SciPy's Dijkstra and of A*."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools, Floats
from oracles_planning import BLOCKED, FREE, free_field, grid_of, masks, ringed, shortest_lengths
from planners import CostSettings, PlanningProblem, ProblemError, TimeLimitError
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of
from planners.costmap.kernels.moves import COLS, ONE, ROWS
from planners.search.astar import AStar, AStarSettings
from planners.search.distance_field import distance_field, reachable
from planners.search.grid_search import GridSearch

COSTLY = CostSettings(clearance_weight=9.0, inflation_radius=3.0, confidence_weight=40.0)
RADII = [0.0, 0.5, 1.0]


def problem_on(blocked: Bools, radius: float = 0.0) -> PlanningProblem:
    return PlanningProblem(
        grid_of(np.where(blocked, BLOCKED, FREE)),
        start=(0.5, 0.5),
        goal=(0.5, 0.5),
        footprint=radius,
        clear_start=False,
    )


def drawn(seed: int, side: int = 24) -> PlanningProblem:
    """Return a random map of cells of various confidences."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((side, side)) < 0.25
    problem = problem_on(blocked)
    problem.grid.tile((0, 0)).confidence[:side, :side][~blocked] *= rng.uniform(
        0.1, 1.0, (~blocked).sum()
    )
    return problem


def inside(costmap: Costmap, field: Floats, shape: tuple[int, ...]) -> Floats:
    """Return the part of a field that is the drawing."""
    row, col = -costmap.lower_cell
    return field[row : row + shape[0], col : col + shape[1]]


@given(masks(side=5), st.sampled_from(RADII), st.data())
@settings(max_examples=20, deadline=None)
def test_distances_are_those_of_the_oracles_graph(
    blocked: Bools, radius: float, data: st.DataObject
) -> None:
    row, col = (data.draw(st.integers(0, length - 1)) for length in blocked.shape)
    costmap = Costmap.of(problem_on(blocked, radius))
    field = inside(costmap, distance_field(costmap, (col + 0.5, row + 0.5)), blocked.shape)
    expected = shortest_lengths(ringed(blocked), (row + 1, col + 1), radius)[1:-1, 1:-1]
    if not np.isfinite(field[row, col]):  # the oracle's graph always contains its source
        expected[row, col] = np.inf
        assert not costmap.traversable[tuple(np.array([row, col]) - costmap.lower_cell)]
    np.testing.assert_allclose(field, expected, rtol=0, atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.sampled_from([CostSettings(), COSTLY]))
@settings(max_examples=20)
def test_a_cells_cost_is_dijkstras_over_the_costmaps_steps(seed: int, costs: CostSettings) -> None:
    costmap = Costmap.of(replace(drawn(seed), costs=costs))
    x, y = np.random.default_rng(seed).uniform(0.5, 23.5, 2).tolist()
    field = distance_field(costmap, (x, y))
    np.testing.assert_allclose(field, csgraph_field(costmap, (x, y)), rtol=1e-12, atol=0)


def csgraph_field(costmap: Costmap, xy: tuple[float, float]) -> Floats:
    """Return the result of `distance_field`, from a sparse graph that NumPy builds."""
    traversable, size = np.pad(costmap.traversable, 1), costmap.traversable.size
    number, price = (
        np.arange(size).reshape(costmap.traversable.shape),
        costmap.costs.astype(np.int64),
    )
    rows, cols = costmap.traversable.shape
    sources = ends_of(costmap, xy, xy).sources
    tails, heads = [np.full(len(sources), size)], [sources[:, 0] * cols + sources[:, 1]]
    steps = [sources[:, 2]]
    for k, (i, j) in enumerate(zip(ROWS.tolist(), COLS.tolist(), strict=True)):
        allowed = np.ones((rows, cols), dtype=np.bool_)
        for di, dj in product({0, i}, {0, j}):
            allowed &= traversable[1 + di : 1 + di + rows, 1 + dj : 1 + dj + cols]
        a = np.argwhere(allowed)
        b = a + np.array([i, j])
        tails.append(number[tuple(a.T)])
        heads.append(number[tuple(b.T)])
        steps.append(costmap.steps[k % 2, price[tuple(a.T)] + price[tuple(b.T)]])
    graph = coo_array(
        (np.concatenate(steps) / ONE, (np.concatenate(tails), np.concatenate(heads))),
        shape=(size + 1, size + 1),
    )
    costs: Floats = dijkstra(graph.tocsr(), indices=size)[:size].reshape(rows, cols)
    return costs * costmap.window.resolution


@given(st.integers(0, 2**32 - 1), st.sampled_from([CostSettings(), COSTLY]))
@settings(max_examples=10)
def test_a_cells_cost_is_that_of_the_route_to_its_centre(seed: int, costs: CostSettings) -> None:
    costmap = Costmap.of(replace(drawn(seed), costs=costs))
    rng = np.random.default_rng(seed)
    field = distance_field(costmap, (3.5, 4.5))
    cells = np.argwhere(costmap.traversable)
    for row, col in rng.permutation(cells)[:10].tolist():
        goal = tuple(costmap.window.cell_to_world([row, col])[0].tolist())
        found = AStar(costmap).search((3.5, 4.5), goal, AStarSettings())
        cost = np.inf if found is None else found.cost
        if ends_of(costmap, (3.5, 4.5), goal).direct:
            cost = np.hypot(goal[0] - 3.5, goal[1] - 4.5)
        assert field[row, col] == pytest.approx(cost, rel=1e-9)


@given(st.integers(0, 2**32 - 1), st.sampled_from(RADII))
@settings(max_examples=20)
def test_reachable_cells_are_the_connected_ones_of_finite_distance(
    seed: int, radius: float
) -> None:
    blocked = np.random.default_rng(seed).random((30, 30)) < 0.05 + 0.3 * (radius == 0)
    problem = problem_on(blocked, radius)
    xy = tuple(np.random.default_rng(seed).uniform(2, 28, 2).tolist())
    mask = reachable(problem, xy)
    np.testing.assert_array_equal(mask, np.isfinite(distance_field(problem, xy)))
    costmap = Costmap.of(problem)
    parts, _ = ndimage.label(costmap.traversable)  # diagonal moves join no further cells
    joined = parts[tuple(ends_of(costmap, xy, xy).sources[:, :2].T)]
    np.testing.assert_array_equal(mask, np.isin(parts, joined[joined > 0]))


def test_a_narrower_robot_reaches_more() -> None:
    z = free_field(20, 20)
    z[10] = BLOCKED
    z[10, 8:10] = FREE
    problem = PlanningProblem(grid_of(z), start=(5, 5), goal=(5, 15), footprint=1.2)
    assert reachable(problem, (5, 5), radius=0.4).sum() > 300
    assert 0 < reachable(problem, (5, 5)).sum() < 150


def test_slices_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    costmap = Costmap.of(replace(drawn(4), costs=COSTLY))
    whole = distance_field(costmap, (3.3, 4.1))
    assert np.isfinite(whole).sum() > 100
    monkeypatch.setattr(GridSearch, "slice_size", 3)
    np.testing.assert_array_equal(distance_field(costmap, (3.3, 4.1)), whole)


def test_distances_are_in_metres() -> None:
    grid = grid_of(free_field(40, 40), resolution=0.25, origin=(3.0, -2.0))
    problem = PlanningProblem(grid, start=(5, 0), goal=(5, 0), footprint=0.3)
    field = distance_field(problem, (5.125, 0.125, 1.0))
    costmap = Costmap.of(problem)
    row, col = costmap.window.world_to_cell((9.125, 0.125))[0]
    assert field[row, col] == pytest.approx(4.0)


@pytest.mark.parametrize("source", [(1.5, 1.5), (-40.0, 3.0)])
def test_nothing_is_reached_from_a_place_where_the_footprint_does_not_fit(
    source: tuple[float, float],
) -> None:
    z = free_field(20, 20)
    z[1, 1] = BLOCKED
    problem = PlanningProblem(grid_of(z), start=(9, 9), goal=(9, 9), footprint=1.0)
    assert np.isinf(distance_field(problem, source)).all()
    assert not reachable(problem, source).any()


@pytest.mark.parametrize("source", [(np.nan, 1.0), (1.0,), ("east", 2.0), 3.0])
def test_a_source_that_is_not_a_position_is_refused(source: object) -> None:
    problem = problem_on(np.zeros((9, 9), dtype=np.bool_))
    with pytest.raises(ProblemError, match=r"source: expected x, y \[m\], finite, got"):
        distance_field(problem, source)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match=r"start: expected x, y \[m\], finite, got"):
        reachable(problem, source)  # type: ignore[arg-type]


def test_a_3d_map_is_refused() -> None:
    grid = ConfidenceGrid(resolution=1.0, origin=(0.0, 0.0, 0.0))
    problem = PlanningProblem(grid, start=(0, 0, 0), goal=(1, 1, 1), footprint=0.5)
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        distance_field(problem, (0, 0))


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    with pytest.raises(TimeLimitError, match="distance_field: no route within time_limit = 0 s"):
        distance_field(drawn(1), (3.0, 3.0), time_limit=0)


@pytest.mark.parametrize("radius", [-1.0, np.nan, np.inf])
def test_a_radius_below_0_or_not_finite_is_refused(radius: float) -> None:
    with pytest.raises(ProblemError, match=f"radius: expected .* 0 or more .*, got {radius}"):
        reachable(problem_on(np.zeros((4, 4), dtype=np.bool_)), (0.5, 0.5), radius=radius)
