"""Roadmaps grown by OMPL's PRM and PRM*, without a query."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator, box_of
from planners.sampling.ompl_lock import Ending, turn
from planners.sampling.ompl_module import ompl, redirect_log, samplers
from planners.sampling.ompl_states import drawing, edge_check, information_of, space_of
from planners.sampling.planner_data import graph_of
from planners.sampling.settings import SamplingSettings
from planners.sampling.state_sampler import StateSampler
from planners.search.base import Cancel, Clock
from planners.search.graph import Graph


def grow_roadmap(
    planner: str,
    validator: MotionValidator,
    start: Pose,
    settings: SamplingSettings,
    *,
    seconds: float,
    cancel: Cancel | None,
) -> Graph:
    """Return a roadmap.

    Parameters
    ----------
    planner : {"prm", "prmstar"}
    validator : MotionValidator
    start : state
        It grows over what can be reached from there.
    settings : SamplingSettings
    seconds : float [s]
        It grows for so long, or until ``settings.iterations`` are used up.
    cancel : Cancel, optional
        Once it is set, growth ends.

    Raises
    ------
    CancelledError
        That was before growth began, while another search ran.
    """
    base, geometric, util = ompl()
    region = validator.region(start)
    # This check also compiles the kernels, if they are not: that is no time of growth.
    first = [start] if validator.is_clear(*start, *start) else []
    with turn(Clock(planner, None, Ending(cancel))), redirect_log():
        util.RNG.setSeed(settings.seed + 1)  # 0 is refused
        box = box_of(region, validator.costmap.window.resolution)
        space = space_of(base, validator.space, box, settings)
        edge = edge_check(validator, count(1), lambda: None)
        seed, yaw_weight = settings.seed, settings.yaw_weight
        sampler = StateSampler(validator, region, seed=seed, yaw_weight=yaw_weight, first=first)
        # States need no check, as only clear ones are drawn.
        allocator = drawing(base, sampler, validator.space)
        information = information_of(base, space, edge, allocator=allocator)
        prm = getattr(geometric, samplers()[planner])(information)
        if settings.max_nearest_neighbors is not None:
            prm.setMaxNearestNeighbors(settings.max_nearest_neighbors)
        prm.setProblemDefinition(base.ProblemDefinition(information))  # it crashes without one
        prm.setup()
        # Growing alone runs no threads, so the question whether to stop may be Python's.
        stop = _stop(settings, Clock(planner, seconds, Ending(cancel)))
        prm.growRoadmapPtc(base.PlannerTerminationCondition(stop))
        return graph_of(base, prm, information, validator)


def _stop(settings: SamplingSettings, clock: Clock) -> Callable[[], bool]:
    looks, over = count(1), False

    def stop() -> bool:
        nonlocal over
        used_up = settings.iterations is not None and next(looks) >= settings.iterations
        over = over or used_up or clock.is_up
        return over

    return stop
