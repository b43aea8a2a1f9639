"""The comparison of sampling planners: queries, attempts, figures, and the command."""

from __future__ import annotations

import _thread
import multiprocessing
import os
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from command_line import run as groundmap
from groundmap.errors import InputError
from planners import ProblemError, plan
from planners.bench.benchmark_problems import CART, WORKLOADS, Case, Cases, raster
from planners.bench.maps import cases_on, find_maps
from planners.bench.samplers import (
    FINDS,
    MOMENTS,
    Optimum,
    Race,
    list_trials,
    optima,
    progress,
    row,
)
from planners.bench.trials import Attempt, Workload, lost_attempt, run_once, shortest
from planners.bench.worker_pool import worker_pool
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.ompl_module import samplers
from planners.sampling.settings import StateSpace

PLANE: tuple[StateSpace, ...] = ("r2", "se2", "dubins", "reeds_shepp")
IMPROVEMENTS = ((0.1, 30.0), (0.3, 24.0), (0.5, 22.0), (0.9, 20.0))  # seconds and costs
needs_ompl = pytest.mark.skipif(not samplers(), reason="ompl is not installed")


@pytest.fixture(scope="module")
def made() -> dict[str, Cases]:
    return {name: make() for name, make in WORKLOADS.items()}


def attempt_once(planner: str, cases: Cases, space: StateSpace = "r2", **options: Any) -> Attempt:
    defaults: dict[str, Any] = {"seed": 0, "time_limit": 30.0, "improve_for": 0.2}
    return run_once(cases[space], planner, space, **(defaults | options))


# Queries


@pytest.mark.parametrize("name", WORKLOADS)
def test_a_workload_is_the_same_each_time_it_is_made(name: str, made: dict[str, Cases]) -> None:
    again = WORKLOADS[name]()
    assert again.keys() == made[name].keys() >= set(PLANE)
    for space, (problem, settings) in again.items():
        before = made[name][space]
        assert (problem.start, problem.goal, settings) == (
            before.problem.start,
            before.problem.goal,
            before.settings,
        )
        bounds = problem.grid.bounds()
        ours, theirs = problem.grid.window(bounds), before.problem.grid.window(bounds)
        np.testing.assert_array_equal(ours.confidence, theirs.confidence)


@pytest.mark.parametrize("name", WORKLOADS)
def test_start_and_goal_are_clear_in_every_space_and_no_straight_line_joins_them(
    name: str, made: dict[str, Cases]
) -> None:
    for space, (problem, settings) in made[name].items():
        validator: MotionValidator
        if space == "r3":
            validator = MotionValidator3D(Voxels.of(problem))
        else:
            validator = MotionValidator2D(
                Costmap.of(problem), space, settings.get("turning_radius", 1.0)
            )
        start, goal = (validator.state_of(tuple(pose)) for pose in (problem.start, problem.goal))
        assert validator.is_clear(*start, *start)
        assert validator.is_clear(*goal, *goal)
        assert validator.bounds(start, goal) is not None
        assert not validator.is_clear(*start, *goal)


def test_the_door_is_lower_than_the_halls(made: dict[str, Cases]) -> None:
    voxels = Voxels.of(made["doorway"]["r3"].problem)
    through, above, hall = (
        voxels.clearance_of(np.array([(x, 5.5, z)]))
        for x, z in [(10.1, 1.0), (10.1, 2.3), (5, 2.3)]
    )
    assert through == pytest.approx(0.5)
    assert above == 0.0
    assert hall == pytest.approx(0.7)


@pytest.mark.parametrize(("radius", "passes"), [(0.49, True), (0.51, False)])
def test_the_door_is_one_metre_wide(radius: float, passes: bool, made: dict[str, Cases]) -> None:
    costmap = Costmap.of(made["doorway"]["r2"].problem)
    through = costmap.clearance_of(np.array([(8.0, 5.5), (12.0, 5.5)]))
    assert (through >= radius) == passes


@given(
    boxes=st.lists(st.tuples(*[st.floats(0.0, 6.0)] * 4), min_size=1, max_size=3),
    resolution=st.sampled_from([0.3, 0.5]),
)
def test_a_cell_is_free_if_it_lies_in_the_free_space(
    boxes: list[tuple[float, ...]], resolution: float
) -> None:
    outer = shapely.box(0.0, 0.0, 6.0, 4.5)
    free = outer - shapely.union_all([shapely.box(*box) for box in boxes])
    if free.area < 1.0 or free.bounds != outer.bounds:
        return
    grid = raster(free, resolution=resolution)
    window = grid.window((0.0, 0.0, 6.0 - 1e-9, 4.5 - 1e-9))
    for (r, c), confidence in np.ndenumerate(window.confidence):
        x, y = c * resolution, r * resolution
        cell = shapely.box(x, y, x + resolution, y + resolution)
        beyond = cell.area - shapely.intersection(cell, free).area
        if beyond > 1e-4 or beyond < 1e-12:
            assert (confidence > 0) == (beyond > 1e-4)


def drawn(folder: Path, *rows: str) -> Path:
    """Write a map of the MovingAI benchmark."""
    file = folder / "yard.map"
    head = ["type octile", f"height {len(rows)}", f"width {len(rows[0])}", "map"]
    file.write_text("\n".join([*head, *rows, ""]))
    return file


def test_on_a_map_start_and_goal_lie_far_apart_in_the_largest_region(tmp_path: Path) -> None:
    file = drawn(tmp_path, *(["...@" + "." * 16] * 6))
    cases = cases_on(file, CART, turning_radius=2.0)
    assert list(cases) == list(PLANE)
    assert cases["dubins"].settings == {"turning_radius": 2.0}
    for problem, _ in cases.values():
        (x0, _, yaw), (x1, *_) = problem.start, problem.goal
        assert min(x0, x1) > 4.0
        assert abs(x1 - x0) > 10.0
        assert abs(np.cos(yaw)) > 0.8
    again = cases_on(file, CART, turning_radius=2.0)["r2"].problem
    assert again.start == cases["r2"].problem.start


def test_a_footprint_that_fits_nowhere_is_refused(tmp_path: Path) -> None:
    file = drawn(tmp_path, "...", ".@.", "...")
    with pytest.raises(ProblemError, match=r"map: expected a place for a .* 2\.00 m, got none"):
        cases_on(file, 2.0, turning_radius=1.0)


def test_maps_are_found_at_any_depth(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a folder with maps .*\.map.* got none"):
        find_maps(tmp_path)
    with pytest.raises(InputError, match=r"a folder with maps, got nothing of that name"):
        find_maps(tmp_path / "gone")
    (tmp_path / "deep").mkdir()
    file = drawn(tmp_path / "deep", "...")
    assert find_maps(tmp_path) == find_maps(file) == [file]


# Attempts


@needs_ompl
def test_an_attempt_records_the_times_and_costs_of_its_improvements(made: dict[str, Cases]) -> None:
    attempt = attempt_once("rrtstar", made["doorway"])
    times, costs = zip(*attempt.improvements, strict=True)
    assert attempt.solved
    assert list(times) == sorted(times)
    assert list(costs) == sorted(costs, reverse=True)
    assert 0 < attempt.first <= times[-1] <= attempt.seconds
    assert attempt.cost == costs[-1] < costs[0]


@needs_ompl
def test_the_cost_of_an_attempt_is_that_of_the_returned_route(made: dict[str, Cases]) -> None:
    attempt = attempt_once("rrtconnect", made["doorway"], seed=3)
    route = plan(made["doorway"]["r2"].problem, "rrtconnect", space="r2", seed=3)
    assert attempt.cost == pytest.approx(route.length, abs=1e-9)


@needs_ompl
def test_an_attempt_without_a_route_has_a_reason(made: dict[str, Cases]) -> None:
    attempt = attempt_once("rrtconnect", made["rooms"], time_limit=0.0)
    assert not attempt.solved
    assert attempt.improvements == ()
    assert attempt.reason.startswith("TimeLimitError: rrtconnect: ")


def test_the_shortest_route_bends_once_at_each_side_of_the_door(made: dict[str, Cases]) -> None:
    case = made["doorway"]["r2"]
    found = shortest(case)
    ends = np.array([case.problem.start_xy, case.problem.goal_xy])
    gaps = np.abs(ends - [(10.0, 5.0), (10.2, 5.0)])  # to the corners of the door
    away, radius = np.hypot(*gaps.T), 0.3
    turns = np.arctan2(gaps[:, 1], gaps[:, 0]) + np.arcsin(radius / away)
    legs = np.sqrt(away**2 - radius**2) + radius * turns
    assert found == pytest.approx(legs.sum() + 0.2, rel=5e-4)


def test_where_no_disc_passes_there_is_no_shortest_route(made: dict[str, Cases]) -> None:
    problem, settings = made["doorway"]["se2"]  # the disc around the cart is wider than the door
    assert shortest(Case(problem, settings)) is None


# Processes: their functions are in this module, which they can import


def halved(number: int) -> float:
    if number < 0:
        os._exit(-number)
    while number == 0:
        time.sleep(0.1)
    return number / 2.0


def failed(task: int, reason: str) -> float:
    assert reason in ("its process ended with 3", "its process did not end within 1 s")
    return float("nan")


def test_a_crash_loses_one_task() -> None:
    done = dict(worker_pool([1, -3, 2, 4], halved, jobs=2, patience=60.0, lost=failed))
    assert np.isnan(done.pop(-3))
    assert done == {1: 0.5, 2: 1.0, 4: 2.0}
    assert multiprocessing.active_children() == []


def test_a_worker_that_hangs_is_killed() -> None:
    [(task, result)] = worker_pool([0], halved, jobs=2, patience=1.0, lost=failed)
    assert task == 0
    assert np.isnan(result)
    assert multiprocessing.active_children() == []


def test_an_interrupt_ends_all_processes() -> None:
    def interrupt() -> None:
        while not multiprocessing.active_children():
            time.sleep(0.05)
        _thread.interrupt_main()

    waiting = threading.Thread(target=interrupt)
    waiting.start()
    with pytest.raises(KeyboardInterrupt):
        list(worker_pool([0, 0], halved, jobs=2, patience=600.0, lost=failed))
    waiting.join()
    assert multiprocessing.active_children() == []


# Figures


def test_trials_are_ordered_by_seed_and_leave_out_refused_planners() -> None:
    names = ["rrtconnect", "prm", "aorrtc"]
    trials, refused = list_trials(
        [Workload("parking")], names, ["r2", "dubins", "r3"],
        seeds=2, time_limit=1.0, improve_for=0.0,
    )  # fmt: skip
    assert [(trial.seed, trial.space, trial.planner) for trial in trials] == [
        (seed, space, planner)
        for seed in (0, 1)
        for space, planner in [("r2", "rrtconnect"), ("r2", "prm"), ("dubins", "rrtconnect")]
    ]
    why = {(planner, space): reason for planner, space, reason in refused}
    assert why.keys() == {("aorrtc", "r2"), ("aorrtc", "dubins"), ("prm", "dubins")}
    assert "crashes" in why["aorrtc", "r2"]


def race(*attempts: Attempt, space: StateSpace = "r2") -> Race:
    return Race("doorway", space, "rrtstar", list(attempts))


def solved(*improvements: tuple[float, float]) -> Attempt:
    return Attempt(improvements[-1][0] + 0.1, improvements)


GAVE_UP = Attempt(10.0, reason="TimeLimitError: too late.")


def test_figures_count_solved_attempts_and_give_a_reason_for_the_others() -> None:
    one = row(
        race(solved(*IMPROVEMENTS), solved((0.3, 30.0)), GAVE_UP), Optimum(20.0, is_best_known=True)
    )
    curve, counts = one.pop("curve"), {key: one[key] for key in ("queries", "solved")}
    assert counts == {"queries": 3, "solved": 2}
    assert one["success"] == pytest.approx(2 / 3)
    assert one["first_ms"] == pytest.approx(200.0)
    assert (one["cost"], one["optimum"], one["ratio"]) == (25.0, 20.0, 1.25)
    assert (one["best_known"], one["median_ms"]) == (True, 1000.0)
    assert one["reason"] == GAVE_UP.reason
    assert curve[-1] == [pytest.approx(0.6), 1.5]  # of three seeds, the median is the second


def test_a_planner_without_a_route_has_only_times() -> None:
    one = row(race(GAVE_UP, lost_one()), Optimum(None, is_best_known=True))
    empty = ("first_ms", "first_p95_ms", "cost", "optimum", "ratio")
    assert [one[key] for key in empty] == [None] * 5
    assert (one["solved"], one["curve"], one["median_ms"]) == (0, [], 10_000.0)


def lost_one() -> Attempt:
    trials, _ = list_trials(
        [Workload("doorway")], ["rrt"], ["r2"], seeds=1, time_limit=10.0, improve_for=0.0
    )
    return lost_attempt(trials[0], "its process ended with -11")


def test_costs_are_compared_with_the_shortest_or_the_best_known(made: dict[str, Cases]) -> None:
    work, known = Workload("doorway"), shortest(made["doorway"]["r2"])
    assert known is not None
    races = [race(solved((1.0, 30.0))), race(solved((1.0, 29.0)), GAVE_UP, space="se2")]
    assert optima([work], races) == {
        ("doorway", "r2"): Optimum(known, is_best_known=False),
        ("doorway", "se2"): Optimum(29.0, is_best_known=True),
    }
    better = optima([work], [race(solved((1.0, known - 0.1)))])
    assert better["doorway", "r2"] == Optimum(known - 0.1, is_best_known=True)
    nothing = optima([work], [race(GAVE_UP, space="se2")])
    assert nothing["doorway", "se2"].cost is None


def improving_attempts() -> st.SearchStrategy[Attempt]:
    steps = st.tuples(st.floats(0.01, 1.0), st.floats(0.5, 1.0))
    return st.lists(steps, min_size=FINDS + 1, max_size=8).map(
        lambda steps: solved(
            *zip(
                np.cumsum([wait for wait, _ in steps]).tolist(),
                (50.0 * np.cumprod([share for _, share in steps])).tolist(),
                strict=True,
            )
        )
    )


@given(won=st.lists(improving_attempts(), min_size=1, max_size=7), failures=st.integers(0, 3))
def test_a_curve_is_the_median_of_the_best_costs_so_far(won: list[Attempt], failures: int) -> None:
    curve = progress(race(*won, *[GAVE_UP] * failures), 10.0)
    if len(won) <= failures:
        assert len(curve) == 1
        return
    times, ratios = zip(*curve, strict=True)
    assert list(times) == sorted(times)
    assert list(ratios) == sorted(ratios, reverse=True)
    for moment, ratio in curve[:-1]:
        had = [
            min((cost for time, cost in one.improvements if time <= moment), default=np.inf)
            for one in won
        ]
        assert ratio == pytest.approx(np.median([*had, *[np.inf] * failures]) / 10.0)
    assert curve[-1][1] == pytest.approx(
        np.median([*(one.cost for one in won), *[np.inf] * failures]) / 10.0
    )


def test_long_curves_are_thinned() -> None:
    steps = [(0.001 * i, 100.0 / i) for i in range(1, 2000)]
    curve = progress(race(solved(*steps)), 0.05)
    assert MOMENTS / 2 < len(curve) <= MOMENTS + 1
    assert curve[0] == (0.001, 2000.0)


def test_a_planner_that_stops_at_the_first_route_is_a_point() -> None:
    one, other = solved((0.2, 30.0), (0.3, 25.0)), solved((0.4, 27.0), (0.5, 21.0))
    assert progress(race(one, other), 20.0) == [(0.4, 1.15)]


# The command

QUICK = ("--seeds", "2", "--improve-for", "0.1", "--jobs", "1", "--space", "r2")


@needs_ompl
def test_the_command_compares_planners_and_draws_them(tmp_path: Path) -> None:
    picture = tmp_path / "race.png"
    planners = [
        word for name in ("rrtconnect", "rrtstar", "aorrtc") for word in ("--planner", name)
    ]
    ran = groundmap(
        "bench", "planning", "--samplers", "--workload", "doorway", *planners, *QUICK,
        "--plot", picture, "--json",
    )  # fmt: skip
    assert ran.code == 0
    rows = {one["system"]: one for one in ran.json["rows"]}
    assert rows.keys() == {"rrtconnect", "rrtstar"}
    for one in rows.values():
        assert (one["workload"], one["space"], one["queries"]) == ("doorway", "r2", 2)
        assert (one["solved"], one["success"], one["reason"]) == (2, 1.0, None)
        assert 1.0 <= one["ratio"] < 2.0
        assert 0 < one["first_ms"] <= one["median_ms"] <= one["p95_ms"]
    assert len(rows["rrtstar"]["curve"]) > len(rows["rrtconnect"]["curve"]) == 1
    [refused] = ran.json["refused"]
    assert (refused["planner"], refused["space"]) == ("aorrtc", "r2")
    assert picture.read_bytes().startswith(b"\x89PNG")


@needs_ompl
def test_the_table_has_solutions_on_a_map_and_reasons_of_refusals(tmp_path: Path) -> None:
    file = drawn(tmp_path, *(["." * 20] * 12))
    ran = groundmap(
        "bench", "planning", "--samplers", "--map", file, "--planner", "rrt", "--planner",
        "aorrtc", *QUICK, "--footprint", "0.4",
    )  # fmt: skip
    assert ran.code == 0
    title, heads, figures, *rest = ran.out.splitlines()
    assert title.startswith(("yard.map, r2 (shortest: ", "yard.map, r2 (best known: "))
    assert heads.split()[:3] == ["solved", "first", "ms"]
    assert figures.split()[:4] == ["rrt", "2", "of", "2"]
    assert rest[0].startswith("aorrtc in r2: OMPL's AORRTC crashes")
    assert rest[1].startswith("2 attempts in ")


@needs_ompl
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--planner", "astar"], "planner: expected one of aorrtc, "),
        (["--space", "r4"], "space: expected one of r2, se2, dubins, reeds_shepp, r3, got 'r4'"),
        (["--workload", "maze"], "workload: expected one of doorway, rooms, parking, got 'maze'"),
        (["--map", "gone"], "gone: expected a map, or a folder with maps, got nothing of that"),
        (["--footprint", "-1"], "footprint: expected a radius of 0 or more"),
        (["--plot", "race.txt"], "plot: expected a file name ending in .png"),
        (["--movingai", "maps"], "expected --movingai or --samplers, got both"),
    ],
)
def test_bad_options_are_refused_before_anything_runs(options: list[str], message: str) -> None:
    ran = groundmap("bench", "planning", "--samplers", *options)
    assert ran.code == 2
    assert message in ran.err
    assert ran.out == ""


def test_published_queries_are_run_with_one_planner_at_a_time() -> None:
    ran = groundmap(
        "bench", "planning", "--movingai", "maps", "--planner", "jps", "--planner", "astar"
    )
    assert ran.code == 2
    assert "expected one with --movingai, got jps, astar" in ran.err
