"""Many queries on one map, answered by threads that share the costmap."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from groundmap.arrays import Floats
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_on_map
from planners.errors import NoRouteError, ProblemError
from planners.problem.problem import PlanningProblem
from planners.registry import Planner, get_planner
from planners.route.route import Route
from planners.route.solve import solve
from planners.search.base import Engine, SearchSettings, now

Pair: TypeAlias = Sequence[Sequence[float] | Floats] | Floats  #: a start and a goal


class _Workspace(NamedTuple):
    """The costmap and engines that answer queries, one query at a time in each thread."""

    costmap: Costmap
    engines: SimpleQueue[Engine]
    settings: SearchSettings
    headings: bool
    audited: bool
    watch: dict[str, Any]


def plan_many(
    problem: PlanningProblem,
    pairs: Iterable[Pair],
    planner: str = "auto",
    *,
    threads: int | None = None,
    audit: bool = True,
    **settings: Any,
) -> list[Route | NoRouteError]:
    """Return for each start and goal the route of `plan`, or the exception that it would raise.

    The costmap and the engines are created once; threads search in parallel.

    Parameters
    ----------
    problem : PlanningProblem
        Everything except the starts and goals. With ``clear_start``, the unknown cells near *its*
        start count as free for every query, and no others (as with ``cleared_at`` at that place).
    pairs : iterable of (start, goal)
        Each x, y [m, map] and optionally yaw [rad].
    planner : str, default "auto"
        A name in `PLANNERS`.
    threads : int, optional
        Number of threads; default: the number of processors. The routes do not depend on it.
    audit : bool, default True
        Whether every route is audited, as by `plan`. The `audit` of other routes is "skipped".
    **settings
        The planner's settings; a time limit applies to each query.

    Returns
    -------
    list of Route or NoRouteError
        In the order of the pairs. Failures of a single query are in the list; errors that concern
        all queries are raised.

    Raises
    ------
    ProblemError
        No planner of that name, or an invalid pair, whose index is in the message.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    AuditError
        A route violates the requested clearance or endpoints: a bug in the planner.

    Examples
    --------
    >>> import numpy as np
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.9)
    >>> pairs = [((2, 2.25), (30, 2.25)), ((2, 2), (31.9, 2)), ((2, 9.25), (9, 9.25))]
    >>> for route in plan_many(problem, pairs, "astar"):
    ...     print(route.length if isinstance(route, Route) else type(route).__name__)
    28.0
    UnknownSpaceError
    7.0
    """
    if not isinstance(audit, bool):
        raise ProblemError("audit", "True or False", repr(audit))
    chosen = get_planner(planner)
    options = chosen.settings(**settings)
    headings = chosen.headings and options.uses_headings(problem)
    posed = (("start",) if options.takes_other_goals else ("start", "goal")) if headings else ()
    problems = _problems(problem, pairs, posed=posed)
    workers = min(_threads(threads), max(len(problems), 1))
    if not problems:
        return []
    costmap = Costmap.of(problems[0])
    for name in (
        "moves",
        "steps",
        "clearance",
        "kept_out",
        "recent",
    ):  # computed once, not by each thread
        getattr(costmap, name)
    stop = threading.Event()
    watch = {"cancel": stop} if chosen.anytime else {}
    engines = _engines(chosen, costmap, workers)
    workspace = _Workspace(costmap, engines, options, chosen.headings, audit, watch)
    with ThreadPoolExecutor(workers) as pool:
        try:
            return list(pool.map(lambda query: _answer(workspace, query), problems))
        except BaseException:  # such as Ctrl-C, which would otherwise wait for all queries
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _problems(
    problem: PlanningProblem, pairs: Iterable[Pair], *, posed: tuple[str, ...]
) -> list[PlanningProblem]:
    """Return a problem for each pair, whose `posed` places need a yaw; all clear the same cells."""
    problem.check_dimensions(2, hint="Use `plan` for each pair.")
    if not isinstance(pairs, Iterable) or (isinstance(pairs, np.ndarray) and pairs.ndim == 0):
        raise ProblemError("pairs", "pairs of a start and a goal", repr(pairs))
    problems = []
    for i, pair in enumerate(pairs):
        try:
            start, goal = pair
        except (TypeError, ValueError) as error:
            raise ProblemError(f"pairs[{i}]", "a start and a goal", repr(pair)) from error
        try:
            query = replace(problem, start=start, goal=goal, cleared_at=problem.clear_place)
        except ProblemError as error:
            raise ProblemError(f"pairs[{i}], {error.name}", error.expected, error.got) from error
        if any(len(getattr(query, place)) == 2 for place in posed):
            expected = f"a {' and a '.join(posed)} with yaws [rad]"
            raise ProblemError(f"pairs[{i}]", expected, repr(pair))
        problems.append(query)
    return problems


def _threads(threads: int | None) -> int:
    if threads is None:  # Python 3.13 counts those that this process may use
        return getattr(os, "process_cpu_count", os.cpu_count)() or 1
    if not isinstance(threads, int) or isinstance(threads, bool) or threads < 1:
        raise ProblemError("threads", "a whole number of 1 or more", repr(threads))
    return threads


def _engines(planner: Planner, costmap: Costmap, count: int) -> SimpleQueue[Engine]:
    """Return engines; those with a `twin` method share their tables."""
    first = planner.engine(costmap)
    twin = getattr(first, "twin", None) or (lambda: planner.engine(costmap))
    engines: SimpleQueue[Engine] = SimpleQueue()
    engines.put(first)
    for _ in range(count - 1):
        engines.put(twin())
    return engines


def _answer(workspace: _Workspace, problem: PlanningProblem) -> Route | NoRouteError:
    engine = workspace.engines.get()
    try:
        return _route(workspace, engine, problem)
    except NoRouteError as error:
        return error.with_traceback(None)  # a traceback would keep the engine's arrays alive
    finally:
        workspace.engines.put(engine)


def _route(workspace: _Workspace, engine: Engine, problem: PlanningProblem) -> Route:
    began = now()
    check_on_map(problem, goal=not workspace.settings.takes_other_goals)
    return solve(
        workspace.costmap.with_problem(problem),
        engine,
        workspace.settings,
        began=began,
        headings=workspace.headings and workspace.settings.uses_headings(problem),
        audited=workspace.audited,
        watch=workspace.watch,
    )
