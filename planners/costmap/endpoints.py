"""How start and goal are linked to the cells around them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from planners.costmap.kernels.moves import ONE
from planners.costmap.map_space import MapSpace
from planners.error_messages import Point
from planners.geometry.polyline import merge_collinear
from planners.geometry.rounding import rounding_at, slack_at


class Links(NamedTuple):
    """The cells that a place is linked to."""

    cells: Ints  #: shape (n, 2): row, column; on voxels (n, 3): layer, row, column
    lengths: Floats  #: shape (n,) [m]


def links(space: MapSpace, place: Point, *, radius: float) -> Links:
    """Return the straight links from a place to the cell centres around it: up to four, or eight.

    Like a move, a link keeps its clearance exactly and cuts no corner: none of the cells of the
    block that its ends span is blocked.

    Parameters
    ----------
    space : Costmap or Voxels
    place : tuple of float [m, map]
        x, y and, on voxels, z.
    radius : float [m]
        Clearance to keep.
    """
    position = space.to_cells(place)[0].tolist()
    kept, near = radius - slack_at(place), rounding_at(place) / space.window.resolution
    cells, lengths = [], []
    for cell in itertools.product(*(centres_around(at, near) for at in reversed(position))):
        centre = [index + 0.5 for index in reversed(cell)]
        if is_clear(space, position, centre, radius=kept):
            cells.append(cell)
            lengths.append(math.dist(position, centre))
    return Links(
        np.array(cells, dtype=np.int64).reshape(-1, len(position)),
        np.array(lengths, dtype=float) * space.window.resolution,
    )


def centres_around(position: float, near: float) -> range:
    """Return the one or two cells along an axis whose centres enclose a position.

    Parameters
    ----------
    position : float [cells]
    near : float [cells]
        A position at most this far from a centre coincides with it.

    Examples
    --------
    >>> [list(centres_around(position, 1e-9)) for position in (2.4, 2.5, 2.5 + 1e-10)]
    [[1, 2], [2], [2]]
    """
    return range(math.floor(position - 0.5 + near), math.ceil(position - 0.5 - near) + 1)


def is_clear(space: MapSpace, a: Sequence[float], b: Sequence[float], *, radius: float) -> bool:
    """Whether the straight piece a-b is within two cells along each axis and keeps a clearance.

    Parameters
    ----------
    space : Costmap or Voxels
    a, b : sequence of float, x first [cells]
    radius : float [m]
        Clearance, without any tolerance for rounding.
    """
    first = [math.floor(min(pair)) for pair in zip(a, b, strict=True)][::-1]
    last = [math.floor(max(pair)) for pair in zip(a, b, strict=True)][::-1]
    for low, high, side in zip(first, last, space.blocked.shape, strict=True):
        if low < 0 or high >= side or high - low > 1:
            return False
    box = tuple(slice(low, high + 1) for low, high in zip(first, last, strict=True))
    if space.blocked[box].any():
        return False
    need = radius / space.window.resolution
    return need <= 0 or space.segment_clearance(a, b, need) >= need


class Ends(NamedTuple):
    """The cells at which searches begin and end.

    If start or goal is linked to no cell, no cell-to-cell route exists. Sources and targets are
    then both empty, so that the search ends immediately.
    """

    sources: Ints  #: shape (n, 3): row, column, cost from the start; on voxels a layer before them
    targets: Ints  #: shape (m, 3): likewise, with the cost to the goal
    direct: bool  #: the straight piece from start to goal is clear and thus the best route


def ends_of(space: MapSpace, start: tuple[float, ...], goal: tuple[float, ...]) -> Ends:
    """Return the cells that start and goal are linked to.

    Parameters
    ----------
    space : Costmap or Voxels
    start, goal : tuple of float
        x, y and, on voxels, z [m, map]; a yaw is ignored.
    """
    axes = space.blocked.ndim
    places = start[:axes], goal[:axes]
    sources, targets = (
        _with_costs(space, links(space, place, radius=space.radius)) for place in places
    )
    if len(sources) == 0 or len(targets) == 0:
        sources, targets = sources[:0], targets[:0]
    a, b = space.to_cells(places).tolist()
    kept = space.radius - slack_at(*places)
    direct = (space.uniform or places[0] == places[1]) and is_clear(space, a, b, radius=kept)
    return Ends(sources, targets, direct)


def waypoints_through(
    space: MapSpace, start: tuple[float, ...], goal: tuple[float, ...], cells: Ints
) -> Floats:
    """Return the line from start to goal through the centres of cells, shape (n, d) [m, map].

    Parameters
    ----------
    space : Costmap or Voxels
    start, goal : tuple of float
        x, y and, on voxels, z [m, map]; a yaw is ignored.
    cells : ndarray of int64, shape (k, d)
        The cells where the line begins, turns and ends, in order; can be empty.
    """
    axes = space.blocked.ndim
    centres = space.window.cell_to_world(cells.reshape(-1, axes))
    return merge_collinear(np.concatenate([[start[:axes]], centres, [goal[:axes]]]))


def _with_costs(space: MapSpace, joined: Links) -> Ints:
    """Return the cells and costs of links: their lengths, weighted by the cost of their cell."""
    # Within the tolerance, a link may keep a clearance that the centre of its cell does not keep.
    on = space.traversable[tuple(joined.cells.T)]
    joined = Links(joined.cells[on], joined.lengths[on])
    lengths = joined.lengths / space.window.resolution * space.weights_at(joined.cells)
    return np.column_stack([joined.cells, np.rint(lengths * ONE).astype(np.int64)])
