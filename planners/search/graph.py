"""Trees and roadmaps as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass

from groundmap.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Graph:
    """A tree or a roadmap.

    Attributes
    ----------
    vertices : ndarray, shape (n, 2) or (n, 3) [m, map; rad]
        x, y and, where the space has it, yaw; on 3-D maps x, y, z.
    edges : ndarray of int64, shape (m, 2)
        Indices of the vertices that an edge joins, from the first to the second; one that can be
        driven both ways is listed once.
    weights : ndarray, shape (m,) [m]
        Lengths of the edges: of straight lines, or of the curves between two poses.
    """

    vertices: Floats
    edges: Ints
    weights: Floats
