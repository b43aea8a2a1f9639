"""Roadmaps grown by OMPL's PRM and PRM*, without a query."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from planners.engine import Cancel, Clock, Pose
from planners.sampling.door import logged, ompl, samplers
from planners.sampling.draws import Draws
from planners.sampling.graph import Graph, graph_of
from planners.sampling.settings import SamplingSettings
from planners.sampling.states import drawing, edge_check, information_of, space_of
from planners.sampling.turns import Ending, turn
from planners.sampling.ways import Ways, box_of


def grown(
    planner: str,
    ways: Ways,
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
    ways : Ways
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
    region = ways.region(start)
    # This check also compiles the kernels, if they are not: that is no time of growth.
    first = [start] if ways.is_clear(*start, *start) else []
    with turn(Clock(planner, None, Ending(cancel))), logged():
        util.RNG.setSeed(settings.seed + 1)  # 0 is refused
        box = box_of(region, ways.costmap.window.resolution)
        space = space_of(base, ways.space, box, settings)
        edge = edge_check(ways, count(1), lambda: None)
        seed, yaw_weight = settings.seed, settings.yaw_weight
        draws = Draws(ways, region, seed=seed, yaw_weight=yaw_weight, first=first)
        # States need no check, as only clear ones are drawn.
        sampler = drawing(base, draws, ways.space)
        information = information_of(base, space, edge, sampler=sampler)
        prm = getattr(geometric, samplers()[planner])(information)
        if settings.max_nearest_neighbors is not None:
            prm.setMaxNearestNeighbors(settings.max_nearest_neighbors)
        prm.setProblemDefinition(base.ProblemDefinition(information))  # it crashes without one
        prm.setup()
        # Growing alone runs no threads, so the question whether to stop may be Python's.
        stop = _stop(settings, Clock(planner, seconds, Ending(cancel)))
        prm.growRoadmapPtc(base.PlannerTerminationCondition(stop))
        return graph_of(base, prm, information, ways)


def _stop(settings: SamplingSettings, clock: Clock) -> Callable[[], bool]:
    looks, over = count(1), False

    def stop() -> bool:
        nonlocal over
        used_up = settings.iterations is not None and next(looks) >= settings.iterations
        over = over or used_up or clock.is_up
        return over

    return stop
