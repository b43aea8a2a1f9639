"""Progress of sampling planners: reported improvements, cancellation and warm starts."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
import pytest

from oracles_planning import BLOCKED, FREE, free_field, grid_of, rooms
from planners import CancelledError, Improvement, PlanningProblem, ProblemError, Route, plan
from planners.costmap.costmap import Costmap
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_lock import hold_ompl
from planners.sampling.ompl_module import samplers
from planners.sampling.ompl_search import THREADED
from planners.sampling.settings import refusal
from planners.sampling.state_sampler import StateSampler
from planners.sampling.warm_start import informed_region
from planners.search.base import Clock

needs_ompl = pytest.mark.skipif(not samplers(), reason="ompl is not installed")
pytestmark = needs_ompl
R2 = sorted(name for name in samplers() if refusal(name, "r2") is None)
ANYTIME = ["bitstar", "informedrrtstar", "prmstar", "rrtstar", "sorrtstar"]
CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]


ROOMS = grid_of(np.where(rooms(), BLOCKED, FREE), resolution=0.25)


def problem(**values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {"start": (2.0, 2.0, 0.5), "goal": (10.0, 9.5, 1.0), "footprint": 0.5}
    return PlanningProblem(ROOMS, **(asked | values), clear_start=False)


def needle() -> PlanningProblem:
    """Return a problem that random samples do not solve: its door is as wide as the disc."""
    z = free_field(48, 48)
    z[20:28] = BLOCKED
    z[20:28, 22:25] = FREE
    ends: dict[str, Any] = {"start": (2, 2), "goal": (9.5, 10), "footprint": 0.3749}
    return PlanningProblem(grid_of(z, resolution=0.25), **ends, clear_start=False)


def plan_and_record(name: str, **settings: Any) -> tuple[Route, list[Improvement]]:
    improvements: list[Improvement] = []
    limits: dict[str, Any] = {"improve_for": 0.3} if name in THREADED else {"iterations": 3000}
    route = plan(problem(), name, on_improved=improvements.append, **(limits | settings))
    return route, improvements


@pytest.mark.parametrize("name", R2)
def test_improvements_are_reported_and_the_last_is_the_route(name: str) -> None:
    route, improvements = plan_and_record(name, seed=1)
    costs = [better.cost for better in improvements]
    seconds = [better.seconds for better in improvements]
    assert costs == sorted(costs, reverse=True)
    assert seconds == sorted(seconds)
    assert costs[-1] == pytest.approx(route.cost, rel=1e-6)
    np.testing.assert_array_equal(improvements[-1].waypoints, route.waypoints)
    assert all(better.bound == math.inf for better in improvements)


@pytest.mark.parametrize("name", sorted(set(ANYTIME) - set(THREADED)))
def test_anytime_planners_improve_their_route(name: str) -> None:
    _, improvements = plan_and_record(name, simplify=False)
    assert len(improvements) > 2
    assert improvements[-1].cost < improvements[0].cost


class CancelPolls:
    """Counts how often a search polls for cancellation; it is never cancelled."""

    count = 0

    def is_set(self) -> bool:
        self.count += 1
        return False


@pytest.mark.parametrize("name", ANYTIME)
def test_a_callback_that_returns_true_ends_the_search(name: str) -> None:
    polls = CancelPolls()

    def stop(better: Improvement) -> bool:
        polls.count = 0
        return True

    asked: dict[str, Any] = {"improve_for": 60, "time_limit": None, "seed": 2}
    route = plan(problem(), name, on_improved=stop, cancel=polls, **asked)
    assert route.audit == "clean"
    assert polls.count < 1000  # in 60 s there are many thousands


@pytest.mark.parametrize("name", ["rrtstar", "bitstar"])
def test_an_error_of_the_callback_is_raised(name: str) -> None:
    def fail(better: Improvement) -> None:
        raise ValueError(f"cost {better.cost > 0}")

    with pytest.raises(ValueError, match=r"^cost True$"):
        plan(problem(), name, on_improved=fail)
    assert plan(problem(), name, improve_for=0).audit == "clean"


@pytest.mark.parametrize("name", R2)
def test_a_search_is_cancelled_from_another_thread(name: str) -> None:
    cancel = threading.Event()
    timer = threading.Timer(0.3, cancel.set)
    timer.start()
    message = rf"^{name}: cancelled after \d\.\d\d s, before .* \(\d+ edges checked\)\.$"
    with pytest.raises(CancelledError, match=message):
        plan(needle(), name, cancel=cancel, time_limit=None)
    timer.join()


@pytest.mark.parametrize("name", ANYTIME)
def test_a_cancelled_search_returns_its_best_route(name: str) -> None:
    cancel = threading.Event()

    def stop_soon(better: Improvement) -> None:
        cancel.set()

    route = plan(problem(), name, cancel=cancel, on_improved=stop_soon, improve_for=60)
    assert route.audit == "clean"


def test_a_search_that_waits_for_another_can_be_cancelled() -> None:
    cancel, entered = threading.Event(), threading.Event()

    def first() -> None:
        plan(
            problem(), "rrtstar", improve_for=60, cancel=cancel, on_improved=lambda _: entered.set()
        )

    other = threading.Thread(target=first)
    other.start()
    entered.wait()
    cancelled = threading.Event()
    cancelled.set()
    with pytest.raises(CancelledError, match="cancelled after"):
        plan(problem(), "rrt", cancel=cancelled)
    threading.Timer(0.3, cancel.set).start()
    clock = Clock("rrt", None)
    made = clock.began
    with hold_ompl(clock):
        assert clock.began > made  # waiting doesn't count
    other.join()


def test_planners_without_progress_reject_callback_and_cancel() -> None:
    with pytest.raises(
        ProblemError, match="on_improved: expected no such option, or an anytime planner: 'ara"
    ):
        plan(problem(), "jps", on_improved=lambda _: None)
    with pytest.raises(
        ProblemError, match="cancel: expected no such option, or an anytime planner"
    ):
        plan(problem(), "astar", cancel=threading.Event())
    with pytest.raises(ProblemError, match=r"cancel: expected a threading\.Event, got 3"):
        plan(problem(), "rrt", cancel=3)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="on_improved: expected a callable, got 3"):
        plan(problem(), "rrt", on_improved=3)  # type: ignore[arg-type]


def test_ara_reports_improvements_and_can_be_cancelled() -> None:
    improvements: list[Improvement] = []
    route = plan(problem(), "ara", on_improved=improvements.append)
    assert improvements[-1].cost == route.cost
    cancelled = threading.Event()
    cancelled.set()
    with pytest.raises(CancelledError, match="ara: cancelled after"):
        plan(problem(), "ara", cancel=cancelled)


@pytest.mark.parametrize("space", ["r2", "se2", "reeds_shepp"])
@pytest.mark.parametrize("name", ["rrtconnect", "bitstar", "prm", "informedrrtstar"])
def test_a_warm_start_never_returns_a_costlier_route_than_its_first(name: str, space: str) -> None:
    wide = grid_of(np.where(rooms(door=12), BLOCKED, FREE), resolution=0.25)
    ends: dict[str, Any] = {"start": (2.0, 2.0, 0.5), "goal": (10.0, 9.5, 1.0)}
    asked = PlanningProblem(wide, **ends, footprint=0.5 if space == "r2" else CAR)
    improvements: list[Improvement] = []
    limits: dict[str, Any] = {"improve_for": 0.2} if name == "prm" else {"iterations": 800}
    route = plan(
        asked, name, space=space, warm_start=True, on_improved=improvements.append, **limits
    )
    assert route.audit == "clean"
    assert route.cost <= improvements[0].cost
    assert len(improvements[0].waypoints) > 1
    if space == "r2":
        assert (
            improvements[0].cost <= plan(asked, "astar").cost + 1e-9
        )  # the first route is simplified


def test_a_warm_start_solves_a_problem_that_random_samples_do_not() -> None:
    assert plan(needle(), "rrtconnect", warm_start=True, iterations=200).audit == "clean"


def test_a_warm_start_without_a_first_route_searches_without_one() -> None:
    narrow = rooms()
    narrow[24:27, 8:16] = narrow[24:27, 32:40] = True
    narrow[24:27, 10:15] = False  # 1.25 m, the car is 0.9 m wide, its disc 2.2 m
    grid = grid_of(np.where(narrow, BLOCKED, FREE), resolution=0.25)
    ends: dict[str, Any] = {"start": (2, 2, 0), "goal": (3, 9, 1), "footprint": CAR}
    asked = PlanningProblem(grid, **ends, clear_start=False)
    route = plan(asked, "rrtconnect", warm_start=True, iterations=20000)
    assert route.audit == "clean"


def test_the_informed_region_contains_all_shorter_lines() -> None:
    rng = np.random.default_rng(5)
    start, goal, max_length = (2.3, 4.1), (8.2, 7.7), 8.5
    region = informed_region(np.ones((24, 24), dtype=np.bool_), 0.5, start, [goal], max_length)
    places = rng.uniform(0, 12, (4000, 2))
    detour = [math.dist(start, place) + math.dist(place, goal) for place in places]
    inside = region[tuple((places // 0.5).astype(int).T[::-1])]
    assert inside[np.array(detour) <= max_length].all()
    assert not inside.all()


@pytest.mark.parametrize("space", ["r2", "se2"])
def test_samples_are_clear_and_cover_narrow_passages(space: Any) -> None:
    z = np.full((64, 64), BLOCKED, dtype=np.float32)
    z[4:14, 4:60] = z[50:60, 4:60] = FREE
    z[14:50, 30:33] = FREE  # 0.75 m wide
    grid = grid_of(z, resolution=0.25)
    footprint = 0.3 if space == "r2" else [(-0.3, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.3, 0.3)]
    asked = PlanningProblem(grid, start=(3, 2, 0), goal=(12, 13, 0), footprint=footprint)
    validator = MotionValidator2D(Costmap.of(asked), space, 1.0)
    start = validator.state_of((3, 2, 0))
    sampler = StateSampler(validator, validator.region(start), seed=0, first=[start])
    assert sampler.sample() == start
    states = [state for state in (sampler.sample() for _ in range(2000)) if state is not None]
    assert len(states) == 2000
    assert all(validator.is_clear(*state, *state) for state in states)
    rows = np.array(states)[:, 1] / 0.25 - validator.state_of((0, 0, 0))[1] / 0.25
    assert ((rows > 14) & (rows < 50)).sum() > 0
    near = [sampler.sample_near(start, 0.2) for _ in range(50)]
    assert all(s is not None and math.dist(s[:2], start[:2]) <= 0.2 * math.sqrt(2) for s in near)
