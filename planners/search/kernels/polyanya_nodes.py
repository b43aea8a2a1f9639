"""Search nodes of Polyanya: what they are, how they are made, and how roots are reached."""

from __future__ import annotations

from typing import NamedTuple

from groundmap.arrays import Bools, Bytes, Floats, Ints
from planners.search.kernels.astar import BEST, TARGET
from planners.search.kernels.polyanya_bound import away
from planners.search.kernels.polyanya_jit import borrowing

SCALE = 2.0**36  # a cell's side in heap keys
SOFAR = 4  # column of `cones`
COUNT, LAST = 4, 5  # entries of `state` after those of A*
SAME = 1e-13  # lengths are the same that differ by no more than this share and as many cells


class Polygons(NamedTuple):
    """The mesh, and in its last rows of `points` and `kinds` what one query adds to it."""

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
    """What one query looks for, and what it has found out about vertices."""

    targets: Floats  #: shape (n, 3), x, y and final cost [cells]
    near: Ints  #: shape (m, 2), polygon and a target that lies in it
    begun: Ints  #: shape (k, 2), polygon and a source in it that is no vertex
    looked_for: Bools  #: shape (p,), polygons in `near`
    open: Bools  #: shape (p,), dead ends that lead to targets
    sofar: Floats  #: shape (v,), least length to each root [cells]
    came: Ints  #: shape (v,), the root before; -1 for sources


class Pool(NamedTuple):
    """Search nodes and the heap of those that wait."""

    cones: Floats  #: shape (room, 5), left and right direction, length to the root
    places: Ints  #: shape (room, 2), root and side; side -1 for point nodes
    heap: Ints  #: shape (room, 2)


@borrowing
def at(mesh: Polygons, vertex: int) -> tuple[float, float]:
    """Return x and y of a vertex."""
    return mesh.points[vertex, 0], mesh.points[vertex, 1]


@borrowing
def following(mesh: Polygons, side: int) -> int:
    """Return the next side of a polygon."""
    polygon = mesh.owner[side]
    return side + 1 if side + 1 < mesh.first[polygon + 1] else mesh.first[polygon]


@borrowing
def between(mesh: Polygons, a: int, b: int) -> float:
    """Return the distance between two vertices."""
    (ax, ay), (bx, by) = at(mesh, a), at(mesh, b)
    return away(ax, ay, bx, by)


@borrowing
def arrive(mesh: Polygons, query: PolyanyaQuery, vertex: int, came: int) -> bool:
    """Whether lines may turn at a vertex that the root `came` sees.

    Not if a shorter line to it is known, nor if one as long is that comes from elsewhere: of what
    lies beyond, all that is best reached this way is also best reached that way. (On a lattice,
    ways round obstacles are often equally long; with both kept, nodes would double at each.)
    That is so because this is asked only where something lies round the corner: from a root
    behind, on the same straight line, nothing does.
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
    """Make a point node of a vertex seen from the root `came`, if that is the best way to it."""
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
    """Make a node of a cone through a side, or, with side -1, of all around a root."""
    node = state[COUNT]
    cone = pool.cones[node]
    cone[0], cone[1], cone[2], cone[3] = left_x, left_y, right_x, right_y
    cone[SOFAR] = query.sofar[root]
    pool.places[node, 0], pool.places[node, 1] = root, side
    state[COUNT] += 1


@borrowing
def useful(mesh: Polygons, query: PolyanyaQuery, side: int) -> bool:
    """Whether what lies beyond a side can be of use: not nothing, and no dead end without goal."""
    twin = mesh.twins[side]
    if twin < 0:
        return False
    beyond = mesh.owner[twin]
    return bool(mesh.exits[beyond] != twin or query.open[beyond])


@borrowing
def finish(mesh: Polygons, query: PolyanyaQuery, state: Ints, root: int, target: int) -> None:
    """Note a line that turns at `root` last and ends at a target, if it is the best so far."""
    x, y = at(mesh, root)
    length = away(x, y, query.targets[target, 0], query.targets[target, 1])
    key = int((query.sofar[root] + length + query.targets[target, 2]) * SCALE)
    if key < state[BEST]:
        state[BEST], state[LAST], state[TARGET] = key, root, target
