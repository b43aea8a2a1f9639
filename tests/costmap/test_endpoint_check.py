"""Why a place is refused, and where to go instead."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, UNSEEN, free_field, grid_of
from planners import (
    EnclosedError,
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    PlanningProblem,
    UnknownSpaceError,
    plan,
)
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_on_map
from planners.costmap.endpoints import ends_of
from strategies import rngs


def problem(grid: ConfidenceGrid, **values: Any) -> PlanningProblem:
    return PlanningProblem(grid, **({"footprint": 1.2} | values))


def pocketed() -> ConfidenceGrid:
    """Return a map of a free room, walled in, with a pillar in it, in a large free space."""
    z = free_field(64, 64)
    z[10:31, 10] = z[10:31, 30] = z[10, 10:31] = z[30, 10:31] = BLOCKED
    z[18:23, 18:23] = BLOCKED
    return grid_of(z)


def test_a_start_on_an_island_in_unknown_space_is_unknown() -> None:
    z = free_field(64, 64)
    z[10:40, 10:40] = UNSEEN
    with pytest.raises(UnknownSpaceError, match=r"start .* begins 0.00 m away") as caught:
        plan(problem(grid_of(z), start=(25.5, 25.5), goal=(55.5, 55.5)))
    nearest = caught.value.nearest
    assert nearest is not None
    assert plan(problem(grid_of(z), start=nearest, goal=(55.5, 55.5))).audit == "clean"


def test_a_start_on_an_island_in_unknown_space_is_unknown_in_3d() -> None:
    z = np.full((32, 16, 16), -1.0, dtype=np.float32)
    z[1:20] = UNSEEN
    grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    grid.fuse(np.array([0, 0, 0]), z)
    with pytest.raises(UnknownSpaceError, match="start"):
        plan(problem(grid, start=(8, 8, 8), goal=(8, 8, 28)))


def test_a_start_that_gets_off_the_unknown_cells_is_fenced_in() -> None:
    z = free_field(64, 64)
    z[:, 30] = BLOCKED
    z[20:25, 10:15] = UNSEEN
    with pytest.raises(EnclosedError, match="the start is enclosed"):
        plan(problem(grid_of(z), start=(12.5, 22.5), goal=(55.5, 30.5)))


def test_a_start_among_nonfree_cells_is_fenced_in_though_it_is_unknown() -> None:
    z = free_field(64, 64)
    z[20:27, 20:27] = BLOCKED
    z[22:25, 22:25] = UNSEEN
    with pytest.raises(EnclosedError, match="the start is enclosed"):
        plan(problem(grid_of(z), start=(23.5, 23.5), goal=(55.5, 30.5), footprint=1.0))


def test_the_nearest_place_is_one_that_the_other_end_can_be_reached_from() -> None:
    # The nearest free place to the pillar's middle is in the inaccessible room.
    with pytest.raises(NonFreeError, match="goal") as caught:
        plan(problem(pocketed(), start=(50, 50), goal=(20.5, 22.5)))
    assert caught.value.nearest is not None
    assert plan(problem(pocketed(), start=(50, 50), goal=caught.value.nearest)).audit == "clean"
    with pytest.raises(NonFreeError, match="goal") as caught:
        plan(problem(pocketed(), start=(14, 14), goal=(20.5, 22.5)))
    assert caught.value.nearest == (20.5, 24.5)


def test_a_place_off_the_map_is_led_to_one_from_which_the_goal_is_reached() -> None:
    z = free_field(64, 64)
    z[:, 4] = BLOCKED
    with pytest.raises(OutsideMapError, match="start") as caught:
        plan(problem(grid_of(z), start=(-9, 20), goal=(50, 20), clear_start=False))
    assert caught.value.nearest == (6.5, 19.5)


def refusal(asked: PlanningProblem) -> NoRouteError | None:
    """Return why there is no route; None if there is one."""
    try:
        plan(asked)
    except NoRouteError as error:
        return error
    return None


@given(rng=rngs())
@settings(max_examples=40)
def test_a_problem_moved_to_the_nearest_places_has_a_route(rng: np.random.Generator) -> None:
    z = np.where(rng.random((20, 20)) < rng.choice([0.2, 0.4]), BLOCKED, free_field(20, 20))
    start, goal = (tuple(place) for place in (rng.random((2, 2)) * 20.0).tolist())
    radius = float(rng.choice([0.0, 0.4, 0.5, 0.8]))
    asked = problem(grid_of(z), start=start, goal=goal, footprint=radius)
    moved = set()
    while isinstance(error := refusal(asked), NonFreeError | UnknownSpaceError):
        assert error.place not in moved  # a nearest place is a place
        if error.nearest is None:
            return
        moved.add(error.place)
        nearest: Any = {error.place: error.nearest}
        asked = replace(asked, **nearest)
    assert error is None or len(moved) < 2
    if error is not None and moved:  # the other end fits, but joins no cell
        ends = ends_of(Costmap.of(asked), asked.start_xy, asked.goal_xy)
        assert len(ends.sources) == len(ends.targets) == 0


def test_a_goal_on_the_border_of_a_tile_is_on_the_map() -> None:
    for at in (0.0, 448_000.1, 5_412_000.3):
        grid = grid_of(free_field(64, 64), resolution=0.1, origin=(at, at))
        for x in (at, at + 6.4):
            check_on_map(problem(grid, start=(at + 3.0, at + 3.0), goal=(x, at + 3.0)))


def test_a_start_far_from_the_tiles_touches_them_with_a_large_footprint() -> None:
    grid = grid_of(free_field(64, 64), resolution=0.1)
    for x, fits in ((-49.9, True), (-50.1, False)):
        asked = problem(grid, start=(x, 3.0), goal=(3.0, 3.0), footprint=50.0)
        if fits:
            check_on_map(asked)
        else:
            with pytest.raises(OutsideMapError, match="start"):
                check_on_map(asked)
