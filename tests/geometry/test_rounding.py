"""Rounding: what fits at the origin fits far from it, and the audit agrees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from groundmap.arrays import Floats
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, free_field, grid_of
from planners import (
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    PlanningProblem,
    Route,
    UnknownSpaceError,
    plan,
    shortcut,
)
from planners.audit.obstacles import TOLERANCE
from planners.geometry.rounding import rounding_at, slack_at

PLACES = {"UTM": (448_000.0, 5_412_000.0, 300.0), "far": (1e8, -1e8, 1e8)}  # [m, map]
SIDE = 20  # [cells]
RESOLUTIONS = [0.05, 0.1, 0.1524, 0.25, 1.0, 7.3]
REFUSALS = (NonFreeError, OutsideMapError, UnknownSpaceError)
RADII = [0.5, 0.75, 1.0, 1.3]  # [cells]


@pytest.mark.parametrize("scale", [0.0, 1.0, 1e3, 5.4e6, 1e8])
def test_the_slack_is_below_the_tolerance_of_the_audit(scale: float) -> None:
    step = float(np.spacing(scale))
    assert slack_at((0.0, scale)) < TOLERANCE + 4.0 * step
    assert rounding_at((-scale, 0.0)) == rounding_at((0.0, 0.0), (scale, scale)) == 2.0 * step


def walls(rng: np.random.Generator) -> Any:
    z = free_field(SIDE, SIDE)
    for _ in range(int(rng.integers(1, 5))):
        i, j = rng.integers(0, SIDE, 2)
        piece = slice(max(0, j - 6), j + 6)
        z[(i, piece) if rng.random() < 0.5 else (piece, i)] = BLOCKED
    return z


def faces_ahead(free: Any, cell: Any) -> list[int]:
    """Return where the free cells beyond a cell end along each axis, x first."""
    ends = []
    for axis in range(free.ndim)[::-1]:
        line = free[(*cell[:axis], slice(None), *cell[axis + 1 :])]
        beyond = np.flatnonzero(~line[cell[axis] :])
        ends.append(int(cell[axis] + beyond[0]) if len(beyond) else len(line))
    return ends


def touching(rng: np.random.Generator, z: Any, radius: float, size: float, at: Floats) -> Floats:
    """Return a place [m, map] that is exactly the radius away from the next face along x or y."""
    cell = np.argwhere(z < 0)[rng.integers((z < 0).sum())]
    place = at + (cell[::-1] + rng.random(z.ndim)) * size
    faces = at + np.array(faces_ahead(z < 0, cell)) * size - radius
    exact = rng.random(z.ndim) < 0.5
    exact[0] = True
    return np.where(exact, faces, place)


def tight_problem(seed: int, at: tuple[float, ...], *, outline: bool = False) -> PlanningProblem:
    rng = np.random.default_rng(seed)
    size = float(rng.choice(RESOLUTIONS))
    if len(at) == 3:
        z: Any = np.full((10, 10, 10), -1.0, dtype=np.float32)
        z[:7, 5] = BLOCKED
        grid = ConfidenceGrid(resolution=size, origin=at)
        grid.fuse(np.zeros(3, dtype=np.int64), z)
    else:
        z = walls(rng)
        grid = grid_of(z, resolution=size, origin=(at[0], at[1]))
    # In 3-D, no radius leads to the border of a voxel: which of two it is in, the last bit says.
    radius = float(rng.choice(RADII if len(at) == 2 else [0.5, 0.8, 1.3])) * size
    start, goal = (touching(rng, z, radius, size, np.array(at)) for _ in range(2))
    footprint: Any = radius
    if outline:
        footprint = [(-radius, -radius), (radius, -radius), (radius, radius), (-radius, radius)]
        start, goal = np.append(start, 0.0), np.append(goal, 0.0)
    return PlanningProblem(grid, start=start, goal=goal, footprint=footprint)


def answer(problem: PlanningProblem, planner: str, **settings: Any) -> Route | NoRouteError:
    try:
        return plan(problem, planner, **settings)
    except NoRouteError as error:
        return error


def agree(a: Route | NoRouteError, b: Route | NoRouteError, *, cost: bool = True) -> bool:
    if isinstance(a, Route) and isinstance(b, Route):
        return not cost or b.cost == pytest.approx(a.cost, rel=1e-6)
    return type(a) is type(b)


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("planner", ["astar", "jps", "theta", "polyanya", "ara", "dstar_lite"])
def test_exact_fits_are_answered_alike_far_from_the_origin(planner: str, where: str) -> None:
    routes = 0
    for seed in range(25):
        near = answer(tight_problem(seed, (0.0, 0.0)), planner)
        far_problem = tight_problem(seed, PLACES[where][:2])
        far = answer(far_problem, planner)
        assert agree(near, far), seed
        if isinstance(far, Route):
            assert shortcut(far_problem, far).audit == "clean"
            routes += 1
    assert routes > 10


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize(("planner", "outline"), [("hybrid_astar", True), ("rrtconnect", False)])
def test_planners_of_curves_and_samples_accept_the_same_exact_fits(
    planner: str, outline: bool, where: str
) -> None:
    settings: dict[str, Any] = {} if outline else {"space": "r2", "iterations": 400}
    for seed in range(12):
        near = answer(tight_problem(seed, (0.0, 0.0), outline=outline), planner, **settings)
        far = answer(tight_problem(seed, PLACES[where][:2], outline=outline), planner, **settings)
        # Whether they find a way within their bins and samples may depend on the last bit.
        assert isinstance(near, REFUSALS) == isinstance(far, REFUSALS), seed


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("planner", ["astar", "rrtconnect"])
def test_exact_fits_in_space_are_answered_alike(planner: str, where: str) -> None:
    settings: dict[str, Any] = {} if planner == "astar" else {"iterations": 400}
    for seed in range(12):
        near = answer(tight_problem(seed, (0.0, 0.0, 0.0)), planner, **settings)
        far = answer(tight_problem(seed, PLACES[where]), planner, **settings)
        assert agree(near, far, cost=planner == "astar"), seed


@pytest.mark.parametrize("overlap", [2e-9, 1e-7])
def test_an_overlap_of_large_cells_is_measured_in_metres(overlap: float) -> None:
    # In cells of 100 m, 1e-7 m is 1e-9 of a cell: more than the audit tolerates.
    z = free_field(12, 12)
    z[:, 8] = BLOCKED
    car = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)]
    asked: dict[str, Any] = {"start": (300.0, 500.0, 0.0), "goal": (750.0 + overlap, 500.0, 0.0)}
    problem = PlanningProblem(grid_of(z, resolution=100.0), footprint=car, **asked)
    with pytest.raises(NoRouteError, match=r"goal .*overlaps non-free space"):
        plan(problem, "hybrid_astar")
