"""Time to validate a motion: one compiled call per motion against a Python lambda per state.

OMPL calls both. The lambda is the usual state validity checker; OMPL calls it at states one cell
apart along a motion, which misses corners that are cut between two states. The compiled check is
exact.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import count, pairwise
from typing import Any, NamedTuple

import numpy as np

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools, Floats
from planners.costmap.costmap import Costmap
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem, Pose
from planners.sampling.motion_validator import Bounds
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_module import ompl, redirect_log
from planners.sampling.ompl_states import edge_check, information_of, reader, space_of, state_of
from planners.sampling.settings import SamplingSettings, StateSpace

POINTS = 40  # points on an outline that the lambda checks
MAX_EDGES = 5000  # edges of a search that are recorded and checked again
STEP = 0.999  # [cells] between states; below 1, so that rounding does not exceed one cell
CLOCK_INTERVAL = 64  # calls of the termination condition between two readings of the clock
EXACT = "EXACT_SOLUTION"
COMPILED, LAMBDA, REACH = "compiled", "lambda", "compiled, own range"


class MotionQuery(NamedTuple):
    """Start, goal, and the bounds that OMPL samples in."""

    validator: MotionValidator2D
    start: Pose  #: state of the validator
    goal: Pose  #: state of the validator
    room: Bounds


class Search(NamedTuple):
    """Duration and success of a search."""

    seconds: float
    solved: bool


def compare_motions(
    grid: ConfidenceGrid,
    *,
    footprint: Any,
    queries: Sequence[tuple[Pose, Pose]],
    seeds: int,
    time_limit: float = 10.0,
) -> list[dict[str, Any]]:
    """Return figures of both checks, over all queries and seeds.

    The space is "r2" for a radius and "se2" for an outline. Rows of the workload "motions" repeat
    the checks of the edges that RRT-Connect needed. Rows of "first route" are searches of
    RRT-Connect, with OMPL's default range and, in the last row, that of
    `MotionValidator.max_edge_length`.

    Parameters
    ----------
    grid : ConfidenceGrid
    footprint : float or array_like, shape (n, 2) [m, base_link]
    queries : sequence of (start, goal)
        x, y [m, map] and, for an outline, yaw [rad]. Queries without a route are left out.
    seeds : int
    time_limit : float [s]
        Time limit of a search.

    Returns
    -------
    list of dict
        ``workload``, ``system``, ``median_ms`` and ``p95_ms`` of a search or of the edges of one
        search, ``ratio`` (speed-up over the lambda), ``motions_per_s``, ``agree`` (share of edges
        with equal results) and ``solved`` (share of searches with a route). Times are CPU times.

    Raises
    ------
    ProblemError
        No query can have a route.
    """
    solvable = _solvable_queries(grid, footprint, queries)
    runs = [(query, seed) for query in solvable for seed in range(seeds)]
    with redirect_log():
        lists = [_edges_of(query, seed, time_limit) for query, seed in runs]
        motions = {
            system: [
                _time_checks(query, system, edges)
                for (query, _), edges in zip(runs, lists, strict=True)
            ]
            for system in (LAMBDA, COMPILED)
        }
        routes = {
            system: [_first_route(query, system, seed, time_limit) for query, seed in runs]
            for system in (LAMBDA, COMPILED, REACH)
        }
    space = solvable[0].validator.space
    return [*_motion_rows(space, motions), *_route_rows(space, routes)]


def _motion_rows(space: StateSpace, motions: dict[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """Yield a row per check."""
    answers = {name: np.concatenate([valid for _, valid in runs]) for name, runs in motions.items()}
    agree = float(np.mean(answers[LAMBDA] == answers[COMPILED]))
    total = {name: sum(seconds for seconds, _ in runs) for name, runs in motions.items()}
    for name, runs in motions.items():
        yield {
            "workload": f"motions, {space}",
            "system": name,
            **_percentiles([seconds for seconds, _ in runs]),
            "ratio": total[LAMBDA] / total[name],
            "motions_per_s": len(answers[name]) / total[name],
            "agree": agree,
            "solved": None,
        }


def _route_rows(space: StateSpace, routes: dict[str, list[Search]]) -> Iterator[dict[str, Any]]:
    """Yield a row per check and range."""
    times = {name: [search.seconds for search in searches] for name, searches in routes.items()}
    for name, searches in routes.items():
        yield {
            "workload": f"first route, {space}",
            "system": name,
            **_percentiles(times[name]),
            "ratio": float(np.median(times[LAMBDA]) / np.median(times[name])),
            "motions_per_s": None,
            "agree": None,
            "solved": float(np.mean([search.solved for search in searches])),
        }


def _percentiles(seconds: list[float]) -> dict[str, float]:
    median, high = 1e3 * np.percentile(seconds, [50, 95])
    return {"median_ms": float(median), "p95_ms": float(high)}


def _solvable_queries(
    grid: ConfidenceGrid, footprint: Any, queries: Sequence[Any]
) -> list[MotionQuery]:
    """Return the queries that can have a route."""
    solvable, validator = [], None
    for start, goal in queries:
        if validator is None:
            problem = PlanningProblem(
                grid, start=start, goal=goal, footprint=footprint, clear_start=False
            )
            validator = MotionValidator2D(
                Costmap.of(problem), "r2" if problem.shape.is_disc else "se2", 1.0
            )
        ends = validator.state_of(start), validator.state_of(goal)
        if all(validator.is_clear(*end, *end) for end in ends):
            room = validator.bounds(*ends)
            if room is not None:
                solvable.append(MotionQuery(validator, *ends, room))
    if not solvable:
        raise ProblemError("queries", "one that can have a route", "none")
    return solvable


def _information(
    query: MotionQuery, system: str, edges: list[tuple[Pose, Pose]] | None = None
) -> Any:
    """Return OMPL's space information with one of the checks, which records its `edges`."""
    base, validator = ompl().base, query.validator
    space = space_of(base, validator.space, query.room, SamplingSettings())
    if system == LAMBDA:
        information = base.SpaceInformation(space)
        information.setStateValidityChecker(lambda_of(validator))
        _set_steps(space, validator)
        information.setup()
        return information
    check = edge_check(validator, count(1), lambda: None)
    if edges is not None:
        check = _record_edges(check, reader(validator.space), edges)
    return information_of(base, space, check)


def _record_edges(check: Callable[..., bool], read: Any, edges: list[Any]) -> Callable[..., bool]:
    """Return a check that also appends the first edges to a list."""

    def record(ompl_validator: Any, a: Any, b: Any, _: Any = None) -> bool:
        if len(edges) < MAX_EDGES:
            edges.append((read(a), read(b)))
        return check(ompl_validator, a, b)

    return record


def _set_steps(space: Any, validator: MotionValidator2D) -> None:
    """Set OMPL's steps: no point of the footprint moves by more than about one cell."""
    size = validator.costmap.window.resolution
    plane = space if validator.space == "r2" else space.getSubspace(0)
    plane.setLongestValidSegmentFraction(STEP * size / plane.getMaximumExtent())
    if validator.space != "r2":
        turn = STEP * size / validator.costmap.problem.shape.radius
        yaw = space.getSubspace(1)
        yaw.setLongestValidSegmentFraction(min(turn / yaw.getMaximumExtent(), 1.0))


def lambda_of(validator: MotionValidator2D) -> Callable[[Any], bool]:
    """Return a state validity checker in Python.

    In "r2" a state is valid if its cell is traversable. In "se2" it is valid if none of the cells
    under points on the outline is blocked.
    """
    size = validator.costmap.window.resolution
    if validator.space == "r2":
        blocked = ~validator.costmap.traversable
        return lambda state: not blocked[int(state[1] / size), int(state[0] / size)]
    points = _outline(validator) / size
    across, along = points.T
    margin = math.ceil(float(np.hypot(across, along).max())) + 1  # the outline can leave the map
    padded: Bools = np.pad(validator.costmap.blocked, margin, constant_values=True)

    def is_valid(state: Any) -> bool:
        cosine, sine = math.cos(state.getYaw()), math.sin(state.getYaw())
        cols = cosine * across - sine * along + (state.getX() / size + margin)
        rows = sine * across + cosine * along + (state.getY() / size + margin)
        return not padded[rows.astype(int), cols.astype(int)].any()

    return is_valid


def _outline(validator: MotionValidator2D) -> Floats:
    """Return about 40 points on the outline, evenly spaced on each side [m, base_link]."""
    corners = np.asarray(validator.costmap.problem.shape.polygon)
    closed = np.concatenate([corners, corners[:1]])
    spacing = np.hypot(*np.diff(closed, axis=0).T).sum() / POINTS
    sides = []
    for a, b in pairwise(closed):
        pieces = max(round(math.dist(a, b) / spacing), 1)
        sides.append(a + np.arange(pieces)[:, None] / pieces * (b - a))
    return np.concatenate(sides)


def _search(
    query: MotionQuery, information: Any, *, seed: int, longest: float, limit: float
) -> Search:
    """Search with RRT-Connect; `longest` is the maximum length of an edge [m], 0 for OMPL's."""
    modules, kind = ompl(), query.validator.space
    modules.util.RNG.setSeed(seed + 1)  # 0 is refused
    space = information.getStateSpace()
    task = modules.base.ProblemDefinition(information)
    task.setStartAndGoalStates(*(state_of(space, e, kind) for e in (query.start, query.goal)))
    planner = modules.geometric.RRTConnect(information)
    planner.setRange(longest)
    planner.setProblemDefinition(task)
    planner.setup()
    calls, deadline = count(1), time.thread_time() + limit

    def stop() -> bool:
        return not next(calls) % CLOCK_INTERVAL and time.thread_time() >= deadline

    began = time.thread_time()
    status = planner.solve(modules.base.PlannerTerminationCondition(stop))
    seconds = time.thread_time() - began
    return Search(seconds, status.getStatus().name == EXACT)


def _edges_of(query: MotionQuery, seed: int, limit: float) -> list[tuple[Pose, Pose]]:
    """Return the first edges that a search checks, at most `MAX_EDGES`."""
    edges: list[tuple[Pose, Pose]] = []
    _search(query, _information(query, COMPILED, edges), seed=seed, longest=0.0, limit=limit)
    return edges


def _first_route(query: MotionQuery, system: str, seed: int, limit: float) -> Search:
    """Search for a first route with one of the checks."""
    validator = query.validator
    region = validator.region(query.start)
    longest = validator.max_edge_length(region, query.room) if system == REACH else 0.0
    return _search(query, _information(query, system), seed=seed, longest=longest, limit=limit)


def _time_checks(
    query: MotionQuery, system: str, edges: Sequence[tuple[Pose, Pose]]
) -> tuple[float, Bools]:
    """Return the time to check edges through OMPL [s], and the result of each check."""
    information, kind = _information(query, system), query.validator.space
    space = information.getStateSpace()
    pairs = [(state_of(space, a, kind), state_of(space, b, kind)) for a, b in edges]
    check = information.checkMotion
    began = time.thread_time()
    answers = [check(a, b) for a, b in pairs]
    return time.thread_time() - began, np.array(answers)
