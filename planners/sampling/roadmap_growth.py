"""Growth of roadmaps by OMPL's PRM and PRM*, without a query."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from planners.problem.problem import Pose
from planners.sampling.motion_validator import box_of
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_lock import StopRequest, hold_ompl
from planners.sampling.ompl_module import ompl, redirect_log, samplers
from planners.sampling.ompl_states import edge_check, information_of, sampler_allocator, space_of
from planners.sampling.planner_data import graph_of
from planners.sampling.settings import SamplingSettings
from planners.sampling.state_sampler import StateSampler
from planners.search.base import Cancel, Clock
from planners.search.graph import Graph


def grow_roadmap(
    planner: str,
    validator: MotionValidator2D,
    start: Pose,
    settings: SamplingSettings,
    *,
    seconds: float,
    cancel: Cancel | None,
) -> Graph:
    """Return a roadmap of the region that can be reached from a start.

    Parameters
    ----------
    planner : {"prm", "prmstar"}
    validator : MotionValidator2D
    start : state [m, corner; rad]
    settings : SamplingSettings
    seconds : float [s]
        Duration of growth, unless ``settings.iterations`` are used up before.
    cancel : Cancel, optional
        Once set, growth ends.

    Raises
    ------
    CancelledError
        `cancel` was set before growth began, while another search ran.
    """
    base, geometric, util = ompl()
    region = validator.region(start)
    # This check also compiles the kernels, so that compilation takes no time of growth.
    first = [start] if validator.is_clear(*start, *start) else []
    with hold_ompl(Clock(planner, None, StopRequest(cancel))), redirect_log():
        util.RNG.setSeed(settings.seed + 1)  # 0 is refused
        bounds = box_of(region, validator.costmap.window.resolution)
        space = space_of(base, validator.space, bounds, settings)
        edge = edge_check(validator, count(1), lambda: None)
        seed, yaw_weight = settings.seed, settings.yaw_weight
        sampler = StateSampler(validator, region, seed=seed, yaw_weight=yaw_weight, first=first)
        # States need no check, as only clear ones are sampled.
        allocator = sampler_allocator(base, sampler, validator.space)
        information = information_of(base, space, edge, allocator=allocator)
        prm = getattr(geometric, samplers()[planner])(information)
        if settings.max_nearest_neighbors is not None:
            prm.setMaxNearestNeighbors(settings.max_nearest_neighbors)
        prm.setProblemDefinition(base.ProblemDefinition(information))  # required, or it crashes
        prm.setup()
        # Growth runs no threads, so its termination condition may call Python.
        stop = _termination(settings, Clock(planner, seconds, StopRequest(cancel)))
        prm.growRoadmapPtc(base.PlannerTerminationCondition(stop))
        return graph_of(base, prm, information, validator)


def _termination(settings: SamplingSettings, clock: Clock) -> Callable[[], bool]:
    """Return a termination condition that stays true once it is."""
    calls, is_over = count(1), False

    def stop() -> bool:
        nonlocal is_over
        used_up = settings.iterations is not None and next(calls) >= settings.iterations
        is_over = is_over or used_up or clock.is_up
        return is_over

    return stop
