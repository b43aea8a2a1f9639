"""Paths through a roadmap: how starts and goals are joined to it, and what can be left out."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from groundmap.arrays import Floats, Ints
from planners.problem.problem import Pose
from planners.sampling.kernels.roadmap import cheapest_path
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.objectives import Objective
from planners.sampling.settings import FLAT, TURNING, SamplingSettings
from planners.search.graph import Graph

NEIGHBOURS = 10  # vertices that a start or a goal is joined to
NEAREST = (40, 1000)  # vertices that are tried for that, the second if none of the first will do
ROUNDS = 5  # of leaving out vertices of a path


class Checked:
    """A check of edges that counts them."""

    def __init__(self, is_clear: Callable[..., bool]) -> None:
        self.is_clear, self.count = is_clear, 0

    def __call__(self, a: Pose, b: Pose) -> bool:
        """Whether an edge is clear."""
        self.count += 1
        return self.is_clear(*a, *b)


class Connections(NamedTuple):
    """Vertices that a place is joined to, and what it costs to get there."""

    vertices: Ints
    costs: Floats


class RoadmapQuery:
    """A roadmap that is ready for queries.

    Parameters
    ----------
    graph : Graph
        Its edges can be driven both ways.
    validator : MotionValidator
    objective : Objective
        What is to be small.
    settings : SamplingSettings
    """

    def __init__(
        self,
        graph: Graph,
        validator: MotionValidator,
        objective: Objective,
        settings: SamplingSettings,
    ) -> None:
        self.validator, self.objective = validator, objective
        states = graph.vertices.copy()
        states[:, :2] -= validator.costmap.window.origin
        self.states: list[Pose] = [tuple(state) for state in states.tolist()]
        self.places = np.ascontiguousarray(states[:, :2])
        self.rate = objective.least(*(0.0,) * states.shape[1], 1.0, *(0.0,) * (states.shape[1] - 1))
        self._join(graph.edges, self._costs(graph, settings))
        # A turn is as far as its arc: on a circle, every yaw has its neighbours on both sides.
        self.arm = 0.0
        if validator.space not in FLAT:
            turning = validator.space in TURNING
            self.arm = settings.turning_radius if turning else settings.yaw_weight
        self.tree = cKDTree(self._spread(states)) if len(states) else None

    def path(self, start: Pose, goal: Pose, is_clear: Checked) -> list[Pose] | None:
        """Return the states of the cheapest path that is found, or None.

        Every edge of it was checked.
        """
        direct = [start, goal] if is_clear(start, goal) else None
        if direct is not None and self.objective.is_native:
            return direct
        sources, targets = (self._links(end, is_clear) for end in (start, goal))
        while True:
            vertices = self._cheapest(sources, targets, goal)
            if len(vertices) == 0:
                return direct
            path = [start, *(self.states[vertex] for vertex in vertices.tolist()), goal]
            if self._holds(vertices, is_clear):
                break
        if direct is not None and self.objective.cost(direct) <= self.objective.cost(path):
            return direct
        return path

    def shorten(self, path: list[Pose], is_clear: Checked) -> list[Pose]:
        """Return a path with states left out where that makes it no dearer."""
        for _ in range(ROUNDS):
            shorter = self._skip_states(path, is_clear)
            if len(shorter) == len(path):
                break
            path = shorter
        return path

    def _costs(self, graph: Graph, settings: SamplingSettings) -> Floats:
        """Return what the edges cost, shape (m,)."""
        if not self.objective.is_native:
            edges = graph.edges.tolist()
            costs = [self.objective.edge(*self.states[a], *self.states[b]) for a, b in edges]
            return np.array(costs, dtype=np.float64)
        if self.validator.space != "se2":
            return graph.weights
        tails, heads = graph.vertices[graph.edges, 2].T
        turns = np.abs(np.remainder(heads - tails + math.pi, 2.0 * math.pi) - math.pi)
        weighed: Floats = graph.weights + settings.yaw_weight * turns
        return weighed

    def _join(self, edges: Ints, cost: Floats) -> None:
        """Sort the edges, and their reverses, by where they begin."""
        tails, heads = np.concatenate([edges, edges[:, ::-1]]).T
        order = np.argsort(tails, kind="stable")
        self.heads = np.ascontiguousarray(heads[order])
        self.costs = np.concatenate([cost, cost])[order]
        starts = np.searchsorted(tails[order], np.arange(len(self.states) + 1))
        self.first = starts.astype(np.int64)

    def _spread(self, states: Floats) -> Floats:
        """Return states as points whose distance says which ones may be near."""
        if self.arm == 0.0:
            return states
        yaws = states[:, 2]
        return np.column_stack([states[:, :2], self.arm * np.cos(yaws), self.arm * np.sin(yaws)])

    def _links(self, end: Pose, is_clear: Checked) -> Connections:
        """Return near vertices with a clear edge to a start or goal, at most `NEIGHBOURS`."""
        vertices: list[int] = []
        costs: list[float] = []
        if self.tree is not None:
            at = self._spread(np.array([end]))[0]
            for most in NEAREST:
                near = np.atleast_1d(self.tree.query(at, min(most, len(self.states)))[1]).tolist()
                ranked = sorted((self.objective.edge(*end, *self.states[v]), v) for v in near)
                for cost, vertex in ranked:
                    if is_clear(end, self.states[vertex]):
                        vertices.append(vertex)
                        costs.append(cost)
                        if len(vertices) == NEIGHBOURS:
                            break
                if vertices:
                    break
        return Connections(np.array(vertices, dtype=np.int64), np.array(costs, dtype=np.float64))

    def _cheapest(self, sources: Connections, targets: Connections, goal: Pose) -> Ints:
        to_goal = np.full(len(self.states), math.inf)
        to_goal[targets.vertices] = targets.costs
        path: Ints = cheapest_path(
            self.first,
            self.heads,
            self.costs,
            self.places,
            self.rate,
            np.array(goal[:2]),
            *sources,
            to_goal,
        )
        return path

    def _holds(self, vertices: Ints, is_clear: Checked) -> bool:
        """Whether all edges along a path are clear; those that aren't are never taken again.

        They were when the roadmap was grown. But over a file's the map may have grown: states
        count from another corner then, and rounding may choose another of two equal curves.
        """
        holds = True
        for a, b in pairwise(vertices.tolist()):
            if not is_clear(self.states[a], self.states[b]):
                holds = False
                for tail, head in ((a, b), (b, a)):
                    part = slice(self.first[tail], self.first[tail + 1])
                    self.costs[part][self.heads[part] == head] = math.inf
        return holds

    def _skip_states(self, path: list[Pose], is_clear: Checked) -> list[Pose]:
        """Return the cheapest path that leaves out 0, 1, 3, 7, ... states at a time."""
        best, came = [0.0], [0]
        for j in range(1, len(path)):
            best.append(math.inf)
            came.append(j - 1)
            step = 1 << (j.bit_length() - 1)
            while step:
                i = j - step
                cost = best[i] + self.objective.edge(*path[i], *path[j])
                if cost < best[j] and (step == 1 or is_clear(path[i], path[j])):
                    best[j], came[j] = cost, i
                step >>= 1
        kept = [len(path) - 1]
        while kept[-1]:
            kept.append(came[kept[-1]])
        return [path[k] for k in reversed(kept)]
