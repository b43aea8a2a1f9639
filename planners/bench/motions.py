"""What it takes to check a motion: compiled, all of it at once, against a Python lambda per state.

Both are asked through OMPL. The lambda is what one writes first, and OMPL asks it as it comes: from
cell to cell along the motion. That misses corners which are cut between two cells; the compiled
check misses nothing.
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

POINTS = 40  # on an outline, that the lambda looks at
MOST = 5000  # edges of a search that are asked again
STEP = 0.999  # [cells] from state to state, so that rounding makes it no more than one
GLANCE = 64  # questions whether to stop between two looks at the clock
EXACT = "EXACT_SOLUTION"
COMPILED, LAMBDA, REACH = "compiled", "lambda", "compiled, own range"


class MotionQuery(NamedTuple):
    """Where from, where to, and what OMPL samples."""

    validator: MotionValidator2D
    start: Pose  #: as a state
    goal: Pose
    room: Bounds


class Search(NamedTuple):
    """How long a search took, and whether it found a route."""

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

    The space is "r2" for a radius and "se2" for an outline. Rows of the workload "motions" are
    about edges that RRT-Connect asked for, all asked again; those of "first route" about the whole
    of RRT-Connect, with OMPL's range for edges and, at last, with that of
    `MotionValidator.max_edge_length`.

    Parameters
    ----------
    grid : ConfidenceGrid
    footprint : float or array_like, shape (n, 2) [m, base_link]
    queries : sequence of (start, goal)
        x, y [m, map] and, for an outline, yaw [rad]. Those that have no route are left out.
    seeds : int
    time_limit : float [s]
        Of a search.

    Returns
    -------
    list of dict
        ``workload``, ``system``, ``median_ms`` and ``p95_ms`` of a search or the edges of one,
        ``ratio`` (by how much faster than the lambda), ``motions_per_s``, and ``agree``, the share
        of edges about which both say the same, and ``solved``, the share of searches that found a
        route. Times are those that the processor took.

    Raises
    ------
    ProblemError
        No query is left.
    """
    asked = _possible(grid, footprint, queries)
    runs = [(query, seed) for query in asked for seed in range(seeds)]
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
            system: [_first(query, system, seed, time_limit) for query, seed in runs]
            for system in (LAMBDA, COMPILED, REACH)
        }
    space = asked[0].validator.space
    return [*_motion_rows(space, motions), *_route_rows(space, routes)]


def _motion_rows(space: StateSpace, motions: dict[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """Yield a row per check."""
    answers = {name: np.concatenate([a for _, a in found]) for name, found in motions.items()}
    agree = float(np.mean(answers[LAMBDA] == answers[COMPILED]))
    total = {name: sum(seconds for seconds, _ in found) for name, found in motions.items()}
    for name, found in motions.items():
        yield {
            "workload": f"motions, {space}",
            "system": name,
            **_spread([seconds for seconds, _ in found]),
            "ratio": total[LAMBDA] / total[name],
            "motions_per_s": len(answers[name]) / total[name],
            "agree": agree,
            "solved": None,
        }


def _route_rows(space: StateSpace, routes: dict[str, list[Search]]) -> Iterator[dict[str, Any]]:
    """Yield a row per check and range."""
    times = {name: [search.seconds for search in found] for name, found in routes.items()}
    for name, found in routes.items():
        yield {
            "workload": f"first route, {space}",
            "system": name,
            **_spread(times[name]),
            "ratio": float(np.median(times[LAMBDA]) / np.median(times[name])),
            "motions_per_s": None,
            "agree": None,
            "solved": float(np.mean([search.solved for search in found])),
        }


def _spread(seconds: list[float]) -> dict[str, float]:
    median, high = 1e3 * np.percentile(seconds, [50, 95])
    return {"median_ms": float(median), "p95_ms": float(high)}


def _possible(grid: ConfidenceGrid, footprint: Any, queries: Sequence[Any]) -> list[MotionQuery]:
    """Return the queries that may have a route."""
    found, validator = [], None
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
                found.append(MotionQuery(validator, *ends, room))
    if not found:
        raise ProblemError("queries", "one that may have a route", "none")
    return found


def _information(
    query: MotionQuery, system: str, edges: list[tuple[Pose, Pose]] | None = None
) -> Any:
    """Return OMPL's space with one of the checks; what is asked is appended to `edges`."""
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
        check = _recording(check, reader(validator.space), edges)
    return information_of(base, space, check)


def _recording(check: Callable[..., bool], read: Any, edges: list[Any]) -> Callable[..., bool]:
    def recording(ompl_validator: Any, a: Any, b: Any, _: Any = None) -> bool:
        if len(edges) < MOST:
            edges.append((read(a), read(b)))
        return check(ompl_validator, a, b)

    return recording


def _set_steps(space: Any, validator: MotionValidator2D) -> None:
    """Have OMPL look at states that are a cell apart, or at which the outline has turned by one."""
    size = validator.costmap.window.resolution
    plane = space if validator.space == "r2" else space.getSubspace(0)
    plane.setLongestValidSegmentFraction(STEP * size / plane.getMaximumExtent())
    if validator.space != "r2":
        turn = STEP * size / validator.costmap.problem.shape.radius
        yaw = space.getSubspace(1)
        yaw.setLongestValidSegmentFraction(min(turn / yaw.getMaximumExtent(), 1.0))


def lambda_of(validator: MotionValidator2D) -> Callable[[Any], bool]:
    """Return what tells in Python whether a state of OMPL's is clear.

    In "r2" it looks up the state's cell: whether the footprint's centre may be on the cell's. In
    "se2" it looks up the cells of points on the outline.
    """
    size = validator.costmap.window.resolution
    if validator.space == "r2":
        blocked = ~validator.costmap.traversable
        return lambda state: not blocked[int(state[1] / size), int(state[0] / size)]
    points = _outline(validator) / size
    across, along = points.T
    margin = math.ceil(float(np.hypot(across, along).max())) + 1  # it may reach off the map
    padded: Bools = np.pad(validator.costmap.blocked, margin, constant_values=True)

    def is_valid(state: Any) -> bool:
        cosine, sine = math.cos(state.getYaw()), math.sin(state.getYaw())
        cols = cosine * across - sine * along + (state.getX() / size + margin)
        rows = sine * across + cosine * along + (state.getY() / size + margin)
        return not padded[rows.astype(int), cols.astype(int)].any()

    return is_valid


def _outline(validator: MotionValidator2D) -> Floats:
    """Return about 40 points on the outline, evenly spread along its sides [m, base_link]."""
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
    """Have RRT-Connect search; `longest` is of an edge [m], 0 for OMPL's own."""
    modules, kind = ompl(), query.validator.space
    modules.util.RNG.setSeed(seed + 1)  # 0 is refused
    space = information.getStateSpace()
    task = modules.base.ProblemDefinition(information)
    task.setStartAndGoalStates(*(state_of(space, e, kind) for e in (query.start, query.goal)))
    planner = modules.geometric.RRTConnect(information)
    planner.setRange(longest)
    planner.setProblemDefinition(task)
    planner.setup()
    looks, until = count(1), time.thread_time() + limit

    def stop() -> bool:
        return not next(looks) % GLANCE and time.thread_time() >= until

    began = time.thread_time()
    status = planner.solve(modules.base.PlannerTerminationCondition(stop))
    seconds = time.thread_time() - began
    return Search(seconds, status.getStatus().name == EXACT)


def _edges_of(query: MotionQuery, seed: int, limit: float) -> list[tuple[Pose, Pose]]:
    """Return the edges that a search asks for, the first thousands of them."""
    edges: list[tuple[Pose, Pose]] = []
    _search(query, _information(query, COMPILED, edges), seed=seed, longest=0.0, limit=limit)
    return edges


def _first(query: MotionQuery, system: str, seed: int, limit: float) -> Search:
    """Search with one of the checks."""
    validator = query.validator
    region = validator.region(query.start)
    longest = validator.max_edge_length(region, query.room) if system == REACH else 0.0
    return _search(query, _information(query, system), seed=seed, longest=longest, limit=limit)


def _time_checks(
    query: MotionQuery, system: str, edges: Sequence[tuple[Pose, Pose]]
) -> tuple[float, Bools]:
    """Return how long it takes to check edges through OMPL [s], and what came of each."""
    information, kind = _information(query, system), query.validator.space
    space = information.getStateSpace()
    pairs = [(state_of(space, a, kind), state_of(space, b, kind)) for a, b in edges]
    check = information.checkMotion
    began = time.thread_time()
    answers = [check(a, b) for a, b in pairs]
    return time.thread_time() - began, np.array(answers)
