"""Trees and roadmaps as arrays, compared with those of OMPL."""

from __future__ import annotations

import gc
from itertools import count
from typing import Any

import numpy as np
import pytest

from oracles_planning import BLOCKED, FREE, grid_of
from planners import PlanningProblem, SamplingSettings
from planners.costmap.costmap import Costmap
from planners.geometry.polyline import length_of
from planners.problem.problem import Pose
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_module import ompl, redirect_log, samplers
from planners.sampling.ompl_states import edge_check, reader, space_of, state_of
from planners.sampling.planner_data import graph_of
from planners.sampling.settings import StateSpace
from planners.search.graph import Graph

CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]
SPACES: list[StateSpace] = ["r2", "se2", "dubins", "reeds_shepp"]
pytestmark = pytest.mark.skipif(not samplers(), reason="ompl is not installed")


def validator_in(space: StateSpace) -> MotionValidator2D:
    field = np.full((48, 48), FREE, dtype=np.float32)
    field[:36, 24] = BLOCKED
    grid = grid_of(field, resolution=0.25, origin=(-3.0, 7.0))
    ends: dict[str, Any] = {"start": (0, 9, 0), "goal": (0, 9, 0)}
    problem = PlanningProblem(grid, **ends, footprint=CAR, clear_start=False)
    return MotionValidator2D(Costmap.of(problem), space, 1.0)


def search(
    name: str, validator: MotionValidator2D, *, iterations: int = 300
) -> tuple[Graph, list[Pose], list[tuple[int, int]]]:
    """Return the graph of a planner, and the states and edges that OMPL lists."""
    base, geometric, util = ompl()
    with redirect_log():
        util.RNG.setSeed(1)
        begin, end = validator.state_of((0.0, 9.0, 0.0)), validator.state_of((6.0, 9.0, 1.0))
        bounds = validator.bounds(begin, end)
        assert bounds is not None
        space = space_of(base, validator.space, bounds, SamplingSettings())
        information = base.SpaceInformation(space)
        read = reader(validator.space)
        information.setStateValidityChecker(lambda state: validator.is_clear(*2 * read(state)))
        check = edge_check(validator, count(1), lambda: None)
        motions = type("Motions", (base.MotionValidator,), {"checkMotion": check})
        information.setMotionValidator(motions(information))
        information.setup()
        definition = base.ProblemDefinition(information)
        ends = (state_of(space, state, validator.space) for state in (begin, end))
        definition.setStartAndGoalStates(*ends)
        planner = getattr(geometric, name)(information)
        planner.setProblemDefinition(definition)
        planner.setup()
        asked = count()
        stop = base.PlannerTerminationCondition(lambda: next(asked) >= iterations)
        (planner.growRoadmapPtc if name == "PRM" else planner.solve)(stop)
        graph = graph_of(base, planner, information, validator)
        return graph, *_listed(base, planner, information, validator)


def _listed(
    base: Any, planner: Any, information: Any, validator: MotionValidator2D
) -> tuple[list[Pose], list[tuple[int, int]]]:
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    data.decoupleFromPlanner()
    read, indices = reader(validator.space), range(data.numVertices())
    states = [read(data.getVertex(i).getState()) for i in indices]
    return states, [(a, b) for a in indices for b in indices if data.edgeExists(a, b)]


GROWN = [
    (name, space)
    for name in ("RRT", "RRTConnect", "RRTstar", "PRM")
    for space in SPACES
    if (name, space) != ("PRM", "dubins")
]


@pytest.mark.parametrize(("name", "space"), GROWN)
def test_every_edge_of_ompl_occurs_once(name: str, space: StateSpace) -> None:
    validator = validator_in(space)
    graph, states, listed = search(name, validator)
    assert graph.vertices.shape == (len(states), 2 if space == "r2" else 3)
    shifted = np.array(states)
    shifted[:, :2] += validator.costmap.window.origin
    np.testing.assert_array_equal(graph.vertices, shifted)
    got = list(map(tuple, graph.edges.tolist()))
    assert len(got) > 10
    assert graph.weights.shape == (len(got),)
    assert set(got) <= set(listed)
    assert len({frozenset(edge) for edge in got}) == len(got)
    assert {frozenset(edge) for edge in got} == {frozenset(edge) for edge in listed}
    if name == "PRM":
        assert 2 * len(got) == len(listed)


@pytest.mark.parametrize("space", SPACES)
def test_vertices_are_clear_and_weights_are_the_lengths_of_edges(
    space: StateSpace,
) -> None:
    validator = validator_in(space)
    graph, *_ = search("RRT", validator)
    states = [validator.state_of(tuple(vertex)) for vertex in graph.vertices.tolist()]
    assert all(validator.is_clear(*state, *state) for state in states)
    for (a, b), weight in zip(graph.edges.tolist(), graph.weights.tolist(), strict=True):
        assert validator.is_clear(*states[a], *states[b])
        length = length_of(validator.poses([states[a], states[b]])[:, :2])
        assert weight == pytest.approx(length, rel=0.02)  # chords of curves are a little shorter
        assert weight >= length - 1e-9


def test_an_empty_tree_is_a_graph_without_edges() -> None:
    for space in SPACES:
        graph, *_ = search("PRM", validator_in(space), iterations=1)
        assert graph.edges.shape == (0, 2)
        assert graph.weights.shape == (0,)
        assert graph.vertices.shape[1] == (2 if space == "r2" else 3)


def test_a_graph_outlives_the_objects_of_ompl() -> None:
    graph = search("RRTConnect", validator_in("se2"))[0]
    gc.collect()
    for array in (graph.vertices, graph.edges, graph.weights):
        assert array.base is None or isinstance(array.base, np.ndarray)
        assert np.isfinite(array.sum())
