"""Expansion of Polyanya's search nodes."""

from __future__ import annotations

from groundmap.arrays import Floats, Ints
from planners.costmap.kernels.navmesh import CORNER, GATE, PINCH
from planners.search.kernels.polyanya_bound import cross
from planners.search.kernels.polyanya_jit import borrowing
from planners.search.kernels.polyanya_nodes import (
    PolyanyaQuery,
    Polygons,
    Pool,
    add,
    arrive,
    at,
    finish,
    following,
    reach,
    useful,
)

BESIDE = 1e-10  # [cells²] tolerance of the cross product for a root on a side


@borrowing
def from_point(mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, root: int) -> None:
    """Expand a point node: along spurs, and into the polygons around it.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    pool : Pool
    state : ndarray of int64, shape (6,)
    root : int
    """
    x, y = at(mesh, root)
    for k in range(len(query.targets)):
        if query.targets[k, 0] == x and query.targets[k, 1] == y:
            finish(mesh, query, state, root, k)
    if root >= len(mesh.spurs):  # a source that is not a vertex
        for i in range(len(query.begun)):
            if query.begun[i, 1] == root:
                _radiate(mesh, query, pool, state, root, query.begun[i, 0])
        return
    came = query.came[root]
    along_spur = False
    for k in range(4):
        beside = mesh.spurs[root, k]
        if beside >= 0:
            along_spur = along_spur or beside == came
            reach(mesh, query, pool, state, beside, root)
    if came >= 0 and mesh.kinds[root] == GATE and not along_spur:
        return  # the line came from the squares beside the gate; their union is convex
    for i in range(mesh.around_first[root], mesh.around_first[root + 1]):
        polygon = mesh.around[i]
        if came < 0 or mesh.kinds[root] != PINCH or _opposite(mesh, root, came, polygon):
            _radiate(mesh, query, pool, state, root, polygon)


@borrowing
def _opposite(mesh: Polygons, pinch: int, came: int, polygon: int) -> bool:
    """Whether a polygon and the previous root lie on opposite sides of a pinch."""
    x, y = at(mesh, pinch)
    away_x, away_y = 0.0, 0.0
    for side in range(mesh.first[polygon], mesh.first[polygon + 1]):
        away_x += mesh.points[mesh.corners[side], 0] - x
        away_y += mesh.points[mesh.corners[side], 1] - y
    to_x, to_y = at(mesh, came)
    return away_x * (to_x - x) + away_y * (to_y - y) < 0.0


@borrowing
def _radiate(
    mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, root: int, polygon: int
) -> None:
    """Make nodes from a root in a polygon through all sides that it does not lie on."""
    x, y = at(mesh, root)
    for side in range(mesh.first[polygon], mesh.first[polygon + 1]):
        a, b = mesh.corners[side], mesh.corners[following(mesh, side)]
        (ax, ay), (bx, by) = at(mesh, a), at(mesh, b)
        if a != root and mesh.kinds[a] >= GATE:
            reach(mesh, query, pool, state, a, root)
        inside = cross(bx - ax, by - ay, x - ax, y - ay) > BESIDE
        if root not in (a, b) and inside and useful(mesh, query, side):
            add(query, pool, state, root, side, bx - x, by - y, ax - x, ay - y)
    if query.looked_for[polygon]:
        for i in range(len(query.near)):
            if query.near[i, 0] == polygon:
                finish(mesh, query, state, root, query.near[i, 1])


@borrowing
def from_interval(
    mesh: Polygons, query: PolyanyaQuery, pool: Pool, state: Ints, root: int, cone: Floats, out: int
) -> None:
    """Expand an interval of side `out` into the polygon beyond.

    Its other sides are visited from right to left. Their parts within the cone are seen from the
    root; the parts beside it are seen from the end of the interval on that side, if it is a corner.

    Parameters
    ----------
    mesh : Polygons
    query : PolyanyaQuery
    pool : Pool
    state : ndarray of int64, shape (6,)
    root : int
    cone : ndarray, shape (5,)
    out : int
    """
    x, y = at(mesh, root)
    right, left = mesh.corners[out], mesh.corners[following(mesh, out)]
    (left_x, left_y), (right_x, right_y) = at(mesh, left), at(mesh, right)
    turns_left = _may_turn(mesh, root, left, cone[0], cone[1])
    turns_right = _may_turn(mesh, root, right, cone[2], cone[3])
    side = mesh.twins[out]
    polygon = mesh.owner[side]
    a, (a_left, a_right) = right, _beside(mesh, root, cone, right)
    for _ in range(mesh.first[polygon + 1] - mesh.first[polygon] - 1):
        side = following(mesh, side)
        b = mesh.corners[following(mesh, side)]
        b_left, b_right = _beside(mesh, root, cone, b)
        if mesh.kinds[b] >= GATE and b != left:
            if b_left <= 0.0 and b_right >= 0.0:
                reach(mesh, query, pool, state, b, root)
            elif b_left > 0.0 and turns_left and arrive(mesh, query, left, root):
                reach(mesh, query, pool, state, b, left)
            elif b_right < 0.0 and turns_right and arrive(mesh, query, right, root):
                reach(mesh, query, pool, state, b, right)
        if useful(mesh, query, side):
            (ax, ay), (bx, by) = at(mesh, a), at(mesh, b)
            if a_left < 0.0 and b_right > 0.0:
                lx, ly = (bx - x, by - y) if b_left <= 0.0 else (cone[0], cone[1])
                rx, ry = (ax - x, ay - y) if a_right >= 0.0 else (cone[2], cone[3])
                add(query, pool, state, root, side, lx, ly, rx, ry)
            # If a side is cut, the new cone's ray continues the old one past the corner.
            hidden_left = turns_left and (a_left >= 0.0 or b_left > 0.0)
            if hidden_left and arrive(mesh, query, left, root):
                to_bx, to_by, to_ax, to_ay = bx - left_x, by - left_y, ax - left_x, ay - left_y
                rx, ry = (left_x - x, left_y - y) if a_left < 0.0 else (to_ax, to_ay)
                add(query, pool, state, left, side, to_bx, to_by, rx, ry)
            hidden_right = turns_right and (a_right < 0.0 or b_right <= 0.0)
            if hidden_right and arrive(mesh, query, right, root):
                to_bx, to_by, to_ax, to_ay = bx - right_x, by - right_y, ax - right_x, ay - right_y
                lx, ly = (right_x - x, right_y - y) if b_right > 0.0 else (to_bx, to_by)
                add(query, pool, state, right, side, lx, ly, to_ax, to_ay)
        a, a_left, a_right = b, b_left, b_right
    if query.looked_for[polygon]:
        left, right = left if turns_left else -1, right if turns_right else -1
        _find(mesh, query, state, root, cone, polygon, left, right)


@borrowing
def _may_turn(mesh: Polygons, root: int, vertex: int, dx: float, dy: float) -> bool:
    """Whether lines from a root may turn at an end of a side: it is a corner on the cone's ray."""
    if mesh.kinds[vertex] != CORNER or vertex == root:
        return False
    (x, y), (to_x, to_y) = at(mesh, root), at(mesh, vertex)
    off: float = cross(dx, dy, to_x - x, to_y - y)
    return off == 0.0


@borrowing
def _beside(mesh: Polygons, root: int, cone: Floats, vertex: int) -> tuple[float, float]:
    """Return how far a vertex lies to the left of the left ray, and of the right ray.

    The root is in its own cone. If the root is at an end of the interval, all points are within
    the cone on that side.
    """
    if vertex == root:
        return -1.0, 1.0
    return _off(
        cone,
        mesh.points[vertex, 0] - mesh.points[root, 0],
        mesh.points[vertex, 1] - mesh.points[root, 1],
    )


@borrowing
def _off(cone: Floats, dx: float, dy: float) -> tuple[float, float]:
    left, right = -1.0, 1.0
    if cone[0] != 0.0 or cone[1] != 0.0:
        left = cross(cone[0], cone[1], dx, dy)
    if cone[2] != 0.0 or cone[3] != 0.0:
        right = cross(cone[2], cone[3], dx, dy)
    return left, right


@borrowing
def _find(
    mesh: Polygons,
    query: PolyanyaQuery,
    state: Ints,
    root: int,
    cone: Floats,
    polygon: int,
    left: int,
    right: int,
) -> None:
    """Finish lines at targets in a polygon, from the root or from an end of the interval."""
    for i in range(len(query.near)):
        if query.near[i, 0] != polygon:
            continue
        target = query.near[i, 1]
        dx = query.targets[target, 0] - mesh.points[root, 0]
        dy = query.targets[target, 1] - mesh.points[root, 1]
        off_left, off_right = _off(cone, dx, dy)
        last = left if off_left > 0.0 else right if off_right < 0.0 else root
        if last == root or (last >= 0 and arrive(mesh, query, last, root)):
            finish(mesh, query, state, last, target)
