"""Planners that sample, as engines: what is asked is checked before, and what OMPL brings after."""

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
from planners.sampling.goal_sampling import come_near, goal_states
from planners.sampling.improvement_reporter import ImprovementReporter
from planners.sampling.motion_validator import MotionValidator, box_of
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.objectives import Objective
from planners.sampling.ompl_lock import Ending, turn
from planners.sampling.ompl_module import has_parameter
from planners.sampling.ompl_search import REASONS, THREADED, OmplSearch
from planners.sampling.path_simplifier import simplify_path
from planners.sampling.search_result import to_search_result
from planners.sampling.settings import FLAT, PARAMETERS, SamplingSettings, StateSpace, refusal
from planners.sampling.task import Task, TaskResult
from planners.sampling.threaded_solve import EXACT
from planners.sampling.warm_start import better_region, first_states
from planners.search.base import Cancel, Clock, OnImproved, SearchResult

# With several goals, BFMT crashes, and PRM's threads wait for each other.
ONE_GOAL = ("bfmt", "prm", "prmstar")


class SamplingPlanner:
    """One of OMPL's planners on one costmap.

    Parameters
    ----------
    name : str
        As in `samplers`: the class's name in small letters.
    costmap : Costmap, or Voxels on a 3-D map

    Notes
    -----
    In r2, waypoints are the corners of a line that the disc around the footprint keeps clear. In
    the other spaces they are poses as dense as the sweep between them was checked: half a cell
    apart at most. No route is the best one for sure; its `expanded` counts edges that were checked.

    Searches wait for each other, as OMPL's random numbers are global. With ``iterations``, a search
    repeats exactly, unless the time limit ends it; PRM and PRM* run threads, and never do.
    """

    def __init__(self, name: str, costmap: Costmap | Voxels) -> None:
        self.name, self.costmap = name, costmap
        self._ways: dict[tuple[StateSpace, float], MotionValidator | MotionValidator3D] = {}

    def search(
        self,
        start: Pose,
        goal: Pose,
        settings: SamplingSettings,
        *,
        on_improved: OnImproved | None = None,
        cancel: Cancel | None = None,
    ) -> SearchResult | None:
        """Return a route from start to goal, or None if it is proved that there is none.

        None is also what a start or a goal gets where the footprint overlaps blocked cells.

        Parameters
        ----------
        start, goal : tuple of float
            x, y [m, map] and, where the space has it, yaw [rad].
        settings : SamplingSettings
        on_improved, cancel : optional
            As in `planners.plan`. Costs are the objective's; the last is that of the route.

        Raises
        ------
        ProblemError
            A space or an objective that the planner can't plan with, or a place that lacks a yaw.
        SettingsError
            A parameter that the planner doesn't have.
        UnsolvedError
            The planner ended without reaching the goal.
        TimeLimitError, CancelledError
            Time ran out, or somebody set `cancel`; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit, Ending(cancel))
        validator = self._ways_for(start, goal, settings)
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
        return self._to_result(task, _alone_run(task))

    def _ways_for(
        self, start: Pose, goal: Pose, settings: SamplingSettings
    ) -> MotionValidator | MotionValidator3D:
        axes = self.costmap.blocked.ndim
        if settings.space is not None and (settings.space == "r3") != (axes == 3):
            expected = "'r3', on a 3-D map" if axes == 3 else "one with two axes, on a 2-D map"
            raise ProblemError("space", expected, repr(settings.space))
        space = settings.space_for(self.costmap.problem.shape, start, goal, axes=axes)
        key = space, settings.turning_radius
        if key not in self._ways:
            costmap = self.costmap
            self._ways[key] = (
                MotionValidator3D(costmap)
                if isinstance(costmap, Voxels)
                else MotionValidator(costmap, *key)
            )
        return self._ways[key]

    def _check(self, space: StateSpace, settings: SamplingSettings) -> None:
        reason = refusal(self.name, space)
        if reason is not None:
            raise ProblemError("planner", f"one that works in {space!r}", self.name, hint=reason)
        if self.name in THREADED and settings.iterations is not None:
            reason = "It runs threads, which no count stops: use time_limit."
            raise SettingsError("iterations", f"none for {self.name!r}", "a count", hint=reason)
        if self.name in ONE_GOAL and settings.takes_other_goals:
            expected = f"one place, which is all that {self.name!r} plans to"
            raise SettingsError("goals", expected, "more", hint="Take 'rrtconnect' or 'fmt'.")
        if self.name == "bitstar" and settings.keep_graph:
            reason = "OMPL would never free it: take 'rrtstar'."
            raise SettingsError("keep_graph", "False for 'bitstar'", "True", hint=reason)
        for name in settings.parameters():
            if not has_parameter(self.name, name):
                own = [one for one in PARAMETERS if has_parameter(self.name, one)]
                expected = f"a parameter that {self.name!r} has: {', '.join(own)}"
                raise SettingsError(name, expected, "another's")

    def _task(
        self,
        validator: MotionValidator | MotionValidator3D,
        asked: tuple[Pose, Pose],
        settings: SamplingSettings,
        reporter: ImprovementReporter,
        *,
        objective: Objective,
    ) -> Task | None:
        """Return what OMPL is to do, or None if there is no route for sure."""
        start, goal = asked
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
            look=partial(reporter.clock.check, 0),
        )
        axes = len(begin) if validator.space in FLAT else 2
        place = start[:axes] if validator.space in FLAT else start
        if settings.takes_other_goals and settings.accepts_end(place, goal, axes=axes):
            goals = [begin]
        if not goals and settings.takes_other_goals:
            if not goal_states(validator, settings, goal, settings.seed):
                check_on_map(replace(self.costmap.problem, start=start, goal=goal))
                check_space(self.costmap, "goal", goal, headings=validator.space not in FLAT)
            if come_near(validator, settings, goal, region):
                reason = "nowhere near enough to a goal was found that can be reached"
                raise UnsolvedError(self.name, reason=reason, expanded=0)
        if not (goals and validator.is_clear(*begin, *begin)):
            return None
        return Task(
            name=self.name,
            validator=validator,
            region=region,
            room=box_of(region, self.costmap.window.resolution),
            start=begin,
            goals=goals,
            objective=objective,
            settings=settings,
            clock=reporter.clock,
            reporter=reporter,
            first=[],
            asked=asked,
        )

    def _state(
        self, validator: MotionValidator | MotionValidator3D, place: Place, pose: Pose
    ) -> Pose:
        if validator.space not in FLAT and len(pose) != 3:
            expected = f"x, y [m] and yaw [rad] for {self.name} in {validator.space}"
            raise ProblemError(place, expected, str(pose))
        return validator.state_of(pose)

    def _improve(self, task: Task) -> SearchResult:
        """Return A*'s route, or a better one."""
        first = first_states(task.validator, *task.asked, task.settings, task.clock)
        if not first:
            return self._to_result(task, _alone_run(task))
        if task.settings.simplify:
            first = simplify_path(first, task.validator, task.objective, task.clock)
        cost = task.objective.cost(first)
        task.reporter.report(cost, task.validator.poses(first))
        if task.reporter.enough:
            return self._report(task, first, 0)
        size = self.costmap.window.resolution
        longest = task.objective.longest(cost)
        region = better_region(task.region, size, task.start, task.goals, longest, clock=task.clock)
        room = box_of(region, size)
        with ExitStack() as mine:
            try:
                mine.enter_context(turn(task.clock))
            except (CancelledError, TimeLimitError):
                return self._report(task, first, 0)
            found = OmplSearch(replace(task, region=region, room=room, first=first)).outcome()
        better = found.status == EXACT and task.objective.cost(found.states) < cost
        states = found.states if better else first
        return self._report(task, states, found.checked)._replace(graph=found.graph)

    def _to_result(self, task: Task, outcome: TaskResult) -> SearchResult:
        if outcome.status != EXACT:
            raise self._explain_failure(outcome, task.settings, task.clock)
        found = self._report(task, outcome.states, outcome.checked)
        return found._replace(graph=outcome.graph)

    def _report(self, task: Task, states: Sequence[Pose], checked: int) -> SearchResult:
        cost = task.objective.cost(states)
        found = to_search_result(
            task.validator, states, asked=task.asked, cost=cost, checked=checked
        )
        task.reporter.ends(cost, found.waypoints)
        return found

    def _explain_failure(
        self, found: TaskResult, settings: SamplingSettings, clock: Clock
    ) -> NoRouteError:
        if clock.is_cancelled:
            return CancelledError(self.name, seconds=clock.seconds, expanded=found.checked)
        if clock.is_up and clock.time_limit is not None:
            return TimeLimitError(
                self.name,
                time_limit=clock.time_limit,
                expanded=found.checked,
                unit="edges checked",
                left=found.left,
            )
        reason = REASONS.get(found.status, found.status)
        if settings.iterations is not None and found.status in ("TIMEOUT", "APPROXIMATE_SOLUTION"):
            reason = f"the goal was not reached in iterations = {settings.iterations}"
        return UnsolvedError(self.name, reason=reason, expanded=found.checked, left=found.left)


def _alone_run(task: Task) -> TaskResult:
    """Run a search when no other one runs."""
    with turn(task.clock):
        return OmplSearch(task).outcome()
