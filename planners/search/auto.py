"""The fastest optimal planner for a costmap."""

from __future__ import annotations

from planners.costmap.costmap import Costmap
from planners.problem.problem import Pose
from planners.search.astar import AStar
from planners.search.base import Engine, SearchResult, SearchSettings
from planners.search.jps import JPS


class AutoSettings(SearchSettings):
    """Settings of the fastest planner."""


class Auto:
    """Jump point search if costs are uniform, else A*.

    Both return a route of the least cost; the route's `planner` names the chosen one.
    """

    def __init__(self, costmap: Costmap) -> None:
        engine: type[Engine] = JPS if costmap.uniform else AStar
        self.engine = engine(costmap)
        self.name = self.engine.name

    def search(self, start: Pose, goal: Pose, settings: AutoSettings) -> SearchResult | None:
        """Return the route of least cost, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x and y [m, map]; the rest is ignored.
        settings : AutoSettings

        Raises
        ------
        TimeLimitError
            The time limit is exceeded; with a limit of 0, always.
        """
        return self.engine.search(start, goal, SearchSettings(time_limit=settings.time_limit))
