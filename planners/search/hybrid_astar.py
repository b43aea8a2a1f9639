"""Hybrid A*: routes of bounded curvature, for a footprint that turns with the robot."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from groundmap.arrays import Floats, Ints
from planners.costmap.costmap import Costmap
from planners.costmap.swept_footprint import ground_of, shape_of
from planners.error_messages import Place
from planners.errors import ProblemError
from planners.geometry.kernels.curves import wrap
from planners.geometry.kernels.swept_footprint import step_clear
from planners.problem.problem import Pose
from planners.search.base import Clock, SearchResult, SearchSettings
from planners.search.grid_search import enlarge
from planners.search.hybrid_arrays import empty_nodes, factors_of, field_of, no_shot
from planners.search.kernels.astar import EXHAUSTED, EXPANDED, FOUND, HEAP_FULL, TARGET
from planners.search.kernels.hybrid_astar import (
    COUNT,
    STATE_SIZE,
    Nodes,
    Shot,
    advance,
    begin,
    drive_along,
    rebuild_table,
)
from planners.search.kernels.hybrid_field import seed_field
from planners.search.kernels.hybrid_motion import ROOT, Drive, Prices, pieces, reach, steering

SOON = 0.02  # [s] between two checks of the clock, about: expansions take 1 us to some ms


class HybridAStarSettings(SearchSettings):
    """Settings of hybrid A*."""

    turning_radius: float = Field(
        1.0, ge=0.01, le=1000, description="least turning radius of base_link [m]"
    )
    motion: Literal["dubins", "reeds_shepp"] = Field(
        "reeds_shepp", description="forward only (dubins), or forward and backward (reeds_shepp)"
    )
    reverse_penalty: float = Field(
        2.0, ge=1, le=100, description="factor on lengths that are driven backward"
    )
    gear_change_penalty: float = Field(
        0.5,
        ge=0,
        le=1000,
        description="cost of a change between forward and backward [m]",
    )
    steering_penalty: float = Field(
        0.1,
        ge=0,
        le=1000,
        description="cost of turning the steering from stop to stop [m]",
    )
    heading_bins: int = Field(
        72, ge=8, le=720, description="resolution of headings [bins per turn]"
    )
    step_length: float | None = Field(
        None,
        gt=0,
        le=100,
        description="length of a motion [m]; none: the diagonal of a cell, which is the least",
    )
    analytic_ratio: float = Field(
        3.5,
        gt=0,
        le=1000,
        description="how often the curve to the goal is tried: the higher, the more often",
    )
    weight: float = Field(
        1.5,
        ge=1,
        le=10,
        description="factor on the estimate of the remaining cost",
    )


class HybridAStar:
    """Hybrid A* over motions of constant curvature (Dolgov, Thrun, Montemerlo, Diebel 2010).

    Waypoints are poses, at most half a cell apart; the first and the last are exactly start and
    goal. The robot drives along its heading, forward or backward, and keeps the turning radius.
    Routes are not guaranteed to be optimal, as one pose represents all in its cell and heading bin.

    Between two poses, the swept area is approximated by the convex hull of both placements of the
    footprint (of each triangle of its constrained Delaunay triangulation, if it is concave). If
    the robot turns, the hull is grown by about a millimetre (by a thousandth of a cell on cells of
    more than a metre: `BULGE` in `planners.costmap.swept_footprint`), which covers all points of
    the footprint. A disc is checked by its centre line's distance. Without a turn, both are exact.

    Parameters
    ----------
    costmap : Costmap

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> car = [(-0.5, -0.4), (1.5, -0.4), (1.5, 0.4), (-0.5, 0.4)]
    >>> problem = PlanningProblem(grid, start=(5, 5, 0), goal=(9, 9, np.pi / 2), footprint=car)
    >>> engine = HybridAStar(Costmap.of(problem))
    >>> result = engine.search(problem.start, problem.goal, HybridAStarSettings(turning_radius=4))
    >>> result.waypoints[[0, -1]].tolist(), result.headings[[0, -1]].tolist(), result.expanded
    ([[5.0, 5.0], [9.0, 9.0]], [0.0, 1.5707963267948966], 1)
    """

    name: ClassVar[str] = "hybrid_astar"
    slice_size: ClassVar[int] = 1000  #: expansions between two checks of the clock, at most
    first_room: ClassVar[int] = 1 << 12  #: nodes to begin with

    def __init__(self, costmap: Costmap) -> None:
        self.costmap = costmap
        size = costmap.window.resolution
        footprint = costmap.problem.shape
        self.ground = ground_of(costmap)
        self.shape = shape_of(footprint, size, slack=costmap.slack)
        self.field = field_of(costmap, footprint)
        self.prices = Prices(costmap.costs, factors_of(costmap))
        self.nodes = empty_nodes(self.first_room)
        self.heap = np.empty((2 * self.first_room, 2), dtype=np.int64)
        # The heap is empty, so this only compiles the kernels, before any clock runs.
        drive, shot = _drive(HybridAStarSettings(), size), no_shot()
        self._advance(drive, np.zeros(3), np.zeros(STATE_SIZE, dtype=np.int64), shot, 1)

    def search(self, start: Pose, goal: Pose, settings: HybridAStarSettings) -> SearchResult | None:
        """Return a route from start to goal, or None if there is none.

        There is none if the footprint overlaps blocked cells at the start or at the goal.

        Parameters
        ----------
        start, goal : tuple of float [m, map; rad]
            x, y and yaw.
        settings : HybridAStarSettings

        Raises
        ------
        ProblemError
            The start or the goal has no yaw.
        TimeLimitError
            The time limit is exceeded; with a limit of 0, always.
        """
        clock = Clock(self.name, settings.time_limit)
        clock.check(0)
        a, b = self._in_cells("start", start), self._in_cells("goal", goal)
        if not (self._is_clear(a) and self._is_clear(b)):
            return None
        drive = _drive(settings, self.costmap.window.resolution)
        seed_field(self.field, int(b[1]) * self.costmap.width + int(b[0]))
        state = begin(self.ground, self.field, drive, a, b, self.nodes, self.heap)
        shot = no_shot()
        status, budget = -1, 1
        while status not in (FOUND, EXHAUSTED):
            clock.check(int(state[EXPANDED]))
            before = clock.seconds
            status = self._advance(drive, b, state, shot, budget)
            slow = clock.seconds - before > SOON
            budget = max(budget // 4, 1) if slow else min(2 * budget, self.slice_size)
        if status == EXHAUSTED:
            return None
        curvatures, lengths = self._motions(drive, int(state[TARGET]), shot)
        poses = drive_along(self.shape, a, curvatures, lengths)
        return self._to_result(poses, start, goal, int(state[EXPANDED]))

    def _in_cells(self, place: Place, pose: Pose) -> Floats:
        """Return a pose, shape (3,) [cells; rad]."""
        if len(pose) != 3:
            raise ProblemError(place, f"x, y [m] and yaw [rad] for {self.name}", str(pose))
        x, y = self.costmap.to_cells(pose[:2])[0]
        return np.array([x, y, wrap(pose[2])])

    def _is_clear(self, pose: Floats) -> bool:
        rows, cols = self.ground.blocked.shape
        within = 0 <= pose[0] < cols and 0 <= pose[1] < rows
        x, y, yaw = pose.tolist()
        return within and bool(step_clear(self.ground, self.shape, x, y, yaw, x, y, yaw, 0.0))

    def _advance(self, drive: Drive, goal: Floats, state: Ints, shot: Shot, budget: int) -> int:
        status: int = advance(
            self.ground,
            self.shape,
            self.field,
            self.prices,
            drive,
            goal,
            self.nodes,
            self.heap,
            state,
            shot,
            budget,
        )
        if status == HEAP_FULL:
            self.heap = enlarge(self.heap, by=len(self.heap))
            smaller, count = self.nodes, int(state[COUNT])
            self.nodes = empty_nodes(2 * len(smaller.costs))
            for name in Nodes._fields[:-1]:
                getattr(self.nodes, name)[:count] = getattr(smaller, name)[:count]
            rebuild_table(self.nodes, count)
        return status

    def _motions(self, drive: Drive, node: int, shot: Shot) -> tuple[Floats, Floats]:
        """Return curvatures and lengths of the motions to a node and of the curve after it."""
        motions = []
        while self.nodes.motions[node] != ROOT:
            gear, turn = steering(self.nodes.motions[node])
            motions.append((turn * drive.curvature, gear * reach(drive, turn)))
            node = self.nodes.parents[node]
        motions.reverse()
        for turn, arc in zip(shot.turns.tolist(), shot.lengths.tolist(), strict=True):
            length = arc / drive.curvature
            if arc != 0.0:
                count = pieces(drive, length)
                motions += [(turn * drive.curvature, length / count)] * count
        curvatures, lengths = np.array(motions, dtype=np.float64).reshape(-1, 2).T
        return curvatures.copy(), lengths.copy()

    def _to_result(self, poses: Floats, start: Pose, goal: Pose, expanded: int) -> SearchResult:
        """Return poses [cells] as a route on the map that begins and ends exactly as requested."""
        if len(poses) == 1:
            poses = np.concatenate([poses, poses])
        window = self.costmap.window
        waypoints = window.origin + poses[:, :2] * window.resolution
        headings = np.remainder(poses[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        for i, (x, y, yaw) in ((0, start), (-1, goal)):
            waypoints[i], headings[i] = (x, y), yaw
        cost = None if self.costmap.uniform else self._cost(poses)
        return SearchResult(waypoints, expanded, headings, bound=None, cost=cost)

    def _cost(self, poses: Floats) -> float:
        """Return the length of a line weighted by the costs of its cells, without penalties [m]."""
        steps = np.diff(poses[:, :2], axis=0)
        middle = poses[:-1, :2] + 0.5 * steps
        costs = self.costmap.costs[tuple(np.floor(middle[:, ::-1]).astype(np.int64).T)]
        lengths = np.hypot(*steps.T) * self.costmap.window.resolution
        return float(lengths @ self.prices.factors[costs])


def _drive(settings: HybridAStarSettings, size: float) -> Drive:
    """Return the settings in units of cells of side `size` [m]."""
    step = math.sqrt(2.0)
    if settings.step_length is not None:
        step = max(settings.step_length / size, step)
    return Drive(
        step=step,
        arc=min(step, math.pi * settings.turning_radius / size),
        curvature=size / settings.turning_radius,
        gears=1 if settings.motion == "dubins" else 2,
        reverse=settings.reverse_penalty,
        cusp=settings.gear_change_penalty / size,
        steer=settings.steering_penalty / size,
        bins=settings.heading_bins,
        ratio=settings.analytic_ratio,
        weight=settings.weight,
    )
