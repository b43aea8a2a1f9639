"""Where sampling planners compete: a doorway, rooms, a parking bay, or anybody's map."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely

from groundmap import ConfidenceGrid
from groundmap.io.map_images import BlockedMap, grid_of
from groundmap.simulate.truth import touched_cells
from groundmap.simulate.worlds.rooms import Rooms
from planners.engine import Pose
from planners.problem import PlanningProblem
from planners.sampling.settings import Space

STEP_HEIGHT, ROBOT_HEIGHT = 0.15, 2.0  # [m] what stands between the two is in the way
SEED = 4  # of the rooms


class Case(NamedTuple):
    """A query in one space: the same for every planner and every seed."""

    problem: PlanningProblem
    settings: Mapping[str, Any]  #: of the space, such as its turning radius


CART = ((-0.3, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.3, 0.3))  # [m] on maps, unless told otherwise
Cases = Mapping[Space, Case]  #: a workload without a space has nothing to ask there


def rectangle(rear: float, front: float, width: float) -> list[tuple[float, float]]:
    """Return the corners of an outline that reaches so far behind and before base_link [m]."""
    side = width / 2.0
    return [(-rear, -side), (front, -side), (front, side), (-rear, side)]


def doorway() -> Cases:
    """Return two halls of 10 x 8 m and the door between them, 1.0 m wide, far from any corner.

    A disc of 0.6 m has 0.2 m to spare on each side of it, a cart of 1.0 x 0.6 m the same.
    """
    wall = shapely.box(10.0, 0.0, 10.2, 8.0) - shapely.box(9.0, 5.0, 11.0, 6.0)
    grid = raster(shapely.box(0.0, 0.0, 20.2, 8.0) - wall, resolution=0.1)
    ends = (1.5, 1.5, 0.0), (18.5, 1.5, 0.0)
    return cases(grid, *ends, disc=0.3, outline=rectangle(0.25, 0.75, 0.6), turning_radius=0.8)


def rooms() -> Cases:
    """Return 4 x 4 furnished rooms of 8 m with doors of 2 m, crossed from corner to corner."""
    made = Rooms(
        columns=4, rows=4, room_width=8, room_depth=8, door_width=2, passage=1.6, loops=0.5, boxes=4
    )
    world = made.make(np.random.default_rng(SEED))
    free = shapely.box(*world.bounds) - world.obstacles(STEP_HEIGHT, ROBOT_HEIGHT)
    first, last = made.centres()[[0, -1]].tolist()
    ends = (*first, 0.5), (*last, 1.0)
    cart = rectangle(0.5, 1.0, 0.9)
    return cases(raster(free, resolution=0.2), *ends, disc=0.5, outline=cart, turning_radius=1.0)


def parking() -> Cases:
    """Return a car park: from the aisle into a bay between two cars.

    The car is 4.5 x 1.8 m, its base_link on the rear axle; bays are 2.5 m wide and the aisle 8 m.
    It backs into its bay, as people do; what only drives forward (Dubins) noses in.
    In "r2" a disc as wide as the car goes to the middle of the bay.
    """
    taken = [_parked(bay, 2.6) for bay in range(11) if bay != 6]
    taken += [_parked(bay, 15.4) for bay in range(11) if bay not in (2, 9)]  # across the aisle
    grid = raster(shapely.box(0.0, 0.0, 27.5, 18.0) - shapely.union_all(taken), resolution=0.1)

    def to(*goal: float) -> Cases:
        start, car = (3.0, 9.0, 0.0), rectangle(0.9, 3.6, 1.8)
        return cases(grid, start, goal, disc=0.9, outline=car, turning_radius=4.5)

    x, up = 16.25, 0.5 * math.pi
    backed, nosed, middle = to(x, 1.25, up), to(x, 3.95, -up), to(x, 2.6, 0.0)
    return {**backed, "r2": middle["r2"], "dubins": nosed["dubins"]}


WORKLOADS: Mapping[str, Callable[[], Cases]] = {
    "doorway": doorway,
    "rooms": rooms,
    "parking": parking,
}


def cases(
    grid: ConfidenceGrid,
    start: Pose,
    goal: Pose,
    *,
    disc: float,
    outline: list[tuple[float, float]],
    turning_radius: float,
) -> Cases:
    """Return a query in every plane space: a disc in "r2", an outline in the others."""

    def asked(footprint: Any) -> PlanningProblem:
        return PlanningProblem(grid, start=start, goal=goal, footprint=footprint, clear_start=False)

    curve = {"turning_radius": turning_radius}
    turned = asked(outline)
    return {
        "r2": Case(asked(disc), {}),
        "se2": Case(turned, {}),
        "dubins": Case(turned, curve),
        "reeds_shepp": Case(turned, curve),
    }


def raster(free: shapely.Geometry, *, resolution: float) -> ConfidenceGrid:
    """Return a map of what is free [m, map]; cells that anything else reaches into are blocked."""
    low, high = np.reshape(free.bounds, (2, 2))
    cols, rows = np.ceil((high - low) / resolution - 1e-6).astype(int).tolist()
    others = shapely.box(*low, *(low + resolution * np.array([cols, rows]))) - free
    blocked = touched_cells(others, low, resolution, (rows, cols))
    unknown = np.zeros_like(blocked)
    return grid_of(BlockedMap(blocked, unknown, resolution, (float(low[0]), float(low[1]))))


def _parked(bay: int, middle: float) -> shapely.Polygon:
    """Return a car that stands in the middle of a bay."""
    x = 2.5 * bay + 1.25
    return shapely.box(x - 0.9, middle - 2.25, x + 0.9, middle + 2.25)
