"""Jump point search: the costs of A*, with fewer expansions."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Bytes, Ints
from groundmap.io.movingai import read_movingai_map
from groundmap.io.movingai_scen import read_movingai_scen
from oracles_jps import jump, least_cost, may_step
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import NoRouteError, PlanningProblem, ProblemError, TimeLimitError, plan
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of
from planners.costmap.kernels.moves import COLS, DIAGONAL, ONE, ROWS
from planners.costmap.moves import allowed_moves
from planners.problem.costs import CostSettings
from planners.search.astar import AStar, AStarSettings
from planners.search.jps import JPS, JPSPlus, JPSPlusSettings, JPSSettings, stops_of
from planners.search.kernels.astar import (
    BEST,
    EXHAUSTED,
    EXPANDED,
    FAR,
    FOUND,
    HEAP_FULL,
    ROOT,
    SIZE,
    TARGET,
    estimate,
)
from planners.search.kernels.heap import push
from planners.search.kernels.jps import CAME, MARK, advance, trace
from planners.search.kernels.jps_jumps import Jumps, scan
from planners.search.kernels.jps_table import fill_table

MAPS = Path(__file__).parents[3] / "shared" / "data" / "movingai"
ENGINES = [(JPS, JPSSettings()), (JPSPlus, JPSPlusSettings())]
LENGTHS = [1, 2, 3, 7, 20, 63, 64, 65, 127, 128, 129]
STEPS = list(zip(ROWS.tolist(), COLS.tolist(), strict=True))


class Answer(NamedTuple):
    cost: float  # inf: no path
    expanded: int
    cells: Ints  # where the path begins, turns and ends


def table_of(moves: Bytes, kind: type[np.signedinteger] = np.int16) -> Jumps:
    table: Jumps = np.empty((*moves.shape, 8), dtype=kind)
    fill_table(moves, table)
    return table


class Searcher:
    """The kernels of one grid."""

    def __init__(self, traversable: Bools, *, plus: bool) -> None:
        self.moves = allowed_moves(traversable)
        self.jumps: Jumps = table_of(self.moves) if plus else stops_of(traversable)
        self.labels = np.zeros((traversable.size, 2), dtype=np.int64)
        self.query = 0

    def __call__(
        self, sources: Ints, targets: Ints, *, room: int = 4096, budget: int = 10**6
    ) -> Answer:
        self.query += 1
        width, heap = self.moves.shape[1], np.empty((room, 2), dtype=np.int64)
        state = np.array([0, FAR, -1, 0, MARK * self.query])
        for row, col, cost in sources.tolist():
            self.labels[row * width + col] = cost, MARK * self.query + (ROOT << CAME)
            h = estimate(row, col, targets)
            state[SIZE] = push(heap, state[SIZE], cost + h, h, row * width + col)
        status = -1
        while status not in (FOUND, EXHAUSTED):
            status = advance(self.moves, self.jumps, targets, self.labels, heap, state, budget)
            if status == HEAP_FULL:
                heap = np.concatenate([heap, np.empty_like(heap)])
        if status == EXHAUSTED:
            return Answer(np.inf, int(state[EXPANDED]), np.empty((0, 2), dtype=np.int64))
        turns = trace(self.labels, width, int(state[TARGET]))[::-1]
        return Answer(
            float(state[BEST]), int(state[EXPANDED]), np.column_stack(np.divmod(turns, width))
        )


@st.composite
def grids(draw: st.DrawFn, *, most: int = 400) -> Bools:
    """Draw traversable cells: up to `most`, about whole words long, from open to maze-like."""
    rows = draw(st.sampled_from(LENGTHS))
    cols = draw(st.sampled_from([n for n in LENGTHS if n * rows <= max(most, rows)]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    traversable: Bools = rng.random((rows, cols)) >= draw(
        st.sampled_from([0.0, 0.05, 0.2, 0.35, 0.5])
    )
    if draw(st.booleans()):  # corridors
        traversable[:: draw(st.integers(2, 5))] = rng.random(cols) < 0.15
    traversable[rng.integers(rows), rng.integers(cols)] = True
    return traversable


@st.composite
def queries(draw: st.DrawFn) -> tuple[Bools, Ints, Ints]:
    """Draw a grid with sources and targets: up to four of a block, or of any cells."""
    traversable = draw(grids())
    cells = np.argwhere(traversable)
    ends = []
    for _ in range(2):
        chosen = cells[draw(st.integers(0, len(cells) - 1))]
        offsets = cells - chosen
        near = cells[((offsets >= 0) & (offsets <= 1)).all(axis=1)]
        if draw(st.booleans()):
            picks = draw(st.lists(st.integers(0, len(cells) - 1), min_size=1, max_size=4))
            near = np.unique(cells[picks], axis=0)
        costs = draw(st.lists(st.integers(0, 3 * ONE), min_size=len(near), max_size=len(near)))
        ends.append(np.column_stack([near, costs]).astype(np.int64))
    return traversable, ends[0], ends[1]


@pytest.mark.parametrize("plus", [False, True])
@given(query=queries())
@settings(max_examples=80)
def test_cost_is_dijkstras_and_that_of_the_reverse(
    plus: bool, query: tuple[Bools, Ints, Ints]
) -> None:
    traversable, sources, targets = query
    search = Searcher(traversable, plus=plus)
    expected = least_cost(traversable, sources, targets, side=ONE, diagonal=DIAGONAL)
    assert search(sources, targets).cost == expected
    assert search(targets, sources).cost == expected


@pytest.mark.parametrize("plus", [False, True])
@given(query=queries())
@settings(max_examples=50)
def test_the_cells_are_a_path_of_that_cost_and_turn_at_each(
    plus: bool, query: tuple[Bools, Ints, Ints]
) -> None:
    traversable, sources, targets = query
    answer = Searcher(traversable, plus=plus)(sources, targets)
    if len(answer.cells) == 0:
        return
    cost = sum(
        min(int(c) for *cell, c in ends.tolist() if cell == answer.cells[i].tolist())
        for ends, i in [(sources, 0), (targets, -1)]
    )
    last_step = None
    for a, b in pairwise(answer.cells):
        step = tuple(np.sign(b - a).tolist())
        assert step != last_step
        assert step in STEPS
        last_step = step
        for n in range(int(np.abs(b - a).max())):
            cell = a + n * np.array(step)
            assert may_step(traversable, (int(cell[0]), int(cell[1])), step)
            cost += DIAGONAL if all(step) else ONE
    assert cost == answer.cost


@given(grids(most=130))
@settings(max_examples=20)
def test_bitmap_and_table_hold_the_jumps_of_the_definition(traversable: Bools) -> None:
    rows, cols = traversable.shape
    moves, stops = allowed_moves(traversable), stops_of(traversable)
    table = table_of(moves)
    assert (table == table_of(moves, np.int32)).all()
    for row, col in np.argwhere(traversable):
        for k, step in enumerate(STEPS):
            expected = jump(traversable, (int(row), int(col)), step)
            assert table[row, col, k] == expected
            if k % 2 == 0:
                assert scan(stops, rows, cols, row, col, k) == expected


@given(queries())
@settings(max_examples=30)
def test_slices_and_a_growing_heap_change_nothing(query: tuple[Bools, Ints, Ints]) -> None:
    traversable, sources, targets = query
    search = Searcher(traversable, plus=False)
    once = search(sources, targets)
    sliced = search(sources, targets, room=8, budget=1)
    assert (sliced.cost, sliced.expanded) == (once.cost, once.expanded)
    assert (sliced.cells == once.cells).all()


def costmap_of(blocked: Bools, **options: object) -> Costmap:
    rows, cols = blocked.shape
    problem = PlanningProblem(
        grid_of(np.where(blocked, BLOCKED, FREE)),
        start=(1.5, 1.5),
        goal=(cols - 1.5, rows - 1.5),
        footprint=0,
        clear_start=False,
        **options,  # type: ignore[arg-type]
    )
    return Costmap.of(problem)


@pytest.mark.parametrize(("engine_class", "chosen"), ENGINES)
@pytest.mark.parametrize("seed", range(8))
def test_routes_are_as_long_as_those_of_astar_with_less_work(
    engine_class: type[JPS], chosen: JPSSettings, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    blocked = rng.random((70, 130)) < 0.1 + 0.05 * (seed % 5)
    costmap = costmap_of(blocked)
    engine, astar = engine_class(costmap), AStar(costmap)
    free = np.argwhere(~blocked)
    for _ in range(6):
        a, b = (free[rng.integers(len(free))][::-1] + rng.uniform(0.2, 0.8, 2) for _ in range(2))
        start, goal = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
        found, there = (
            engine.search(start, goal, chosen),
            astar.search(start, goal, AStarSettings()),
        )
        back = engine.search(goal, start, chosen)
        assert (found is None) == (there is None) == (back is None)
        if found is None or there is None or back is None:
            continue
        assert found.waypoints[[0, -1]].tolist() == [list(start), list(goal)]
        lengths = [
            np.hypot(*np.diff(each.waypoints, axis=0).T).sum() for each in (found, there, back)
        ]
        assert lengths == pytest.approx([lengths[1]] * 3, abs=1e-9)
        assert found.expanded <= there.expanded + 1


@pytest.mark.parametrize(("engine_class", "chosen"), ENGINES)
def test_a_wall_leaves_no_route_and_the_next_query_is_answered(
    engine_class: type[JPS], chosen: JPSSettings
) -> None:
    blocked = np.zeros((20, 70), dtype=bool)
    blocked[:, 40] = True
    engine = engine_class(costmap_of(blocked))
    assert engine.search((3.5, 3.5), (60.5, 3.5), chosen) is None
    found = engine.search((3.5, 3.5), (30.5, 3.5), chosen)
    assert found is not None
    assert found.waypoints.tolist() == [[3.5, 3.5], [30.5, 3.5]]


@pytest.mark.parametrize(("engine_class", "chosen"), ENGINES)
def test_goals_in_enclosed_cells_have_no_route(
    engine_class: type[JPS], chosen: JPSSettings
) -> None:
    blocked = np.zeros((9, 9), dtype=bool)
    blocked[3:6, 3:6] = True
    engine = engine_class(costmap_of(blocked))
    assert engine.search((1.5, 1.5), (4.5, 4.5), chosen) is None
    assert engine.search((4.5, 4.5), (1.5, 1.5), chosen) is None


@pytest.mark.parametrize(("engine_class", "name"), [(JPS, "jps"), (JPSPlus, "jps+")])
def test_a_time_limit_of_zero_is_over_at_once(engine_class: type[JPS], name: str) -> None:
    engine = engine_class(costmap_of(free_field(20, 20) > 0))
    with pytest.raises(TimeLimitError, match=rf"^{re.escape(name)}: no route .* = 0 s \(0 nod"):
        engine.search((5, 5), (5.1, 5.1), JPSSettings(time_limit=0))


@pytest.mark.parametrize("engine_class", [JPS, JPSPlus])
def test_costs_that_differ_are_refused(engine_class: type[JPS]) -> None:
    costmap = costmap_of(free_field(20, 20) > 0, costs=CostSettings(clearance_weight=2.0))
    with pytest.raises(ProblemError, match=r"planner: expected uniform costs.*Use 'astar'"):
        engine_class(costmap)


@pytest.mark.skipif(not MAPS.is_dir(), reason="the MovingAI maps are not part of the project")
@pytest.mark.parametrize("plus", [False, True])
@pytest.mark.parametrize("name", ["dao/den312d", "cities/Berlin_0_256"])
def test_lengths_are_the_published_optima(name: str, plus: bool) -> None:
    path = MAPS / f"{name}.map"
    search = Searcher(~read_movingai_map(path).blocked, plus=plus)
    rows = read_movingai_scen(f"{path}.scen")
    for i in np.random.default_rng(0).permutation(len(rows))[:40]:
        start, goal = (np.array([[*cell, 0]]) for cell in (rows[i].start, rows[i].goal))
        assert search(start, goal).cost / ONE == pytest.approx(rows[i].length, abs=0.01)


# Places beside the centres


def outcome(problem: PlanningProblem, planner: str) -> tuple[str, object]:
    """Return the cost of a route, or the reason why there is none."""
    try:
        return "cost", pytest.approx(plan(problem, planner).cost, rel=1e-12)
    except NoRouteError as error:
        return type(error).__name__, str(error)


def speckled_problem(rng: np.random.Generator) -> PlanningProblem:
    """Return a problem between places beside the centres, where the footprint fits."""
    while True:
        side = int(rng.integers(6, 16))
        z = np.where(rng.random((side, side)) < rng.choice([0.1, 0.25, 0.4]), BLOCKED, FREE)
        cells = np.argwhere(z == FREE)
        start, goal = cells[rng.integers(0, len(cells), 2), ::-1] + rng.random((2, 2))
        radius = float(rng.choice([0.2, 0.45, 0.5, 0.6, 0.8]))
        problem = PlanningProblem(grid_of(z), start=start, goal=goal, footprint=radius)
        costmap = Costmap.of(problem)
        if min(costmap.clearance_of(place) for place in (start, goal)) >= radius:
            return problem


@pytest.mark.parametrize("planner", ["jps", "jps+"])
def test_places_beside_the_centres_have_the_routes_of_astar(planner: str) -> None:
    rng = np.random.default_rng(5)
    plan(
        PlanningProblem(grid_of(free_field(9, 9)), start=(2, 2), goal=(7, 5), footprint=0.5), "jps"
    )
    joins_nothing = 0
    for _ in range(150):
        problem = speckled_problem(rng)
        assert outcome(problem, planner) == outcome(problem, "astar")
        ends = ends_of(Costmap.of(problem), problem.start_xy, problem.goal_xy)
        joins_nothing += len(ends.targets) == 0
        assert (len(ends.sources) == 0) == (len(ends.targets) == 0)
    assert joins_nothing >= 5
