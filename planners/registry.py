"""Planners by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from functools import cache, partial
from typing import NamedTuple

from planners.costmap.costmap import Costmap
from planners.costmap.map_space import MapSpace
from planners.errors import ProblemError
from planners.sampling.ompl_module import samplers
from planners.sampling.ompl_search import THREADED
from planners.sampling.planner import SamplingPlanner
from planners.sampling.settings import SamplingSettings
from planners.search.ara import ARA, ARASettings
from planners.search.astar import (
    AStar,
    AStarSettings,
    Dijkstra,
    DijkstraSettings,
    WeightedAStar,
    WeightedAStarSettings,
)
from planners.search.astar3d import AStar3D
from planners.search.auto import Auto, AutoSettings
from planners.search.base import Engine, SearchSettings
from planners.search.dstar_lite import DStarLite, DStarLiteSettings
from planners.search.hybrid_astar import HybridAStar, HybridAStarSettings
from planners.search.jps import JPS, JPSPlus, JPSPlusSettings, JPSSettings
from planners.search.polyanya import Polyanya, PolyanyaSettings
from planners.search.theta import LazyTheta, LazyThetaSettings, Theta, ThetaSettings


class Planner(NamedTuple):
    """A planner."""

    engine: Callable[..., Engine]  #: makes its search engine on a `Costmap`
    settings: type[SearchSettings]  #: class of its settings
    headings: bool = False  #: whether it plans headings
    anytime: bool = False  #: whether it reports routes during the search and can be cancelled
    engine_3d: Callable[..., Engine] | None = None  #: makes its search engine on `Voxels`
    repeatable: bool = True  #: whether it repeats a route exactly unless a time limit ends it


class Planners(MutableMapping[str, Planner]):
    """Planners by name: those of this package, and those of OMPL if it is installed.

    OMPL is only loaded for names that are not in this package and for a list of all names, so that
    neither an import of this package nor a plan with A* waits for it.

    Parameters
    ----------
    own : dict
        Planners of this package.

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
            partial(SamplingPlanner, name),
            SamplingSettings,
            headings=True,
            anytime=True,
            engine_3d=partial(SamplingPlanner, name),
            repeatable=name not in THREADED,
        )
        for name in samplers()
    }


OWN_PLANNERS: dict[str, Planner] = {
    "astar": Planner(AStar, AStarSettings, engine_3d=AStar3D),
    "ara": Planner(ARA, ARASettings, anytime=True),
    "auto": Planner(Auto, AutoSettings, engine_3d=AStar3D),
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


def get_planner(planner: str) -> Planner:
    """Return the planner of a name.

    Raises
    ------
    ProblemError
        There is none; the message lists the available names.
    """
    if not isinstance(planner, str) or planner not in PLANNERS:
        raise ProblemError(
            "planner",
            f"one of {', '.join(sorted(PLANNERS))}",
            repr(planner),
            hint="" if samplers() else "Sampling planners need OMPL: pip install ompl.",
        )
    return PLANNERS[planner]


def make_engine(space: MapSpace, planner: str) -> Engine:
    """Return the search engine of a planner on a map.

    Parameters
    ----------
    space : Costmap or Voxels
    planner : str
        A name in `PLANNERS`.

    Raises
    ------
    ProblemError
        A 3-D map, which the planner does not support.
    """
    entry = PLANNERS[planner]
    make = entry.engine if isinstance(space, Costmap) else entry.engine_3d
    if make is None:
        own = (name for name, one in OWN_PLANNERS.items() if one.engine_3d is not None)
        expected = f"one that supports 3-D maps: {', '.join(own)} or a sampling planner"
        raise ProblemError("planner", expected, repr(planner))
    return make(space)
