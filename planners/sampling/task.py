"""What one of OMPL's planners is to do, and what it brings back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from groundmap.arrays import Bools
from planners.problem.problem import Pose
from planners.sampling.improvement_reporter import ImprovementReporter
from planners.sampling.motion_validator import Bounds, MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.objectives import Objective
from planners.sampling.settings import SamplingSettings
from planners.search.base import Clock
from planners.search.graph import Graph


@dataclass(frozen=True, eq=False)
class Task:
    """What one of OMPL's planners is to do."""

    name: str  #: of the planner
    validator: MotionValidator | MotionValidator3D
    region: Bools  #: cells to draw samples from
    room: Bounds  #: box that OMPL samples
    start: Pose
    goals: list[Pose]  #: clear states, each of which will do
    objective: Objective
    settings: SamplingSettings
    clock: Clock
    reporter: ImprovementReporter
    first: list[Pose]  #: states to draw before any others
    asked: tuple[Pose, Pose]  #: start and goal as they were given [m, map]


class TaskResult(NamedTuple):
    """What OMPL brought back."""

    status: str
    states: list[Pose]  #: the path, if there is one
    left: float | None  #: from its end to the goal, in the space's own distance [m]
    checked: int  #: edges
    graph: Graph | None = None  #: the tree or roadmap, if it was to be kept
