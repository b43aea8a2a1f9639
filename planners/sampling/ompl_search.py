"""One search with one of OMPL's planners.

OMPL grows trees and roadmaps; our own kernels check states and edges, one call per edge. Only an
exact solution counts as a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import count
from typing import Any

from planners.problem.problem import Pose
from planners.sampling.ompl_module import ompl, redirect_log, samplers
from planners.sampling.ompl_parameters import setter_of
from planners.sampling.ompl_states import (
    edge_check,
    goal_of,
    information_of,
    reader,
    sampler_allocator,
    space_of,
    state_check,
    state_of,
)
from planners.sampling.path_simplifier import simplify_path
from planners.sampling.planner_data import graph_of
from planners.sampling.settings import FLAT
from planners.sampling.state_sampler import StateSampler
from planners.sampling.task import Task, TaskResult
from planners.sampling.threaded_solve import EXACT, collect_errors, solve_in_slices
from planners.search.graph import Graph

# Messages for the statuses of failed searches. Starts and goals are checked before the search.
REASONS = {
    "APPROXIMATE_SOLUTION": "the goal itself was not reached",
    "TIMEOUT": "the planner gave up",
    "UNKNOWN": "OMPL gives no reason",
    "TYPE_COUNT": "OMPL gives no reason",
    "INVALID_START": "OMPL rejected the start as invalid",
    "INVALID_GOAL": "OMPL rejected the goal as invalid",
    "UNRECOGNIZED_GOAL_TYPE": "the planner does not support this type of goal",
    "CRASH": "the planner crashed",
    "ABORT": "the planner was stopped",
    "INFEASIBLE": "the planner proved that there is none",
}
THREADED = ("prm", "prmstar")  # evaluate the termination condition in threads of their own
# Reach each state by an edge, whose check includes its ends: a check of states is not needed.
EDGE_CHECKED = ("informedrrtstar", "kpiece1", "rrt", "rrtconnect", "rrtstar", "sorrtstar")
POLL_EVERY = 16  # termination checks between two looks at the clock
# [s] after the time is up, the check of an edge stops a planner that has not evaluated its
# termination condition; with a route, which is then lost, it waits longer.
GRACE, GRACE_WITH_ROUTE = 0.1, 0.25
COST_TOLERANCE = 1e-9  # relative, of costs
# [m] RRT-Connect shortens an edge to its goal by driving on from the goal: in dubins, such a state
# does not lead to the goal.
UNLIMITED_RANGE = 1e6
INITIAL_SAMPLES = 1000  # of planners that draw all their samples first


class _OverdueError(Exception):
    """The time is up and the planner does not evaluate its termination condition."""


class OmplSearch:
    """One search; OMPL's objects exist only during it.

    Parameters
    ----------
    task : Task
    """

    def __init__(self, task: Task) -> None:
        self.task, self.validator, self.settings = task, task.validator, task.settings
        self.clock, self.reporter = task.clock, task.reporter
        self.edges, self.stop_checks, self.overdue_since = count(1), 0, math.inf
        self.read, self.ompl = reader(task.validator.space), ompl()
        self.may_raise = task.name not in THREADED  # no exception may pass through their threads
        self.errors: list[BaseException] = []  # of callbacks in such threads
        least = min(task.objective.least(*task.start, *goal) for goal in task.goals)
        self.optimum = least * (1.0 + COST_TOLERANCE)  # in OMPL's costs

    def run(self) -> TaskResult:
        """Return the result of the search, its path simplified."""
        with redirect_log():
            try:
                return self._run()
            except _OverdueError:
                return TaskResult("TIMEOUT", [], None, self._count_checked())
            except RuntimeError as error:  # C++ exceptions arrive as this type
                if id(error) == self.reporter.error_id:
                    raise
                return TaskResult(f"OMPL reports: {error}", [], None, self._count_checked())

    def _run(self) -> TaskResult:
        self.ompl.util.RNG.setSeed(self.settings.seed + 1)  # 0 is refused
        space = space_of(self.ompl.base, self.validator.space, self.task.bounds, self.settings)
        information = self._information(space)
        definition = self._definition(space, information)
        planner = getattr(self.ompl.geometric, samplers()[self.task.name])(information)
        for name, value in self._parameters(planner).items():
            getattr(planner, setter_of(name))(value)
        planner.setProblemDefinition(definition)
        planner.setup()
        status = self._solve(planner, definition)
        self.may_raise, graph = False, None
        if self.settings.keep_graph:
            graph = graph_of(self.ompl.base, planner, information, self.validator)
        if not definition.hasSolution():
            return TaskResult(status, [], None, self._count_checked(), graph)
        if status != EXACT:
            left = float(definition.getSolutionDifference())
            return TaskResult(status, [], left, self._count_checked(), graph)
        return self._checked_result(definition.getSolutionPath(), graph)

    def _information(self, space: Any) -> Any:
        """Return OMPL's space information with our own checks and samples."""
        base, task = self.ompl.base, self.task
        state = None
        if task.name not in EDGE_CHECKED:
            state = self._guard(state_check(self.validator, self._poll))
        edge = self._guard(edge_check(self.validator, self.edges, self._poll))
        sampler = StateSampler(
            self.validator,
            task.region,
            seed=self.settings.seed,
            yaw_weight=self.settings.yaw_weight,
            first=task.first,
        )
        allocator = sampler_allocator(base, sampler, self.validator.space)
        return information_of(base, space, edge, state=state, allocator=allocator)

    def _guard(self, check: Callable[..., bool]) -> Callable[..., bool]:
        return collect_errors(check, self.errors) if self.task.name in THREADED else check

    def _definition(self, space: Any, information: Any) -> Any:
        """Return OMPL's problem definition: start, goals and objective."""
        base, kind = self.ompl.base, self.validator.space
        definition = base.ProblemDefinition(information)
        definition.addStartState(state_of(space, self.task.start, kind))
        goals = [state_of(space, goal, kind) for goal in self.task.goals]
        definition.setGoal(goal_of(base, information, goals))
        objective = self.task.objective.to_ompl(base, information, self._poll)
        definition.setOptimizationObjective(objective)
        return definition

    def _parameters(self, planner: Any) -> dict[str, float]:
        """Return the planner's parameters: the given ones, and the longest edge."""
        task, parameters = self.task, self.settings.parameters()
        if hasattr(planner, "setRange") and "range" not in parameters:
            if (task.name, self.validator.space) == ("rrtconnect", "dubins"):
                longest = UNLIMITED_RANGE
            else:
                longest = self.validator.max_edge_length(task.region, task.bounds)
            parameters["range"] = longest
        return parameters

    def _solve(self, planner: Any, definition: Any) -> str:
        """Run a planner until it ends or is to; return its status."""
        if self.task.name in THREADED:
            return solve_in_slices(planner, definition, self.task, self.errors)
        grows = hasattr(planner, "setNumSamples") and self.settings.num_samples is None
        samples = INITIAL_SAMPLES
        while True:
            if grows:
                planner.setNumSamples(samples)
            stop = self.ompl.base.PlannerTerminationCondition(self._stop(planner))
            status = _name_of(planner.solve(stop))
            if status == EXACT or not grows or self._is_over:
                return status
            samples *= 2
            planner.clear()

    def _count_checked(self) -> int:
        """Return the number of edges checked; call it once, as it advances the counter."""
        return next(self.edges) - 1

    @property
    def _is_over(self) -> bool:
        """Whether the time, iteration or improvement budget is exhausted."""
        iterations = self.settings.iterations
        if self.clock.is_up or self.reporter.should_stop:
            return True
        if iterations is not None:
            return self.stop_checks >= iterations
        return self.reporter.has_improved_for(self.settings.improve_for)

    def _poll(self) -> None:
        """Stop a search that does not evaluate its termination condition in time.

        RRTConnect joins its trees, BIT* draws a batch, and FMT expands a neighbourhood without
        evaluating it.
        """
        if self.may_raise and self.clock.is_up:
            self.overdue_since = min(self.overdue_since, self.clock.seconds)
            grace = GRACE_WITH_ROUTE if math.isfinite(self.reporter.cost) else GRACE
            if self.clock.seconds >= self.overdue_since + grace:
                raise _OverdueError

    def _stop(self, planner: Any) -> Callable[[], bool]:
        """Return a termination condition that stays true once it is: FMT crashes otherwise."""
        counted = self.settings.iterations is not None
        is_anytime, reporter = hasattr(planner, "bestCost"), self.reporter
        scale, is_over = self.task.objective.scale, False

        def stop() -> bool:
            nonlocal is_over
            self.stop_checks += 1
            if is_anytime:  # SORRT* never ends its search for a sample that improves the optimum
                is_over = is_over or planner.bestCost().value() <= self.optimum
            is_overdue = self.overdue_since < math.inf
            if not is_over and (counted or self.stop_checks % POLL_EVERY == 0 or is_overdue):
                if is_anytime and math.isfinite(cost := planner.bestCost().value()):
                    reporter.report(scale * cost)
                is_over = self._is_over
            return is_over

        return stop

    def _checked_result(self, path: Any, graph: Graph | None) -> TaskResult:
        """Return the result with the path simplified, all of its edges checked again."""
        states = self._join_ends(path)
        if not self.validator.are_clear(states):
            reason = "its path is not clear"
            return TaskResult(reason, [], None, self._count_checked(), graph)
        self.reporter.report(self.task.objective.cost(states))
        if self.settings.simplify and len(states) > 2:
            states = simplify_path(states, self.validator, self.task.objective, self.clock)
        return TaskResult(EXACT, states, 0.0, self._count_checked(), graph)

    def _join_ends(self, path: Any) -> list[Pose]:
        """Return the states of a path, its ends replaced by the exact start and goal."""
        states = [self.read(state) for state in path.getStates()]
        has_yaw = self.validator.space not in FLAT
        goal = min(self.task.goals, key=lambda goal: _distance(states[-1], goal, has_yaw=has_yaw))
        if len(states) > 1:
            states.pop()
        return [self.task.start, *states[1:], goal]


def _distance(a: Pose, b: Pose, *, has_yaw: bool) -> float:
    """Return a distance of two states that serves to find the goal of a path."""
    gaps = [p - q for p, q in zip(a, b, strict=True)]
    if has_yaw:
        gaps[2] = math.remainder(gaps[2], math.tau)
    return math.hypot(*gaps)


def _name_of(status: Any) -> str:
    return str(status.getStatus().name)
