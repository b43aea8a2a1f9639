"""Many queries on one map: what they share is worked out once, and threads answer them."""

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
from planners.route.solve import solve, with_problem
from planners.search.base import Engine, SearchSettings, now

Pair: TypeAlias = Sequence[Sequence[float] | Floats] | Floats  #: a start and a goal


class _Desk(NamedTuple):
    """What answers queries, one at a time in each thread."""

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
    """Return for each start and goal what `plan` would return, or the exception it would raise.

    Costmap and engines are made once; the searches of different threads run at the same time.

    Parameters
    ----------
    problem : PlanningProblem
        Says all but the starts and goals. With ``clear_start``, the unknown cells near *its* start
        count as free, for every query, and no others (as with ``cleared_at`` at that place).
    pairs : iterable of (start, goal)
        Each x, y [m, map] and optionally yaw [rad].
    planner : str, default "auto"
        A name in `PLANNERS`.
    threads : int, optional
        As many as the machine has processors unless told. The routes don't depend on it.
    audit : bool, default True
        Whether every route is audited, as those of `plan` are. On maps of 512 x 512 cells this
        takes about half as long as all the rest; an unaudited route's `audit` is "skipped".
    **settings
        The planner's settings; a time limit is for each query.

    Returns
    -------
    list of Route or NoRouteError
        In the order of the pairs. Only what is wrong with one query is in the list; what is
        wrong with all of them is raised.

    Raises
    ------
    ProblemError
        No planner of that name, or a pair that is not two places: its number is in the sentence.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    AuditError
        A planner's route keeps not what was asked: a bug in the planner.

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
    turned = (("start",) if options.takes_other_goals else ("start", "goal")) if headings else ()
    problems = _problems(problem, pairs, turned=turned)
    workers = min(_threads(threads), max(len(problems), 1))
    if not problems:
        return []
    costmap = Costmap.of(problems[0])
    for name in ("moves", "steps", "clearance"):  # worked out by one thread, not by each
        getattr(costmap, name)
    stop = threading.Event()
    watch = {"cancel": stop} if chosen.anytime else {}
    engines = _engines(chosen, costmap, workers)
    desk = _Desk(costmap, engines, options, chosen.headings, audit, watch)
    with ThreadPoolExecutor(workers) as pool:
        try:
            return list(pool.map(lambda asked: _answer(desk, asked), problems))
        except BaseException:  # such as Ctrl-C, which would wait for all that run or wait
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _problems(
    problem: PlanningProblem, pairs: Iterable[Pair], *, turned: tuple[str, ...]
) -> list[PlanningProblem]:
    """Return a problem for each pair, some of whose places need a yaw; they clear the same."""
    if problem.grid.ndim != 2:
        raise ProblemError(
            "grid", "a 2-D map", f"a {problem.grid.ndim}-D one", hint="Use `plan` for each pair."
        )
    if not isinstance(pairs, Iterable) or (isinstance(pairs, np.ndarray) and pairs.ndim == 0):
        raise ProblemError("pairs", "pairs of a start and a goal", repr(pairs))
    problems = []
    for i, pair in enumerate(pairs):
        try:
            start, goal = pair
        except (TypeError, ValueError) as error:
            raise ProblemError(f"pairs[{i}]", "a start and a goal", repr(pair)) from error
        try:
            asked = replace(problem, start=start, goal=goal, cleared_at=problem.clear_place)
        except ProblemError as error:
            raise ProblemError(f"pairs[{i}], {error.name}", error.expected, error.got) from error
        if any(len(getattr(asked, place)) == 2 for place in turned):
            expected = f"a {' and a '.join(turned)} with yaws [rad]"
            raise ProblemError(f"pairs[{i}]", expected, repr(pair))
        problems.append(asked)
    return problems


def _threads(threads: int | None) -> int:
    if threads is None:  # Python 3.13 knows how many of them this process may use
        return getattr(os, "process_cpu_count", os.cpu_count)() or 1
    if not isinstance(threads, int) or isinstance(threads, bool) or threads < 1:
        raise ProblemError("threads", "a whole number of 1 or more", repr(threads))
    return threads


def _engines(planner: Planner, costmap: Costmap, count: int) -> SimpleQueue[Engine]:
    """Return engines; those that can make a twin of themselves share what they worked out."""
    first = planner.engine(costmap)
    twin = getattr(first, "twin", None) or (lambda: planner.engine(costmap))
    engines: SimpleQueue[Engine] = SimpleQueue()
    engines.put(first)
    for _ in range(count - 1):
        engines.put(twin())
    return engines


def _answer(desk: _Desk, problem: PlanningProblem) -> Route | NoRouteError:
    engine = desk.engines.get()
    try:
        return _route(desk, engine, problem)
    except NoRouteError as error:
        return error.with_traceback(None)  # which would keep the engine's arrays alive
    finally:
        desk.engines.put(engine)


def _route(desk: _Desk, engine: Engine, problem: PlanningProblem) -> Route:
    began = now()
    check_on_map(problem, goal=not desk.settings.takes_other_goals)
    return solve(
        with_problem(desk.costmap, problem),
        engine,
        desk.settings,
        began=began,
        headings=desk.headings and desk.settings.uses_headings(problem),
        audited=desk.audited,
        watch=desk.watch,
    )
