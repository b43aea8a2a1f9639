"""The tree or roadmap of a planner of OMPL, read into plain arrays."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from groundmap.arrays import Ints
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.ompl_states import reader
from planners.sampling.settings import FLAT, TURNING
from planners.search.graph import Graph


def graph_of(
    base: Any, planner: Any, information: Any, validator: MotionValidator | MotionValidator3D
) -> Graph:
    """Return what a planner of OMPL's has grown; vertices without an edge may be left out.

    Parameters
    ----------
    base : module
        OMPL's.
    planner, information
        OMPL's planner, and the space that it plans in.
    validator : MotionValidator or MotionValidator3D
    """
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    data.decoupleFromPlanner()  # or it would die with the planner's states
    count = data.numVertices()
    states = [data.getVertex(i).getState() for i in range(count)]
    edges = _edges(data, count)
    if validator.space != "dubins":
        edges = _once(edges, count)
    read = reader(validator.space)
    width = 2 if validator.space == "r2" else 3
    places = np.array([read(state) for state in states], dtype=np.float64).reshape(count, width)
    axes = width if validator.space in FLAT else 2
    if validator.space in TURNING:
        lengths = [information.distance(states[a], states[b]) for a, b in edges.tolist()]
        weights = np.array(lengths, dtype=np.float64)
    else:
        tails, heads = places[edges[:, 0], :axes], places[edges[:, 1], :axes]
        weights = np.linalg.norm(heads - tails, axis=1)
    places[:, :axes] += validator.costmap.window.origin
    return Graph(places, edges, weights)


def _edges(data: Any, count: int) -> Ints:
    """Return all edges, shape (m, 2); asked for by vertex, as a question for each is slow."""
    heads = [data.getEdges(i) for i in range(count)]
    counts = np.fromiter(map(len, heads), dtype=np.int64, count=count)
    edges = np.empty((counts.sum(), 2), dtype=np.int64)
    edges[:, 0] = np.repeat(np.arange(count), counts)
    edges[:, 1] = np.fromiter(chain.from_iterable(heads), dtype=np.int64, count=len(edges))
    return edges


def _once(edges: Ints, count: int) -> Ints:
    """Return the edges; of two that join the same vertices, the one from the lower index."""
    keys, back = edges @ [count, 1], edges @ [1, count]
    return edges[(edges[:, 0] < edges[:, 1]) | ~np.isin(keys, back)]
