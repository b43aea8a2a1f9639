"""Polyanya: the shortest route at any angle, on a mesh of convex polygons."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import ends_of, waypoints_through
from planners.costmap.kernels.moves import ONE
from planners.costmap.kernels.navmesh import open_ways
from planners.costmap.navmesh import NavigationMesh
from planners.geometry.rounding import rounding_at
from planners.problem.problem import Pose
from planners.search.base import SLICE, Clock, SearchResult, SearchSettings, check_uniform
from planners.search.kernels.astar import EXHAUSTED, FAR, FOUND, HEAP_FULL, SLICE_DONE
from planners.search.kernels.polyanya import advance, enqueue, trace
from planners.search.kernels.polyanya_nodes import (
    COUNT,
    EXPANDED,
    LAST,
    TARGET,
    PolyanyaQuery,
    Polygons,
    Pool,
    add,
)

FIRST_ROOM = 1 << 12  # search nodes to begin with
MOST_ENDS = 4  # cells that a place is joined to
SNAP = 1e-10  # [cells] places this near to a row or column of cell centres lie on it


class PolyanyaSettings(SearchSettings):
    """What Polyanya can be told."""


class Places(NamedTuple):
    """Where lines begin or end."""

    points: Floats  #: shape (n, 3), x, y and the length before or after [cells]
    itself: bool  #: the only one is the start or the goal, not a cell joined to it


class Polyanya:
    """Polyanya (Cui, Harabor, Grastien 2017): no line is shorter that keeps to the region.

    The region is the squares between the centres of four cells that can be stood on, and the
    straight pieces between the centres of two neighbours. A place outside of it is joined to the
    centres around it by straight pieces. Every metre has to cost the same. The mesh is made by
    the first search.

    Raises
    ------
    ProblemError
        The costmap makes some metres dearer than others.

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

    name: ClassVar[str] = "polyanya"

    def __init__(self, costmap: Costmap) -> None:
        check_uniform(self.name, costmap)
        self.costmap = costmap
        self.pool = _pool(FIRST_ROOM)

    def twin(self) -> Polyanya:
        """Return an engine for another thread: the mesh is shared."""
        other = Polyanya(self.costmap)
        other.mesh = self.mesh
        return other

    @cached_property
    def mesh(self) -> NavigationMesh:
        """The region that routes may use."""
        return NavigationMesh.of(self.costmap.traversable)

    def search(self, start: Pose, goal: Pose, settings: SearchSettings) -> SearchResult | None:
        """Return the shortest route from start to goal, or None if there is none.

        Parameters
        ----------
        start, goal : tuple of float
            x and y [m, map]; what follows is ignored.
        settings : PolyanyaSettings

        Raises
        ------
        TimeLimitError
            Time ran out; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        ends = ends_of(self.costmap, start, goal)
        if ends.direct:
            return SearchResult(
                waypoints_through(self.costmap, start, goal, np.empty((0, 2), int)), 0
            )
        sources, targets = self._places(start, ends.sources), self._places(goal, ends.targets)
        query = self._query(sources.points, targets.points)
        state = np.array([0, 0, 0, FAR, -1, -1], dtype=np.int64)
        if len(targets.points) > 0:
            self._seed(sources.points, query, state)
        status = SLICE_DONE
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            status = self._advance(query, state)
        if status == EXHAUSTED:
            return None
        cells = self._cells(query, state, sources, targets)
        return SearchResult(
            waypoints_through(self.costmap, start, goal, cells), int(state[EXPANDED])
        )

    def _places(self, place: Pose, joined: Ints) -> Places:
        """Return the place itself where the mesh holds it, else the centres it is joined to."""
        xy = self.costmap.to_cells(place[:2])[0] - 0.5
        snapped = np.rint(xy)
        near = SNAP + rounding_at(place[:2]) / self.costmap.window.resolution
        x, y = np.where(np.abs(xy - snapped) < near, snapped, xy).tolist()
        if self.mesh.holds(x, y):
            return Places(np.array([[x, y, 0.0]]), itself=True)
        return Places(joined[:, [1, 0, 2]] / np.array([1.0, 1.0, ONE]), itself=False)

    @cached_property
    def _polygons(self) -> Polygons:
        """The mesh for the kernels: with room for sources that are no vertices."""
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

    def _query(self, sources: Floats, targets: Floats) -> PolyanyaQuery:
        mesh, polygons = self.mesh, self._polygons
        near = [(p, k) for k, (x, y, _) in enumerate(targets) for p in mesh.polygons_at(x, y)]
        looked_for, leads_there = np.zeros((2, len(mesh.exits)), dtype=np.bool_)
        begun: list[tuple[int, int]] = []
        for k, (x, y, _) in enumerate(sources):
            root = len(mesh.points) + k
            polygons.points[root] = x, y
            begun += [(p, root) for p in mesh.polygons_at(x, y)]
        query = PolyanyaQuery(
            targets=targets,
            near=np.array(near, dtype=np.int64).reshape(-1, 2),
            begun=np.array(begun, dtype=np.int64).reshape(-1, 2),
            looked_for=looked_for,
            open=leads_there,
            sofar=np.full(len(polygons.points), np.inf),
            came=np.full(len(polygons.points), -1),
        )
        open_ways(query.near, mesh.exits, mesh.twins, mesh.owner, looked_for, leads_there)
        return query

    def _seed(self, sources: Floats, query: PolyanyaQuery, state: Ints) -> None:
        """Put the sources on the empty heap."""
        for k, (x, y, sofar) in enumerate(sources.tolist()):
            vertex = self.mesh.vertex_at(x, y)
            root = vertex if vertex >= 0 else len(self.mesh.points) + k
            query.sofar[root] = sofar
            add(query, self.pool, state, root, -1, 0.0, 0.0, 0.0, 0.0)
            enqueue(self._polygons, query, self.pool, state, int(state[COUNT]) - 1)

    def _advance(self, query: PolyanyaQuery, state: Ints) -> int:
        status = advance(self._polygons, query, self.pool, state, self._spare, SLICE)
        if status == HEAP_FULL:
            more = _pool(len(self.pool.places) + self._spare)
            self.pool = Pool(
                cones=np.concatenate([self.pool.cones, more.cones]),
                places=np.concatenate([self.pool.places, more.places]),
                heap=np.concatenate([self.pool.heap, more.heap]),
            )
        return status

    @cached_property
    def _spare(self) -> int:
        """Nodes that one expansion makes at most.

        Through each side of a polygon up to three intervals, and as many point nodes as corners;
        for a root up to one of each for all sides of the polygons around it, and its spurs.
        """
        sides = np.diff(self.mesh.first)
        largest = int(sides.max(initial=0))
        around = np.bincount(self.mesh.corners, weights=sides[self.mesh.owner])
        return max(8 * largest, 2 * int(around.max(initial=0)) + 4)

    def _cells(self, query: PolyanyaQuery, state: Ints, sources: Places, targets: Places) -> Ints:
        """Return the cells [row, col] through which the line leads, shape (k, 2)."""
        roots = trace(query.came, int(state[LAST]))
        line = self._polygons.points[roots[1:] if sources.itself else roots]
        if not targets.itself:
            line = np.concatenate([line, targets.points[state[TARGET], None, :2]])
        return line[:, ::-1].astype(np.int64)


def _pool(room: int) -> Pool:
    return Pool(
        cones=np.empty((room, 5)),
        places=np.empty((room, 2), dtype=np.int64),
        heap=np.empty((room, 2), dtype=np.int64),
    )
