"""The public names of `planners`, which loads this module on the first access to one of them."""

from planners.batch_planning import plan_many
from planners.errors import (
    AuditError,
    CancelledError,
    EnclosedError,
    KeepOutError,
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
from planners.incremental import IncrementalPlanner
from planners.no_route import widest_route
from planners.planning import plan
from planners.problem.costs import CostSettings
from planners.problem.footprint import Footprint
from planners.problem.keep_out import KeepOut
from planners.problem.keep_out_file import read_keep_out
from planners.problem.problem import PlanningProblem
from planners.registry import OWN_PLANNERS, PLANNERS
from planners.route.route import Route
from planners.route.shortcut import shortcut
from planners.route.smooth import max_curvature, smooth
from planners.sampling.roadmap import Roadmap
from planners.sampling.settings import SamplingSettings
from planners.search.ara import ARASettings
from planners.search.astar import AStarSettings, DijkstraSettings, WeightedAStarSettings
from planners.search.auto import AutoSettings
from planners.search.base import Improvement
from planners.search.distance_field import distance_field, reachable
from planners.search.dstar_lite import DStarLiteSettings
from planners.search.hybrid_astar import HybridAStarSettings
from planners.search.jps import JPSPlusSettings, JPSSettings
from planners.search.polyanya import PolyanyaSettings
from planners.search.theta import LazyThetaSettings, ThetaSettings
from planners.search.widest_path import WidestRoute

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
    "KeepOut",
    "KeepOutError",
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
    "read_keep_out",
    "shortcut",
    "smooth",
    "widest_route",
]
