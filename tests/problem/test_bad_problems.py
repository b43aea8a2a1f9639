"""Problems that are odd, degenerate or wrong: every planner answers, or says what is wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from groundmap.arrays import Floats32
from groundmap.errors import SettingsError
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import (
    OWN_PLANNERS,
    CostSettings,
    EnclosedError,
    NonFreeError,
    OutsideMapError,
    PlanningProblem,
    ProblemError,
    TimeLimitError,
    UnknownSpaceError,
    plan,
)

FIELD = grid_of(free_field(64, 64))
ALONG: dict[str, Any] = {"start": (9.5, 9.5, 0), "goal": (50.5, 9.5, 0)}

every_planner = pytest.mark.parametrize("planner", sorted(OWN_PLANNERS))


def problem(grid: ConfidenceGrid = FIELD, **values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {"start": (9, 9, 0), "goal": (50, 50, 0), "footprint": 1.0}
    return PlanningProblem(grid, **(asked | values))


def serpentine(rows: int, cols: int) -> Floats32:
    """Return the evidence of a corridor one cell wide that fills a rectangle, row after row."""
    z = np.full((rows, cols), BLOCKED, dtype=np.float32)
    z[::2] = FREE
    z[1::4, -1] = z[3::4, 0] = FREE
    return z


@every_planner
@pytest.mark.parametrize("shape", [(7, 200), (200, 7)])
def test_maps_need_not_be_square(planner: str, shape: tuple[int, int]) -> None:
    rows, cols = shape
    grid = grid_of(free_field(rows, cols))
    along = math.atan2(rows - 7, cols - 7)
    ends: dict[str, Any] = {"start": (3.5, 3.5, along), "goal": (cols - 3.5, rows - 3.5, along)}
    route = plan(problem(grid, **ends, clear_start=False), planner)
    assert route.audit == "clean"
    assert route.length == pytest.approx(193.0)


@every_planner
def test_an_empty_map_has_no_inside(planner: str) -> None:
    with pytest.raises(
        OutsideMapError, match=r"start \(9.00, 9.00\) is outside the map: .* the map has none"
    ):
        plan(problem(ConfidenceGrid()), planner)


@every_planner
def test_where_all_is_blocked_no_place_is_left(planner: str) -> None:
    grid = grid_of(np.full((64, 64), BLOCKED))
    with pytest.raises(NonFreeError, match=r"clearance there is 0.00 m\.$") as caught:
        plan(problem(grid), planner)
    assert caught.value.nearest is None


@every_planner
def test_where_nothing_is_known_only_leave_to_guess_gives_a_route(planner: str) -> None:
    grid = ConfidenceGrid(resolution=1.0)
    grid.tile((0, 0))
    with pytest.raises(UnknownSpaceError, match=r"start \(9.00, 9.00\): .* unknown or contested"):
        plan(problem(grid, clear_start=False), planner)
    with pytest.raises(UnknownSpaceError, match=r"goal \(50.00, 50.00\): .* Map that area"):
        plan(problem(grid), planner)
    route = plan(problem(grid, **ALONG, unknown="allow"), planner)
    assert route.unknown_length == pytest.approx(route.length)
    assert route.length == pytest.approx(41.0)
    assert route.min_clearance == math.inf


@every_planner
def test_from_a_place_to_itself_the_route_has_no_length(planner: str) -> None:
    route = plan(problem(goal=(9, 9, 0)), planner)
    assert route.length == route.cost == 0.0
    assert route.waypoints[[0, -1]].tolist() == [[9, 9], [9, 9]]
    assert np.isfinite(route.headings).all()


@pytest.mark.parametrize("place", ["start", "goal"])
@pytest.mark.parametrize(
    "pose", [(math.nan, 1), (1, math.nan), (1, -math.inf), (1, 1, math.nan), (None, 1), ((1, 2), 3)]
)
def test_places_are_finite_numbers(place: str, pose: Any) -> None:
    with pytest.raises(ProblemError, match=rf"{place}: expected x, y .* all finite, got \("):
        problem(**{place: pose})


@every_planner
@pytest.mark.parametrize("far", [1e6, 1e300])
def test_places_far_away_are_outside(planner: str, far: float) -> None:
    with pytest.raises(OutsideMapError, match=r"goal \(\d+\.00, \d+\.00\) is outside the map"):
        plan(problem(goal=(far, far, 0)), planner)


@every_planner
def test_a_footprint_larger_than_the_map_fits_nowhere(planner: str) -> None:
    with pytest.raises(UnknownSpaceError, match=r"begins \d+\.\d\d m away\. Map .* allow\)\.$"):
        plan(problem(footprint=100.0, clear_start=False), planner)
    with pytest.raises(
        ProblemError, match=r"footprint: expected at most \d+ cells in the box around the map"
    ):
        plan(problem(footprint=1e6), planner)


@pytest.mark.parametrize(
    ("footprint", "got"),
    [
        ([(0, 0), (1, 1), (1, 0), (0, 1)], r"a self-intersection at \(0\.5, 0\.5\)"),
        ([(0, 0), (1, 0), (math.nan, 1)], "a number that is not finite"),
        ([(0, 0), (1, 0), (2, 0)], "points on one line"),
        ([], "0 different points"),
        (-1.0, r"-1\.0"),
        (math.inf, "inf"),
        (None, r".*"),
    ],
)
def test_invalid_footprints_are_refused(footprint: Any, got: str) -> None:
    with pytest.raises(ProblemError, match=f"footprint: expected a radius of 0 or .*, got {got}"):
        problem(footprint=footprint)


@pytest.mark.parametrize("name", sorted(CostSettings.model_fields))
@pytest.mark.parametrize("value", [-1.0, -1e-9, math.nan, math.inf, "expensive"])
def test_costs_are_numbers_of_zero_or_more(name: str, value: Any) -> None:
    with pytest.raises(SettingsError, match=rf"{name}: expected .*, got {value!r}"):
        CostSettings(**{name: value})


@every_planner
def test_no_time_is_never_enough(planner: str) -> None:
    for goal in ((50, 50, 0), (9, 9, 0), (9.1, 9, 0)):
        with pytest.raises(TimeLimitError, match="no route within time_limit = 0 s"):
            plan(problem(goal=goal), planner, time_limit=0)


@every_planner
@pytest.mark.parametrize("limit", [-1.0, math.nan, math.inf, "long"])
def test_a_time_limit_is_a_number_of_zero_or_more(planner: str, limit: Any) -> None:
    with pytest.raises(SettingsError, match=rf"time_limit: expected .*, got {limit!r}"):
        plan(problem(), planner, time_limit=limit)


@every_planner
def test_a_setting_that_does_not_exist_is_refused(planner: str) -> None:
    with pytest.raises(SettingsError, match=r"time_limt: .* Did you mean 'time_limit'\?"):
        plan(problem(), planner, time_limt=3)


@every_planner
def test_a_wall_all_across_encloses(planner: str) -> None:
    z = free_field(64, 64)
    z[30] = BLOCKED
    with pytest.raises(EnclosedError, match=r"enclosed in .* however narrow the footprint\.$"):
        plan(problem(grid_of(z)), planner)


@every_planner
def test_start_and_goal_on_borders_of_cells_are_places_too(planner: str) -> None:
    route = plan(problem(start=(10, 10, 0), goal=(20, 10, 0), footprint=0.0), planner)
    assert 10.0 - 1e-9 <= route.length <= 10.5  # a detour of half a diagonal at either end


@every_planner
def test_coordinates_as_large_as_a_surveyors_cost_no_precision(planner: str) -> None:
    z = free_field(64, 64)
    z[20:40, :30] = z[20:40, 33:] = BLOCKED
    lengths = []
    for origin in ((0.0, 0.0), (500_000.0, 5_400_000.0)):
        grid = grid_of(z, resolution=0.1, origin=origin)
        ends = [
            (x + origin[0], y + origin[1], math.pi / 2) for x, y in ((3.15, 0.55), (3.15, 5.55))
        ]
        asked = problem(grid, start=ends[0], goal=ends[1], footprint=0.1)
        route = plan(asked, planner)
        assert route.min_clearance >= 0.1 - 1e-9
        lengths.append(route.length)
    assert lengths[0] == pytest.approx(lengths[1], abs=1e-6)
    assert lengths[0] == pytest.approx(5.0, abs=1e-6)


@pytest.fixture(scope="module")
def corridor() -> ConfidenceGrid:
    """Return a straight corridor of 64 x 16384 cells, which are a million."""
    return grid_of(free_field(64, 16384))


@every_planner
def test_in_a_corridor_of_a_million_cells_all_planners_end_in_time(
    planner: str, corridor: ConfidenceGrid
) -> None:
    asked = problem(corridor, start=(3.5, 32.5, 0), goal=(16380.5, 32.5, 0))
    # Theta* looks along the whole corridor from each of its cells: it may be stopped.
    time_limit = 1.0 if planner == "theta" else None
    try:
        route = plan(asked, planner, time_limit=time_limit)
    except TimeLimitError:
        assert planner == "theta"
    else:
        assert route.length == pytest.approx(16377.0)


@every_planner
def test_planners_that_turn_on_the_spot_drive_a_winding_corridor_one_cell_wide(
    planner: str,
) -> None:
    grid = grid_of(serpentine(127, 128))
    asked = problem(grid, start=(0.5, 0.5, 0), goal=(0.5, 126.5, 0), footprint=0.3)
    if planner == "hybrid_astar":
        with pytest.raises(EnclosedError, match="found no drivable motion"):
            plan(asked, planner)
    else:
        assert plan(asked, planner).length == pytest.approx(64 * 127 + 63 * 2)


@pytest.mark.parametrize("planner", ["astar", "ara", "dijkstra", "dstar_lite"])
def test_costs_do_not_lengthen_the_route_from_a_place_to_itself(planner: str) -> None:
    expensive = CostSettings(confidence_weight=1.0)
    route = plan(problem(start=(9, 9), goal=(9, 9), costs=expensive), planner)
    assert (route.length, route.cost) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({"start": "12"}, "start"),
        ({"clear_start_radius": "wide"}, "clear_start_radius"),
        ({"epsilon": None}, "epsilon"),
    ],
)
def test_values_that_are_not_numbers_are_refused_by_name(values: dict[str, Any], name: str) -> None:
    with pytest.raises(ProblemError, match=rf"^{name}: expected"):
        problem(**values)


def test_an_outline_without_a_yaw_is_refused() -> None:
    z = np.full((64, 64), BLOCKED)
    z[30:34] = FREE  # wide enough for the outline, not for the disc around it
    car = [(-2.0, -1.0), (6.0, -1.0), (6.0, 1.0), (-2.0, 1.0)]
    asked = problem(grid_of(z), start=(9, 32, 0), goal=(40, 32), footprint=car)
    with pytest.raises(ProblemError, match=r"goal: expected x, y \[m\] and yaw \[rad\]"):
        plan(asked, "hybrid_astar")
