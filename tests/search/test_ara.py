"""ARA*: its bounds hold whenever it stops, and with enough time the route is optimal."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import CostSettings, PlanningProblem, TimeLimitError
from planners.audit.audit import audit
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of
from planners.costmap.kernels.moves import DIAGONAL, ONE
from planners.problem.problem import Pose
from planners.search.ara import ARA, ARASettings
from planners.search.astar import AStar, AStarSettings, WeightedAStar, WeightedAStarSettings
from planners.search.base import Clock, Improvement, SearchResult
from planners.search.kernels.ara import WAITS
from planners.search.kernels.astar import BEST, CAME, EXPANDED, FAR, MARK, ROOT

PLAIN = CostSettings()
COSTLY = CostSettings(clearance_weight=4.0, inflation_radius=4.0, confidence_weight=10.0)
SIDE = 40
queries = st.tuples(
    st.integers(0, 10_000), st.sampled_from([PLAIN, COSTLY]), st.sampled_from([0.0, 0.5])
)
# Checks of the clock until time is up, and expansions between two of them.
cuts = st.tuples(st.integers(1, 60), st.integers(1, 40)) | st.tuples(
    st.integers(2, 6), st.just(10**6)
)


def costmap_of(seed: int, costs: CostSettings = PLAIN, footprint: float = 0.0) -> Costmap:
    """Return a field of obstacles and walls with doors; half of its cells have low confidence."""
    rng = np.random.default_rng(seed)
    z = rng.choice([-1.0, -0.02], (SIDE, SIDE))
    z[rng.random((SIDE, SIDE)) < rng.choice([0.05, 0.15, 0.3])] = BLOCKED
    for wall in rng.integers(4, SIDE - 4, size=2).tolist():
        z[wall] = BLOCKED
        for door in rng.integers(0, SIDE - 3, size=2).tolist():
            z[wall, door : door + 3] = FREE
    z[1:4, 1:4] = z[-4:-1, -4:-1] = FREE
    return Costmap.of(
        PlanningProblem(
            grid_of(z),
            start=rng.uniform(2, 3, 2),
            goal=rng.uniform(SIDE - 3, SIDE - 2, 2),
            footprint=footprint,
            costs=costs,
            clear_start=False,
        )
    )


def least_cost(costmap: Costmap) -> float:
    """Return the cost of the best route by SciPy [m]; inf if there is none."""
    traversable: Bools = costmap.traversable
    costs = costmap.costs.astype(np.int64)
    rows, cols = traversable.shape
    index: Ints = np.arange(traversable.size, dtype=np.int64).reshape(rows, cols)
    joined = ends_of(costmap, *ends(costmap))
    begin, end = traversable.size, traversable.size + 1
    edges = [
        np.column_stack([np.full(len(joined.sources), begin), _indices(index, joined.sources)]),
        np.column_stack([_indices(index, joined.targets), np.full(len(joined.targets), end)]),
    ]
    lengths = [joined.sources[:, 2], joined.targets[:, 2]]
    for i, j in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = (slice(0, rows - i), slice(max(-j, 0), cols - max(j, 0)))
        b = (slice(i, rows), slice(max(j, 0), cols - max(-j, 0)))
        beside = ((a[0], b[1]), (b[0], a[1]))
        allowed = traversable[a] & traversable[b] & traversable[beside[0]] & traversable[beside[1]]
        tails, heads = index[a][allowed], index[b][allowed]
        length = costmap.steps[int(i * j != 0), (costs[a] + costs[b])[allowed]]
        edges += [np.column_stack([tails, heads]), np.column_stack([heads, tails])]
        lengths += [length, length]
    tails, heads = np.concatenate(edges).T
    size = (traversable.size + 2, traversable.size + 2)
    # SciPy ignores edges of length 0, such as the piece from a start at its cell's centre.
    weights = np.maximum(np.concatenate(lengths).astype(np.float64), 1e-3)
    graph = coo_array((weights, (tails, heads)), shape=size)
    total = float(dijkstra(graph.tocsr(), indices=begin)[end])
    return total / ONE * costmap.window.resolution


def _indices(index: Ints, links: Ints) -> Ints:
    indices: Ints = index[links[:, 0], links[:, 1]]
    return indices


def cost_along(costmap: Costmap, waypoints: Floats) -> float:
    """Return the cost of a line through cell centres, step by step [m]."""
    first, last = (
        {(row, col): cost for row, col, cost in joined.tolist()}
        for joined in ends_of(costmap, *ends(costmap))[:2]
    )
    centres = np.rint(costmap.to_cells(waypoints[1:-1]) - 0.5).astype(np.int64)[:, ::-1]
    total = first[tuple(centres[0].tolist())] + last[tuple(centres[-1].tolist())]
    for a, b in pairwise(centres):
        count = int(np.abs(b - a).max())
        cells = a + np.outer(np.arange(count + 1), (b - a) // count)
        costs = costmap.costs[tuple(cells.T)].astype(np.int64)
        total += int(costmap.steps[int((a != b).all()), costs[1:] + costs[:-1]].sum())
    return float(total) / ONE * costmap.window.resolution


def searched(
    engine: ARA,
    options: ARASettings | None = None,
    *,
    on_improved: Callable[[Improvement], bool | None] | None = None,
) -> tuple[SearchResult | None, list[Improvement]]:
    """Return the route between the problem's ends, and all reports."""
    reports: list[Improvement] = []

    def report(better: Improvement) -> bool | None:
        reports.append(better)
        return None if on_improved is None else on_improved(better)

    start, goal = ends(engine.costmap)
    found = engine.search(start, goal, options or ARASettings(time_limit=None), on_improved=report)
    return found, reports


def ends(costmap: Costmap) -> tuple[Pose, Pose]:
    return tuple(costmap.problem.start), tuple(costmap.problem.goal)


def check(costmap: Costmap, found: SearchResult | None, reports: list[Improvement]) -> None:
    """Check that every report keeps its bound, improves the previous one, and is a valid route."""
    least = least_cost(costmap)
    if found is None:
        assert least == np.inf
        assert reports == []
        return
    assert (found.cost, found.bound) == (reports[-1].cost, reports[-1].bound)
    np.testing.assert_array_equal(found.waypoints, reports[-1].waypoints)
    for report in reports:
        assert report.bound >= 1.0
        assert report.cost <= report.bound * least + 1e-9
        assert report.cost >= least - 1e-6
        audit(costmap.problem, report.waypoints)
        if costmap.uniform:
            length = np.hypot(*np.diff(report.waypoints, axis=0).T).sum()
            assert report.cost == pytest.approx(length)
        elif len(report.waypoints) > 3:
            assert report.cost == pytest.approx(cost_along(costmap, report.waypoints))
    for before, after in pairwise(reports):
        assert after.bound < before.bound
        assert after.cost <= before.cost
        assert after.seconds >= before.seconds


@given(queries, st.floats(1, 10), st.floats(0.1, 3))
@settings(max_examples=40)
def test_every_bound_holds_and_the_last_route_is_the_best(
    query: tuple[int, CostSettings, float], first_weight: float, step: float
) -> None:
    costmap = costmap_of(*query)
    options = ARASettings(first_weight=first_weight, step=step, time_limit=None)
    found, reports = searched(ARA(costmap), options)
    check(costmap, found, reports)
    expected = AStar(costmap).search(*ends(costmap), AStarSettings())
    assert (found is None) == (expected is None)
    if found is not None and expected is not None:
        assert found.bound == 1.0
        assert reports[0].bound <= first_weight
        assert found.cost == pytest.approx(expected.cost, rel=1e-12)


@given(queries, st.integers(1, 4))
@settings(max_examples=15)
def test_a_callback_that_returns_true_ends_the_search(
    query: tuple[int, CostSettings, float], enough: int
) -> None:
    costmap = costmap_of(*query)
    countdown = iter(range(enough - 1, -1, -1))
    found, reports = searched(
        ARA(costmap), ARASettings(step=0.1), on_improved=lambda better: next(countdown) == 0
    )
    check(costmap, found, reports)
    assert len(reports) <= enough
    assert found is None or found.bound == 1.0 or len(reports) == enough


@given(queries, cuts)
@settings(max_examples=80)
def test_the_bound_holds_after_a_stop_at_any_time(
    query: tuple[int, CostSettings, float], cut: tuple[int, int]
) -> None:
    costmap, (checks, budget) = costmap_of(*query), cut
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ARA, "slice_size", budget)
        patch.setattr("planners.search.ara.Clock", clock_of(checks))
        engine = ARA(costmap)
        try:
            found, reports = searched(engine, ARASettings(time_limit=1.0))
        except TimeLimitError:
            assert engine.state[BEST] == FAR
        else:
            check(costmap, found, reports)
        assert engine.state[EXPANDED] <= checks * budget


def clock_of(checks: int) -> type[Clock]:
    """Return a clock that is up after a number of checks."""

    class Countdown(Clock):
        left = checks

        @property
        def is_up(self) -> bool:
            self.left -= 1
            return self.left < 0

    return Countdown


@pytest.mark.parametrize("seed", range(6))
def test_no_iteration_expands_a_cell_twice(seed: int) -> None:
    engine, before = ARA(costmap_of(seed, COSTLY)), [0]

    def report(better: Improvement) -> None:
        expanded = int(engine.state[EXPANDED])
        assert (engine.labels[:, 1] >= MARK * engine.turn).sum() == expanded - before[-1]
        before.append(expanded)

    found, _ = searched(engine, ARASettings(step=0.25), on_improved=report)
    assert found is None or len(before) > 1


@pytest.mark.parametrize("seed", range(6))
def test_no_route_through_a_cell_that_waits_costs_less_than_the_least_total(seed: int) -> None:
    engine = ARA(costmap_of(seed, COSTLY))
    joined = ends_of(engine.costmap, *ends(engine.costmap))
    rows, cols = np.indices(engine.costmap.traversable.shape).reshape(2, -1)

    def report(better: Improvement) -> None:
        marks = engine.labels[:, 1]
        waits = (marks >= MARK * engine.first) & (marks & WAITS > 0)
        away = np.sort(
            np.abs([rows - joined.targets[:, :1], cols - joined.targets[:, 1:2]]), axis=0
        )
        octile = (away[1] - away[0]) * ONE + away[0] * DIAGONAL + joined.targets[:, 2:]
        totals = engine.labels[:, 0] + octile.min(axis=0)
        least = min(int(totals[waits].min(initial=FAR)), int(engine.state[BEST]))
        assert engine._least_total(joined.targets) == least
        assert better.bound <= engine.state[BEST] / least

    searched(engine, ARASettings(first_weight=10), on_improved=report)


@pytest.mark.parametrize("costs", [PLAIN, COSTLY])
def test_all_iterations_together_expand_less_than_searches_from_scratch(
    costs: CostSettings,
) -> None:
    total = scratch = best = 0
    for seed in range(12):
        costmap = costmap_of(seed, costs)
        found, reports = searched(ARA(costmap), ARASettings(step=0.5))
        if found is None:
            continue
        optimal = AStar(costmap).search(*ends(costmap), AStarSettings())
        assert optimal is not None
        best += optimal.expanded
        total += found.expanded
        for report in reports:
            weight = WeightedAStarSettings(weight=report.bound)
            single = WeightedAStar(costmap).search(*ends(costmap), weight)
            assert single is not None
            scratch += single.expanded
    assert total < scratch
    assert total < 2 * best


def test_the_search_ends_at_the_final_bound() -> None:
    stopped = []
    for seed in range(12):
        costmap = costmap_of(seed, COSTLY)
        found, reports = searched(ARA(costmap), ARASettings(final_bound=1.3))
        check(costmap, found, reports)
        if found is not None:
            assert found.bound is not None
            assert found.bound <= 1.3
            assert all(report.bound > 1.3 for report in reports[:-1])
            stopped.append(found.bound)
    assert max(stopped) > 1.0


def test_slices_and_a_growing_heap_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = [searched(ARA(costmap_of(seed))) for seed in range(6)]
    monkeypatch.setattr(ARA, "slice_size", 7)
    monkeypatch.setattr(ARA, "first_room", 9)
    for seed, (_, reports) in enumerate(whole):
        _, sliced = searched(ARA(costmap_of(seed)))
        assert summary(sliced) == summary(reports)


def summary(reports: list[Improvement]) -> list[tuple[float, float, list[list[float]]]]:
    return [(report.cost, report.bound, report.waypoints.tolist()) for report in reports]


def test_one_engine_serves_many_queries() -> None:
    costmap = costmap_of(3, COSTLY)
    shared, rng = ARA(costmap), np.random.default_rng(3)
    places = costmap.window.cell_to_world(np.argwhere(costmap.traversable))
    for a, b in rng.choice(places, (20, 2)).tolist():
        again = shared.search(tuple(a), tuple(b), ARASettings(final_bound=1.5))
        fresh = ARA(costmap).search(tuple(a), tuple(b), ARASettings(final_bound=1.5))
        assert (again is None) == (fresh is None)
        if again is not None and fresh is not None:
            assert again.waypoints.tolist() == fresh.waypoints.tolist()
            assert again[1:] == fresh[1:]


@pytest.mark.parametrize("costs", [PLAIN, COSTLY])
def test_start_and_goal_in_one_place_are_joined_directly(costs: CostSettings) -> None:
    problem = PlanningProblem(
        grid_of(free_field(32, 32)), start=(5.5, 5.5), goal=(5.5, 5.5), footprint=1, costs=costs
    )
    found, reports = searched(ARA(Costmap.of(problem)))
    assert found is not None
    assert [(report.cost, report.bound) for report in reports] == [(0.0, 1.0)]


def test_no_route_is_none_and_reports_nothing() -> None:
    z = free_field(32, 32)
    z[16] = BLOCKED
    problem = PlanningProblem(grid_of(z), start=(5, 5), goal=(5, 25), footprint=1)
    assert searched(ARA(Costmap.of(problem))) == (None, [])
    shut = PlanningProblem(grid_of(z), start=(5, 5), goal=(5, 16.5), footprint=1)
    assert searched(ARA(Costmap.of(shut))) == (None, [])


def test_a_time_limit_of_zero_is_over_at_once() -> None:
    problem = PlanningProblem(grid_of(free_field(32, 32)), start=(5, 5), goal=(5.1, 5), footprint=1)
    with pytest.raises(TimeLimitError, match=r"ara: no route within time_limit = 0 s \(0 nodes"):
        searched(ARA(Costmap.of(problem)), ARASettings(time_limit=0))


@pytest.mark.parametrize("values", [{"first_weight": 0.9}, {"step": 0}, {"final_bound": 0.5}])
def test_settings_out_of_range_are_refused_by_name(values: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=f"{next(iter(values))}: expected"):
        ARASettings(**values)


def test_the_parts_of_a_mark_do_not_overlap() -> None:
    assert CAME | WAITS < MARK
    assert CAME & ROOT
    assert CAME & WAITS == 0
