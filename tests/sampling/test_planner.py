"""Sampling planners: OMPL's names, our checks, and errors for every failure."""

from __future__ import annotations

import _thread
import logging
import math
import subprocess
import sys
import threading
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, free_field, grid_of, rooms
from planners import (
    OWN_PLANNERS,
    PLANNERS,
    CostSettings,
    EnclosedError,
    PlanningProblem,
    ProblemError,
    Route,
    SamplingSettings,
    TimeLimitError,
    UnsolvedError,
    plan,
    plan_many,
)
from planners.costmap.costmap import Costmap
from planners.sampling.improvement_reporter import ImprovementReporter
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.objectives import COST_AWARE, Objective
from planners.sampling.ompl_module import samplers
from planners.sampling.ompl_parameters import PARAMETERS, setter_of
from planners.sampling.ompl_search import REASONS, THREADED, OmplSearch
from planners.sampling.settings import REFUSED, StateSpace, refusal
from planners.sampling.task import Task
from planners.sampling.threaded_solve import EXACT
from planners.search.base import Clock

NAMES = sorted(samplers())
SPACES: tuple[StateSpace, ...] = tuple(space for space in get_args(StateSpace) if space != "r3")
PAIRS = [(name, space) for name, space in product(NAMES, SPACES) if refusal(name, space) is None]
R2 = sorted({name for name, _ in PAIRS})
ANYTIME = ["bitstar", "informedrrtstar", "prmstar", "rrtstar", "sorrtstar"]
CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]
QUICK = ["bkpiece1", "kpiece1", "rrtconnect"]
needs_ompl = pytest.mark.skipif(not NAMES, reason="ompl is not installed")


ROOMS = grid_of(np.where(rooms(), BLOCKED, FREE), resolution=0.25)
FIELD = grid_of(free_field(32, 32))


def problem(space: StateSpace = "r2", **values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {
        "start": (2.0, 2.0, 0.5),
        "goal": (10.0, 9.5, 1.0),
        "footprint": 0.5 if space == "r2" else CAR,
        "clear_start": False,
    }
    return PlanningProblem(ROOMS, **(asked | values))


def short_run(name: str, **options: Any) -> dict[str, Any]:
    """Return settings with which a planner ends soon, and repeatably if it can."""
    if name in THREADED:
        return options | {"improve_for": 0.1}
    return options | {"iterations": 1000 if name in ANYTIME else 20_000}


def plan_route(name: str, space: StateSpace, **options: Any) -> Route:
    return plan(problem(space), name, space=space, **short_run(name, **options))


def python(script: str) -> subprocess.CompletedProcess[str]:
    """Run a script in an interpreter of its own."""
    command = [sys.executable, "-c", script]
    return subprocess.run(command, capture_output=True, text=True, check=False)


SMALL = """
import sys
import numpy as np
from groundmap import ConfidenceGrid
from planners import OWN_PLANNERS, PLANNERS, PlanningProblem, ProblemError, plan
grid = ConfidenceGrid(resolution=0.5)
grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
problem = PlanningProblem(grid, start=(2, 2, 0), goal=(30, 6, 0), footprint=0.9)
"""


def test_our_own_planners_do_not_import_ompl() -> None:
    ran = python(SMALL + 'plan(problem); "jps" in PLANNERS; print("ompl" in sys.modules)')
    assert (ran.stdout, ran.stderr) == ("False\n", "")


def test_without_ompl_there_are_our_own_planners_and_a_hint() -> None:
    ran = python(
        'import sys; sys.modules["ompl"] = None\n'
        + SMALL
        + "print(sorted(PLANNERS) == sorted(OWN_PLANNERS))\n"
        + 'try:\n    plan(problem, "rrtconnect")\nexcept ProblemError as error:\n    print(error)'
    )
    assert ran.stdout.startswith("True\nplanner: expected one of ara, astar, ")
    assert ran.stdout.endswith("got 'rrtconnect'. Sampling planners need OMPL: pip install ompl.\n")


def test_an_unknown_planner_raises_an_error_that_lists_the_planners() -> None:
    with pytest.raises(ProblemError, match=r"one of (aorrtc, )?ara, astar, .*, got 'rrt_connect'"):
        plan(problem(), "rrt_connect")


@needs_ompl
def test_planners_of_ompl_are_listed_beside_our_own() -> None:
    assert {"rrt", "rrtconnect", "rrtstar", "bitstar", "fmt", "prm", "bkpiece1"} <= set(NAMES)
    assert set(PLANNERS) == set(OWN_PLANNERS) | set(NAMES)
    assert len(PLANNERS) == len(OWN_PLANNERS) + len(NAMES)
    for name in R2:
        assert PLANNERS[name].engine(Costmap.of(problem())).name == name


@pytest.mark.parametrize(("name", "space"), PAIRS)
def test_every_planner_finds_a_route_through_the_rooms_in_every_space(
    name: str, space: StateSpace
) -> None:
    route = plan_route(name, space)
    assert route.audit == "clean"
    assert route.planner == name
    assert route.bound is None
    assert 10.9 < route.length < 60.0
    assert route.waypoints[[0, -1]].tolist() == [[2.0, 2.0], [10.0, 9.5]]
    if space != "r2":
        assert route.headings[[0, -1]].tolist() == [0.5, 1.0]
        assert np.hypot(*np.diff(route.waypoints, axis=0).T).max() <= 0.125 + 1e-9


@pytest.mark.parametrize(
    ("name", "space"),
    [(name, s) for name, s in PAIRS if name not in THREADED and (s == "r2" or name in QUICK)],
)
def test_equal_seeds_repeat_the_route_and_other_seeds_do_not(name: str, space: StateSpace) -> None:
    first, again, other = (plan_route(name, space, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(again.waypoints, first.waypoints)
    np.testing.assert_array_equal(again.headings, first.headings)
    assert again.expanded == first.expanded
    assert other.expanded != first.expanded


@needs_ompl
def test_planners_that_run_threads_are_flagged_as_not_repeatable() -> None:
    assert {name for name in PLANNERS if not PLANNERS[name].repeatable} == {"prm", "prmstar"}


@pytest.mark.parametrize("space", ["dubins", "reeds_shepp"])
@needs_ompl
def test_curves_turn_no_tighter_than_the_turning_radius(space: StateSpace) -> None:
    route = plan_route("rrtconnect", space, turning_radius=0.8)
    turns = np.diff(route.headings)
    turns = np.abs(np.remainder(turns + np.pi, 2.0 * np.pi) - np.pi)
    chords = np.hypot(*np.diff(route.waypoints, axis=0).T)
    assert (chords >= 2.0 * 0.8 * np.sin(turns / 2.0) * (1 - 1e-6) - 1e-12).all()


@needs_ompl
def test_the_space_follows_from_the_footprint_and_the_yaws() -> None:
    options = SamplingSettings()
    cart = [(-0.4, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.4, 0.3)]
    for footprint, start, space in [
        (0.5, (2, 2, 0.5), "r2"),
        (cart, (2, 2), "r2"),
        (cart, (2, 2, 0.5), "se2"),
    ]:
        asked = problem(footprint=footprint, start=start)
        assert options.space_for(asked.shape, start, (10, 9.5, 1)) == space
        route = plan(asked, "rrtconnect", **short_run("rrtconnect"))
        dense = np.hypot(*np.diff(route.waypoints, axis=0).T).max() <= 0.125 + 1e-9
        assert dense == (space == "se2")


@needs_ompl
def test_a_car_passes_where_the_disc_around_it_does_not() -> None:
    narrow = rooms()
    narrow[24:27, 8:16] = narrow[24:27, 32:40] = True
    narrow[24:27, 10:15] = False  # 1.25 m, the car is 0.9 m wide, its disc 2.2 m
    grid = grid_of(np.where(narrow, BLOCKED, FREE), resolution=0.25)
    ends: dict[str, Any] = {"start": (2, 2, 0), "goal": (3, 9, 1), "footprint": CAR}
    asked = PlanningProblem(grid, **ends, clear_start=False)
    assert plan(asked, "rrtconnect", iterations=20000).audit == "clean"
    with pytest.raises(EnclosedError, match="no route"):
        plan(asked, "rrtconnect", space="r2", iterations=20000)


@pytest.mark.parametrize(("name", "space"), sorted(REFUSED, key=str))
@needs_ompl
def test_planners_that_crash_or_return_invalid_paths_are_rejected(
    name: str, space: StateSpace | None
) -> None:
    with pytest.raises(ProblemError, match=rf"one that works in .*, got {name}\. .*: take"):
        plan(problem(space or "r2"), name, space=space or "r2")


@needs_ompl
def test_every_status_of_ompl_has_a_message() -> None:
    from ompl import base  # noqa: PLC0415

    statuses = {status.name for status in base.PlannerStatus.PlannerStatusType}
    assert statuses == {EXACT, *REASONS}


@needs_ompl
def test_exceptions_of_ompl_become_a_reason() -> None:
    validator, options, clock = (
        MotionValidator2D(Costmap.of(problem()), "r2", 1.0),
        SamplingSettings(),
        Clock("rrt", 5.0),
    )
    start, goal = validator.state_of((2, 2)), validator.state_of((9, 9))
    task = Task(
        name="rrt",
        validator=validator,
        region=validator.region(start),
        bounds=(9.0, 9.0, 1.0, 1.0),  # lower and upper corner swapped
        start=start,
        goals=[goal],
        objective=Objective(validator, options),
        settings=options,
        clock=clock,
        reporter=ImprovementReporter(clock, None),
        first=[],
        query=((2, 2), (9, 9)),
    )
    assert OmplSearch(task).run().status.startswith("OMPL reports: ")


@needs_ompl
def test_a_path_that_ends_beside_the_goal_is_no_route() -> None:
    with pytest.raises(
        UnsolvedError, match=r"in iterations = 3 \(\d+ edges .* m from the goal"
    ) as caught:
        plan(problem(), "rrt", iterations=3, range=0.5)
    assert caught.value.left is not None
    assert 5.0 < caught.value.left <= math.hypot(8.0, 7.5)
    with pytest.raises(UnsolvedError, match=r"fmt: no route found: .* in iterations = 90"):
        plan(problem(), "fmt", iterations=90)


@pytest.mark.parametrize("name", sorted(set(R2) - set(THREADED)))
@pytest.mark.usefixtures("ticking")
def test_a_time_limit_raises_an_error_and_does_not_crash(name: str) -> None:
    z = free_field(48, 48)
    z[20:28] = BLOCKED
    z[20:28, 22:24] = FREE  # 0.5 m, too narrow to be found in time: the disc is as wide
    grid = grid_of(z, resolution=0.25)
    asked = PlanningProblem(grid, start=(2, 2), goal=(9.5, 10), footprint=0.2499)
    with pytest.raises(TimeLimitError, match=r"no route within time_limit = 0.1 s") as caught:
        plan(asked, name, time_limit=0.1)
    assert caught.value.expanded > 0
    if name == "rrt":
        assert caught.value.left is not None


@pytest.mark.parametrize("name", R2)
def test_a_time_limit_of_zero_gives_no_route(name: str) -> None:
    with pytest.raises(TimeLimitError, match=r"no route within time_limit = 0 s \(0 nodes"):
        plan(problem(), name, time_limit=0)


@pytest.mark.parametrize(("name", "space"), PAIRS)
def test_a_start_at_the_goal_gives_a_route_of_zero_length(name: str, space: StateSpace) -> None:
    route = plan(problem(space, goal=(2.0, 2.0, 0.5)), name, space=space)
    assert route.length == 0.0
    assert route.waypoints.tolist() == [[2.0, 2.0]] * 2


@needs_ompl
def test_a_continuous_wall_encloses_without_a_search() -> None:
    z = free_field(48, 48)
    z[30] = BLOCKED
    for space in SPACES:
        asked = PlanningProblem(
            grid_of(z, resolution=0.25), start=(3, 3, 0), goal=(3, 10, 0), footprint=0.3
        )
        with pytest.raises(EnclosedError, match="enclosed"):
            plan(asked, "rrtconnect", space=space, time_limit=None)


@pytest.mark.parametrize("name", sorted(set(R2) - COST_AWARE))
def test_planners_without_cost_support_are_rejected_on_costs(name: str) -> None:
    asked = problem(costs=CostSettings(clearance_weight=1.0))
    with pytest.raises(ProblemError, match=r"supports costs and times in .* these: bfmt, bi"):
        plan(asked, name)


@pytest.mark.parametrize("name", sorted(COST_AWARE))
@needs_ompl
def test_costs_increase_the_clearance(name: str) -> None:
    asked = problem(costs=CostSettings(clearance_weight=3.0))
    route = plan(asked, name, **short_run(name))
    assert route.cost > route.length
    assert route.mean_clearance > plan(problem(), name, **short_run(name)).mean_clearance


@needs_ompl
def test_curved_spaces_need_yaws() -> None:
    asked = problem(start=(2.0, 2.0))
    with pytest.raises(
        ProblemError, match=r"start: expected x, y \[m\] and yaw \[rad\] for rrt, got"
    ):
        plan(asked, "rrt", space="dubins")


@needs_ompl
def test_every_parameter_belongs_to_a_planner_and_the_others_reject_it() -> None:
    from ompl import geometric  # noqa: PLC0415

    for name in PARAMETERS:
        assert any(hasattr(getattr(geometric, c), setter_of(name)) for c in samplers().values())
    with pytest.raises(SettingsError, match="goal_bias: expected a parameter that 'bitstar' has"):
        plan(problem(), "bitstar", goal_bias=0.1)
    with pytest.raises(SettingsError, match=r"goal_bias: expected .*less than or equal to 1"):
        plan(problem(), "rrt", goal_bias=2)
    with pytest.raises(SettingsError, match="iterations: expected none for 'prm', got a count"):
        plan(problem(), "prm", iterations=100)


@needs_ompl
def test_parameters_are_passed_to_the_planner() -> None:
    short, long = (plan_route("rrt", "r2", range=step, simplify=False) for step in (0.5, 5.0))
    assert np.hypot(*np.diff(short.waypoints, axis=0).T).max() <= 0.5 + 1e-9
    assert len(short.waypoints) > len(long.waypoints)


@pytest.mark.parametrize("space", SPACES)
@needs_ompl
def test_simplification_never_lengthens(space: StateSpace) -> None:
    for seed in range(5):
        lengths = [
            plan_route("rrt", space, seed=seed, simplify=simplify).length
            for simplify in (False, True)
        ]
        assert lengths[1] <= lengths[0] + 1e-9


@pytest.mark.parametrize("name", ["rrtstar", "prmstar"])
@needs_ompl
def test_a_search_can_be_interrupted(name: str) -> None:
    timer = threading.Timer(0.3, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt, match=r"^$"):
        plan(problem(), name, improve_for=20)
    timer.join()
    assert plan_route(name, "r2").audit == "clean"


@needs_ompl
def test_searches_in_threads_return_the_same_routes() -> None:
    pairs = [((2, 2), (9, y)) for y in (2.0, 3.0, 8.0, 9.0)]
    alone = plan_many(problem(), pairs, "rrtconnect", threads=1, iterations=4000)
    many = plan_many(problem(), pairs, "rrtconnect", threads=4, iterations=4000)
    for route, expected in zip(many, alone, strict=True):
        assert isinstance(route, Route)
        assert isinstance(expected, Route)
        np.testing.assert_array_equal(route.waypoints, expected.waypoints)


@needs_ompl
def test_nothing_is_printed_and_nothing_leaks_at_exit() -> None:
    names = [name for name in R2 if refusal(name, "se2") is None]
    script = f"for name in {names}: plan(problem, name, space='se2', improve_for=0.02)"
    ran = python(SMALL + script)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


@needs_ompl
def test_messages_of_ompl_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, logger="planners.sampling"):
        plan_route("rrtconnect", "r2")
    assert any("Starting planning" in record.getMessage() for record in caplog.records)


MANY = """
import ctypes
import gc
from pathlib import Path

def resident() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

names, marks = {names}, []
for i in range(160):
    name, space = names[i % len(names)], ("r2", "se2")[i % 2]
    try:
        plan(problem, name, space=space, seed=i, improve_for=0.02, keep_graph=name != "bitstar")
    except ProblemError:
        pass
    if i in (49, 159):
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)
        marks.append(resident())
print(marks[1] - marks[0] < 5.0, marks)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="Linux tells how much is used")
@pytest.mark.parametrize("names", [sorted(set(R2) - set(THREADED)), list(THREADED)])
@needs_ompl
def test_many_plans_take_no_more_memory_than_some(names: list[str]) -> None:
    ran = python(SMALL + MANY.format(names=names))
    assert ran.stdout.startswith("True"), ran.stdout
    assert ran.stderr == ""
