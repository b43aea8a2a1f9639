"""Polyanya: the shortest route at any angle, on a mesh of convex polygons."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import ONE
from planners.costmap.kernels.navmesh import open_ways
from planners.costmap.navmesh import NavigationMesh
from planners.geometry.rounding import rounding_at
from planners.problem.problem import Pose
from planners.search.base import SearchSettings
from planners.search.grid_search import CostmapSearch, GridQuery, enlarge
from planners.search.kernels.astar import FAR, TARGET
from planners.search.kernels.polyanya import advance, enqueue, trace
from planners.search.kernels.polyanya_nodes import (
    COUNT,
    LAST,
    PolyanyaQuery,
    Polygons,
    Pool,
    add,
)

MOST_ENDS = 4  # cells that a place is joined to, at most
SNAP = 1e-10  # [cells] places as near to a row or column of cell centres lie on it


class PolyanyaSettings(SearchSettings):
    """Settings of Polyanya."""


class Places(NamedTuple):
    """Points where lines on the mesh begin or end."""

    points: Floats  #: shape (n, 3): x, y and the length of the piece before or after [cells]
    itself: bool  #: the only point is the start or the goal itself, not a cell joined to it


class Polyanya(CostmapSearch):
    """Polyanya (Cui, Harabor, Grastien 2017): the shortest line at any angle within a region.

    The region consists of the squares between the centres of four traversable cells, and of the
    straight pieces between the centres of two neighbours. A place outside of it is joined to the
    centres around it by straight pieces. Costs must be uniform. The first search makes the mesh.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=1.0)
    >>> z = np.full((64, 64), -1.0, dtype=np.float32)
    >>> z[10:, 20] = 1.0
    >>> grid.fuse(np.array([0, 0]), z)
    >>> problem = PlanningProblem(grid, start=(9.1, 20), goal=(30, 18.2), footprint=1.0)
    >>> polyanya = Polyanya(Costmap.of(problem))
    >>> polyanya.search(problem.start, problem.goal, PolyanyaSettings()).waypoints.tolist()
    [[9.1, 20.0], [18.5, 8.5], [22.5, 8.5], [30.0, 18.2]]
    """

    name = "polyanya"
    needs_uniform = True
    first_room = 1 << 12  # search nodes to begin with

    def __init__(self, costmap: Costmap) -> None:
        super().__init__(costmap)
        cones = np.empty((self.first_room, 5))
        self.pool = Pool(cones, np.empty((self.first_room, 2), dtype=np.int64), self.heap)

    def twin(self) -> Polyanya:
        """Return an engine for another thread, which shares the mesh."""
        other = Polyanya(self.costmap)
        other.mesh = self.mesh
        return other

    @cached_property
    def mesh(self) -> NavigationMesh:
        """The region that routes may use."""
        return NavigationMesh.of(self.costmap.traversable)

    def _seed(self, query: GridQuery) -> None:
        self.sources = self._places(query.start, query.ends.sources)
        self.targets = self._places(query.goal, query.ends.targets)
        self.labels = self._labels(self.sources.points, self.targets.points)
        self.state = np.array([0, FAR, -1, 0, 0, -1], dtype=np.int64)
        for k, (x, y, sofar) in enumerate(self.sources.points.tolist()):
            vertex = self.mesh.vertex_at(x, y)
            root = vertex if vertex >= 0 else len(self.mesh.points) + k
            self.labels.sofar[root] = sofar
            add(self.labels, self.pool, self.state, root, -1, 0.0, 0.0, 0.0, 0.0)
            node = int(self.state[COUNT]) - 1
            enqueue(self._polygons, self.labels, self.pool, self.state, node)

    def _places(self, place: Pose, joined: Ints) -> Places:
        """Return a place itself if the mesh contains it, else the centres that it is joined to."""
        xy = self.costmap.to_cells(place[:2])[0] - 0.5
        snapped = np.rint(xy)
        near = SNAP + rounding_at(place[:2]) / self.costmap.window.resolution
        x, y = np.where(np.abs(xy - snapped) < near, snapped, xy).tolist()
        if self.mesh.holds(x, y):
            return Places(np.array([[x, y, 0.0]]), itself=True)
        return Places(joined[:, [1, 0, 2]] / np.array([1.0, 1.0, ONE]), itself=False)

    @cached_property
    def _polygons(self) -> Polygons:
        """The mesh for the kernels, with room for sources that are not vertices."""
        mesh = self.mesh
        return Polygons(
            points=np.concatenate([mesh.points, np.zeros((MOST_ENDS, 2))]),
            kinds=np.concatenate([mesh.kinds, np.zeros(MOST_ENDS, dtype=np.uint8)]),
            first=mesh.first,
            corners=mesh.corners,
            twins=mesh.twins,
            owner=mesh.owner,
            exits=mesh.exits,
            around_first=mesh.around_first,
            around=mesh.around,
            spurs=mesh.spurs,
        )

    def _labels(self, sources: Floats, targets: Floats) -> PolyanyaQuery:
        """Return a query's ends and labels, before the search."""
        mesh, polygons = self.mesh, self._polygons
        near = [(p, k) for k, (x, y, _) in enumerate(targets) for p in mesh.polygons_at(x, y)]
        looked_for, leads_there = np.zeros((2, len(mesh.exits)), dtype=np.bool_)
        begun: list[tuple[int, int]] = []
        for k, (x, y, _) in enumerate(sources):
            root = len(mesh.points) + k
            polygons.points[root] = x, y
            begun += [(p, root) for p in mesh.polygons_at(x, y)]
        labels = PolyanyaQuery(
            targets=targets,
            near=np.array(near, dtype=np.int64).reshape(-1, 2),
            begun=np.array(begun, dtype=np.int64).reshape(-1, 2),
            looked_for=looked_for,
            open=leads_there,
            sofar=np.full(len(polygons.points), np.inf),
            came=np.full(len(polygons.points), -1),
        )
        open_ways(labels.near, mesh.exits, mesh.twins, mesh.owner, looked_for, leads_there)
        return labels

    def _advance(self, query: GridQuery) -> int:
        return advance(
            self._polygons, self.labels, self.pool, self.state, self._spare, self.slice_size
        )

    def _grow(self) -> None:
        more = len(self.pool.places) + self._spare
        self.pool = Pool(*(enlarge(array, by=more) for array in self.pool))

    @cached_property
    def _spare(self) -> int:
        """The number of nodes that one expansion makes at most.

        An interval makes up to three intervals for each side of the polygon beyond it, and a point
        node for each corner; a root makes up to one of each for every side of the polygons around
        it, and one for each of its spurs.
        """
        sides = np.diff(self.mesh.first)
        largest = int(sides.max(initial=0))
        around = np.bincount(self.mesh.corners, weights=sides[self.mesh.owner])
        return max(8 * largest, 2 * int(around.max(initial=0)) + 4)

    def _trace(self) -> Ints:
        roots = trace(self.labels.came, int(self.state[LAST]))
        line = self._polygons.points[roots[1:] if self.sources.itself else roots]
        if not self.targets.itself:
            line = np.concatenate([line, self.targets.points[self.state[TARGET], None, :2]])
        return line[:, ::-1].astype(np.int64)
