"""Queries of a roadmap: connection of start and goal, the cheapest path, and its shortening."""

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
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.objectives import Objective
from planners.sampling.settings import FLAT, TURNING, SamplingSettings
from planners.search.graph import Graph

NEIGHBOURS = 10  # vertices that a start or a goal is connected to
NEAREST = (40, 1000)  # nearest vertices tried for that; the second if none of the first is clear
ROUNDS = 5  # of shortening a path


class CountingCheck:
    """A check of edges that counts its calls."""

    def __init__(self, is_clear: Callable[..., bool]) -> None:
        self.is_clear, self.count = is_clear, 0

    def __call__(self, a: Pose, b: Pose) -> bool:
        """Whether an edge is clear."""
        self.count += 1
        return self.is_clear(*a, *b)


class Connections(NamedTuple):
    """Vertices that a start or goal is connected to, and the costs of the edges to them."""

    vertices: Ints
    costs: Floats


class RoadmapQuery:
    """A roadmap prepared for queries.

    Parameters
    ----------
    graph : Graph
        Its edges can be driven both ways.
    validator : MotionValidator2D
    objective : Objective
        Minimised.
    settings : SamplingSettings
    """

    def __init__(
        self,
        graph: Graph,
        validator: MotionValidator2D,
        objective: Objective,
        settings: SamplingSettings,
    ) -> None:
        self.validator, self.objective = validator, objective
        states = graph.vertices.copy()
        states[:, :2] -= validator.costmap.window.origin
        self.states: list[Pose] = [tuple(state) for state in states.tolist()]
        self.places = np.ascontiguousarray(states[:, :2])
        self.rate = objective.least(*(0.0,) * states.shape[1], 1.0, *(0.0,) * (states.shape[1] - 1))
        self._build_adjacency(graph.edges, self._costs(graph, settings))
        # Yaws are embedded as points on a circle of this radius, which has no jump at ±π.
        self.arm = 0.0
        if validator.space not in FLAT:
            turning = validator.space in TURNING
            self.arm = settings.turning_radius if turning else settings.yaw_weight
        self.tree = cKDTree(self._embed(states)) if len(states) else None

    def path(self, start: Pose, goal: Pose, is_clear: CountingCheck) -> list[Pose] | None:
        """Return the states of the cheapest path, all of its edges checked; None if there is none.

        Parameters
        ----------
        start, goal : state [m, corner; rad]
        is_clear : CountingCheck
        """
        direct = [start, goal] if is_clear(start, goal) else None
        if direct is not None and self.objective.is_native:
            return direct
        sources, targets = (self._connect(end, is_clear) for end in (start, goal))
        while True:
            vertices = self._cheapest(sources, targets, goal)
            if len(vertices) == 0:
                return direct
            path = [start, *(self.states[vertex] for vertex in vertices.tolist()), goal]
            if self._are_clear(vertices, is_clear):
                break
        if direct is not None and self.objective.cost(direct) <= self.objective.cost(path):
            return direct
        return path

    def shorten(self, path: list[Pose], is_clear: CountingCheck) -> list[Pose]:
        """Return a path without the states whose removal does not increase its cost.

        Parameters
        ----------
        path : list of states [m, corner; rad]
        is_clear : CountingCheck
        """
        for _ in range(ROUNDS):
            shorter = self._skip_states(path, is_clear)
            if len(shorter) == len(path):
                break
            path = shorter
        return path

    def _costs(self, graph: Graph, settings: SamplingSettings) -> Floats:
        """Return the costs of the edges, shape (m,)."""
        if not self.objective.is_native:
            edges = graph.edges.tolist()
            costs = [self.objective.edge(*self.states[a], *self.states[b]) for a, b in edges]
            return np.array(costs, dtype=np.float64)
        if self.validator.space != "se2":
            return graph.weights
        tails, heads = graph.vertices[graph.edges, 2].T
        turns = np.abs(np.remainder(heads - tails + math.pi, 2.0 * math.pi) - math.pi)
        weighted: Floats = graph.weights + settings.yaw_weight * turns
        return weighted

    def _build_adjacency(self, edges: Ints, cost: Floats) -> None:
        """Sort the edges and their reverses by their tails."""
        tails, heads = np.concatenate([edges, edges[:, ::-1]]).T
        order = np.argsort(tails, kind="stable")
        self.heads = np.ascontiguousarray(heads[order])
        self.costs = np.concatenate([cost, cost])[order]
        starts = np.searchsorted(tails[order], np.arange(len(self.states) + 1))
        self.first = starts.astype(np.int64)

    def _embed(self, states: Floats) -> Floats:
        """Return states as points in a Euclidean space, for nearest neighbours."""
        if self.arm == 0.0:
            return states
        yaws = states[:, 2]
        return np.column_stack([states[:, :2], self.arm * np.cos(yaws), self.arm * np.sin(yaws)])

    def _connect(self, end: Pose, is_clear: CountingCheck) -> Connections:
        """Return near vertices with a clear edge to a start or goal, at most `NEIGHBOURS`."""
        vertices: list[int] = []
        costs: list[float] = []
        if self.tree is not None:
            point = self._embed(np.array([end]))[0]
            for number in NEAREST:
                nearest = self.tree.query(point, min(number, len(self.states)))[1]
                near = np.atleast_1d(nearest).tolist()
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
        """Return the vertices of the cheapest path; empty if there is none."""
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

    def _are_clear(self, vertices: Ints, is_clear: CountingCheck) -> bool:
        """Whether all edges along a path are clear; the others get an infinite cost.

        They were clear when the roadmap was grown. But the map may have been extended since a
        roadmap was saved: states then refer to another corner, and rounding may select another of
        two equally short curves.
        """
        path_is_clear = True
        for a, b in pairwise(vertices.tolist()):
            if not is_clear(self.states[a], self.states[b]):
                path_is_clear = False
                for tail, head in ((a, b), (b, a)):
                    part = slice(self.first[tail], self.first[tail + 1])
                    self.costs[part][self.heads[part] == head] = math.inf
        return path_is_clear

    def _skip_states(self, path: list[Pose], is_clear: CountingCheck) -> list[Pose]:
        """Return the cheapest path that skips 0, 1, 3, 7, ... states at a time."""
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
