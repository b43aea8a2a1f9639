"""Routes of a scenario's queries, compared with the true world."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.grid.window import CellBox
from planners.errors import PlanningError
from planners.geometry.polyline import length_of
from planners.planning import plan
from planners.problem.problem import PlanningProblem
from planners.scenario.outcome import REASON, Figure
from planners.scenario.queries import OUTCOME, QuerySettings
from planners.scenario.simulated import Simulated

FINE = 0.05  # [m], side of a cell in the map of the true world
ABOVE = 1.0  # [m] above all solids, in which routes of a flying robot may pass
MOST_CELLS = 5e7  # in the map of the true world
# Changes to a query for the best route in the true world.
IN_TRUTH: dict[str, Any] = {
    "planner": "astar",
    "settings": {},
    "unknown": "avoid",
    "recent": False,
    "time_limit": None,
}


class QueryOutcome(NamedTuple):
    """Result of one query."""

    query: QuerySettings
    outcome: str  #: "route", or the name of the error
    reason: str  #: message of the error
    waypoints: Floats | None  #: shape (n, 2), on a 3-D map (n, 3) [m, map]
    figures: dict[str, Figure]


def run_query(query: QuerySettings, grid: ConfidenceGrid) -> QueryOutcome:
    """Plan the route of a query on a map.

    Parameters
    ----------
    query : QuerySettings
    grid : ConfidenceGrid
    """
    settings = dict(query.settings)
    if query.time_limit is not None:
        settings["time_limit"] = query.time_limit
    try:
        problem = PlanningProblem(
            grid,
            start=query.start,
            goal=query.goal,
            footprint=query.footprint,
            unknown=query.unknown,
            recent=grid.recent if query.recent else None,
        )
        route = plan(problem, query.planner, **settings)
    except PlanningError as error:
        name, reason = type(error).__name__, str(error)
        return QueryOutcome(query, name, reason, None, {"outcome": name, REASON: reason})
    figures: dict[str, Figure] = {
        "outcome": OUTCOME,
        "length": route.length,
        "min_clearance": route.min_clearance,
    }
    return QueryOutcome(query, OUTCOME, "", route.waypoints, figures)


def compare_with_truth(
    answer: QueryOutcome, simulated: Simulated, fine: ConfidenceGrid
) -> QueryOutcome:
    """Add the figures of a route in the true world: clearance, collisions, ratio to the best.

    Parameters
    ----------
    answer : QueryOutcome
    simulated : Simulated
    fine : ConfidenceGrid
        Result of `true_map`.
    """
    if answer.waypoints is None:
        return answer
    query = answer.query
    radius = query.radius if query.robot_radius is None else query.robot_radius
    distances = simulated.truth.clearances(answer.waypoints)
    best = run_query(query.model_copy(update={"footprint": radius, **IN_TRUTH}), fine)
    optimum = best.figures.get("length")
    figures: dict[str, Figure] = {
        **answer.figures,
        "true_clearance": float(distances.min()) if len(distances) else None,
        "collisions": int((distances < radius).sum()),
        "optimum": optimum,
        "ratio": None,
    }
    if isinstance(optimum, float) and optimum > 0:
        figures["ratio"] = length_of(answer.waypoints) / optimum
    return answer._replace(figures=figures)


def true_map(simulated: Simulated) -> ConfidenceGrid:
    """Return a map of the true world with fine cells: free, except for obstacles."""
    window = simulated.window
    low, sides = window.origin.copy(), np.array(window.shape[::-1]) * window.resolution
    if window.origin.size == 3:  # from the ground to above all solids, also beyond what is judged
        top = max([low[2] + sides[2], *(solid.top + ABOVE for solid in simulated.world.solids)])
        low[2], sides[2] = -FINE, top + FINE
    shape = np.ceil(sides / FINE)[::-1]
    if shape.prod() > MOST_CELLS:
        raise InputError(
            "world",
            f"{MOST_CELLS:g} cells of {FINE} m at most, to compare routes with",
            f"{shape.prod():.3g}",
            hint="Give smaller bounds [m].",
        )
    lower = np.floor(low / FINE).astype(np.int64)[::-1]
    origin = lower[::-1].astype(np.float64) * FINE
    box = CellBox(lower, lower + shape.astype(np.int64), origin, FINE)
    nonfree = simulated.truth.nonfree_on(box)
    grid = ConfidenceGrid(resolution=FINE, origin=np.zeros(nonfree.ndim).tolist())
    grid.fuse(lower, np.where(nonfree, 1.0, -1.0).astype(np.float32))
    return grid
