"""Many queries on one map: what `plan` says of each, whatever the number of threads."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of
from planners import (
    AuditError,
    CostSettings,
    EnclosedError,
    NoRouteError,
    OutsideMapError,
    PlanningProblem,
    ProblemError,
    Route,
    TimeLimitError,
    UnknownSpaceError,
    plan,
)
from planners.batch_planning import plan_many
from planners.costmap.costmap import Costmap
from planners.problem.problem import Pose
from planners.registry import OWN_PLANNERS, PLANNERS, Planner
from planners.search.astar import AStar, AStarSettings
from planners.search.base import SearchResult, SearchSettings
from planners.search.jps import JPSPlus
from planners.search.polyanya import Polyanya

SIDE = 40


def problem_of(seed: int, **values: Any) -> PlanningProblem:
    """Return a problem on a field of obstacles with unknown patches and a wall across."""
    rng = np.random.default_rng(seed)
    z = free_field(SIDE, SIDE)
    z[rng.random((SIDE, SIDE)) < 0.08] = BLOCKED
    z[20] = BLOCKED
    z[20, 30:33] = FREE
    z[25:38, 5] = z[25:38, 17] = z[25, 5:18] = z[37, 5:18] = BLOCKED
    for row, col in rng.integers(0, SIDE - 6, (3, 2)).tolist():
        z[row : row + 6, col : col + 6] = UNSEEN
    asked: dict[str, Any] = {"start": (6.2, 6.7), "goal": (30, 30), "footprint": 0.5}
    return PlanningProblem(grid_of(z), **(asked | values))


def pairs_of(seed: int, count: int = 12) -> Floats:
    """Return starts and goals on the map and a little beyond it."""
    pairs: Floats = np.random.default_rng(seed).uniform(-2, SIDE + 2, (count, 2, 2))
    return pairs


def one_by_one(
    problem: PlanningProblem, pairs: Floats, planner: str = "astar"
) -> list[Route | NoRouteError]:
    answers: list[Route | NoRouteError] = []
    for start, goal in pairs:
        asked = replace(problem, start=start, goal=goal, cleared_at=problem.clear_place)
        try:
            answers.append(plan(asked, planner))
        except NoRouteError as error:
            answers.append(error)
    return answers


def outcome_of(answer: Route | NoRouteError) -> dict[str, Any]:
    """Return the content of an answer except its duration."""
    if isinstance(answer, NoRouteError):
        return {"error": type(answer), "message": str(answer)}
    values = {field.name: getattr(answer, field.name) for field in fields(answer)}
    arrays = {name: values[name].tolist() for name in ("waypoints", "headings")}
    return values | arrays | {"seconds": None}


@given(
    st.integers(0, 1000),
    st.booleans(),
    st.sampled_from([CostSettings(), CostSettings(clearance_weight=3)]),
    st.integers(1, 4),
)
@settings(max_examples=8)
def test_answers_are_those_of_plan_whatever_the_threads(
    seed: int, clear_start: bool, costs: CostSettings, threads: int
) -> None:
    problem = problem_of(seed, clear_start=clear_start, costs=costs)
    pairs = pairs_of(seed)
    answers = plan_many(problem, pairs, "astar", threads=threads)
    assert [outcome_of(answer) for answer in answers] == [
        outcome_of(answer) for answer in one_by_one(problem, pairs)
    ]


@pytest.mark.parametrize("planner", sorted(OWN_PLANNERS.keys() - {"astar3d", "hybrid_astar"}))
def test_every_planner_answers_as_for_single_queries(planner: str) -> None:
    problem, pairs = problem_of(7, clear_start=False), pairs_of(7, count=6)
    many = plan_many(problem, pairs, planner, threads=2)
    for got, expected in zip(many, one_by_one(problem, pairs, planner), strict=True):
        assert type(got) is type(expected)
        if isinstance(got, Route) and isinstance(expected, Route):
            assert got.cost == pytest.approx(expected.cost)
            assert got.audit == "clean"


def test_each_failure_is_its_exception_in_its_place() -> None:
    problem = problem_of(1, clear_start=False)
    pairs = [((2, 2), (90, 2)), ((30.5, 30.5), (11, 31)), ((6, 6), (6, 6))]
    outside, enclosed, here = plan_many(problem, pairs, "astar")
    assert isinstance(outside, OutsideMapError)
    assert isinstance(enclosed, EnclosedError)
    assert enclosed.__traceback__ is None
    assert isinstance(here, Route)
    assert here.length == 0.0
    late = plan_many(problem, pairs[1:], "astar", time_limit=0)
    assert [type(answer) for answer in late] == [TimeLimitError, TimeLimitError]


def test_unknown_cells_are_cleared_at_the_problems_start_and_nowhere_else() -> None:
    z = free_field(32, 32)
    z[5:8, 4:7] = z[20:23, 20:23] = UNSEEN
    problem = PlanningProblem(
        grid_of(z), start=(5.5, 6.5), goal=(28, 28), footprint=1, clear_start_radius=3
    )
    through, from_elsewhere, at_start = plan_many(
        problem,
        [((2, 6.5), (12, 6.5)), ((21.5, 21.5), (28, 28)), ((5.5, 6.5), (28.5, 6.5))],
        "astar",
    )
    assert isinstance(through, Route)
    assert through.length == pytest.approx(10.0)
    assert through.start_unknown_area > 0
    assert isinstance(from_elsewhere, UnknownSpaceError)
    assert str(from_elsewhere).startswith("start (21.50, 21.50): ")
    assert isinstance(at_start, Route)


def test_a_requested_yaw_is_the_last_heading() -> None:
    (route,) = plan_many(problem_of(2), [((6, 6, 0.0), (12, 6, 1.5))], "astar")
    assert isinstance(route, Route)
    assert route.headings[-1] == 1.5


def test_no_pairs_no_answers() -> None:
    assert plan_many(problem_of(0), [], "astar") == []


@pytest.mark.parametrize(
    ("pair", "sentence"),
    [
        (((1, 2), (3, np.nan)), r"pairs\[1\], goal: expected x, y \[m\] .*, got \(3, nan\)"),
        (((1,), (3, 4)), r"pairs\[1\], start: expected x, y \[m\]"),
        (((1, 2),), r"pairs\[1\]: expected a start and a goal, got \(\(1, 2\),\)"),
        (7, r"pairs\[1\]: expected a start and a goal, got 7"),
    ],
)
def test_a_malformed_pair_is_refused_by_its_number(pair: Any, sentence: str) -> None:
    with pytest.raises(ProblemError, match=sentence):
        plan_many(problem_of(0), [((6, 6), (9, 9)), pair], "astar")


def test_errors_that_concern_all_queries_are_raised() -> None:
    with pytest.raises(
        ProblemError, match=r"planner: expected one of (aorrtc, )?ara, astar, .* got 'astral'"
    ):
        plan_many(problem_of(0), [], "astral")
    with pytest.raises(SettingsError, match="Did you mean 'time_limit'"):
        plan_many(problem_of(0), [], "astar", time_limt=3)
    for threads in (0, 1.5):
        with pytest.raises(ProblemError, match=f"threads: expected a whole number .*got {threads}"):
            plan_many(problem_of(0), [], "astar", threads=threads)  # type: ignore[arg-type]
    solid = PlanningProblem(
        ConfidenceGrid(origin=(0, 0, 0)), start=(0, 0, 0), goal=(1, 1, 1), footprint=1
    )
    with pytest.raises(ProblemError, match="grid: expected a 2-D map, got a 3-D map"):
        plan_many(solid, [], "astar")


class Straight:
    """A planner that ignores obstacles and counts its instances."""

    name = "straight"
    made: list[str]

    def __init__(self, costmap: Costmap) -> None:
        self.costmap = costmap
        self.made.append("built")

    def twin(self) -> Straight:
        twin = object.__new__(type(self))
        self.made.append("twin")
        return twin

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        return SearchResult(np.array([start[:2], goal[:2]]), 0)


def test_routes_are_audited_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    Straight.made = []
    monkeypatch.setitem(PLANNERS, "straight", Planner(Straight, SearchSettings))
    problem = PlanningProblem(
        grid_of([[FREE] * 9, [BLOCKED] * 9, [FREE] * 9]),
        start=(0.5, 0.5),
        goal=(0.5, 2.5),
        footprint=0,
        clear_start=False,
    )
    pairs = [((col + 0.5, 0.5), (col + 0.5, 2.5)) for col in range(9)]
    for route in plan_many(problem, pairs, "straight", threads=3, audit=False):
        assert isinstance(route, Route)
        assert route.audit == "skipped"
    assert Straight.made == ["built", "twin", "twin"]
    with pytest.raises(AuditError, match="too close to a non-free cell"):
        plan_many(problem, pairs, "straight", threads=3)


def test_an_engine_without_twins_is_built_for_each_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    built = []

    class Counted(AStar):
        def __init__(self, costmap: Costmap) -> None:
            super().__init__(costmap)
            built.append(costmap)

    monkeypatch.setitem(PLANNERS, "counted", Planner(Counted, AStarSettings))
    plan_many(problem_of(3), pairs_of(3, count=2), "counted", threads=8)
    assert len(built) == 2  # not more than there are queries
    assert built[0] is built[1]


@pytest.mark.parametrize(("planner", "shared"), [(JPSPlus, "jumps"), (Polyanya, "mesh")])
def test_tables_of_a_map_are_shared_between_engines(planner: type[Any], shared: str) -> None:
    first = planner(Costmap.of(problem_of(0)))
    twin = first.twin()
    assert getattr(twin, shared) is getattr(first, shared)
    start, goal = (6.0, 6.0), (9.0, 9.0)
    asked = [engine.search(start, goal, SearchSettings()) for engine in (first, twin)]
    np.testing.assert_array_equal(asked[0].waypoints, asked[1].waypoints)


def test_a_pair_without_yaws_is_named_where_they_are_needed() -> None:
    pairs = [((6, 6, 0), (9, 9, 0)), ((6, 6), (9, 9))]
    with pytest.raises(ProblemError, match=r"pairs\[1\]: expected a start and a goal with yaws"):
        plan_many(problem_of(0), pairs, "hybrid_astar")
