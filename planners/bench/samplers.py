"""Comparison of sampling planners: success, time of the first route, costs over time."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from itertools import product
from typing import Any, NamedTuple, get_args

import numpy as np

from groundmap.arrays import Floats
from planners.bench.trials import Attempt, Trial, Workload, lost_attempt, make_attempt, shortest
from planners.bench.worker_pool import worker_pool
from planners.sampling.settings import StateSpace, refusal

SPACES: tuple[StateSpace, ...] = get_args(StateSpace)
PATIENCE = 120.0  # [s] beyond the time limit, for compilation and for building maps
MOMENTS = 80  # points of a curve, at most
COST_TOLERANCE = 1e-9  # relative, of costs
FINDS = 3  # reports of a planner that stops at its first route: found, validated and simplified


class Refused(NamedTuple):
    """A planner that does not support a state space."""

    planner: str
    space: StateSpace
    reason: str


class Race(NamedTuple):
    """All attempts of one planner at a workload in a space."""

    work: str
    space: StateSpace
    planner: str
    attempts: list[Attempt]


def list_trials(
    works: Sequence[Workload],
    planners: Sequence[str],
    spaces: Sequence[StateSpace],
    *,
    seeds: int,
    time_limit: float,
    improve_for: float,
) -> tuple[list[Trial], list[Refused]]:
    """Return all trials, seed after seed, and the planners that a space does not support.

    There are no trials of a workload in a space in which it has no query.

    Parameters
    ----------
    works : sequence of Workload
    planners : sequence of str
    spaces : sequence of StateSpace
    seeds : int
        Number of seeds; they count from 0.
    time_limit : float [s]
    improve_for : float [s]
        Time to keep improving after the first route.
    """
    used = [space for space in spaces if any(space in work.cases() for work in works)]
    pairs = list(product(planners, used))
    refused = [Refused(*pair, reason) for pair in pairs if (reason := refusal(*pair))]
    excluded = {pair[:2] for pair in refused}
    trials = [
        Trial(work, space, planner, seed, time_limit, improve_for)
        for seed in range(seeds)
        for work in works
        for space in spaces
        if space in work.cases()
        for planner in planners
        if (planner, space) not in excluded
    ]
    return trials, refused


def run(
    trials: Sequence[Trial],
    *,
    jobs: int,
    watch: Callable[[Iterable[Any]], Iterable[Any]] = lambda steps: steps,
) -> list[Race]:
    """Return the races of all trials, in the order of the trials.

    A planner that crashes or hangs loses its trial; the other trials continue.

    Parameters
    ----------
    trials : sequence of Trial
    jobs : int
        Number of processes.
    watch : callable, optional
        Receives the iterator over completed trials and yields each of them, to show progress.
    """
    races: dict[tuple[Workload, StateSpace, str], Race] = {}
    for work, space, planner, *_ in trials:
        races.setdefault((work, space, planner), Race(work.name, space, planner, []))
    patience = PATIENCE + max((trial.time_limit for trial in trials), default=0.0)
    with closing(
        worker_pool(trials, make_attempt, jobs=jobs, patience=patience, lost=lost_attempt)
    ) as results:
        for trial, attempt in watch(results):
            races[trial[:3]].attempts.append(attempt)
    return list(races.values())


class Optimum(NamedTuple):
    """The cost that costs are compared with."""

    cost: float | None  #: None if no planner found a route
    is_best_known: bool  #: whether it is only the best cost of the run


def optima(
    works: Sequence[Workload], races: Sequence[Race]
) -> dict[tuple[str, StateSpace], Optimum]:
    """Return the least cost for each workload and space; in "r2" that of `trials.shortest`.

    Parameters
    ----------
    works : sequence of Workload
    races : sequence of Race
    """
    least: dict[tuple[str, StateSpace], Optimum] = {}
    by_name = {work.name: work for work in works}
    for name, space in dict.fromkeys((race.work, race.space) for race in races):
        costs = [
            attempt.cost
            for race in races
            if (race.work, race.space) == (name, space)
            for attempt in race.attempts
            if attempt.solved
        ]
        known = shortest(by_name[name].cases()[space]) if space == "r2" else None
        best = min(costs, default=None)
        if known is not None and (best is None or known <= best * (1.0 + COST_TOLERANCE)):
            least[name, space] = Optimum(known, is_best_known=False)
        else:
            least[name, space] = Optimum(best, is_best_known=True)
    return least


def row(race: Race, optimum: Optimum) -> dict[str, Any]:
    """Return the figures of a race; costs and first times are those of solved attempts.

    ``first_ms`` is the time of the first route, the costmap included; ``median_ms`` and ``p95_ms``
    are total times, the improvement of the route included.

    Parameters
    ----------
    race : Race
    optimum : Optimum
        Of the workload and space of the race.
    """
    solved = [attempt for attempt in race.attempts if attempt.solved]
    ms = [1e3 * attempt.seconds for attempt in race.attempts]
    first = [1e3 * attempt.first for attempt in solved]
    cost = float(np.median([attempt.cost for attempt in solved])) if solved else None
    ratio = cost / optimum.cost if cost is not None and optimum.cost else None
    reasons = Counter(attempt.reason for attempt in race.attempts if not attempt.solved)
    curve = progress(race, optimum.cost) if optimum.cost else []
    return {
        "workload": race.work,
        "space": race.space,
        "system": race.planner,
        "queries": len(race.attempts),
        "solved": len(solved),
        "success": len(solved) / len(race.attempts),
        "first_ms": float(np.median(first)) if solved else None,
        "first_p95_ms": float(np.percentile(first, 95)) if solved else None,
        "cost": cost,
        "optimum": optimum.cost,
        "best_known": optimum.is_best_known,
        "ratio": ratio,
        "median_ms": float(np.median(ms)),
        "p95_ms": float(np.percentile(ms, 95)),
        "curve": [list(point) for point in curve],
        "reason": reasons.most_common(1)[0][0] if reasons else None,
    }


def progress(race: Race, optimum: float) -> list[tuple[float, float]]:
    """Return the median ratio to the optimum over time, as (seconds, ratio).

    The cost of an attempt without a route is infinite, so the curve begins when more than half of
    the attempts have a route. A planner that stops at its first route, or solves at most half of
    the attempts, has one point: the median time and ratio of the returned routes.

    Parameters
    ----------
    race : Race
    optimum : float
        Cost that the costs are divided by.
    """
    solved = [attempt for attempt in race.attempts if attempt.solved]
    if not solved:
        return []
    end = float(np.median([attempt.improvements[-1][0] for attempt in solved]))
    stops_at_first = all(len(attempt.improvements) <= FINDS for attempt in solved)
    if 2 * len(solved) <= len(race.attempts) or stops_at_first:
        return [(end, float(np.median([attempt.cost for attempt in solved])) / optimum)]
    times = [time for attempt in solved for time, _ in attempt.improvements]
    moments = _moments(np.array(times), end)
    best = np.full((len(race.attempts), len(moments) + 1), np.inf)
    for attempt, costs in zip(solved, best, strict=False):
        for time, cost in attempt.improvements:
            costs[:-1][moments >= time] = cost
        costs[-1] = attempt.cost
    median = np.median(best, axis=0) / optimum
    points = zip([*moments.tolist(), end], median.tolist(), strict=True)
    return [(time, ratio) for time, ratio in points if np.isfinite(ratio)]


def processors() -> int:
    """Return the number of processors that this process can use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _moments(times: Floats, end: float) -> Floats:
    """Return at most `MOMENTS` of the times before the end, evenly spaced in their logarithm."""
    early: Floats = np.unique(times[times < end])
    if len(early) <= MOMENTS:
        return early
    wanted = np.geomspace(early[0], early[-1], MOMENTS)
    nearest = np.searchsorted(early, wanted * (1.0 - 1e-12))
    thinned: Floats = np.unique(early[np.minimum(nearest, len(early) - 1)])
    return thinned
