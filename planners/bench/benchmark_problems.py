"""Built-in workloads for sampling planners: a doorway, rooms and a parking bay."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import shapely

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools
from groundmap.io.map_images import BlockedMap, BlockedVoxels, grid_of
from groundmap.simulate.truth import touched_cells
from groundmap.simulate.worlds.rooms import Rooms
from planners.problem.problem import PlanningProblem, Pose
from planners.sampling.settings import StateSpace

STEP_HEIGHT, ROBOT_HEIGHT = 0.15, 2.0  # [m]; objects between these heights are obstacles
SEED = 4  # of the rooms


class Case(NamedTuple):
    """A query in one state space, the same for every planner and seed."""

    problem: PlanningProblem
    settings: Mapping[str, Any]  #: of the space, such as its turning radius


CART = ((-0.3, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.3, 0.3))  # [m], default footprint on maps
Cases = Mapping[StateSpace, Case]  #: a workload has no query in a space that is missing


def rectangle(rear: float, front: float, width: float) -> list[tuple[float, float]]:
    """Return the corners of a rectangular footprint [m, base_link].

    Parameters
    ----------
    rear, front : float [m]
        Extent behind and ahead of base_link.
    width : float [m]
    """
    side = width / 2.0
    return [(-rear, -side), (front, -side), (front, side), (-rear, side)]


def doorway() -> Cases:
    """Return a query between two halls of 10 x 8 m through a door of 1.0 m width.

    A disc of 0.6 m diameter and a cart of 1.0 x 0.6 m have 0.2 m clearance on both sides of the
    door. In 3-D the halls are 3 m high, the door is 2 m high, and the robot is a ball of 0.6 m
    diameter.
    """
    wall = shapely.box(10.0, 0.0, 10.2, 8.0)
    halls = shapely.box(0.0, 0.0, 20.2, 8.0) - wall
    free = halls | shapely.box(9.0, 5.0, 11.0, 6.0)
    ends, cart = ((1.5, 1.5, 0.0), (18.5, 1.5, 0.0)), rectangle(0.25, 0.75, 0.6)
    grid = raster(free, resolution=0.1)
    layers = stack_layers([free] * 10 + [halls] * 5, resolution=0.2)
    return {
        **cases(grid, *ends, disc=0.3, outline=cart, turning_radius=0.8),
        "r3": problem_3d(layers, (1.5, 1.5, 0.6), (18.5, 1.5, 2.4), ball=0.3),
    }


def rooms() -> Cases:
    """Return a query from corner to corner of 4 x 4 furnished rooms of 8 m with doors of 2 m.

    In 3-D the robot is a ball of 1 m diameter, which can fly over low furniture.
    """
    generator = Rooms(
        columns=4, rows=4, room_width=8, room_depth=8, door_width=2, passage=1.6, loops=0.5, boxes=4
    )
    world = generator.make(np.random.default_rng(SEED))

    def between(low: float, high: float) -> shapely.Geometry:
        return shapely.box(*world.bounds) - world.obstacles(low, high)

    (x0, y0), (x1, y1) = generator.centres()[[0, -1]].tolist()
    grid, cart = raster(between(STEP_HEIGHT, ROBOT_HEIGHT), resolution=0.2), rectangle(0.5, 1, 0.9)
    layers = [between(z, z + 0.25) for z in np.arange(10) * 0.25]
    flight = problem_3d(
        stack_layers(layers, resolution=0.25), (x0, y0, 1.0), (x1, y1, 1.5), ball=0.5
    )
    ends = (x0, y0, 0.5), (x1, y1, 1.0)
    return {**cases(grid, *ends, disc=0.5, outline=cart, turning_radius=1.0), "r3": flight}


def parking() -> Cases:
    """Return a query in a car park, from the aisle into a bay between two cars.

    The car is 4.5 x 1.8 m with base_link on the rear axle; a bay is 2.5 m wide, the aisle 8 m.
    The car parks backwards, in the forward-only space ("dubins") forwards. In "r2" the robot is a
    disc as wide as the car, and the goal is the middle of the bay.
    """
    parked = [_parked_car(bay, 2.6) for bay in range(11) if bay != 6]
    parked += [_parked_car(bay, 15.4) for bay in range(11) if bay not in (2, 9)]  # across the aisle
    grid = raster(shapely.box(0.0, 0.0, 27.5, 18.0) - shapely.union_all(parked), resolution=0.1)

    def to(*goal: float) -> Cases:
        start, car = (3.0, 9.0, 0.0), rectangle(0.9, 3.6, 1.8)
        return cases(grid, start, goal, disc=0.9, outline=car, turning_radius=4.5)

    x, up = 16.25, 0.5 * math.pi
    backwards, forwards, middle = to(x, 1.25, up), to(x, 3.95, -up), to(x, 2.6, 0.0)
    return {**backwards, "r2": middle["r2"], "dubins": forwards["dubins"]}


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
    """Return a query in every 2-D space: for a disc in "r2", for an outline in the others.

    Parameters
    ----------
    grid : ConfidenceGrid
    start, goal : (x, y, yaw) [m, rad; map]
    disc : float [m]
        Radius of the disc.
    outline : list of (x, y) [m, base_link]
    turning_radius : float [m]
        Of the spaces "dubins" and "reeds_shepp".
    """

    def problem(footprint: Any) -> PlanningProblem:
        return PlanningProblem(grid, start=start, goal=goal, footprint=footprint, clear_start=False)

    curve = {"turning_radius": turning_radius}
    with_outline = problem(outline)
    return {
        "r2": Case(problem(disc), {}),
        "se2": Case(with_outline, {}),
        "dubins": Case(with_outline, curve),
        "reeds_shepp": Case(with_outline, curve),
    }


def problem_3d(grid: ConfidenceGrid, start: Pose, goal: Pose, *, ball: float) -> Case:
    """Return a query on a 3-D map.

    Parameters
    ----------
    grid : ConfidenceGrid
    start, goal : (x, y, z) [m, map]
    ball : float [m]
        Radius of the robot.
    """
    return Case(
        PlanningProblem(grid, start=start, goal=goal, footprint=ball, clear_start=False), {}
    )


def raster(free: shapely.Geometry, *, resolution: float) -> ConfidenceGrid:
    """Return a map whose cells are free if they lie in the free space as a whole.

    Parameters
    ----------
    free : shapely geometry [m, map]
    resolution : float [m]
    """
    blocked = _blocked(free, resolution)
    low = (free.bounds[0], free.bounds[1])
    return grid_of(BlockedMap(blocked, np.zeros_like(blocked), resolution, low))


def stack_layers(layers: list[shapely.Geometry], *, resolution: float) -> ConfidenceGrid:
    """Return a 3-D map from the free space of each layer, from z = 0 upwards.

    Parameters
    ----------
    layers : list of shapely geometry [m, map]
        With the same bounds.
    resolution : float [m]
        Side of a cell and height of a layer.
    """
    blocked = np.stack([_blocked(free, resolution) for free in layers])
    low = (layers[0].bounds[0], layers[0].bounds[1], 0.0)
    return grid_of(BlockedVoxels(blocked, resolution, low))


def _blocked(free: shapely.Geometry, resolution: float) -> Bools:
    low, high = np.reshape(free.bounds, (2, 2))
    cols, rows = np.ceil((high - low) / resolution - 1e-6).astype(int).tolist()
    others = shapely.box(*low, *(low + resolution * np.array([cols, rows]))) - free
    return touched_cells(others, low, resolution, (rows, cols))


def _parked_car(bay: int, middle: float) -> shapely.Polygon:
    """Return the outline of a car in the middle of a bay."""
    x = 2.5 * bay + 1.25
    return shapely.box(x - 0.9, middle - 2.25, x + 0.9, middle + 2.25)
