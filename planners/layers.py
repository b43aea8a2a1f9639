"""What the cells of a window are to a problem: blocked, how far from that, how dear."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints32
from groundmap.window import CellState, GridWindow
from planners.costs import (
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    NO_INFORMATION,
    cell_costs,
)
from planners.errors import ProblemError
from planners.kernels.distance import NOWHERE, squared_distances
from planners.lattice import squared_need
from planners.problem import PlanningProblem
from planners.rounding import slack_at

MOST_CELLS = 2**25  # of a costmap: what is held of it takes about 50 bytes for each


class Layers(NamedTuple):
    """Arrays of shape (rows, cols), described at `planners.costmap.Costmap`."""

    blocked: Bools
    nonfree: Bools
    cleared: Bools
    squared: Ints32
    costs: Bytes


def layers_of(problem: PlanningProblem, window: GridWindow) -> Layers:
    """Return the layers of a window; what lies outside it counts as not blocked."""
    states = window.states(epsilon=problem.epsilon)
    nonfree = states == CellState.NONFREE
    cleared = near_start(problem, window) & (states == CellState.UNKNOWN)
    free = (states == CellState.FREE) | cleared
    blocked = ~free if problem.avoids_unknown else nonfree
    squared = squared_distances(blocked, cap(problem))
    costs = cell_costs(
        problem.costs,
        metres(squared, window.resolution),
        window.confidence,
        free,
        radius=problem.radius,
        penalise=problem.unknown == "penalise",
    )
    costs[squared < squared_need(problem.radius, window.resolution)] = INSCRIBED_INFLATED_OBSTACLE
    costs[blocked] = NO_INFORMATION
    costs[nonfree] = LETHAL_OBSTACLE
    return Layers(blocked, nonfree, cleared, squared, costs)


def cap(problem: PlanningProblem) -> int:
    """Return the squared distance beyond which nothing changes [(half cells)²]."""
    farthest = max(problem.radius, problem.costs.reach)
    return min(squared_need(farthest, problem.grid.resolution), NOWHERE)


def metres(squared: Ints32, resolution: float) -> Floats:
    """Return distances [m] of squared ones in half cells."""
    return np.where(squared == NOWHERE, np.inf, np.sqrt(squared) * (resolution / 2.0))


def padded_window(problem: PlanningProblem) -> GridWindow:
    """Return the touched tiles, the cleared start, and a ring of cells around them, in 2-D or 3-D.

    Raises
    ------
    ProblemError
        More than `MOST_CELLS` cells.
    """
    return problem.grid.window(padded_bounds(problem))


def padded_bounds(problem: PlanningProblem) -> Floats:
    """Return the box of `padded_window`: lower then upper corner [m, map]."""
    grid = problem.grid
    lower, upper = grid.bounds().reshape(2, -1)
    mapped = float(np.prod((upper - lower) / grid.resolution))
    if mapped > MOST_CELLS:
        raise ProblemError(
            "grid",
            f"a box of {MOST_CELLS} cells around the touched tiles at most",
            f"{mapped:.3g}",
            hint="Map with larger cells.",
        )
    if problem.clear_start:
        start = np.array(problem.clear_place)
        lower = np.minimum(lower, start - problem.clear_radius)
        upper = np.maximum(upper, start + problem.clear_radius)
    cells = float(np.prod((upper - lower) / grid.resolution))
    if cells > MOST_CELLS:
        raise ProblemError(
            "footprint" if problem.cleared_at is None else "cleared_at",
            f"one that leaves {MOST_CELLS} cells of map and cleared start at most",
            f"{problem.clear_radius:g} m around {problem.clear_place}, which makes {cells:.3g}",
            hint="Give a smaller footprint or clear_start_radius, or map with larger cells.",
        )
    # One cell and a half: borders that rounding moves by a cell must not swallow the ring.
    ring = 1.5 * grid.resolution
    return np.concatenate([lower - ring, upper + ring])


def near_start(problem: PlanningProblem, window: GridWindow) -> Bools:
    """Return which cells' squares (cubes) come within the clear radius of the cleared place."""
    shape = window.count.shape
    if not problem.clear_start:
        return np.zeros(shape, dtype=np.bool_)
    position = (np.array(problem.clear_place) - window.origin) / window.resolution
    squared = np.zeros((1,) * len(shape))
    for axis, (length, at) in enumerate(zip(shape, position[::-1], strict=True)):
        first = np.arange(length)
        gaps = np.maximum(np.maximum(first - at, at - first - 1), 0.0)
        squared = squared + np.expand_dims(gaps**2, [k for k in range(len(shape)) if k != axis])
    reach = problem.clear_radius + slack_at(problem.clear_place)
    near: Bools = np.sqrt(squared) * window.resolution <= reach
    return near
