"""The names that `planners` shows on the outside; it loads this module when one is asked for."""

from planners.ara import ARASettings
from planners.astar import AStarSettings, DijkstraSettings, WeightedAStarSettings
from planners.auto import AutoSettings
from planners.costs import CostSettings
from planners.dstar_lite import DStarLiteSettings
from planners.enclosure import widest_route
from planners.engine import Improvement
from planners.errors import (
    AuditError,
    CancelledError,
    EnclosedError,
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    PlanningError,
    ProblemError,
    SmoothingError,
    TimeLimitError,
    UnknownSpaceError,
    UnsolvedError,
)
from planners.fields import distance_field, reachable
from planners.footprint import Footprint
from planners.hybrid import HybridAStarSettings
from planners.incremental import IncrementalPlanner
from planners.jps import JPSPlusSettings, JPSSettings
from planners.many import plan_many
from planners.polyanya import PolyanyaSettings
from planners.problem import PlanningProblem
from planners.registry import OWN_PLANNERS, PLANNERS, plan
from planners.route import Route
from planners.sampling.roadmap import Roadmap
from planners.sampling.settings import SamplingSettings
from planners.shortcuts import shortcut
from planners.smoother import max_curvature, smooth
from planners.theta import LazyThetaSettings, ThetaSettings
from planners.widest import WidestRoute

__all__ = [
    "ARASettings",
    "AStarSettings",
    "AuditError",
    "AutoSettings",
    "CancelledError",
    "CostSettings",
    "DStarLiteSettings",
    "DijkstraSettings",
    "EnclosedError",
    "Footprint",
    "HybridAStarSettings",
    "Improvement",
    "IncrementalPlanner",
    "JPSPlusSettings",
    "JPSSettings",
    "LazyThetaSettings",
    "NoRouteError",
    "NonFreeError",
    "OWN_PLANNERS",
    "OutsideMapError",
    "PLANNERS",
    "PlanningError",
    "PlanningProblem",
    "PolyanyaSettings",
    "ProblemError",
    "Roadmap",
    "Route",
    "SamplingSettings",
    "SmoothingError",
    "ThetaSettings",
    "TimeLimitError",
    "UnknownSpaceError",
    "UnsolvedError",
    "WeightedAStarSettings",
    "WidestRoute",
    "distance_field",
    "max_curvature",
    "plan",
    "plan_many",
    "reachable",
    "shortcut",
    "smooth",
    "widest_route",
]
