"""Planners by name, and `plan`, the one way to a route."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

from planners.answers import check_on_map, space_of
from planners.ara import ARA, ARASettings
from planners.astar import (
    AStar,
    AStarSettings,
    Dijkstra,
    DijkstraSettings,
    WeightedAStar,
    WeightedAStarSettings,
)
from planners.astar3d import AStar3D
from planners.auto import Auto, AutoSettings
from planners.dstar_lite import DStarLite, DStarLiteSettings
from planners.engine import Engine, SearchSettings
from planners.errors import ProblemError
from planners.hybrid import HybridAStar, HybridAStarSettings
from planners.jps import JPS, JPSPlus, JPSPlusSettings, JPSSettings
from planners.polyanya import Polyanya, PolyanyaSettings
from planners.problem import PlanningProblem
from planners.route import Route
from planners.solve import solve
from planners.theta import LazyTheta, LazyThetaSettings, Theta, ThetaSettings
from planners.voxels import Voxels

SPATIAL = ("astar", "auto")  # planners that plan on 3-D maps, too


class Planner(NamedTuple):
    """A planner: its engine, the class of its settings, and whether it heeds headings."""

    engine: type[Engine]
    settings: type[SearchSettings]
    headings: bool = False


PLANNERS: dict[str, Planner] = {
    "astar": Planner(AStar, AStarSettings),
    "ara": Planner(ARA, ARASettings),
    "auto": Planner(Auto, AutoSettings),
    "dijkstra": Planner(Dijkstra, DijkstraSettings),
    "dstar_lite": Planner(DStarLite, DStarLiteSettings),
    "hybrid_astar": Planner(HybridAStar, HybridAStarSettings, headings=True),
    "jps": Planner(JPS, JPSSettings),
    "jps+": Planner(JPSPlus, JPSPlusSettings),
    "lazy_theta": Planner(LazyTheta, LazyThetaSettings),
    "polyanya": Planner(Polyanya, PolyanyaSettings),
    "theta": Planner(Theta, ThetaSettings),
    "weighted_astar": Planner(WeightedAStar, WeightedAStarSettings),
}


def plan(problem: PlanningProblem, planner: str = "astar", **settings: Any) -> Route:
    """Return a route that the audit passed, or raise an exception that says why there is none.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str, default "astar"
        A name in `PLANNERS`.
    **settings
        The planner's settings, such as `planners.AStarSettings`.

    Raises
    ------
    ProblemError
        No planner of that name.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    OutsideMapError, NonFreeError, UnknownSpaceError
        Start or goal is no place for the footprint.
    EnclosedError
        No route joins them.
    TimeLimitError
        Time ran out.
    AuditError
        The planner's route keeps not what was asked: a bug in the planner.

    Examples
    --------
    >>> import numpy as np
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> route = plan(PlanningProblem(grid, start=(2, 2), goal=(30, 6), footprint=0.9))
    >>> route.waypoints.tolist()[0], route.min_clearance, route.audit
    ([2.0, 2.0], 2.0, 'clean')
    """
    began = time.perf_counter()
    entry = named(planner)
    chosen = entry.settings(**settings)
    check_on_map(problem)
    space = space_of(problem)
    if isinstance(space, Voxels):
        return solve(space, _engine_3d(space, planner), chosen, began=began)
    return solve(space, entry.engine(space), chosen, began=began, headings=entry.headings)


def _engine_3d(space: Voxels, planner: str) -> AStar3D:
    if planner not in SPATIAL:
        expected = f"one that plans on 3-D maps: {', '.join(SPATIAL)}"
        raise ProblemError("planner", expected, repr(planner))
    return AStar3D(space)


def named(planner: str) -> Planner:
    """Return the planner of a name.

    Raises
    ------
    ProblemError
        There is none; the sentence names those there are.
    """
    if not isinstance(planner, str) or planner not in PLANNERS:
        raise ProblemError("planner", f"one of {', '.join(sorted(PLANNERS))}", repr(planner))
    return PLANNERS[planner]
