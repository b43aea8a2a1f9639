"""Why there is no route: who is fenced in, how far one gets, how wide the widest way is."""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from groundmap.arrays import Bools, Ints
from planners.costmap import Costmap
from planners.errors import EnclosedError, Place, Point
from planners.kernels.flood import flood
from planners.lattice import allowed_moves, squared_need
from planners.links import is_clear, links


def enclosed(costmap: Costmap) -> EnclosedError:
    """Return the exception that says why start and goal are not joined."""
    problem, resolution = costmap.problem, costmap.window.resolution
    from_start = reachable(costmap, problem.start_xy, radius=costmap.radius)
    from_goal = reachable(costmap, problem.goal_xy, radius=costmap.radius)
    place: Place = "start" if from_start.sum() < from_goal.sum() else "goal"
    fenced = from_start if place == "start" else from_goal
    nearest, distance = _nearest(costmap, from_start)
    return EnclosedError(
        place,
        area=float(fenced.sum()) * resolution**2,
        nearest=nearest,
        distance=distance,
        widest_gap=widest_way(costmap),
        needed=2.0 * problem.radius,
    )


def reachable(costmap: Costmap, xy: Point, *, radius: float) -> Bools:
    """Return which cell centres can be reached from a place, shape (rows, cols).

    Parameters
    ----------
    costmap : Costmap
    xy : tuple of float [m, map]
    radius : float [m]
        Clearance to keep on the way.
    """
    cells = links(costmap, xy, radius=radius).cells
    sources = cells[:, 0] * costmap.width + cells[:, 1]
    mask: Bools = flood(allowed_moves(costmap.stand_for(radius)).ravel(), costmap.width, sources)
    return mask.reshape(costmap.blocked.shape)


def widest_way(costmap: Costmap) -> float:
    """Return the width of the widest way from start to goal [m]; 0 if there is none.

    Ways lead over the half-cell lattice, along its lines and from cell centres to corners: steps
    whose clearance is that of their ends (see `planners.lattice`). A narrower footprint gets
    wherever a wider one does, so bisection over the clearances that occur, those of start and
    goal included, ends at the answer.
    """
    problem, resolution = costmap.problem, costmap.window.resolution
    ends = [costmap.clearance_of(xy) for xy in (problem.start_xy, problem.goal_xy)]
    radii = np.append(np.sqrt(np.unique(costmap.lattice)) * resolution / 2.0, ends)
    radii = np.unique(radii[(radii > 0) & (radii <= min(ends))])
    low, high = -1, len(radii)  # joined at radii[low], not at radii[high]
    while low + 1 < high:
        middle = (low + high) // 2
        low, high = (middle, high) if _joined(costmap, float(radii[middle])) else (low, middle)
    return 2.0 * float(radii[low]) if low >= 0 else 0.0


def _joined(costmap: Costmap, radius: float) -> bool:
    """Whether a way on the lattice joins start and goal for a radius above 0 [m]."""
    parts = _parts(costmap.lattice >= squared_need(radius, costmap.window.resolution))
    start, goal = costmap.problem.start_xy, costmap.problem.goal_xy
    at_start, at_goal = (
        set(parts[_points_at(costmap, xy, radius)].tolist()) for xy in (start, goal)
    )
    return bool((at_start & at_goal) - {0})


def _parts(clear: Bools) -> Ints:
    """Return the number of the connected part of every clear lattice point; 0 where not clear.

    Steps along the lattice's lines are `ndimage.label`'s; steps from a centre to a corner of its
    cell join the parts that these find.
    """
    labels, count = ndimage.label(clear)
    centres, corners = labels[1::2, 1::2], labels[::2, ::2]
    pairs = [
        np.stack([centres.ravel(), corner.ravel()])
        for corner in (corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:])
    ]
    a, b = np.concatenate(pairs, axis=1)
    both = (a > 0) & (b > 0) & (a != b)
    graph = coo_array((np.ones(both.sum()), (a[both], b[both])), shape=(count + 1, count + 1))
    _, part = connected_components(graph, directed=False)
    numbers: Ints = np.where(labels > 0, part[labels] + 1, 0)
    return numbers


def _points_at(costmap: Costmap, xy: Point, radius: float) -> tuple[Ints, Ints]:
    """Return the lattice points around a place, and the centres, that clear pieces join it to."""
    x, y = costmap.to_cells(xy)[0]
    around = [
        (row, col)
        for row in {math.floor(2 * y), math.ceil(2 * y)}
        for col in {math.floor(2 * x), math.ceil(2 * x)}
        if is_clear(costmap, (x, y), (col / 2, row / 2), radius=radius)
    ]
    centres = 2 * links(costmap, xy, radius=radius).cells + 1
    rows, cols = np.concatenate([np.array(around, dtype=np.int64).reshape(-1, 2), centres]).T
    return rows, cols


def _nearest(costmap: Costmap, reached: Bools) -> tuple[Point, float]:
    """Return the reached centre nearest to the goal, else the start, and its distance."""
    centres = costmap.window.cell_to_world(np.argwhere(reached))
    places = centres if len(centres) else np.array([costmap.problem.start_xy])
    distances = np.hypot(*(places - costmap.problem.goal_xy).T)
    i = int(distances.argmin())
    return (float(places[i, 0]), float(places[i, 1])), float(distances[i])
