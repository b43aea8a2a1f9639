"""The fastest exact planner that a problem allows."""

from __future__ import annotations

from planners.costmap.costmap import Costmap
from planners.problem.problem import Pose
from planners.search.astar import AStar
from planners.search.base import Engine, SearchResult, SearchSettings
from planners.search.jps import JPS


class AutoSettings(SearchSettings):
    """What the choice of the fastest planner can be told."""


class Auto:
    """Jump point search where every metre costs the same, A* where some are dearer.

    Both bring a route of the least cost; the route's `planner` names the one that was chosen.
    """

    def __init__(self, costmap: Costmap) -> None:
        engine: type[Engine] = JPS if costmap.uniform else AStar
        self.engine = engine(costmap)
        self.name = self.engine.name

    def search(self, start: Pose, goal: Pose, settings: AutoSettings) -> SearchResult | None:
        """Return the route of least cost, or None if there is none.

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        return self.engine.search(start, goal, SearchSettings(time_limit=settings.time_limit))
