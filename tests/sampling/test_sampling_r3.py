"""Sampling planners on 3-D maps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import free_field, grid_of
from planners import EnclosedError, PlanningProblem, ProblemError, plan
from planners.sampling.ompl_module import samplers
from planners.sampling.ompl_search import THREADED
from planners.sampling.settings import refusal

NAMES = sorted(name for name in samplers() if refusal(name, "r3") is None)
COUNTED = [name for name in NAMES if name not in THREADED]
STARS = ("bitstar", "informedrrtstar", "rrtstar", "sorrtstar")
needs_ompl = pytest.mark.skipif(not NAMES, reason="ompl is not installed")


def rooms(*, holes: bool = True) -> ConfidenceGrid:
    """Return three rooms of 4 m, in voxels of 0.25 m, with holes of 2.5 m."""
    z = np.full((16, 16, 48), -1.0, dtype=np.float32)
    for wall, row, layer in ((16, 1, 6), (32, 6, 0)):
        z[:, :, wall] = 1.0
        if holes:
            z[layer : layer + 10, row : row + 10, wall] = -1.0
    grid = ConfidenceGrid(resolution=0.25, origin=(0.0, 0.0, 0.0))
    grid.fuse(np.zeros(3, dtype=np.int64), z)
    return grid


def problem(grid: ConfidenceGrid, **values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {
        "start": (1.0, 3.0, 1.0),
        "goal": (11.0, 1.0, 3.0, 0.5),
        "footprint": 0.4,
        "clear_start": False,
    }
    return PlanningProblem(grid, **(asked | values))


def short_run(name: str, **settings: Any) -> dict[str, Any]:
    if name in THREADED:
        return settings | {"improve_for": 0.1}
    return settings | {"iterations": 2000 if name in STARS else 100_000}


@pytest.mark.parametrize("name", NAMES)
def test_every_planner_finds_a_route_through_holes_in_walls(name: str) -> None:
    route = plan(problem(rooms()), name, **short_run(name))
    assert (route.audit, route.planner, route.bound) == ("clean", name, None)
    assert route.waypoints[[0, -1]].tolist() == [[1.0, 3.0, 1.0], [11.0, 1.0, 3.0]]
    assert route.headings[-1] == 0.5
    assert 10.4 < route.length < 40.0
    assert route.min_clearance >= 0.4 - 1e-9


@pytest.mark.parametrize("name", COUNTED)
def test_equal_seeds_repeat_the_route_and_other_seeds_do_not(name: str) -> None:
    first, again, other = (
        plan(problem(rooms()), name, **short_run(name, seed=s)) for s in (3, 3, 4)
    )
    np.testing.assert_array_equal(again.waypoints, first.waypoints)
    assert again.expanded == first.expanded
    assert other.expanded != first.expanded


@needs_ompl
def test_walls_without_holes_enclose_without_a_search() -> None:
    with pytest.raises(EnclosedError, match="enclosed"):
        plan(problem(rooms(holes=False)), "rrtconnect", time_limit=None)


@pytest.mark.parametrize("space", ["r2", "se2", "dubins", "reeds_shepp"])
@needs_ompl
def test_2d_spaces_are_rejected_on_3d_maps(space: str) -> None:
    with pytest.raises(ProblemError, match=rf"space: expected 'r3', on a 3-D map, got '{space}'"):
        plan(problem(rooms()), "rrtconnect", space=space)
    assert plan(problem(rooms()), "rrtconnect", space="r3", iterations=100_000).audit == "clean"


@needs_ompl
def test_r3_is_rejected_on_2d_maps() -> None:
    flat = PlanningProblem(grid_of(free_field(16, 16)), start=(2, 2), goal=(9, 9), footprint=0.5)
    with pytest.raises(ProblemError, match=r"space: expected .* on a 2-D map, got 'r3'"):
        plan(flat, "rrtconnect", space="r3")
