"""Roadmaps that are grown once and queried many times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from groundmap.arrays import Floats, is_number
from groundmap.errors import SettingsError
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_on_map, check_space
from planners.errors import AuditError, ProblemError, UnsolvedError
from planners.problem.problem import PlanningProblem, Pose
from planners.route.route import Route
from planners.route.solve import solve
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.objectives import Objective
from planners.sampling.ompl_module import samplers
from planners.sampling.roadmap_files import read_roadmap, write_roadmap
from planners.sampling.roadmap_growth import grow_roadmap
from planners.sampling.roadmap_query import CountingCheck, RoadmapQuery
from planners.sampling.search_result import to_search_result
from planners.sampling.settings import FLAT, SamplingSettings, refusal
from planners.search.base import Cancel, SearchResult, check_cancel, now
from planners.search.graph import Graph

NAME = "roadmap"
GROWERS = ("prm", "prmstar")
# The settings of sampling planners that roadmaps use, during growth and in queries.
GROWTH = ("space", "seed", "iterations", "turning_radius", "yaw_weight", "max_nearest_neighbors")
QUERIES = ("simplify", "length_weight", "time_weight", "max_speed", "max_turn_rate")


class Roadmap:
    """A graph of poses and clear edges over a map: grown once, queried many times.

    `plan` searches anew for every start and goal. A roadmap covers all places that can be reached;
    a query connects its start and goal to the roadmap and returns the cheapest path through it,
    within milliseconds. A roadmap is valid for one map: when that changes, grow another.

    `Roadmap.grow` creates a roadmap, `Roadmap.load` reads one from a file.

    Attributes
    ----------
    problem : PlanningProblem
        The problem that it was grown for; all of it but start and goal applies to every query.
    graph : Graph
        Plain arrays; `groundmap.draw.draw_graph` draws them.
    settings : SamplingSettings
    validator : MotionValidator2D
    name : str

    Examples
    --------
    A floor with a wall that has a door:

    >>> import numpy as np
    >>> from groundmap import ConfidenceGrid
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> floor = np.full((64, 64), -1.0, dtype=np.float32)
    >>> floor[:50, 30:32] = 1.0
    >>> grid.fuse(np.array([0, 0]), floor)
    >>> problem = PlanningProblem(grid, start=(4, 4), goal=(28, 4), footprint=0.9)

    One roadmap, many routes:

    >>> roadmap = Roadmap.grow(problem, seconds=0.2)
    >>> for start, goal in [((4, 4), (28, 4)), ((4, 4), (4, 28)), ((28, 28), (4, 28))]:
    ...     route = roadmap.plan(start, goal)
    ...     print(route.planner, route.audit, route.length < 60)
    roadmap clean True
    roadmap clean True
    roadmap clean True
    """

    name = NAME

    def __init__(
        self, validator: MotionValidator2D, graph: Graph, settings: SamplingSettings
    ) -> None:
        self.validator, self.graph, self.settings = validator, graph, settings
        self.problem = validator.costmap.problem
        self._objective = Objective(validator, settings)
        self._query = RoadmapQuery(graph, validator, self._objective, settings)

    @classmethod
    def grow(
        cls,
        problem: PlanningProblem,
        *,
        seconds: float = 2.0,
        planner: str = "prm",
        cancel: Cancel | None = None,
        **settings: Any,
    ) -> Roadmap:
        """Return a roadmap of the region that can be reached from a problem's start.

        Parameters
        ----------
        problem : PlanningProblem
            On a 2-D map. With ``clear_start``, the unknown cells near *its* start count as free
            for every query, and no others. Its goal is ignored, except that an outline is planned
            for in se2 only if both start and goal have a yaw.
        seconds : float, default 2 [s]
            Duration of growth, without the conversion to arrays.
        planner : {"prm", "prmstar"}
            OMPL's planner: PRM connects each pose to its 10 nearest ones, PRM* to an increasing
            number of them.
        cancel : Cancel, optional
            Such as a `threading.Event`: once set, growth ends.
        **settings
            Fields of `planners.SamplingSettings`. For growth: ``space`` (not "dubins", as edges
            have no direction), ``seed``, ``turning_radius``, ``yaw_weight``,
            ``max_nearest_neighbors`` and ``iterations``, with which growth repeats exactly if
            ``seconds`` suffice. For queries: ``simplify``, ``length_weight``, ``time_weight``,
            ``max_speed`` and ``max_turn_rate``.

        Raises
        ------
        ProblemError
            A 3-D map, a start without a yaw where the space needs one, another planner, a space
            that it does not support, or OMPL is not installed.
        SettingsError
            A setting that roadmaps do not support, or one out of its range.
        OutsideMapError, NonFreeError, UnknownSpaceError
            The footprint does not fit at the start.
        CancelledError
            `cancel` was set before growth began.
        """
        check_cancel(cancel)
        validator, checked = _validator_of(problem, planner, settings)
        if not (is_number(seconds) and seconds > 0):
            raise SettingsError("seconds", "a number above 0 [s]", repr(seconds))
        if not samplers():
            raise ProblemError("planner", "OMPL", "none", hint="pip install ompl.")
        start = tuple(map(float, problem.start))
        check_space(validator.costmap, "start", start, headings=validator.space not in FLAT)
        Objective(validator, checked)  # rejects invalid weights before growth
        graph = grow_roadmap(
            planner, validator, validator.state_of(start), checked, seconds=seconds, cancel=cancel
        )
        return cls(validator, graph, checked)

    def plan(
        self, start: Sequence[float] | Floats, goal: Sequence[float] | Floats, *, audit: bool = True
    ) -> Route:
        """Return the cheapest route through the roadmap, shortened where possible.

        `Route.expanded` counts edges that were checked.

        Parameters
        ----------
        start, goal : sequence of float
            x, y [m, map] and, where the space has one, yaw [rad].
        audit : bool, default True
            Whether the route is audited; if not, its `audit` is "skipped".

        Raises
        ------
        ProblemError
            A wrong number of coordinates, coordinates that are not finite, or an audited route
            that is blocked because the map has changed since the roadmap was grown.
        OutsideMapError, NonFreeError, UnknownSpaceError
            The footprint does not fit at the start or the goal.
        EnclosedError
            There is no route.
        UnsolvedError
            The roadmap has no path; one that is grown for longer may have one.
        """
        began = now()
        place = self.problem.clear_place
        problem = replace(self.problem, start=start, goal=goal, cleared_at=place)
        check_on_map(problem)
        try:
            return solve(
                self.validator.costmap.with_problem(problem),
                self,
                self.settings,
                began=began,
                headings=self.validator.space not in FLAT,
                audited=audit,
            )
        except AuditError as error:
            if np.array_equal(Costmap.of(problem).blocked, self.validator.costmap.blocked):
                raise
            expected = "the map that the roadmap was grown on"
            hint = "Grow another roadmap."
            raise ProblemError("grid", expected, "one that has changed", hint=hint) from error

    def search(self, start: Pose, goal: Pose, settings: SamplingSettings) -> SearchResult | None:
        """Return a route as a planner's engine does, or None if there is provably none.

        Parameters
        ----------
        start, goal : tuple of float
            x, y [m, map] and, where the space has one, yaw [rad].
        settings : SamplingSettings

        Raises
        ------
        UnsolvedError
            The roadmap has no path; one that is grown for longer may have one.
        """
        ends = self.validator.state_of(start), self.validator.state_of(goal)
        is_clear = CountingCheck(self.validator.is_clear)
        if not all(is_clear(end, end) for end in ends):
            return None
        path = self._query.path(*ends, is_clear)
        if path is None:
            if self.validator.bounds(*ends) is None:
                return None
            count = len(self.graph.vertices)
            reason = f"its {count} vertices do not connect start and goal: grow it for longer"
            raise UnsolvedError(NAME, reason=reason, expanded=is_clear.count)
        if settings.simplify:
            path = self._query.shorten(path, is_clear)
        cost = self._objective.cost(path)
        return to_search_result(
            self.validator, path, query=(start, goal), cost=cost, checked=is_clear.count
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the roadmap to an ``.npz`` file atomically: arrays and JSON, no pickle.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        settings = self.settings.model_dump(include=set(GROWTH + QUERIES), exclude_unset=True)
        write_roadmap(path, self.graph, self.validator.costmap, settings)

    @classmethod
    def load(cls, path: str | PathLike[str], problem: PlanningProblem) -> Roadmap:
        """Return a roadmap from a file that `save` wrote.

        Parameters
        ----------
        path : path-like
        problem : PlanningProblem
            With the same map, footprint and options as when it was grown. Its start and goal are
            ignored; without ``cleared_at``, the same unknown cells count as free as then.

        Raises
        ------
        FileFormatError
            Missing, damaged, of another kind or a newer version, or grown on other free cells or
            for another footprint.
        """
        if not isinstance(problem, PlanningProblem):
            raise ProblemError("problem", "a PlanningProblem", repr(problem))
        graph, costmap, settings = read_roadmap(path, problem)
        assert settings.space is not None
        validator = MotionValidator2D(costmap, settings.space, settings.turning_radius)
        return cls(validator, graph, settings)


def _validator_of(
    problem: PlanningProblem, planner: str, settings: dict[str, Any]
) -> tuple[MotionValidator2D, SamplingSettings]:
    """Return the motion validator of a roadmap to grow, and its checked settings."""
    checked = SamplingSettings(**settings)
    for name in settings:
        if name not in GROWTH + QUERIES:
            raise SettingsError(name, f"one of {', '.join(GROWTH + QUERIES)}", "another setting")
    if not isinstance(planner, str) or planner not in GROWERS:
        raise ProblemError("planner", " or ".join(map(repr, GROWERS)), repr(planner))
    if planner == "prmstar" and checked.max_nearest_neighbors is not None:
        expected = "none for 'prmstar', which increases the number"
        raise SettingsError("max_nearest_neighbors", expected, str(checked.max_nearest_neighbors))
    problem.check_dimensions(2)
    check_on_map(replace(problem, goal=problem.start))
    start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
    space = checked.space_for(problem.shape, start, goal)
    reason = refusal(planner, space)
    if reason is not None or space == "r3":
        hint = reason or "Roadmaps support 2-D maps only."
        raise ProblemError("planner", f"one that works in {space!r}", planner, hint=hint)
    if space not in FLAT and len(start) != 3:
        raise ProblemError("start", f"x, y [m] and yaw [rad] in {space}", str(start))
    checked = checked.model_copy(update={"space": space})
    return MotionValidator2D(Costmap.of(problem), space, checked.turning_radius), checked
