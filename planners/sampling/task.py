"""Input and result of one search with OMPL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from groundmap.arrays import Bools
from planners.problem.problem import Pose
from planners.sampling.improvement_reporter import ImprovementReporter
from planners.sampling.motion_validator import Bounds, MotionValidator
from planners.sampling.objectives import Objective
from planners.sampling.settings import SamplingSettings
from planners.search.base import Clock
from planners.search.graph import Graph


@dataclass(frozen=True, eq=False)
class Task:
    """Input of one search."""

    name: str  #: of the planner
    validator: MotionValidator
    region: Bools  #: cells to sample
    bounds: Bounds  #: box that OMPL samples
    start: Pose
    goals: list[Pose]  #: clear states, any of which may end the path
    objective: Objective
    settings: SamplingSettings
    clock: Clock
    reporter: ImprovementReporter
    first: list[Pose]  #: states to sample before any others
    query: tuple[Pose, Pose]  #: start and goal as given [m, map]


class TaskResult(NamedTuple):
    """Result of one search."""

    status: str  #: OMPL's, or another reason for a failure
    states: list[Pose]  #: the path; empty without a solution
    left: float | None  #: from its end to the goal, in the space's own metric [m]
    checked: int  #: number of edges checked
    graph: Graph | None = None  #: the planner's tree or roadmap, if kept
