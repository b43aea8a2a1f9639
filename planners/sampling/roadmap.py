"""Roadmaps that are grown once and asked many times."""

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
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.objectives import Objective
from planners.sampling.ompl_module import samplers
from planners.sampling.roadmap_files import read_roadmap, write_roadmap
from planners.sampling.roadmap_growth import grow_roadmap
from planners.sampling.roadmap_query import Checked, RoadmapQuery
from planners.sampling.search_result import to_search_result
from planners.sampling.settings import FLAT, SamplingSettings, refusal
from planners.search.base import Cancel, SearchResult, check_cancel, now
from planners.search.graph import Graph

NAME = "roadmap"
GROWERS = ("prm", "prmstar")
# What a roadmap heeds of what sampling planners can be told.
GROWTH = ("space", "seed", "iterations", "turning_radius", "yaw_weight", "max_nearest_neighbors")
QUERIES = ("simplify", "length_weight", "time_weight", "max_speed", "max_turn_rate")


class Roadmap:
    """A roadmap over a map: grown once, then asked for a route as often as one likes.

    Where `plan` begins anew for every start and goal, a roadmap keeps what it learned: a net of
    poses and of clear ways between them, all over the places that can be reached. A query joins
    its start and its goal to the net and takes the cheapest way through it, which is a matter of
    milliseconds. The net knows one map: when that changes, grow another.

    `Roadmap.grow` makes one, `Roadmap.load` reads one from a file.

    Attributes
    ----------
    problem : PlanningProblem
        The one it was grown for; all but its start and goal holds for every query.
    graph : Graph
        The net, as plain arrays; `groundmap.draw.draw_graph` draws it.
    settings : SamplingSettings
    validator : MotionValidator
    name : str

    Examples
    --------
    A floor with a wall, and a door in it:

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
        self, validator: MotionValidator, graph: Graph, settings: SamplingSettings
    ) -> None:
        self.validator, self.graph, self.settings = validator, graph, settings
        self.problem = validator.costmap.problem
        self._objective = Objective(validator, settings)
        self._net = RoadmapQuery(graph, validator, self._objective, settings)

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
        """Return a roadmap of all that can be reached from a problem's start.

        Parameters
        ----------
        problem : PlanningProblem
            On a 2-D map. With ``clear_start``, the unknown cells near *its* start count as free,
            for every query, and no others. Its goal does not matter, but for whether it has a yaw.
        seconds : float, default 2 [s]
            How long it grows; reading it out takes some time, too.
        planner : {"prm", "prmstar"}
            OMPL's planner that grows it: PRM joins each pose to its 10 nearest ones, PRM* to
            more and more.
        cancel : Cancel, optional
            Such as a `threading.Event`: once set, growth ends.
        **settings
            Those of `planners.SamplingSettings` that roadmaps heed. Of growth: ``space`` ("dubins"
            is refused: a roadmap has no direction), ``seed``, ``turning_radius``, ``yaw_weight``,
            ``max_nearest_neighbors``, and ``iterations``, with which growth repeats exactly if
            ``seconds`` suffice. Of queries: ``simplify``, and the weights of what is to be small.

        Raises
        ------
        ProblemError
            A 3-D map, a start without a yaw where the space needs one, another planner, a space
            it can't plan in, no OMPL.
        SettingsError
            A setting that roadmaps don't heed, or one out of its range.
        OutsideMapError, NonFreeError, UnknownSpaceError
            The start is no place for the footprint.
        CancelledError
            `cancel` was set before growth began.
        """
        check_cancel(cancel)
        validator, told = _ways_of(problem, planner, settings)
        if not (is_number(seconds) and seconds > 0):
            raise SettingsError("seconds", "a number above 0 [s]", repr(seconds))
        if not samplers():
            raise ProblemError("planner", "OMPL", "none", hint="pip install ompl.")
        start = tuple(map(float, problem.start))
        check_space(validator.costmap, "start", start, headings=validator.space not in FLAT)
        Objective(validator, told)  # refuses what it can't weigh, before time is spent
        graph = grow_roadmap(
            planner, validator, validator.state_of(start), told, seconds=seconds, cancel=cancel
        )
        return cls(validator, graph, told)

    def plan(
        self, start: Sequence[float] | Floats, goal: Sequence[float] | Floats, *, audit: bool = True
    ) -> Route:
        """Return a route from start to goal, or raise an exception that says why there is none.

        It is the shortest one through the roadmap, or the cheapest one with other weights, with
        what can be left out of it left out. `Route.expanded` counts edges that were checked.

        Parameters
        ----------
        start, goal : sequence of float
            x, y [m, map] and, where the space has it, yaw [rad].
        audit : bool, default True
            Whether the route is audited; if not, its `audit` is "skipped".

        Raises
        ------
        ProblemError
            A place that is not so many finite numbers, or a map that has changed since, where that
            matters. Unaudited routes can't tell.
        OutsideMapError, NonFreeError, UnknownSpaceError
            Start or goal is no place for the footprint.
        EnclosedError
            There is no route, for sure.
        UnsolvedError
            The roadmap knows none; one that grew for longer may.
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
        """Return a route as planners' engines do, or None if it is proved that there is none.

        Raises
        ------
        UnsolvedError
        """
        ends = self.validator.state_of(start), self.validator.state_of(goal)
        is_clear = Checked(self.validator.is_clear)
        if not all(is_clear(end, end) for end in ends):
            return None
        path = self._net.path(*ends, is_clear)
        if path is None:
            if self.validator.room(*ends) is None:
                return None
            reason = f"its {len(self.graph.vertices)} places don't join them: grow it for longer"
            raise UnsolvedError(NAME, reason=reason, expanded=is_clear.count)
        if settings.simplify:
            path = self._net.shorten(path, is_clear)
        cost = self._objective.cost(path)
        return to_search_result(
            self.validator, path, asked=(start, goal), cost=cost, checked=is_clear.count
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the roadmap to an ``.npz`` file, all or nothing: arrays and JSON, no pickle.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        told = self.settings.model_dump(include=set(GROWTH + QUERIES), exclude_unset=True)
        write_roadmap(path, self.graph, self.validator.costmap, told)

    @classmethod
    def load(cls, path: str | PathLike[str], problem: PlanningProblem) -> Roadmap:
        """Return a roadmap from a file that `save` wrote.

        Parameters
        ----------
        path : path-like
        problem : PlanningProblem
            With the same map, footprint and options as when it was grown. Start and goal don't
            matter: unless the problem says ``cleared_at``, the unknown cells count as free that
            did so then.

        Raises
        ------
        FileFormatError
            Missing, damaged, of another kind or a newer version, or grown over other free cells
            or for another footprint.
        """
        if not isinstance(problem, PlanningProblem):
            raise ProblemError("problem", "a PlanningProblem", repr(problem))
        graph, costmap, told = read_roadmap(path, problem)
        assert told.space is not None
        return cls(MotionValidator(costmap, told.space, told.turning_radius), graph, told)


def _ways_of(
    problem: PlanningProblem, planner: str, settings: dict[str, Any]
) -> tuple[MotionValidator, SamplingSettings]:
    """Return the ways that a roadmap is grown over, and the checked settings."""
    told = SamplingSettings(**settings)
    for name in settings:
        if name not in GROWTH + QUERIES:
            raise SettingsError(name, f"one of {', '.join(GROWTH + QUERIES)}", "another setting")
    if not isinstance(planner, str) or planner not in GROWERS:
        raise ProblemError("planner", " or ".join(map(repr, GROWERS)), repr(planner))
    if planner == "prmstar" and told.max_nearest_neighbors is not None:
        expected = "none for 'prmstar', which takes more and more"
        raise SettingsError("max_nearest_neighbors", expected, str(told.max_nearest_neighbors))
    problem.check_dimensions(2)
    check_on_map(replace(problem, goal=problem.start))
    start, goal = tuple(map(float, problem.start)), tuple(map(float, problem.goal))
    space = told.space_for(problem.shape, start, goal)
    reason = refusal(planner, space)
    if reason is not None or space == "r3":
        hint = reason or "Roadmaps are of 2-D maps."
        raise ProblemError("planner", f"one that works in {space!r}", planner, hint=hint)
    if space not in FLAT and len(start) != 3:
        raise ProblemError("start", f"x, y [m] and yaw [rad] in {space}", str(start))
    told = told.model_copy(update={"space": space})
    return MotionValidator(Costmap.of(problem), space, told.turning_radius), told
