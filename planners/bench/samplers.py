"""Sampling planners side by side: who finds a way, how soon, how good, and how it gets better."""

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
PATIENCE = 120.0  # [s] beyond the time limit, for what is made and compiled before
MOMENTS = 80  # points of a curve, at most
COST_TOLERANCE = 1e-9  # relative, of costs
FINDS = 3  # what everybody may tell: a route as it was found, as it was checked, and simplified


class Refused(NamedTuple):
    """What is not tried, and why."""

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
    """Return what is to be tried, seed after seed, and what is refused.

    A workload that has no query in a space is left out there.
    """
    asked = [space for space in spaces if any(space in work.cases() for work in works)]
    pairs = list(product(planners, asked))
    refused = [Refused(*pair, reason) for pair in pairs if (reason := refusal(*pair))]
    out = {pair[:2] for pair in refused}
    trials = [
        Trial(work, space, planner, seed, time_limit, improve_for)
        for seed in range(seeds)
        for work in works
        for space in spaces
        if space in work.cases()
        for planner in planners
        if (planner, space) not in out
    ]
    return trials, refused


def run(
    trials: Sequence[Trial],
    *,
    jobs: int,
    watch: Callable[[Iterable[Any]], Iterable[Any]] = lambda steps: steps,
) -> list[Race]:
    """Return the races of all trials, run by so many processes, in the order they were entered.

    A planner that crashes or hangs ends its process and loses the trial; the others go on.
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
    """What costs are held against."""

    cost: float | None  #: None if nobody found a route
    is_best_known: bool  #: whether it is only the best that anybody in the run came by


def optima(
    works: Sequence[Workload], races: Sequence[Race]
) -> dict[tuple[str, StateSpace], Optimum]:
    """Return for each workload and space the least cost: in "r2" of the best route at any angle."""
    found: dict[tuple[str, StateSpace], Optimum] = {}
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
            found[name, space] = Optimum(known, is_best_known=False)
        else:
            found[name, space] = Optimum(best, is_best_known=True)
    return found


def row(race: Race, optimum: Optimum) -> dict[str, Any]:
    """Return the figures of a race; costs and first times are of the attempts with a route.

    ``first_ms`` is when there was a route, the costmap included; ``median_ms`` and ``p95_ms`` when
    the planner handed one out, bettered as long as it was told to, or gave up.
    """
    won = [attempt for attempt in race.attempts if attempt.solved]
    ms = [1e3 * attempt.seconds for attempt in race.attempts]
    first = [1e3 * attempt.first for attempt in won]
    cost = float(np.median([attempt.cost for attempt in won])) if won else None
    ratio = cost / optimum.cost if cost is not None and optimum.cost else None
    reasons = Counter(attempt.reason for attempt in race.attempts if not attempt.solved)
    curve = progress(race, optimum.cost) if optimum.cost else []
    return {
        "workload": race.work,
        "space": race.space,
        "system": race.planner,
        "queries": len(race.attempts),
        "solved": len(won),
        "success": len(won) / len(race.attempts),
        "first_ms": float(np.median(first)) if won else None,
        "first_p95_ms": float(np.percentile(first, 95)) if won else None,
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

    An attempt without a route counts as infinitely dear, so a curve begins when more than half of
    all attempts have one. Of a planner that stops at its first route, and of one that solves half
    or less, there is only one point: the medians of what was handed out.
    """
    won = [attempt for attempt in race.attempts if attempt.solved]
    if not won:
        return []
    end = float(np.median([attempt.betters[-1][0] for attempt in won]))
    if 2 * len(won) <= len(race.attempts) or all(len(one.betters) <= FINDS for one in won):
        return [(end, float(np.median([attempt.cost for attempt in won])) / optimum)]
    moments = _moments(np.array([time for attempt in won for time, _ in attempt.betters]), end)
    best = np.full((len(race.attempts), len(moments) + 1), np.inf)
    for attempt, costs in zip(won, best, strict=False):
        for time, cost in attempt.betters:
            costs[:-1][moments >= time] = cost
        costs[-1] = attempt.cost
    median = np.median(best, axis=0) / optimum
    points = zip([*moments.tolist(), end], median.tolist(), strict=True)
    return [(time, ratio) for time, ratio in points if np.isfinite(ratio)]


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _moments(times: Floats, end: float) -> Floats:
    """Return so many of the times up to the end, evenly spread over their logarithm."""
    early: Floats = np.unique(times[times < end])
    if len(early) <= MOMENTS:
        return early
    wanted = np.geomspace(early[0], early[-1], MOMENTS)
    nearest = np.searchsorted(early, wanted * (1.0 - 1e-12))
    thinned: Floats = np.unique(early[np.minimum(nearest, len(early) - 1)])
    return thinned
