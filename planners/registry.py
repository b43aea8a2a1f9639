"""Planners by name, and `plan`, the one way to a route."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from functools import cache, partial
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
from planners.engine import Cancel, Engine, OnImproved, SearchSettings, check_cancel, now
from planners.errors import ProblemError
from planners.hybrid import HybridAStar, HybridAStarSettings
from planners.jps import JPS, JPSPlus, JPSPlusSettings, JPSSettings
from planners.polyanya import Polyanya, PolyanyaSettings
from planners.problem import PlanningProblem
from planners.route import Route
from planners.sampling.door import samplers
from planners.sampling.run import THREADED
from planners.sampling.sampler import Sampler
from planners.sampling.settings import SamplingSettings
from planners.solve import solve
from planners.theta import LazyTheta, LazyThetaSettings, Theta, ThetaSettings
from planners.voxels import Voxels

SPATIAL = ("astar", "auto")  # planners that plan on 3-D maps, too


class Planner(NamedTuple):
    """A planner."""

    engine: Callable[..., Engine]  #: made on a `Costmap`; some also on `Voxels`
    settings: type[SearchSettings]  #: class of its settings
    headings: bool = False  #: whether it heeds headings
    anytime: bool = False  #: whether it tells of routes while it searches, and can be cancelled
    spatial: bool = False  #: whether it can be made on `Voxels`
    repeatable: bool = True  #: whether it repeats a route exactly, if no time limit ends it


class Planners(MutableMapping[str, Planner]):
    """Planners by name: our own, and those of OMPL where it is installed.

    OMPL is loaded by what can't be answered without it: a name that is not one of ours, or a list
    of all. So neither an import of this package nor a plan with A* waits for it.

    Parameters
    ----------
    own : dict

    Examples
    --------
    >>> "astar" in PLANNERS, "no_such" in PLANNERS, sorted(OWN_PLANNERS)[:3]
    (True, False, ['ara', 'astar', 'auto'])
    """

    def __init__(self, own: dict[str, Planner]) -> None:
        self._own = own

    def __getitem__(self, name: str) -> Planner:
        return self._own[name] if name in self._own else _sampling()[name]

    def __setitem__(self, name: str, planner: Planner) -> None:
        self._own[name] = planner

    def __delitem__(self, name: str) -> None:
        del self._own[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._own | _sampling())

    def __len__(self) -> int:
        return len(self._own | _sampling())


@cache
def _sampling() -> dict[str, Planner]:
    return {
        name: Planner(
            partial(Sampler, name),
            SamplingSettings,
            headings=True,
            anytime=True,
            spatial=True,
            repeatable=name not in THREADED,
        )
        for name in samplers()
    }


OWN_PLANNERS: dict[str, Planner] = {
    "astar": Planner(AStar, AStarSettings),
    "ara": Planner(ARA, ARASettings, anytime=True),
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
PLANNERS = Planners(dict(OWN_PLANNERS))


def plan(
    problem: PlanningProblem,
    planner: str = "astar",
    *,
    on_improved: OnImproved | None = None,
    cancel: Cancel | None = None,
    **settings: Any,
) -> Route:
    """Return a route that the audit passed, or raise an exception that says why there is none.

    Parameters
    ----------
    problem : PlanningProblem
    planner : str, default "astar"
        A name in `PLANNERS`.
    on_improved : callable, optional
        Called with an `Improvement` for the first route and every better one, while the search
        goes on. If it returns True, it hears no more, and the search ends. Only "ara" and sampling
        planners tell.
    cancel : Cancel, optional
        Such as a `threading.Event`: once another thread sets it, the search ends, with the best
        route so far. Only "ara" and sampling planners look at it.
    **settings
        The planner's settings, such as `planners.AStarSettings`.

    Raises
    ------
    ProblemError
        No planner of that name, or one that can neither tell nor be cancelled.
    SettingsError
        An unknown setting, or one out of its range (from `groundmap.errors`).
    OutsideMapError, NonFreeError, UnknownSpaceError
        Start or goal is no place for the footprint.
    EnclosedError
        No route joins them.
    TimeLimitError
        Time ran out.
    CancelledError
        The search was cancelled before there was a route.
    UnsolvedError
        A sampling planner ended without a route.
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
    entry = named(planner)
    began = now()
    chosen = entry.settings(**settings)
    watch = _watch(planner, entry, on_improved=on_improved, cancel=cancel)
    check_on_map(problem, goal=not chosen.takes_other_goals)
    space = space_of(problem)
    if isinstance(space, Voxels) and not entry.spatial:
        return solve(space, _engine_3d(space, planner), chosen, began=began)
    headings = entry.headings and chosen.heeds_headings(problem)
    return solve(space, entry.engine(space), chosen, began=began, headings=headings, watch=watch)


def _watch(planner: str, entry: Planner, **watch: Any) -> dict[str, Any]:
    """Return what an anytime planner is to tell of or to look at; others have no such thing."""
    asked = {name: value for name, value in watch.items() if value is not None}
    if asked and not entry.anytime:
        expected = "none, or an anytime planner: 'ara' or a sampling one"
        raise ProblemError(next(iter(asked)), expected, repr(planner))
    if "on_improved" in asked and not callable(asked["on_improved"]):
        raise ProblemError("on_improved", "a callable", repr(asked["on_improved"]))
    check_cancel(asked.get("cancel"))
    return asked


def _engine_3d(space: Voxels, planner: str) -> AStar3D:
    if planner not in SPATIAL:
        expected = f"one that plans on 3-D maps: {', '.join(SPATIAL)}, or a sampling one"
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
        raise ProblemError(
            "planner",
            f"one of {', '.join(sorted(PLANNERS))}",
            repr(planner),
            hint="" if samplers() else "Sampling planners need OMPL: pip install ompl.",
        )
    return PLANNERS[planner]
