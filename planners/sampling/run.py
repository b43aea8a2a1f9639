"""One search with one of OMPL's planners.

OMPL grows trees and roadmaps; whether a state or an edge is clear is decided by our own kernels,
an edge in one call. Its answers are taken for what they are: only an exact solution is a path.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import count
from typing import Any, NamedTuple

from planners.engine import Clock, Pose
from planners.sampling.door import logged, ompl, samplers
from planners.sampling.settings import SamplingSettings, setter_of
from planners.sampling.states import edge_check, reader, space_of, state_check, state_of
from planners.sampling.ways import Bounds, Ways

EXACT = "EXACT_SOLUTION"
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
SLICE = 0.1  # [s] these are stopped that often, to look whether to
SAMPLES = 1000  # that planners begin with which take all of their samples at first
SAME = 1e-9  # [m, rad] how far OMPL's copy of the goal may be off


class Outcome(NamedTuple):
    """What OMPL brought back."""

    status: str
    states: list[Pose]  #: the path, if there is one
    left: float | None  #: from its end to the goal, in the space's own distance [m]
    checked: int  #: edges


class Run:
    """One search: OMPL's objects are made for it, and gone after it."""

    def __init__(
        self,
        name: str,
        ways: Ways,
        *,
        room: Bounds,
        ends: tuple[Pose, Pose],
        settings: SamplingSettings,
        clock: Clock,
    ) -> None:
        self.name, self.ways, self.ends, self.settings = name, ways, ends, settings
        self.clock, self.edges, self.looks = clock, count(), 0
        self.read = reader(ways.space)
        self.room, self.ompl = room, ompl()

    def outcome(self) -> Outcome:
        """Search, and shorten what was found."""
        with logged():
            try:
                return self._outcome()
            except RuntimeError as error:  # what C++ throws arrives as that
                return Outcome(f"OMPL says: {error}", [], None, self._checked())

    def _outcome(self) -> Outcome:
        self.ompl.util.RNG.setSeed(self.settings.seed + 1)  # 0 is refused
        space = space_of(self.ompl.base, self.ways.space, self.room, self.settings)
        information = self._information(space)
        task = self.ompl.base.ProblemDefinition(information)
        task.setStartAndGoalStates(*(state_of(space, end) for end in self.ends))
        planner = getattr(self.ompl.geometric, samplers()[self.name])(information)
        for name, value in self.settings.parameters().items():
            getattr(planner, setter_of(name))(value)
        planner.setProblemDefinition(task)
        planner.setup()
        status = self._solved(planner)
        if not task.hasSolution():
            return Outcome(status, [], None, self._checked())
        path = task.getSolutionPath()
        if status != EXACT:
            return Outcome(status, [], float(task.getSolutionDifference()), self._checked())
        return self._honest(information, path)

    def _information(self, space: Any) -> Any:
        """Return the space with our own checks of states and edges."""
        base = self.ompl.base
        information = base.SpaceInformation(space)
        if self.name in BY_EDGES:
            information.setStateValidityChecker(base.AllValidStateValidityChecker(information))
        else:
            information.setStateValidityChecker(state_check(self.ways))
        # The class is made here: one that outlives the search is reported as a leak at exit.
        check = edge_check(self.ways, self.edges)
        motions = type("Motions", (base.MotionValidator,), {"checkMotion": check})
        information.setMotionValidator(motions(information))
        information.setup()
        return information

    def _solved(self, planner: Any) -> str:
        """Run a planner until it ends or is to; return its status."""
        if self.name in THREADED:
            return self._solved_in_slices(planner)
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

    def _solved_in_slices(self, planner: Any) -> str:
        """Run a planner whose threads no exception may pass through, nor any question to Python.

        It is stopped by OMPL's own clock, in a thread that signals don't reach.
        """
        stopped = threading.Event()

        def work() -> str:
            status, solved = "", math.inf
            while True:
                status = _name_of(planner.solve(SLICE))
                if status == EXACT:
                    solved = min(solved, time.perf_counter())
                improved = time.perf_counter() - solved >= self.settings.improve_for
                if (status == EXACT and self.name == "prm") or improved:
                    return status
                if self.clock.is_up or stopped.is_set():
                    return status

        with ThreadPoolExecutor(1) as pool:
            try:
                ending = pool.submit(work)
                while not wait([ending], timeout=SLICE).done:  # a wait without end hears no signal
                    pass
                return ending.result()
            finally:
                stopped.set()

    def _checked(self) -> int:
        """Return how many edges were checked, once: asking counts."""
        return next(self.edges)

    @property
    def _is_over(self) -> bool:
        iterations = self.settings.iterations
        return self.clock.is_up or (iterations is not None and self.looks >= iterations)

    def _stop(self, planner: Any) -> Callable[[], bool]:
        """Return what a planner asks time and again: whether to stop.

        Once yes, always yes: FMT crashes on a change of mind.
        """
        counted = self.settings.iterations is not None
        betters = hasattr(planner, "bestCost") and not counted
        first, over = math.inf, False  # when it had a route; whether to stop

        def stop() -> bool:
            nonlocal first, over
            self.looks += 1
            if not over and (counted or self.looks % GLANCE == 0):
                over = self._is_over
                if betters and math.isfinite(planner.bestCost().value()):
                    first = min(first, time.perf_counter())
                    over = over or time.perf_counter() - first >= self.settings.improve_for
            return over

        return stop

    def _honest(self, information: Any, path: Any) -> Outcome:
        """Return the path, shortened if that made it shorter, all of its edges checked again."""
        states = self._joined(path)
        if not self.ways.are_clear(states):
            reason = "its path can't be driven"
            return Outcome(reason, [], None, self._checked())
        if self.settings.simplify and len(states) > 2:
            trial = self.ompl.geometric.PathGeometric(path)
            until = self.ompl.base.PlannerTerminationCondition(lambda: self.clock.is_up)
            self.ompl.geometric.PathSimplifier(information).simplify(trial, until)
            shorter = self._joined(trial)
            if self.ways.length(shorter) < self.ways.length(states):
                states = shorter if self.ways.are_clear(shorter) else states
        return Outcome(EXACT, states, 0.0, self._checked())

    def _joined(self, path: Any) -> list[Pose]:
        """Return the states of a path, from the very start to the very goal."""
        states = [self.read(state) for state in path.getStates()]
        start, goal = self.ends
        x, y, *turn = (float(p - q) for p, q in zip(states[-1], goal, strict=True))
        off = max(math.hypot(x, y), *(abs(math.remainder(angle, math.tau)) for angle in turn), 0.0)
        if off <= SAME and len(states) > 1:
            states.pop()
        return [start, *states[1:], goal]


def _name_of(status: Any) -> str:
    return str(status.getStatus().name)
