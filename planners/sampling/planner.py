"""The engine of sampling planners: validates a query, runs OMPL, and converts its result."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from groundmap.errors import SettingsError
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_on_map, check_space
from planners.costmap.voxel_map import Voxels
from planners.error_messages import Place
from planners.errors import (
    CancelledError,
    NoRouteError,
    ProblemError,
    TimeLimitError,
    UnsolvedError,
)
from planners.problem.problem import Pose
from planners.sampling.goal_sampling import goal_states, may_contain_goal
from planners.sampling.improvement_reporter import ImprovementReporter
from planners.sampling.motion_validator import MotionValidator, box_of
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.objectives import Objective
from planners.sampling.ompl_lock import StopRequest, hold_ompl
from planners.sampling.ompl_module import has_parameter
from planners.sampling.ompl_parameters import PARAMETERS
from planners.sampling.ompl_search import REASONS, THREADED, OmplSearch
from planners.sampling.path_simplifier import simplify_path
from planners.sampling.search_result import to_search_result
from planners.sampling.settings import FLAT, SamplingSettings, StateSpace, refusal
from planners.sampling.task import Task, TaskResult
from planners.sampling.threaded_solve import EXACT
from planners.sampling.warm_start import astar_states, informed_region
from planners.search.base import Cancel, Clock, OnImproved, SearchResult

# With several goals, BFMT crashes, and the threads of PRM and PRM* deadlock.
SINGLE_GOAL = ("bfmt", "prm", "prmstar")
EFFORT = "edges checked"


class SamplingPlanner:
    """One of OMPL's planners on a costmap.

    Parameters
    ----------
    name : str
        As in `samplers`: the name of the class in lower case.
    costmap : Costmap or Voxels

    Notes
    -----
    In flat spaces, waypoints are the corners of a line along which the disc or ball around the
    footprint is clear. In the others they are poses as dense as the checks of the sweep between
    them: at most half a cell apart. No route is guaranteed to be optimal. Its `expanded` counts
    edges that were checked.

    One search runs at a time, as OMPL's random numbers are global. With ``iterations``, a search
    repeats exactly unless the time limit ends it; PRM and PRM* run threads and never repeat.
    """

    def __init__(self, name: str, costmap: Costmap | Voxels) -> None:
        self.name, self.costmap = name, costmap
        self._validators: dict[tuple[StateSpace, float], MotionValidator] = {}

    def search(
        self,
        start: Pose,
        goal: Pose,
        settings: SamplingSettings,
        *,
        on_improved: OnImproved | None = None,
        cancel: Cancel | None = None,
    ) -> SearchResult | None:
        """Return a route from start to goal, or None if there is provably none.

        None is also returned if the footprint overlaps blocked cells at the start or the goal.

        Parameters
        ----------
        start, goal : tuple of float
            x, y (, z) [m, map] and, where the space has one, yaw [rad].
        settings : SamplingSettings
        on_improved, cancel : optional
            As in `planners.plan`. Costs are the objective's; the last is that of the route.

        Raises
        ------
        ProblemError
            A space or an objective that the planner does not support, or a place without a yaw.
        SettingsError
            A parameter that the planner does not have.
        UnsolvedError
            The planner ended without reaching the goal.
        TimeLimitError, CancelledError
            The time was up, always so with a limit of 0, or `cancel` was set.
        """
        clock = Clock(self.name, settings.time_limit, StopRequest(cancel))
        validator = self._validator_for(start, goal, settings)
        self._check(validator.space, settings)
        objective = Objective(validator, settings)
        objective.check(self.name)
        clock.check(0)
        reporter = ImprovementReporter(clock, on_improved)
        task = self._task(validator, (start, goal), settings, reporter, objective=objective)
        if task is None:
            return None
        if task.start in task.goals:
            return self._report(task, [task.start, task.start], 0)
        if settings.warm_start:
            return self._improve(task)
        return self._to_result(task, _run_exclusively(task))

    def _validator_for(
        self, start: Pose, goal: Pose, settings: SamplingSettings
    ) -> MotionValidator:
        axes = self.costmap.blocked.ndim
        if settings.space is not None and (settings.space == "r3") != (axes == 3):
            expected = "'r3', on a 3-D map" if axes == 3 else "one with two axes, on a 2-D map"
            raise ProblemError("space", expected, repr(settings.space))
        space = settings.space_for(self.costmap.problem.shape, start, goal, axes=axes)
        key = space, settings.turning_radius
        if key not in self._validators:
            costmap = self.costmap
            self._validators[key] = (
                MotionValidator3D(costmap)
                if isinstance(costmap, Voxels)
                else MotionValidator2D(costmap, *key)
            )
        return self._validators[key]

    def _check(self, space: StateSpace, settings: SamplingSettings) -> None:
        reason = refusal(self.name, space)
        if reason is not None:
            raise ProblemError("planner", f"one that works in {space!r}", self.name, hint=reason)
        if self.name in THREADED and settings.iterations is not None:
            reason = "It runs threads, which a count can't stop: use time_limit."
            raise SettingsError("iterations", f"none for {self.name!r}", "a count", hint=reason)
        if self.name in SINGLE_GOAL and settings.takes_other_goals:
            expected = f"a single goal for {self.name!r}, without tolerances"
            raise SettingsError("goals", expected, "more", hint="Take 'rrtconnect' or 'fmt'.")
        if self.name == "bitstar" and settings.keep_graph:
            reason = "OMPL would never free its memory: take 'rrtstar'."
            raise SettingsError("keep_graph", "False for 'bitstar'", "True", hint=reason)
        for name in settings.parameters():
            if not has_parameter(self.name, name):
                own = [one for one in PARAMETERS if has_parameter(self.name, one)]
                expected = f"a parameter that {self.name!r} has: {', '.join(own)}"
                raise SettingsError(name, expected, "one of another planner")

    def _task(
        self,
        validator: MotionValidator,
        query: tuple[Pose, Pose],
        settings: SamplingSettings,
        reporter: ImprovementReporter,
        *,
        objective: Objective,
    ) -> Task | None:
        """Return the input of OMPL's search, or None if there is provably no route."""
        start, goal = query
        begin = self._state(validator, "start", start)
        if not settings.takes_other_goals:
            self._state(validator, "goal", goal)
        region = validator.region(begin)
        goals = goal_states(
            validator,
            settings,
            goal,
            settings.seed,
            within=region,
            poll=partial(reporter.clock.check, 0),
        )
        axes = validator.axes
        place = start[:axes] if validator.space in FLAT else start
        if settings.takes_other_goals and settings.accepts_end(place, goal, axes=axes):
            goals = [begin]
        if not goals and settings.takes_other_goals:
            if not goal_states(validator, settings, goal, settings.seed):
                check_on_map(replace(self.costmap.problem, start=start, goal=goal))
                check_space(self.costmap, "goal", goal, headings=validator.space not in FLAT)
            if may_contain_goal(region, validator, settings, goal):
                reason = "no reachable place within the tolerances of a goal was found"
                raise UnsolvedError(self.name, reason=reason, expanded=0)
        if not (goals and validator.is_clear(*begin, *begin)):
            return None
        return Task(
            name=self.name,
            validator=validator,
            region=region,
            bounds=box_of(region, self.costmap.window.resolution),
            start=begin,
            goals=goals,
            objective=objective,
            settings=settings,
            clock=reporter.clock,
            reporter=reporter,
            first=[],
            query=query,
        )

    def _state(self, validator: MotionValidator, place: Place, pose: Pose) -> Pose:
        if validator.space not in FLAT and len(pose) != 3:
            expected = f"x, y [m] and yaw [rad] for {self.name} in {validator.space}"
            raise ProblemError(place, expected, str(pose))
        return validator.state_of(pose)

    def _improve(self, task: Task) -> SearchResult:
        """Return A*'s route, or a cheaper one."""
        first = astar_states(task.validator, *task.query, task.settings, task.clock)
        if not first:
            return self._to_result(task, _run_exclusively(task))
        if task.settings.simplify:
            first = simplify_path(first, task.validator, task.objective, task.clock)
        cost = task.objective.cost(first)
        task.reporter.report(cost, task.validator.poses(first))
        if task.reporter.should_stop:
            return self._report(task, first, 0)
        size = self.costmap.window.resolution
        max_length = task.objective.max_length(cost)
        region = informed_region(
            task.region, size, task.start, task.goals, max_length, clock=task.clock
        )
        bounds = box_of(region, size)
        with ExitStack() as stack:
            try:
                stack.enter_context(hold_ompl(task.clock))
            except (CancelledError, TimeLimitError):
                return self._report(task, first, 0)
            result = OmplSearch(replace(task, region=region, bounds=bounds, first=first)).run()
        is_cheaper = result.status == EXACT and task.objective.cost(result.states) < cost
        states = result.states if is_cheaper else first
        return self._report(task, states, result.checked)._replace(graph=result.graph)

    def _to_result(self, task: Task, result: TaskResult) -> SearchResult:
        if result.status != EXACT:
            raise self._explain_failure(result, task.settings, task.clock)
        route = self._report(task, result.states, result.checked)
        return route._replace(graph=result.graph)

    def _report(self, task: Task, states: Sequence[Pose], checked: int) -> SearchResult:
        cost = task.objective.cost(states)
        route = to_search_result(
            task.validator, states, query=task.query, cost=cost, checked=checked
        )
        task.reporter.report_final(cost, route.waypoints)
        return route

    def _explain_failure(
        self, result: TaskResult, settings: SamplingSettings, clock: Clock
    ) -> NoRouteError:
        if clock.is_cancelled:
            return CancelledError(
                self.name, seconds=clock.seconds, expanded=result.checked, unit=EFFORT
            )
        if clock.is_up and clock.time_limit is not None:
            return TimeLimitError(
                self.name,
                time_limit=clock.time_limit,
                expanded=result.checked,
                unit=EFFORT,
                left=result.left,
            )
        reason = REASONS.get(result.status, result.status)
        if settings.iterations is not None and result.status in ("TIMEOUT", "APPROXIMATE_SOLUTION"):
            reason = f"the goal was not reached in iterations = {settings.iterations}"
        return UnsolvedError(self.name, reason=reason, expanded=result.checked, left=result.left)


def _run_exclusively(task: Task) -> TaskResult:
    """Run a search while no other one runs."""
    with hold_ompl(task.clock):
        return OmplSearch(task).run()
