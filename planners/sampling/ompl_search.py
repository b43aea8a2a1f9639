"""One search with one of OMPL's planners.

OMPL grows trees and roadmaps; whether a state or an edge is clear is decided by our own kernels,
an edge in one call. Its answers are taken for what they are: only an exact solution is a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import count
from typing import Any

from planners.problem.problem import Pose
from planners.sampling.ompl_module import ompl, redirect_log, samplers
from planners.sampling.ompl_states import (
    drawing,
    edge_check,
    goal_of,
    information_of,
    reader,
    space_of,
    state_check,
    state_of,
)
from planners.sampling.path_simplifier import simplify_path
from planners.sampling.planner_data import graph_of
from planners.sampling.settings import FLAT, setter_of
from planners.sampling.state_sampler import StateSampler
from planners.sampling.task import Task, TaskResult
from planners.sampling.threaded_solve import EXACT, collect_errors, solve_in_slices
from planners.search.graph import Graph

# Every other status of OMPL, and what it means to who asked. Starts and goals are checked before.
REASONS = {
    "APPROXIMATE_SOLUTION": "the goal itself was not reached",
    "TIMEOUT": "it gave up",
    "UNKNOWN": "it doesn't say why",
    "TYPE_COUNT": "it doesn't say why",
    "INVALID_START": "it takes the start for no valid state",
    "INVALID_GOAL": "it takes the goal for no valid state",
    "UNRECOGNIZED_GOAL_TYPE": "it can't plan to such a goal",
    "CRASH": "it crashed",
    "ABORT": "it was stopped",
    "INFEASIBLE": "it proved that there is none",
}
THREADED = ("prm", "prmstar")  # they ask from threads of their own whether to stop
# They take no state but by an edge, and the check of an edge is one of its ends, too.
BY_EDGES = ("informedrrtstar", "kpiece1", "rrt", "rrtconnect", "rrtstar", "sorrtstar")
GLANCE = 16  # questions whether to stop between two looks at the clock
# [s] after time is up, a planner that has not asked is stopped in an edge's check, without a route
# and with one, which is lost then.
LATE, LATE_WITH_ROUTE = 0.1, 0.25
COST_TOLERANCE = 1e-9  # relative, of costs
# [m] RRT-Connect cuts an edge to its goal short by driving on from the goal: forward only, that
# leads to nowhere.
UNCUT = 1e6
SAMPLES = 1000  # that planners begin with which take all of their samples at first


class _LateError(Exception):
    """Time is up, and the planner doesn't ask: thrown through it."""


class OmplSearch:
    """One search: OMPL's objects are made for it, and gone after it."""

    def __init__(self, task: Task) -> None:
        self.task, self.validator, self.settings = task, task.validator, task.settings
        self.clock, self.reporter = task.clock, task.reporter
        self.edges, self.looks, self.late = count(1), 0, math.inf
        self.read, self.ompl = reader(task.validator.space), ompl()
        self.searching = task.name not in THREADED  # whose threads no exception may pass through
        self.errors: list[BaseException] = []  # so they wait here
        least = min(task.objective.least(*task.start, *goal) for goal in task.goals)
        self.optimum = least * (1.0 + COST_TOLERANCE)  # in OMPL's costs

    def outcome(self) -> TaskResult:
        """Search, and shorten what was found."""
        with redirect_log():
            try:
                return self._outcome()
            except _LateError:
                return TaskResult("TIMEOUT", [], None, self._count_checked())
            except RuntimeError as error:  # what C++ throws arrives as that
                if id(error) == self.reporter.fault:
                    raise
                return TaskResult(f"OMPL says: {error}", [], None, self._count_checked())

    def _outcome(self) -> TaskResult:
        self.ompl.util.RNG.setSeed(self.settings.seed + 1)  # 0 is refused
        space = space_of(self.ompl.base, self.validator.space, self.task.room, self.settings)
        information = self._information(space)
        definition = self._definition(space, information)
        planner = getattr(self.ompl.geometric, samplers()[self.task.name])(information)
        for name, value in self._parameters(planner).items():
            getattr(planner, setter_of(name))(value)
        planner.setProblemDefinition(definition)
        planner.setup()
        status = self._solve(planner, definition)
        self.searching, graph = False, None
        if self.settings.keep_graph:
            graph = graph_of(self.ompl.base, planner, information, self.validator)
        if not definition.hasSolution():
            return TaskResult(status, [], None, self._count_checked(), graph)
        if status != EXACT:
            left = float(definition.getSolutionDifference())
            return TaskResult(status, [], left, self._count_checked(), graph)
        return self._honest(information, definition.getSolutionPath(), graph)

    def _information(self, space: Any) -> Any:
        """Return the space with our own checks of states and edges, and our own samples."""
        base, task = self.ompl.base, self.task
        state = None
        if task.name not in BY_EDGES:
            state = self._guard(state_check(self.validator, self._look))
        edge = self._guard(edge_check(self.validator, self.edges, self._look))
        sampler = StateSampler(
            self.validator,
            task.region,
            seed=self.settings.seed,
            yaw_weight=self.settings.yaw_weight,
            first=task.first,
        )
        allocator = drawing(base, sampler, self.validator.space)
        return information_of(base, space, edge, state=state, allocator=allocator)

    def _guard(self, check: Callable[..., bool]) -> Callable[..., bool]:
        return collect_errors(check, self.errors) if self.task.name in THREADED else check

    def _definition(self, space: Any, information: Any) -> Any:
        """Return OMPL's problem: where from, where to, and what is best."""
        base, kind = self.ompl.base, self.validator.space
        definition = base.ProblemDefinition(information)
        definition.addStartState(state_of(space, self.task.start, kind))
        goals = [state_of(space, goal, kind) for goal in self.task.goals]
        definition.setGoal(goal_of(base, information, goals))
        objective = self.task.objective.as_ompl(base, information, self._look)
        definition.setOptimizationObjective(objective)
        return definition

    def _parameters(self, planner: Any) -> dict[str, float]:
        """Return the planner's own parameters: what was told, and how far edges reach."""
        told = self.settings.parameters()
        if hasattr(planner, "setRange") and "range" not in told:
            if (self.task.name, self.validator.space) == ("rrtconnect", "dubins"):
                return told | {"range": UNCUT}
            return told | {"range": self.validator.reach(self.task.region, self.task.room)}
        return told

    def _solve(self, planner: Any, definition: Any) -> str:
        """Run a planner until it ends or is to; return its status."""
        if self.task.name in THREADED:
            return solve_in_slices(planner, definition, self.task, self.errors)
        grows = hasattr(planner, "setNumSamples") and self.settings.num_samples is None
        samples = SAMPLES
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
        """Return how many edges were checked, once: asking counts."""
        return next(self.edges) - 1

    @property
    def _is_over(self) -> bool:
        """Whether the search has had all it gets, and its route all the time to be bettered."""
        iterations = self.settings.iterations
        if self.clock.is_up or self.reporter.enough:
            return True
        if iterations is not None:
            return self.looks >= iterations
        return self.reporter.has_had(self.settings.improve_for)

    def _look(self) -> None:
        """Stop a search from within that doesn't ask whether to.

        RRTConnect joins its trees, BIT* draws a batch, FMT grows a neighbourhood in one go.
        """
        if self.searching and self.clock.is_up:
            self.late = min(self.late, self.clock.seconds)
            patience = LATE_WITH_ROUTE if math.isfinite(self.reporter.cost) else LATE
            if self.clock.seconds >= self.late + patience:
                raise _LateError

    def _stop(self, planner: Any) -> Callable[[], bool]:
        """Return what a planner asks time and again: whether to stop.

        Once yes, always yes: FMT crashes on a change of mind.
        """
        counted = self.settings.iterations is not None
        betters, reporter = hasattr(planner, "bestCost"), self.reporter
        scale, over = self.task.objective.scale, False

        def stop() -> bool:
            nonlocal over
            self.looks += 1
            if betters:  # SORRT* looks for ever for what is better than the best there can be
                over = over or planner.bestCost().value() <= self.optimum
            if not over and (counted or self.looks % GLANCE == 0 or self.late < math.inf):
                if betters and math.isfinite(cost := planner.bestCost().value()):
                    reporter.report(scale * cost)
                over = self._is_over
            return over

        return stop

    def _honest(self, information: Any, path: Any, graph: Graph | None) -> TaskResult:
        """Return the path, simplified if that made it better, all of its edges checked again."""
        states = self._join_ends(path)
        if not self.validator.are_clear(states):
            reason = "its path can't be driven"
            return TaskResult(reason, [], None, self._count_checked(), graph)
        self.reporter.report(self.task.objective.cost(states))
        if self.settings.simplify and len(states) > 2:
            states = simplify_path(states, self.validator, self.task.objective, self.clock)
        return TaskResult(EXACT, states, 0.0, self._count_checked(), graph)

    def _join_ends(self, path: Any) -> list[Pose]:
        """Return the states of a path, from the very start to the very goal."""
        states = [self.read(state) for state in path.getStates()]
        turns = self.validator.space not in FLAT
        goal = min(self.task.goals, key=lambda goal: _apart(states[-1], goal, turns=turns))
        if len(states) > 1:
            states.pop()
        return [self.task.start, *states[1:], goal]


def _apart(a: Pose, b: Pose, *, turns: bool) -> float:
    """Return how far two states are apart: only to tell goals from each other."""
    gaps = [p - q for p, q in zip(a, b, strict=True)]
    if turns:
        gaps[2] = math.remainder(gaps[2], math.tau)
    return math.hypot(*gaps)


def _name_of(status: Any) -> str:
    return str(status.getStatus().name)
