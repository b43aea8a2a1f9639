"""Per-cell masks, distances and costs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints32
from groundmap.grid.window import CellState, GridWindow
from planners.costmap.imposed import imposed_cells
from planners.costmap.kernels.distance import NOWHERE, squared_distances
from planners.costmap.moves import squared_need
from planners.geometry.rounding import slack_at
from planners.problem.costs import (
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    NO_INFORMATION,
    cell_costs,
)
from planners.problem.problem import PlanningProblem


class Occupancy(NamedTuple):
    """Masks of the cells of a map of any dimension, see `planners.costmap.map_space.MapSpace`."""

    blocked: Bools
    nonfree: Bools
    cleared: Bools
    free: Bools  #: free cells and cleared ones


class Layers(NamedTuple):
    """Arrays of shape (rows, cols), see `planners.costmap.costmap.Costmap`."""

    blocked: Bools
    nonfree: Bools
    cleared: Bools
    squared: Ints32
    costs: Bytes


def occupancy_of(problem: PlanningProblem, window: GridWindow) -> Occupancy:
    """Return which cells of a window the footprint must not touch.

    Parameters
    ----------
    problem : PlanningProblem
    window : GridWindow
        In any dimension.
    """
    states = window.states(epsilon=problem.epsilon)
    imposed = imposed_cells(problem, window)
    if imposed is not None:
        states[imposed] = CellState.NONFREE
    nonfree = states == CellState.NONFREE
    cleared = _near_start(problem, window)
    cleared &= states == CellState.UNKNOWN
    free = (states == CellState.FREE) | cleared
    return Occupancy(~free if problem.avoids_unknown else nonfree, nonfree, cleared, free)


def layers_of(problem: PlanningProblem, window: GridWindow) -> Layers:
    """Return the layers of a window; everything outside it counts as not blocked.

    Parameters
    ----------
    problem : PlanningProblem
    window : GridWindow
        In 2-D.
    """
    blocked, nonfree, cleared, free = occupancy_of(problem, window)
    squared = squared_distances(blocked, cap(problem))
    costs = np.zeros(squared.shape, dtype=np.uint8)
    penalise = problem.unknown == "penalise"
    if problem.costs.top(penalise=penalise) > 0:
        costs = cell_costs(
            problem.costs,
            metres(squared, window.resolution),
            window.confidence,
            free,
            radius=problem.radius,
            penalise=penalise,
        )
    costs[squared < squared_need(problem.radius, window.resolution)] = INSCRIBED_INFLATED_OBSTACLE
    costs[blocked] = NO_INFORMATION
    costs[nonfree] = LETHAL_OBSTACLE
    return Layers(blocked, nonfree, cleared, squared, costs)


def cap(problem: PlanningProblem) -> int:
    """Return the squared distance beyond which no layer depends on it [(half cells)²]."""
    farthest = max(problem.radius, problem.costs.reach)
    return min(squared_need(farthest, problem.grid.resolution), NOWHERE)


def metres(squared: Ints32, resolution: float) -> Floats:
    """Return distances in metres.

    Parameters
    ----------
    squared : ndarray of int32 [(half cells)²]
    resolution : float [m]
    """
    return np.where(squared == NOWHERE, np.inf, np.sqrt(squared) * (resolution / 2.0))


def _near_start(problem: PlanningProblem, window: GridWindow) -> Bools:
    """Return the cells whose square or cube comes within the clear radius of the cleared place."""
    near = np.zeros(window.shape, dtype=np.bool_)
    if not problem.clear_start:
        return near
    position = ((np.array(problem.clear_place) - window.origin) / window.resolution)[::-1]
    reach = problem.clear_radius + slack_at(problem.clear_place)
    cells = reach / window.resolution + 1.0
    first = np.clip(np.floor(position - cells), 0, near.shape).astype(np.int64)
    last = np.clip(np.ceil(position + cells), 0, near.shape).astype(np.int64)
    squared = np.zeros((1,) * near.ndim)
    for axis, at in enumerate(position):
        lower = np.arange(first[axis], last[axis])
        gaps = np.maximum(np.maximum(lower - at, at - lower - 1), 0.0)
        squared = squared + np.expand_dims(gaps**2, [k for k in range(near.ndim) if k != axis])
    near[tuple(map(slice, first, last))] = np.sqrt(squared) * window.resolution <= reach
    return near
