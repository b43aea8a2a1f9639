"""From A to B on a confidence grid: routes, or reasons why there is none."""

from planners.astar import AStarSettings, DijkstraSettings, WeightedAStarSettings
from planners.costs import CostSettings
from planners.errors import (
    AuditError,
    EnclosedError,
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    PlanningError,
    ProblemError,
    TimeLimitError,
    UnknownSpaceError,
)
from planners.footprint import Footprint
from planners.problem import PlanningProblem
from planners.registry import PLANNERS, plan
from planners.route import Route

__all__ = [
    "AStarSettings",
    "AuditError",
    "CostSettings",
    "DijkstraSettings",
    "EnclosedError",
    "Footprint",
    "NoRouteError",
    "NonFreeError",
    "OutsideMapError",
    "PLANNERS",
    "PlanningError",
    "PlanningProblem",
    "ProblemError",
    "Route",
    "TimeLimitError",
    "UnknownSpaceError",
    "WeightedAStarSettings",
    "plan",
]
