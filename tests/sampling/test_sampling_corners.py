"""Corner cases of sampling planners and of their bench: each was wrong once."""

from __future__ import annotations

import copy
import gc
import math
import pickle
import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import run as groundmap
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import (
    AuditError,
    OutsideMapError,
    PlanningProblem,
    ProblemError,
    Route,
    plan,
    plan_many,
)
from planners.bench.samplers import Optimum, Race, row
from planners.bench.trials import Attempt
from planners.bench.worker_pool import _receive, _Worker
from planners.costmap.costmap import Costmap
from planners.route.solve import solve
from planners.sampling import threaded_solve
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.roadmap import Roadmap
from planners.sampling.settings import SamplingSettings, StateSpace
from planners.search.base import SearchResult

CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]


def walled() -> Any:
    """Return a hall of 16 m with a wall that leaves 6 m of it open."""
    z = free_field(64, 64)
    z[:40, 32] = BLOCKED
    return grid_of(z, resolution=0.25)


def asked(**values: Any) -> PlanningProblem:
    options: dict[str, Any] = {"start": (2, 2, 0), "goal": (14, 2, 0), "footprint": 0.5}
    return PlanningProblem(walled(), **(options | values), clear_start=False)


def needle() -> PlanningProblem:
    z = free_field(48, 48)
    z[20:28] = BLOCKED
    z[20:28, 22:25] = FREE
    ends: dict[str, Any] = {"start": (2, 2), "goal": (9.5, 10), "footprint": 0.3749}
    return PlanningProblem(grid_of(z, resolution=0.25), **ends, clear_start=False)


def test_a_goal_radius_across_a_wall_selects_a_reachable_goal() -> None:
    z = free_field(80, 80)
    z[:, 19:21] = BLOCKED
    ends: dict[str, Any] = {"start": (1.0, 15), "goal": (11, 10), "footprint": 0.3}
    problem = PlanningProblem(grid_of(z, resolution=0.25), **ends, clear_start=False)
    for seed in range(10):
        route = plan(problem, "rrtconnect", goal_radius=6.9, seed=seed)
        assert route.waypoints[-1, 0] < 4.5
        assert math.dist(route.waypoints[-1], (11, 10)) <= 6.9 + 1e-9


@pytest.mark.parametrize("options", [{"goals": ((14, 10, 1.0),)}, {"goal_radius": 1.0}])
def test_a_route_ends_at_an_accepted_goal(options: dict[str, Any]) -> None:
    problem = asked(footprint=CAR)
    route = plan(problem, "rrtconnect", space="se2", goal_yaw_tolerance=0.3, **options)
    end = (*route.waypoints[-1].tolist(), float(route.headings[-1]))
    assert SamplingSettings(goal_yaw_tolerance=0.3, **options).accepts_end(end, (14, 2, 0), axes=2)


def test_a_route_that_ends_at_no_goal_is_caught() -> None:
    class Liar:
        name = "liar"

        def search(self, start: Any, goal: Any, settings: Any) -> SearchResult:
            return SearchResult(np.array([(2.0, 2.0), (5.0, 2.0)]), 1, goal=(5.0, 2.0))

    options = SamplingSettings(goal_radius=1.0)
    with pytest.raises(AuditError, match=r"does not end at a goal at \(5.00, 2.00\)"):
        solve(Costmap.of(asked()), Liar(), options, began=0.0)


@pytest.mark.parametrize("name", ["rrtconnect", "rrtstar", "prm"])
@pytest.mark.parametrize("kind", [RuntimeError, NotImplementedError])
def test_a_runtime_error_of_the_callback_is_raised(name: str, kind: type) -> None:
    def fail(_: Any) -> None:
        raise kind("mine")

    with pytest.raises(kind, match=r"^mine$"):
        plan(asked(), name, on_improved=fail)


def test_a_cancelled_warm_start_returns_its_first_route() -> None:
    cancel = threading.Event()
    route = plan(
        asked(), "rrtstar", warm_start=True, cancel=cancel, on_improved=lambda _: cancel.set()
    )
    assert route.audit == "clean"


@pytest.mark.parametrize("name", ["rrtconnect", "rrtstar", "fmt", "prm"])
def test_a_warm_start_ends_after_improve_for(name: str) -> None:
    # Without a time limit and a better route, only improve_for ends it.
    route = plan(needle(), name, warm_start=True, improve_for=0.1, time_limit=None)
    assert route.audit == "clean"


@pytest.mark.parametrize("space", ["se2", "dubins", "reeds_shepp"])
def test_a_warm_start_needs_no_yaw_with_a_full_yaw_tolerance(space: str) -> None:
    problem = asked(footprint=CAR, goal=(14, 2))
    options: dict[str, Any] = {"goal_yaw_tolerance": math.pi, "iterations": 200}
    assert plan(problem, "rrtstar", space=space, warm_start=True, **options).audit == "clean"
    [route] = plan_many(problem, [((2, 2, 0), (14, 2))], "rrtstar", space=space, **options)
    assert isinstance(route, Route)


def test_a_slice_too_short_for_a_solution_does_not_lose_the_route(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threaded_solve, "SLICE", 0.0005)
    for seed in range(5):
        assert plan(asked(), "prmstar", seed=seed, improve_for=0.1).audit == "clean"


@pytest.mark.parametrize(
    "again", [copy.deepcopy, lambda validator: pickle.loads(pickle.dumps(validator))]
)
def test_a_copied_validator_reads_its_own_arrays(again: Any) -> None:
    validator = MotionValidator2D(Costmap.of(asked(footprint=CAR)), "se2", 1.0)
    before, twin = validator.is_clear.args[0], again(validator)  # type: ignore[attr-defined]
    assert twin.is_clear.args[0] != before
    del validator
    gc.collect()
    assert twin.is_clear(3, 3, 0, 4, 4, 0)


@pytest.mark.parametrize("again", [copy.deepcopy, pickle.dumps])
@pytest.mark.parametrize("space", ["r2", "se2", "dubins", "reeds_shepp"])
def test_a_check_of_edges_can_not_be_copied_or_pickled(space: StateSpace, again: Any) -> None:
    validator = MotionValidator2D(Costmap.of(asked(footprint=CAR)), space, 1.0)
    with pytest.raises(TypeError, match=r"is_clear can't be copied or pickled.* its MotionV"):
        again(validator.is_clear)


def test_a_shallow_copy_of_a_check_keeps_its_arrays() -> None:
    validator = MotionValidator2D(Costmap.of(asked(footprint=CAR)), "se2", 1.0)
    twin = copy.copy(validator.is_clear)
    assert vars(twin)["owner"] is vars(validator.is_clear)["owner"]


def test_a_roadmap_with_zero_weights_is_rejected_before_growth() -> None:
    with pytest.raises(SettingsError, match="length_weight: expected more than 0"):
        Roadmap.grow(asked(), seconds=1e9, length_weight=0)


def halve(number: Any) -> Any:
    return number / 2.0


def test_a_worker_that_dies_before_it_reads_its_task_loses_that_task() -> None:
    for given_first in (True, False):
        worker = _Worker(halve)
        if given_first:
            worker.send(3, 60.0)
        worker.process.kill()
        worker.process.join()
        if not given_first:
            worker.send(3, 60.0)
        result, fit = _receive(worker, lambda task, reason: (task, reason), 60.0)
        assert (result, fit) == ((3, "its process ended with -9"), False)
        worker.kill()


def test_a_route_of_zero_length_has_no_ratio() -> None:
    race = Race("one place", "r2", "rrt", [Attempt(0.1, ((0.05, 0.0),))])
    one = row(race, Optimum(0.0, is_best_known=False))
    assert (one["ratio"], one["curve"], one["solved"]) == (None, [], 1)


def test_maps_of_the_same_name_are_distinguished(tmp_path: Path) -> None:
    options: list[Any] = []
    for folder, width in (("a", 40), ("b", 20)):
        (tmp_path / folder).mkdir()
        rows = ["type octile", "height 12", f"width {width}", "map", *["." * width] * 12, ""]
        (tmp_path / folder / "yard.map").write_text("\n".join(rows))
        options += ["--map", tmp_path / folder / "yard.map"]
    ran = groundmap(
        "bench", "planning", "--samplers", *options, "--planner", "rrtconnect", "--space", "r2",
        "--seeds", "1", "--jobs", "1", "--footprint", "0.4", "--json",
    )  # fmt: skip
    assert len({one["workload"] for one in ran.json["rows"]}) == 2


def test_options_of_the_other_benchmark_are_rejected() -> None:
    ran = groundmap("bench", "planning", "--movingai", "maps", "--space", "r2")
    assert (ran.code, "--space: expected it with --samplers" in ran.err) == (2, True)
    ran = groundmap("bench", "planning", "--samplers", "--limit", "3")
    assert (ran.code, "--limit: expected it with --movingai" in ran.err) == (2, True)


def test_a_start_within_the_goal_radius_gives_a_route_of_zero_length() -> None:
    z = np.full((64, 64), FREE, dtype=np.float32)
    shifted = grid_of(z, resolution=0.1524, origin=(-7.3, 2.9))
    ends: dict[str, Any] = {"start": (-3.1, 5.7), "goal": (1.1, 6.3), "footprint": 0.3}
    problem = PlanningProblem(shifted, **ends, clear_start=False)
    assert plan(problem, "rrtconnect", goal_radius=5).waypoints.tolist() == [[-3.1, 5.7]] * 2
    for options in ({"goal_radius": 30.0}, {"goals": [[2, 2, 0]]}):
        assert plan(asked(), "rrtconnect", **options).length == 0.0


def test_a_goal_off_the_map_is_ignored_if_another_goal_is_accepted() -> None:
    route = plan(asked(goal=(500, 2)), "rrtconnect", goals=[[14, 2]])
    assert route.waypoints[-1].tolist() == [14.0, 2.0]
    with pytest.raises(OutsideMapError, match=r"^goal \(500.00, 2.00\) is outside the map"):
        plan(asked(goal=(500, 2)), "rrtconnect", goals=[[600, 2]])


def test_goals_that_are_no_list_of_places_are_rejected() -> None:
    for wrong in ((3, 4), "3,4", 7):
        with pytest.raises(SettingsError, match=r"goals: expected a list of places, such as"):
            plan(asked(), "rrtconnect", goals=wrong)


def test_the_first_route_of_a_warm_start_is_simplified() -> None:
    route = plan(asked(), "rrtconnect", warm_start=True, iterations=1)
    assert route.length < plan(asked(), "astar").length - 0.1


def test_a_roadmap_reports_that_its_map_has_changed() -> None:
    problem = asked()
    roadmap = Roadmap.grow(problem, iterations=300, seconds=30)
    z = np.full((64, 64), FREE, dtype=np.float32)
    z[40:, 32] = BLOCKED  # the rest of the wall
    for _ in range(9):
        problem.grid.fuse(np.array([0, 0]), z)
    with pytest.raises(ProblemError, match=r"grid: expected the map that the roadmap was grown on"):
        roadmap.plan((2, 2), (14, 2))


def test_time_spent_waiting_for_other_searches_does_not_count() -> None:
    pairs = [((2, 2), (14, y)) for y in (2, 4, 6, 8)]
    found = plan_many(asked(), pairs, "rrtstar", threads=4, improve_for=0.2, time_limit=None)
    assert all(isinstance(route, Route) for route in found)


def test_ctrl_c_ends_plan_many() -> None:
    # A real signal: `interrupt_main` would not wake a main thread that waits for others.
    main = threading.main_thread().ident
    assert main is not None
    timer = threading.Timer(0.5, signal.pthread_kill, (main, signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt, match=r"^$"):
        plan_many(needle(), [((2, 2), (9.5, 10))] * 4, "rrtconnect", time_limit=None)
    timer.join()
