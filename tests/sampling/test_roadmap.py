"""Roadmaps: grown once, queried many times; their routes meet the same requirements as plans."""

from __future__ import annotations

import _thread
import math
import subprocess
import sys
import threading
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from groundmap import ConfidenceGrid
from groundmap.errors import FileFormatError, SettingsError
from groundmap.files.archive import read_archive, write_archive
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of, rooms
from planners import (
    CancelledError,
    CostSettings,
    EnclosedError,
    NonFreeError,
    OutsideMapError,
    PlanningProblem,
    ProblemError,
    SamplingSettings,
    UnknownSpaceError,
    UnsolvedError,
    plan,
)
from planners.costmap.costmap import Costmap
from planners.sampling.kernels.roadmap import cheapest_path
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_module import samplers
from planners.sampling.roadmap import Roadmap
from planners.sampling.settings import StateSpace
from planners.search.graph import Graph
from strategies import rngs

CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]
SPACES: list[StateSpace] = ["r2", "se2", "reeds_shepp"]
needs_ompl = pytest.mark.skipif(not samplers(), reason="ompl is not installed")


ROOMS = grid_of(np.where(rooms(), BLOCKED, FREE), resolution=0.25)


def problem(
    space: StateSpace = "r2", grid: ConfidenceGrid = ROOMS, **values: Any
) -> PlanningProblem:
    asked: dict[str, Any] = {
        "start": (2.0, 2.0, 0.5),
        "goal": (10.0, 9.5, 1.0),
        "footprint": 0.5 if space == "r2" else CAR,
        "clear_start": False,
    }
    return PlanningProblem(grid, **(asked | values))


def grow(space: StateSpace = "r2", asked: PlanningProblem | None = None, **options: Any) -> Roadmap:
    """Return a roadmap that is the same every time."""
    asked = problem(space) if asked is None else asked
    return Roadmap.grow(asked, seconds=600, space=space, **({"iterations": 1500} | options))


def pose(rng: np.random.Generator) -> tuple[float, ...]:
    return (*rng.uniform(1.5, 10.5, 2).tolist(), float(rng.uniform(-math.pi, math.pi)))


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_one_roadmap_serves_many_queries(space: StateSpace) -> None:
    roadmap = grow(space)
    rng = np.random.default_rng(0)
    solved = 0
    for _ in range(60):
        start, goal = pose(rng), pose(rng)
        try:
            route = roadmap.plan(start, goal)
        except (NonFreeError, UnknownSpaceError):
            continue
        solved += 1
        assert (route.planner, route.audit, route.bound) == ("roadmap", "clean", None)
        assert route.waypoints[[0, -1]].tolist() == [list(start[:2]), list(goal[:2])]
        assert route.length >= math.dist(start[:2], goal[:2]) - 1e-9
        assert route.expanded > 0
        if space != "r2":
            assert route.headings[[0, -1]].tolist() == [start[2], goal[2]]
    assert solved > 20


@needs_ompl
def test_routes_are_little_longer_than_the_shortest_ones() -> None:
    roadmap = grow(iterations=4000)
    rng = np.random.default_rng(1)
    ratios: list[float] = []
    while len(ratios) < 30:
        start, goal = pose(rng)[:2], pose(rng)[:2]
        try:
            shortest = plan(problem(start=start, goal=goal), "polyanya")
        except (NonFreeError, UnknownSpaceError):
            continue
        ratios.append(roadmap.plan(start, goal).length / shortest.length)
    assert np.median(ratios) < 1.02
    assert max(ratios) < 1.3


@given(rng=rngs(), count=st.integers(1, 40))
@settings(max_examples=60)
def test_the_cheapest_path_is_that_of_scipy(rng: np.random.Generator, count: int) -> None:
    places = rng.uniform(0.0, 10.0, (count, 2))
    tails, heads = rng.integers(count, size=(2, 3 * count))
    order = np.argsort(tails, kind="stable")
    tails, heads = tails[order], heads[order]
    costs = np.hypot(*(places[heads] - places[tails]).T) * rng.uniform(1.0, 3.0, len(tails))
    costs[rng.random(len(costs)) < 0.1] = math.inf
    first = np.searchsorted(tails, np.arange(count + 1)).astype(np.int64)
    goal = rng.uniform(0.0, 10.0, 2)
    sources = rng.integers(count, size=3)
    source_costs = rng.uniform(0.0, 5.0, 3)
    target_costs = np.hypot(*(places - goal).T) * rng.uniform(1.0, 2.0, count)
    target_costs[rng.random(count) < 0.7] = math.inf
    options = (first, heads, costs, places, 1.0, goal, sources, source_costs, target_costs)
    path = cheapest_path(*options).tolist()
    # An additional source vertex; of parallel edges the cheapest.
    table = np.full((count + 1, count + 1), math.inf)
    np.minimum.at(table, (tails, heads), costs)
    np.minimum.at(table, (np.full(3, count), sources), source_costs)
    graph = csr_array(np.where(np.isfinite(table), table, 0.0))
    least = (dijkstra(graph, indices=count)[:count] + target_costs).min()
    if not path:
        assert least == math.inf
        return
    cost = table[count, path[0]] + sum(table[a, b] for a, b in pairwise(path))
    assert cost + target_costs[path[-1]] == pytest.approx(least, abs=1e-5)


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_edges_are_clear_and_vertices_reachable_from_the_start(space: StateSpace) -> None:
    field = np.where(rooms(), BLOCKED, FREE)
    field[:, 24] = BLOCKED  # the rooms on the right can't be reached
    roadmap = grow(space, problem(space, grid_of(field, resolution=0.25)), iterations=600)
    validator, graph = roadmap.validator, roadmap.graph
    states = [validator.state_of(tuple(vertex)) for vertex in graph.vertices.tolist()]
    assert len(graph.edges) > 100
    assert all(validator.is_clear(*states[a], *states[b]) for a, b in graph.edges.tolist())
    assert graph.vertices[:, 0].max() < 6.0


@needs_ompl
def test_with_iterations_equal_seeds_repeat_growth_and_other_seeds_do_not() -> None:
    first, again, other = (grow(seed=seed, iterations=400) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.graph.vertices, again.graph.vertices)
    np.testing.assert_array_equal(first.graph.edges, again.graph.edges)
    assert not np.array_equal(first.graph.vertices, other.graph.vertices)
    ends = (2, 2), (10, 9.5)
    np.testing.assert_array_equal(first.plan(*ends).waypoints, again.plan(*ends).waypoints)


@pytest.mark.parametrize("planner", ["prm", "prmstar"])
@needs_ompl
def test_roadmaps_of_prm_and_prmstar_grow_with_the_time(planner: str) -> None:
    sizes = []
    for seconds in (0.02, 0.5):
        roadmap = Roadmap.grow(problem(), seconds=seconds, planner=planner)
        sizes.append(len(roadmap.graph.vertices))
    assert sizes[1] > sizes[0]
    assert roadmap.plan((2, 2), (10, 9.5)).audit == "clean"


@needs_ompl
def test_max_nearest_neighbors_limits_the_edges() -> None:
    few, many = (grow(iterations=400, max_nearest_neighbors=most) for most in (2, 20))
    assert len(many.graph.edges) > 3 * len(few.graph.edges)


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_simplification_makes_no_route_costlier(space: StateSpace) -> None:
    plain, simplified = (grow(space, simplify=simplify) for simplify in (False, True))
    rng = np.random.default_rng(2)
    shorter = 0
    for _ in range(40):
        start, goal = pose(rng), pose(rng)
        try:
            lengths = [roadmap.plan(start, goal).cost for roadmap in (plain, simplified)]
        except (NonFreeError, UnknownSpaceError):
            continue
        assert lengths[1] <= lengths[0] + 1e-9
        shorter += lengths[1] < lengths[0] - 1e-6
    assert shorter > 5


@needs_ompl
def test_routes_avoid_costly_cells() -> None:
    field = free_field(48, 48)
    field[:30, 20:28] = -0.3  # low confidence
    grid = grid_of(field, resolution=0.25)
    costs = CostSettings(confidence_weight=10.0)
    near, far = (
        grow(asked=problem(grid=grid, costs=options)) for options in (CostSettings(), costs)
    )
    ends = (2.0, 2.0), (10.0, 2.0)
    assert near.plan(*ends).length == pytest.approx(8.0)
    around = far.plan(*ends)
    assert around.waypoints[:, 1].max() > 7.0
    assert around.length < around.cost < near.plan(*ends).length * 4


@needs_ompl
def test_a_time_weight_adds_the_duration() -> None:
    roadmap = grow("se2", time_weight=1.0, max_speed=0.5)
    route = roadmap.plan((2, 2, 0), (4, 2, 0))
    assert route.length == pytest.approx(2.0)
    assert route.cost == pytest.approx(2.0 + 4.0)


@needs_ompl
def test_a_start_at_the_goal_gives_a_route_of_zero_length() -> None:
    for space in SPACES:
        route = grow(space, iterations=100).plan((2, 2, 0.5), (2, 2, 0.5))
        assert route.length == 0.0
        assert route.waypoints.tolist() == [[2.0, 2.0]] * 2


@needs_ompl
def test_invalid_places_raise_the_same_errors_as_plan() -> None:
    roadmap = grow("se2", iterations=300)
    with pytest.raises(NonFreeError, match=r"start \(6.00, 6.00\): the footprint \(at yaw 0.00"):
        roadmap.plan((6, 6, 0), (10, 9.5, 1))
    with pytest.raises(UnknownSpaceError, match=r"goal \(12.00, 11.00\)"):
        roadmap.plan((2, 2, 0), (12, 11, 1))
    with pytest.raises(OutsideMapError, match=r"goal \(40.00, 4.00\) is outside the map"):
        roadmap.plan((2, 2, 0), (40, 4, 1))
    with pytest.raises(
        ProblemError, match=r"goal: expected x, y \[m\] and yaw \[rad\] for roadmap"
    ):
        roadmap.plan((2, 2, 0), (10, 9.5))
    with pytest.raises(ProblemError, match=r"start: expected x, y .* all finite, got"):
        roadmap.plan((2, math.nan, 0), (10, 9.5, 0))


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_enclosed_is_raised_only_if_it_is_proved(space: StateSpace) -> None:
    field = np.where(rooms(), BLOCKED, FREE)
    field[24, 8:16] = field[24, 32:40] = BLOCKED
    walled = grow(space, problem(space, grid_of(field, resolution=0.25)), iterations=300)
    with pytest.raises(EnclosedError, match=r"no route: the (start|goal) is enclosed"):
        walled.plan((2, 2, 0), (2, 10, 0))
    bare = grow(space, iterations=2)
    with pytest.raises(
        UnsolvedError,
        match=r"roadmap: no route found: its \d+ vertices do not .* \(\d+ edges checked",
    ):
        bare.plan((2, 2, 0), (10, 10, 0))
    assert bare.plan((2, 2, 0), (2.5, 2, 0)).audit == "clean"


@needs_ompl
def test_only_the_start_of_the_problem_is_cleared() -> None:
    field = free_field(48, 48)
    field[4:10, 4:10] = UNSEEN
    field[30:36, 30:36] = UNSEEN
    grid = grid_of(field, resolution=0.25)
    asked = problem(grid=grid, start=(1.75, 1.75), clear_start=True, clear_start_radius=2.0)
    roadmap = grow(asked=asked)
    assert roadmap.plan((10, 2), (1.75, 1.75)).unknown_length > 0.0
    with pytest.raises(UnknownSpaceError, match=r"start \(8.25, 8.25\)"):
        roadmap.plan((8.25, 8.25), (10, 2))


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_a_loaded_roadmap_returns_the_same_routes(space: StateSpace, tmp_path: Path) -> None:
    roadmap = grow(space, turning_radius=0.8, yaw_weight=0.3)
    roadmap.save(tmp_path / "roadmap.npz")
    other_ends = problem(space, start=(9, 3, 0), goal=(3, 9, 0))
    loaded = Roadmap.load(tmp_path / "roadmap.npz", other_ends)
    assert loaded.settings == roadmap.settings
    for name in ("vertices", "edges", "weights"):
        kept = getattr(loaded.graph, name), getattr(roadmap.graph, name)
        np.testing.assert_array_equal(*kept)
    for ends in [((2, 2, 0), (10, 9.5, 1)), ((2, 10, 2), (9, 2, 1))]:
        first, again = (query.plan(*ends) for query in (roadmap, loaded))
        np.testing.assert_array_equal(first.waypoints, again.waypoints)


@needs_ompl
def test_a_file_stores_the_cleared_start(tmp_path: Path) -> None:
    field = free_field(48, 48)
    field[4:10, 4:10] = UNSEEN
    options: dict[str, Any] = {"grid": grid_of(field, resolution=0.25), "clear_start": True}
    grow(asked=problem(**options, start=(1.75, 1.75))).save(tmp_path / "roadmap.npz")
    loaded = Roadmap.load(tmp_path / "roadmap.npz", problem(**options, start=(10, 10)))
    assert loaded.plan((10, 2), (1.75, 1.75)).audit == "clean"
    with pytest.raises(FileFormatError, match="expected a roadmap of this map and footprint, got"):
        Roadmap.load(tmp_path / "roadmap.npz", problem(**options, cleared_at=(10, 10)))


@needs_ompl
def test_a_roadmap_of_another_map_or_footprint_is_rejected(tmp_path: Path) -> None:
    file = tmp_path / "roadmap.npz"
    grow(iterations=200).save(file)
    blocked = rooms()
    blocked[40, 40] = True
    changed = grid_of(np.where(blocked, BLOCKED, FREE), resolution=0.25)
    moved = grid_of(np.where(rooms(), BLOCKED, FREE), resolution=0.25, origin=(0.25, 0))
    small = grid_of(free_field(4, 4), resolution=0.01)
    for asked in (changed, moved, small):
        with pytest.raises(FileFormatError, match="a roadmap of this map and footprint, got"):
            Roadmap.load(file, problem(grid=asked))
    for other in (problem(footprint=0.45), problem("se2")):
        with pytest.raises(
            FileFormatError, match=r"one that was grown on .* Grow another roadmap\."
        ):
            Roadmap.load(file, other)


@needs_ompl
def test_damaged_files_are_rejected(tmp_path: Path) -> None:
    file = tmp_path / "roadmap.npz"
    grow(iterations=200).save(file)
    header, arrays = read_archive(file, "groundmap roadmap", 1)
    for change in (
        {"edges": arrays["edges"] + len(arrays["vertices"])},
        {"edges": arrays["edges"].astype(np.float64)},
        {"weights": arrays["weights"][:-1]},
        {"vertices": arrays["vertices"] * np.nan},
        {"vertices": arrays["vertices"][:, :1]},
    ):
        write_archive(file, header, arrays | change)
        with pytest.raises(FileFormatError, match="a complete roadmap, got arrays that are not"):
            Roadmap.load(file, problem())
    wrong: list[dict[str, Any]] = [
        {"settings": {"space": "r5"}},
        {"settings": None},
        {"settings": {"no_such": 1}},
        {"settings": {}},
        {"cleared_at": None},
        {"cleared_at": [math.nan, 0]},
    ]
    for changed in wrong:
        write_archive(file, header | changed, arrays)
        with pytest.raises(FileFormatError, match="a complete roadmap, got one with missing"):
            Roadmap.load(file, problem())
    del arrays["weights"]
    write_archive(file, header, arrays)
    with pytest.raises(FileFormatError, match="one with missing or invalid parts"):
        Roadmap.load(file, problem())
    write_archive(file, header | {"version": 2}, arrays)
    with pytest.raises(FileFormatError, match="version 1 or older, got version 2"):
        Roadmap.load(file, problem())
    with pytest.raises(FileFormatError, match="no file of that name"):
        Roadmap.load(tmp_path / "none.npz", problem())


def test_blocked_edges_are_not_used() -> None:
    asked = problem(grid=grid_of(np.where(rooms(), BLOCKED, FREE), resolution=0.25))
    broken = _by_hand(asked, [(3, 5), (3, 9), (9, 5), (9, 9)], [(0, 2), (0, 1), (1, 3), (2, 3)])
    for _ in range(2):
        route = broken.plan((3, 4.5), (9, 7))  # the shorter way leads through a wall
        assert route.audit == "clean"
        assert route.waypoints[:, 1].max() >= 8.0


def _by_hand(
    asked: PlanningProblem, vertices: list[tuple[float, float]], edges: list[tuple[int, int]]
) -> Roadmap:
    places, joined = np.array(vertices, dtype=np.float64), np.array(edges)
    weights = np.hypot(*(places[joined[:, 0]] - places[joined[:, 1]]).T)
    validator = MotionValidator2D(Costmap.of(asked), "r2", 1.0)
    return Roadmap(validator, Graph(places, joined, weights), SamplingSettings(space="r2"))


@needs_ompl
def test_invalid_growth_is_rejected() -> None:
    problems: list[tuple[dict[str, Any], str]] = [
        ({"planner": "rrt"}, r"planner: expected 'prm' or 'prmstar', got 'rrt'"),
        ({"space": "dubins"}, r"one that works in 'dubins', got prm\. .* backwards"),
        ({"space": "r3"}, r"one that works in 'r3', got prm"),
    ]
    for options, match in problems:
        with pytest.raises(ProblemError, match=match):
            Roadmap.grow(problem(), **options)
    with pytest.raises(ProblemError, match=r"start: expected x, y \[m\] and yaw \[rad\] in se2"):
        Roadmap.grow(problem(start=(2, 2)), space="se2")
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"seconds": 0}, r"seconds: expected a number above 0 \[s\], got 0"),
        ({"goal_bias": 0.1}, "goal_bias: expected one of space, seed, .*, got another setting"),
        ({"no_such": 1}, "no_such: expected a setting of SamplingSettings"),
        ({"planner": "prmstar", "max_nearest_neighbors": 5}, "expected none for 'prmstar'"),
    ]
    for options, match in wrong:
        with pytest.raises(SettingsError, match=match):
            Roadmap.grow(problem(), **options)
    with pytest.raises(NonFreeError, match=r"start \(6.00, 6.00\)"):
        Roadmap.grow(problem(start=(6, 6)))
    with pytest.raises(OutsideMapError, match=r"start \(60.00, 6.00\)"):
        Roadmap.grow(problem(start=(60, 6)))
    solid = ConfidenceGrid(resolution=0.5, origin=(0, 0, 0))
    solid.fuse(np.zeros(3, dtype=np.int64), np.full((8, 8, 8), FREE, dtype=np.float32))
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        Roadmap.grow(PlanningProblem(solid, start=(2, 2, 2), goal=(2, 2, 2), footprint=0.5))


@needs_ompl
def test_growth_can_be_interrupted_and_cancelled() -> None:
    timer = threading.Timer(0.3, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt, match=r"^$"):
        Roadmap.grow(problem(), seconds=20)
    timer.join()
    cancel = threading.Event()
    timer = threading.Timer(0.3, cancel.set)
    timer.start()
    roadmap = Roadmap.grow(problem(), seconds=20, cancel=cancel)
    timer.join()
    assert roadmap.plan((2, 2), (10, 9.5)).audit == "clean"


@needs_ompl
def test_roadmaps_grown_in_threads_each_get_their_time() -> None:
    done: list[int] = []

    def grow(seed: int) -> None:
        done.append(len(Roadmap.grow(problem(), seconds=0.2, seed=seed).graph.vertices))

    threads = [threading.Thread(target=grow, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(done) == 3
    assert min(done) > 0


@needs_ompl
def test_growth_that_is_cancelled_before_raises_an_error() -> None:
    cancel = threading.Event()
    cancel.set()
    with pytest.raises(CancelledError, match=r"prm: cancelled after 0\.\d+ s"):
        Roadmap.grow(problem(), cancel=cancel)


SCRIPT = """
import resource
import numpy as np
from groundmap import ConfidenceGrid
from planners import PlanningProblem
from planners.sampling.roadmap import Roadmap
grid = ConfidenceGrid(resolution=0.5)
grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
problem = PlanningProblem(grid, start=(4, 4, 0), goal=(28, 6, 0), footprint=0.9)
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for space in ("r2", "se2", "reeds_shepp"):
    for _ in range(3):
        roadmap = Roadmap.grow(problem, seconds=600, iterations=1000, space=space)
    rng = np.random.default_rng(0)
    for query in range(500):
        start, goal = ((*rng.uniform(2, 30, 2), 0.5) for _ in range(2))
        roadmap.search(start, goal, roadmap.settings)
        if query % 50 == 0:
            roadmap.plan(start, goal)
        if query == 100:
            before = peak()
    assert peak() - before < 20_000, peak() - before  # [KiB]
"""


@needs_ompl
def test_nothing_is_printed_and_no_memory_is_lost() -> None:
    command = [sys.executable, "-c", SCRIPT]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


def test_without_ompl_a_hint_is_given() -> None:
    script = 'import sys; sys.modules["ompl"] = None\n' + SCRIPT.replace(
        "for space in",
        "try:\n    Roadmap.grow(problem)\nexcept ValueError as error:\n"
        "    print(error)\n    raise SystemExit\nfor space in",
    )
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert (ran.stdout, ran.stderr) == ("planner: expected OMPL, got none. pip install ompl.\n", "")
