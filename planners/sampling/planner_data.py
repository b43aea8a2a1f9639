"""Conversion of the tree or roadmap of an OMPL planner to plain arrays."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from groundmap.arrays import Ints
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.ompl_states import reader
from planners.sampling.settings import FLAT, TURNING
from planners.search.graph import Graph


def graph_of(base: Any, planner: Any, information: Any, validator: MotionValidator) -> Graph:
    """Return the tree or roadmap of a planner; vertices without an edge may be missing.

    Parameters
    ----------
    base : module
        OMPL's.
    planner, information : object
        OMPL's planner and space information.
    validator : MotionValidator
    """
    data = base.PlannerData(information)
    planner.getPlannerData(data)
    data.decoupleFromPlanner()  # its states would be freed with the planner otherwise
    count = data.numVertices()
    states = [data.getVertex(i).getState() for i in range(count)]
    edges = _edges(data, count)
    if validator.space != "dubins":
        edges = _without_reverses(edges, count)
    read = reader(validator.space)
    axes = validator.axes
    width = axes if validator.space in FLAT else axes + 1
    places = np.array([read(state) for state in states], dtype=np.float64).reshape(count, width)
    if validator.space in TURNING:
        lengths = [information.distance(states[a], states[b]) for a, b in edges.tolist()]
        weights = np.array(lengths, dtype=np.float64)
    else:
        tails, heads = places[edges[:, 0], :axes], places[edges[:, 1], :axes]
        weights = np.linalg.norm(heads - tails, axis=1)
    places[:, :axes] += validator.costmap.window.origin
    return Graph(places, edges, weights)


def _edges(data: Any, count: int) -> Ints:
    """Return all edges, shape (m, 2); one call per vertex is faster than one per edge."""
    heads = [data.getEdges(i) for i in range(count)]
    counts = np.fromiter(map(len, heads), dtype=np.int64, count=count)
    edges = np.empty((counts.sum(), 2), dtype=np.int64)
    edges[:, 0] = np.repeat(np.arange(count), counts)
    edges[:, 1] = np.fromiter(chain.from_iterable(heads), dtype=np.int64, count=len(edges))
    return edges


def _without_reverses(edges: Ints, count: int) -> Ints:
    """Return the edges; of two that join the same vertices, the one from the lower index."""
    keys, reverse_keys = edges @ [count, 1], edges @ [1, count]
    return edges[(edges[:, 0] < edges[:, 1]) | ~np.isin(keys, reverse_keys)]
