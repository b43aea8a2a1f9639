"""Whether the footprint fits at start and goal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import TypeAlias

import numpy as np
from scipy import ndimage

from groundmap.arrays import Bools, Floats
from planners.costmap.costmap import Costmap
from planners.costmap.endpoints import links
from planners.costmap.map_space import MapSpace
from planners.costmap.regions import connected_to, largest_region, nearest_cells
from planners.costmap.voxel_map import Voxels
from planners.error_messages import Place, Point, WayOut, format_point
from planners.errors import (
    KeepOutError,
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    ProblemError,
    UnknownSpaceError,
)
from planners.geometry.kernels.swept_footprint import pose_clear
from planners.geometry.rounding import rounding_at, slack_at
from planners.problem.problem import PlanningProblem, Pose

SPACES: dict[int, type[Costmap | Voxels]] = {2: Costmap, 3: Voxels}  # by dimension of the map
FARTHEST_OUT = 10.0  # [m], from the start to a place that the same drive saw
#: Cells of one kind, and the error of an end whose footprint overlaps them.
Cause: TypeAlias = tuple[Bools, Callable[..., NoRouteError]]
MOST_LOOKUPS = 64  # tiles near a place above which all observed tiles are searched instead


def costmap_of(problem: PlanningProblem) -> Costmap:
    """Return the costmap of a problem on a 2-D map after checking that its disc fits at both ends.

    Raises
    ------
    ProblemError
        A 3-D map.
    OutsideMapError, NonFreeError, UnknownSpaceError
    """
    problem.check_dimensions(2)
    check_on_map(problem)
    costmap = Costmap.of(problem)
    check_space(costmap, "start", problem.start_xy)
    check_space(costmap, "goal", problem.goal_xy)
    return costmap


def check_on_map(problem: PlanningProblem, *, goal: bool = True) -> None:
    """Check that start and goal lie on observed tiles.

    A start whose surroundings are cleared may lie beside them if its footprint (or a cell) reaches
    them: poses at the border of a tile have rounding errors.

    Parameters
    ----------
    problem : PlanningProblem
    goal : bool, default True
        Whether the goal is checked.

    Raises
    ------
    OutsideMapError
    """
    grid = problem.grid
    reach = max(problem.radius, grid.resolution) if problem.clears_its_start else 0.0
    places: tuple[tuple[Place, Point, float], ...] = (
        ("start", problem.start_xy, reach),
        ("goal", problem.goal_xy, 0.0),
    )
    for place, xy, margin in places if goal else places[:1]:
        if not _touches_tile(problem, xy, margin):
            if not any(True for _ in grid.tiles()):
                raise OutsideMapError(place, xy, bounds=())
            space = space_of(replace(problem, clear_start=False))
            nearest = nearest_place(space, xy, place=place)
            raise OutsideMapError(place, xy, bounds=tuple(grid.bounds().tolist()), nearest=nearest)


def check_space(space: MapSpace, place: Place, pose: Pose, *, headings: bool = False) -> None:
    """Check that the footprint fits; the state of the place itself takes precedence.

    Parameters
    ----------
    space : Costmap or Voxels
    place : {"start", "goal"}
        Name of the place in the message.
    pose : tuple of float
        x, y (in 3-D: x, y, z) [m, map] and, if `headings`, yaw [rad].
    headings : bool, default False
        Whether an outline is checked at its yaw, instead of the disc around it.

    Raises
    ------
    NonFreeError, KeepOutError, UnknownSpaceError
    ProblemError
        A place outside the part of a large map that is planned on.
    """
    xy, yaw = _place_and_yaw(space, pose, headings=headings)
    _check_in_window(space, place, xy)
    if _fits(space, space.blocked, xy, yaw):
        return
    cell = tuple(np.floor(space.to_cells(xy)[0]).astype(np.int64)[::-1])
    checks = _causes(space)
    checks.sort(key=lambda check: not check[0][cell])
    for blocked, error in checks:
        if not _fits(space, blocked, xy, yaw):
            raise error(
                place,
                xy,
                clearance=space.clearance_of(xy, to=blocked),
                needed=space.radius,
                nearest=nearest_place(space, xy, place=place, yaw=yaw),
                yaw=yaw,
            )


def _causes(space: MapSpace) -> list[Cause]:
    """Return the kinds of blocked cells, with the errors that name them, by precedence."""
    nonfree = space.nonfree.copy()
    checks: list[Cause] = [(nonfree, NonFreeError)]
    for mask, error in (
        (space.recent, partial(NonFreeError, recent=True)),
        (space.kept_out, KeepOutError),
    ):
        if mask is not None:
            only = np.argwhere(mask)
            confidence, _ = space.evidence_at(only)
            only = only[confidence < space.problem.epsilon]
            nonfree[tuple(only.T)] = False
            checks.append((mask, error))
    # Of recent cells, those that the map does not call non-free; all of keep-out areas.
    checks.sort(key=lambda check: check[1] is not KeepOutError)
    return [*checks, (space.blocked & ~space.nonfree, UnknownSpaceError)]


def check_start_is_known(space: MapSpace) -> None:
    """Check that the start, from which no route was found, is not an island in unknown space.

    Unknown cells near the start count as free. If other unknown cells enclose these for a point,
    the start is in unknown space and not enclosed by obstacles.

    Parameters
    ----------
    space : Costmap or Voxels

    Raises
    ------
    UnknownSpaceError
    """
    xy = space.problem.start_xy
    island = connected_to(~space.blocked, space.window.world_to_cell(xy))
    unknown = space.blocked & ~space.nonfree
    ends_in_unknown = (ndimage.binary_dilation(island) & unknown).any()
    if ends_in_unknown and not (island & ~space.cleared).any():
        raise UnknownSpaceError(
            "start",
            xy,
            clearance=space.clearance_of(xy, to=unknown | space.cleared),
            needed=space.radius,
            nearest=nearest_place(space, xy, place="start"),
            way_out=find_way_out(space),
        )


def find_way_out(space: MapSpace) -> WayOut | None:
    """Return where a route could start, if only unknown space near the start prevents one.

    That is so if there is a route once the unknown cells up to that place count as free.
    """
    problem = space.problem
    if not problem.clears_its_start or problem.unknown != "avoid":
        return None
    xy = problem.start_xy
    place = nearest_place(space, xy, place="start")
    if place is None or math.dist(xy, place) > FARTHEST_OUT:
        return None
    needed = math.dist(xy, place) + space.radius + space.window.resolution
    radius = max(problem.clear_radius, math.ceil(10.0 * needed) / 10.0)
    cleared = space_of(replace(problem, clear_start_radius=radius))
    ends = [
        region_around(cleared, cleared.traversable, end, radius=space.radius)
        for end in (xy, problem.goal_xy)
    ]
    if not (ends[0] & ends[1]).any():
        return None
    return WayOut(place, math.dist(xy, place), radius)


def nearest_place(
    space: MapSpace, xy: Point, *, place: Place, yaw: float | None = None
) -> Point | None:
    """Return the cell centre nearest to a place where the footprint fits, or None [m, map].

    For a start, only centres from which the goal can be reached are considered, and vice versa. If
    the other end is linked to no cell, only the largest connected region of the map is considered.
    A problem whose start and goal are both replaced by their nearest positions has a route.

    Parameters
    ----------
    space : Costmap or Voxels
    xy : tuple of float [m, map]
    place : {"start", "goal"}
        The end of the problem at the place.
    yaw : float, optional [rad]
        Heading at which the outline has to fit; default: the disc around it has to fit. For an
        outline, regions are those that base_link alone can move in.
    """
    problem = space.problem
    free = space.traversable if yaw is None else ~space.blocked
    other = problem.goal_xy if place == "start" else problem.start_xy
    radius = space.radius if yaw is None else 0.0
    region = region_around(space, free, other, radius=radius, or_largest=True)
    if yaw is None:
        nearest, distance = nearest_cells(space.window, region, xy)
        return tuple(nearest.tolist()) if distance < math.inf else None
    centres: Floats = space.window.cell_to_world(np.argwhere(region))
    away = np.hypot.reduce(centres - xy, axis=1)
    for index in np.argsort(away, kind="stable"):
        centre: Point = tuple(centres[index].tolist())
        if _fits(space, space.blocked, centre, yaw):
            return centre
    return None


def region_around(
    space: MapSpace, free: Bools, xy: Point, *, radius: float, or_largest: bool = False
) -> Bools:
    """Return the cells that are connected to a place.

    Moves pass through the sides of cells, as a diagonal move requires all cells that it spans.

    Parameters
    ----------
    space : Costmap or Voxels
    free : ndarray of bool, shape as `space.blocked`
        Cells that may be visited.
    xy : tuple of float [m, map]
    radius : float [m]
        Clearance on the way to the cells around the place.
    or_largest : bool, default False
        Whether to return the largest region if the place is connected to no cell.
    """
    cells = links(space, xy, radius=radius).cells
    if or_largest and not free[tuple(cells.T)].any():
        return largest_region(free)
    return connected_to(free, cells)


def _check_in_window(space: MapSpace, place: Place, xy: Point) -> None:
    """Check that a place is on the part of the map that is planned on."""
    window = space.window
    if not window.contains(window.world_to_cell(xy))[0]:
        raise ProblemError(
            place,
            "a place on the part of the map that is planned on, as the map has too many cells",
            format_point(xy),
            hint="Plan on the parts of the map separately.",
        )


def _place_and_yaw(space: MapSpace, pose: Pose, *, headings: bool) -> tuple[Point, float | None]:
    ndim = space.blocked.ndim
    turned = headings and not space.problem.shape.is_disc and len(pose) > ndim
    return pose[:ndim], pose[ndim] if turned else None


def _fits(space: MapSpace, blocked: Bools, xy: Point, yaw: float | None) -> bool:
    polygon = space.problem.shape.polygon
    position = space.to_cells(xy)[0]
    if yaw is None or polygon is None:
        cell = tuple(np.floor(position).astype(np.int64)[::-1])
        least = space.radius - slack_at(xy)
        return not blocked[cell] and space.clearance_of(xy, to=blocked, limit=space.radius) >= least
    x, y = position.tolist()
    size = space.window.resolution
    touch = slack_at(xy) / size
    return bool(pose_clear(blocked, polygon / size, x, y, math.cos(yaw), math.sin(yaw), touch))


def space_of(problem: PlanningProblem) -> Costmap | Voxels:
    """Return the costmap of a problem, or the voxels on a 3-D map."""
    return SPACES[problem.grid.ndim].of(problem)


def _touches_tile(problem: PlanningProblem, xy: Point, margin: float) -> bool:
    """Whether an observed tile comes within a margin [m] of a place, up to rounding."""
    grid = problem.grid
    side = grid.tile_shape[0] * grid.resolution
    position = ((np.array(xy) - grid.origin) / side)[::-1]
    reach = (margin + rounding_at(xy)) / side
    ranges = [
        range(math.ceil(at - reach) - 1, math.floor(at + reach) + 1) for at in position.tolist()
    ]
    indices: Iterable[tuple[int, ...]] = (index for index, _ in grid.tiles())
    if math.prod(each.stop - each.start for each in ranges) <= MOST_LOOKUPS:
        indices = product(*ranges)
    for index in indices:
        first = np.array(index)
        away = np.maximum(np.maximum(first - position, position - first - 1), 0.0)
        if math.hypot(*away) <= reach and grid.has_tile(index):
            return True
    return False
