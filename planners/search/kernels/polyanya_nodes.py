"""Search nodes of Polyanya: their data, their construction, and the update of roots."""

from __future__ import annotations

from typing import NamedTuple

from groundmap.arrays import Bools, Bytes, Floats, Ints
from planners.search.kernels.astar import BEST, TARGET
from planners.search.kernels.polyanya_bound import away
from planners.search.kernels.polyanya_jit import borrowing

SCALE = 2.0**36  # a cell's side in heap keys
SOFAR = 4  # column of `cones`
COUNT, LAST = 4, 5  # entries of `state` after those of A*
SAME = 1e-13  # tolerance of lengths: this share of them plus as many cells


class Polygons(NamedTuple):
    """The mesh; the last rows of `points` and `kinds` are for the sources of one query."""

    points: Floats
    kinds: Bytes
    first: Ints
    corners: Ints
    twins: Ints
    owner: Ints
    exits: Ints
    around_first: Ints
    around: Ints
    spurs: Ints


class PolyanyaQuery(NamedTuple):
    """The ends of one query, and its labels of polygons and vertices."""

    targets: Floats  #: shape (n, 3), x, y and final cost [cells]
    near: Ints  #: shape (m, 2), polygon and a target in it
    begun: Ints  #: shape (k, 2), polygon and a source in it that is not a vertex
    looked_for: Bools  #: shape (p,), polygons in `near`
    open: Bools  #: shape (p,), dead ends that lead to targets
    sofar: Floats  #: shape (v,), least length to each root [cells]
    came: Ints  #: shape (v,), the root before; -1 for sources


class Pool(NamedTuple):
    """Search nodes and the heap of open ones."""

    cones: Floats  #: shape (room, 5), left and right direction, length to the root
    places: Ints  #: shape (room, 2), root and side; side -1 for point nodes
    heap: Ints  #: shape (room, 2)


@borrowing
def at(mesh: Polygons, vertex: int) -> tuple[float, float]:
    """Return x and y of a vertex [cells].

    Parameters
    ----------
    mesh : Polygons
    vertex : int
    """
    return mesh.points[vertex, 0], mesh.points[vertex, 1]


@borrowing
def following(mesh: Polygons, side: int) -> int:
    """Return the next side of the same polygon.

    Parameters
    ----------
    mesh : Polygons
    side : int
    """
    polygon = mesh.owner[side]
    return side + 1 if side + 1 < mesh.first[polygon + 1] else mesh.first[polygon]


@borrowing
def between(mesh: Polygons, a: int, b: int) -> float:
    """Return the distance between two vertices [cells].

    Parameters
    ----------
    mesh : Polygons
    a, b : int
    """
    (ax, ay), (bx, by) = at(mesh, a), at(mesh, b)
    return away(ax, ay, bx, by)


@borrowing
def arrive(mesh: Polygons, query: PolyanyaQuery, vertex: int, came: int) -> bool:
    """Whether lines from the root `came` may turn at a vertex; update the vertex if they may.

    They may not if a shorter line to the vertex is known, or one of equal length from another root:
    points beyond are then reached equally well by that line. (On a lattice, paths around obstacles
    are often equally long; with both kept, the number of nodes would double at each.) This relies
    on being called only if a side or target is hidden behind the vertex, which is not the case for
    a root further back on the same straight line.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    vertex, came : int
    """
    sofar = query.sofar[came] + between(mesh, came, vertex)
    slack = SAME * (1.0 + sofar)
    if query.sofar[vertex] - sofar > slack:
        query.sofar[vertex], query.came[vertex] = sofar, came
        return True
    return bool(query.came[vertex] == came and sofar - query.sofar[vertex] <= slack)


@borrowing
def reach(
    mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, vertex: int, came: int
) -> None:
    """Make a point node of a vertex seen from the root `came`, if no shorter line to it is known.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    pool : Pool
    state : ndarray of int64, shape (6,)
    vertex, came : int
    """
    sofar = query.sofar[came] + between(mesh, came, vertex)
    if query.sofar[vertex] - sofar > SAME * (1.0 + sofar):
        query.sofar[vertex], query.came[vertex] = sofar, came
        add(query, pool, state, vertex, -1, 0.0, 0.0, 0.0, 0.0)


@borrowing
def add(
    query: PolyanyaQuery,
    pool: Pool,
    state: Ints,
    root: int,
    side: int,
    left_x: float,
    left_y: float,
    right_x: float,
    right_y: float,
) -> None:
    """Make a node of a cone through a side or, with side -1, a point node.

    Parameters
    ----------
    query : PolyanyaQuery
    pool : Pool
    state : ndarray of int64, shape (6,)
    root, side : int
    left_x, left_y, right_x, right_y : float
        Directions of the cone's rays.
    """
    node = state[COUNT]
    cone = pool.cones[node]
    cone[0], cone[1], cone[2], cone[3] = left_x, left_y, right_x, right_y
    cone[SOFAR] = query.sofar[root]
    pool.places[node, 0], pool.places[node, 1] = root, side
    state[COUNT] += 1


@borrowing
def useful(mesh: Polygons, query: PolyanyaQuery, side: int) -> bool:
    """Whether there is a polygon beyond a side that is not a dead end without targets.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    side : int
    """
    twin = mesh.twins[side]
    if twin < 0:
        return False
    beyond = mesh.owner[twin]
    return bool(mesh.exits[beyond] != twin or query.open[beyond])


@borrowing
def finish(mesh: Polygons, query: PolyanyaQuery, state: Ints, root: int, target: int) -> None:
    """Store the line whose last turn is at `root` and that ends at a target, if it is the best.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    state : ndarray of int64, shape (6,)
    root, target : int
    """
    x, y = at(mesh, root)
    length = away(x, y, query.targets[target, 0], query.targets[target, 1])
    key = int((query.sofar[root] + length + query.targets[target, 2]) * SCALE)
    if key < state[BEST]:
        state[BEST], state[LAST], state[TARGET] = key, root, target
