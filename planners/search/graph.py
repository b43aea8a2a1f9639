"""Trees and roadmaps as arrays."""

from __future__ import annotations

from dataclasses import dataclass

from groundmap.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Graph:
    """A tree or a roadmap.

    Attributes
    ----------
    vertices : ndarray, shape (n, 2) or (n, 3) [m, map; rad]
        x, y and, if the state space has it, yaw; on 3-D maps x, y, z.
    edges : ndarray of int64, shape (m, 2)
        Indices of the vertices that each edge joins, from the first to the second. An edge that
        can be driven in both directions is listed once.
    weights : ndarray, shape (m,) [m]
        Lengths of the edges, which are straight lines or curves between two poses.
    """

    vertices: Floats
    edges: Ints
    weights: Floats
