"""`plan`: every failure has its exception, and the exception its facts and its sentence."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools
from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of, masks
from planners import (
    PLANNERS,
    EnclosedError,
    NonFreeError,
    NoRouteError,
    OutsideMapError,
    PlanningError,
    PlanningProblem,
    ProblemError,
    UnknownSpaceError,
    plan,
)
from planners.costmap.costmap import Costmap
from planners.search.widest_path import widest_path

FIELD = grid_of(free_field(64, 64))


def problem(grid: ConfidenceGrid = FIELD, **values: Any) -> PlanningProblem:
    asked: dict[str, Any] = {"start": (9, 9), "goal": (50, 50), "footprint": 1}
    return PlanningProblem(grid, **(asked | values))


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"start": (0, math.nan)}, r"start: expected x, y \[m\] .*, got \(0, nan\)"),
        ({"goal": (math.inf, 0)}, r"goal: expected .* all finite, got \(inf, 0\)"),
        ({"goal": (1,)}, r"goal: expected x, y \[m\] and optionally yaw"),
        ({"goal": (1, 2, 3, 4)}, r"goal: expected x, y \[m\] and optionally yaw"),
        ({"goal": "ab"}, r"goal: expected .*, got 'ab'"),
        ({"goal": 3}, r"goal: expected .*, got 3"),
        ({"footprint": -0.1}, "footprint: expected a radius of 0 or more .*, got -0.1"),
        ({"footprint": math.nan}, "footprint: expected a radius of 0 or more .*, got nan"),
        ({"footprint": "wide"}, "footprint: expected a radius .*, got 'wide'"),
        (
            {"footprint": [(0, 0), (1, 1), (1, 0), (0, 1)]},
            r"footprint: .* a self-intersection at \(0.5",
        ),
        ({"costs": {"clearance_weight": 1}}, "costs: expected CostSettings, got {'clear"),
        ({"clear_start_radius": -1}, "clear_start_radius: expected a radius from 0 to"),
        ({"unknown": "perhaps"}, "unknown: expected 'avoid', 'allow' or 'penalise', got 'perhaps'"),
        ({"epsilon": 0}, "epsilon: expected a number between 0 and 1, got 0"),
        (
            {"grid": ConfidenceGrid(origin=(0, 0, 0))},
            r"start: expected x, y, z \[m\] and optionally yaw \[rad\], all finite, got \(9, 9\)",
        ),
        ({"grid": "map.npz"}, "grid: expected a ConfidenceGrid, got 'map.npz'"),
    ],
)
def test_an_invalid_problem_is_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ProblemError, match=sentence):
        problem(**values)


def test_an_unknown_planner_is_refused_with_the_available_names() -> None:
    with pytest.raises(ProblemError, match=r"planner: expected one of .*ara, .*, got 'astral'"):
        plan(problem(), "astral")
    assert "astar" in PLANNERS


@pytest.mark.parametrize("place", ["start", "goal"])
@pytest.mark.parametrize("xy", [(1000, 0), (-5, 5), (64.5, -70)])
def test_places_beyond_the_observed_tiles_are_outside(place: str, xy: tuple[float, float]) -> None:
    where = rf"{place} \({xy[0]:.2f}, {xy[1]:.2f}\)"
    sentence = rf"{where} is outside the map: expected a point on an observed tile.*0.00 to 64.00"
    asked: dict[str, Any] = {place: xy}
    with pytest.raises(OutsideMapError, match=sentence) as caught:
        plan(problem(**asked))
    assert caught.value.place == place
    assert caught.value.xy == xy


def test_an_empty_map_has_no_inside() -> None:
    with pytest.raises(OutsideMapError, match="the map has none"):
        plan(problem(ConfidenceGrid()))


def test_a_place_between_observed_tiles_is_outside() -> None:
    grid = grid_of(free_field(64, 64))
    grid.fuse(np.array([128, 128]), free_field(64, 64))
    with pytest.raises(OutsideMapError, match=r"goal \(96.00, 96.00\)"):
        plan(problem(grid, goal=(96, 96)))


def test_a_start_off_the_border_by_rounding_is_on_the_map() -> None:
    route = plan(problem(start=(-1e-16, 20.0), goal=(30, 20)))
    assert route.start_unknown_area > 0


@pytest.mark.parametrize("place", ["start", "goal"])
def test_a_footprint_over_nonfree_space_is_named_with_its_clearance(place: str) -> None:
    z = free_field(64, 64)
    z[20, 20] = BLOCKED
    sentence = (
        rf"{place} \(22.50, 20.50\): the footprint \(radius 2.00 m\) overlaps non-free space; "
        r"the clearance there is 1.50 m\."
    )
    with pytest.raises(NonFreeError, match=sentence) as caught:
        plan(problem(grid_of(z), **{place: (22.5, 20.5)}, footprint=2))
    assert (caught.value.clearance, caught.value.needed) == (1.5, 2.0)


def test_a_point_robot_inside_a_nonfree_cell_is_named() -> None:
    z = free_field(64, 64)
    z[20, 20] = BLOCKED
    with pytest.raises(NonFreeError, match=r"clearance there is 0.00 m"):
        plan(problem(grid_of(z), goal=(20.5, 20.5), footprint=0))


@pytest.mark.parametrize("place", ["start", "goal"])
@pytest.mark.parametrize("confidence", [None, 0.005])
def test_a_footprint_over_unknown_or_contested_space_is_named(
    place: str, confidence: float | None
) -> None:
    z = free_field(64, 64)
    z[20, 20] = UNSEEN
    grid = grid_of(z)
    if confidence is not None:
        grid.tile((0, 0)).confidence[20, 20] = confidence
        grid.tile((0, 0)).count[20, 20] = 2
    sentence = rf"{place} \(22.50, 20.50\): .*unknown or contested space, which begins 1.50 m away"
    here = problem(grid, **{place: (22.5, 20.5)}, footprint=2, clear_start=False)
    with pytest.raises(UnknownSpaceError, match=sentence):
        plan(here)
    allowed = problem(grid, **{place: (22.5, 20.5)}, footprint=2, unknown="allow")
    assert plan(allowed).audit == "clean"


@pytest.mark.parametrize(
    ("at_goal", "beside", "error", "sentence"),
    [
        (UNSEEN, BLOCKED, UnknownSpaceError, "overlaps unknown or contested space"),
        (BLOCKED, UNSEEN, NonFreeError, "overlaps non-free space"),
    ],
)
def test_the_state_of_the_place_itself_takes_precedence(
    at_goal: float, beside: float, error: type[NoRouteError], sentence: str
) -> None:
    z = free_field(64, 64)
    z[22, 20], z[20, 20] = at_goal, beside
    with pytest.raises(error, match=sentence):
        plan(problem(grid_of(z), goal=(20.5, 22.5), footprint=2))


def test_nonfree_beside_a_free_place_comes_before_unknown() -> None:
    z = free_field(64, 64)
    z[20, 20], z[24, 20] = BLOCKED, UNSEEN
    with pytest.raises(NonFreeError, match="overlaps non-free space"):
        plan(problem(grid_of(z), goal=(20.5, 22.5), footprint=2))


def pocket(*, gap: int = 0) -> ConfidenceGrid:
    """Return a field with a room of 12 x 10 cells, walls of 2 and a gap in its left wall."""
    z = free_field(64, 64)
    z[28:42, 28:44] = BLOCKED
    z[30:40, 30:42] = FREE
    z[32 : 32 + gap, 28:30] = FREE
    return grid_of(z, resolution=0.5)


def test_an_enclosed_pocket_reports_its_area() -> None:
    sentence = "the goal is enclosed in an area of 30.0 m².*No passage connects start and goal"
    with pytest.raises(EnclosedError, match=sentence) as caught:
        plan(problem(pocket(), start=(2.25, 2.25), goal=(18.25, 17.25), footprint=0.0))
    error = caught.value
    assert (error.place, error.area, error.widest_gap) == ("goal", 30.0, 0.0)
    # The nearest cell outside is below the lower wall, at y = 13.75.
    assert error.distance == pytest.approx(math.dist(error.nearest, (18.25, 17.25)))
    assert error.distance == pytest.approx(3.5)


def test_the_end_with_less_room_is_enclosed() -> None:
    with pytest.raises(EnclosedError, match="the start is enclosed") as caught:
        plan(problem(pocket(), start=(18.25, 17.25), goal=(2.25, 2.25), footprint=0.5))
    assert caught.value.place == "start"
    # Centres at least 0.5 m away from the walls: the room without a rim of one cell.
    assert caught.value.area == pytest.approx(10 * 8 * 0.25)


@pytest.mark.parametrize("gap", [1, 2, 3])
def test_the_widest_path_is_as_wide_as_the_gap(gap: int) -> None:
    sentence = rf"{gap * 0.5:.2f} m wide at \(14.50, 16.\d+\); the footprint needs {gap + 1}"
    with pytest.raises(EnclosedError, match=sentence) as caught:
        plan(into_the_pocket(gap=gap, footprint=(gap + 1) / 2))
    assert caught.value.widest_gap == pytest.approx(gap * 0.5)
    assert caught.value.needed == gap + 1


def test_a_passage_that_misses_the_cell_centres_is_distinguished_from_a_narrow_one() -> None:
    sentence = (
        r"is 1.00 m wide at .*, which is enough .* \(0.90 m\), but it does not follow cell centres"
    )
    with pytest.raises(EnclosedError, match=sentence):
        plan(into_the_pocket(gap=2, footprint=0.45))
    assert plan(into_the_pocket(gap=3, footprint=0.75)).min_clearance == 0.75


def into_the_pocket(*, gap: int, footprint: float) -> PlanningProblem:
    return problem(pocket(gap=gap), start=(4.25, 4.25), goal=(18.25, 17.25), footprint=footprint)


@given(masks(side=6), st.floats(0.05, 1.2), st.data())
@settings(max_examples=60)
def test_no_footprint_wider_than_the_widest_path_gets_through(
    blocked: Bools, radius: float, data: st.DataObject
) -> None:
    wide = np.kron(blocked, np.ones((3, 3))) > 0
    free = np.argwhere(~wide)[:, ::-1]
    assume(len(free) > 0)
    cells = [free[data.draw(st.integers(0, len(free) - 1))] for _ in range(2)]
    start, goal = (cell + data.draw(st.sampled_from([0.25, 0.5, 0.8])) for cell in cells)
    grid = grid_of(np.where(wide, BLOCKED, FREE))
    asked = problem(grid, start=start, goal=goal, footprint=radius, clear_start=False)
    way = widest_path(Costmap.of(asked))
    try:
        route = plan(asked)
    except NoRouteError:
        return
    assert way is not None
    assert way.width >= 2 * radius - 1e-9
    assert way.width >= 2 * route.min_clearance - 1e-9


def test_a_forward_camera_gets_off_its_unknown_start() -> None:
    # A wedge of 60 degrees that opens at the start; all else is unknown.
    rows, cols = np.indices((128, 128))
    wedge = np.abs(rows + 0.5 - 64) < np.tan(np.pi / 6) * (cols + 0.5 - 40)
    grid = grid_of(np.where(wedge, FREE, UNSEEN), resolution=0.15)
    asked = {"start": (6.0, 9.6), "goal": (16.0, 9.6), "footprint": 0.9}
    route = plan(problem(grid, **asked))
    assert route.start_unknown_area > 0.5
    with pytest.raises(UnknownSpaceError, match="start"):
        plan(problem(grid, **asked, clear_start=False))
    with pytest.raises(EnclosedError, match="the start is enclosed"):
        plan(problem(grid, **asked, clear_start_radius=0.9))


def test_every_failure_is_a_planning_error() -> None:
    for error in (ProblemError, NoRouteError):
        assert issubclass(error, PlanningError)
    assert issubclass(ProblemError, ValueError)


CAR = [(-0.5, -0.6), (2.5, -0.6), (2.5, 0.6), (-0.5, 0.6)]


def beside_a_wall(yaw: float, **values: Any) -> PlanningProblem:
    """Return the problem to drive a car along a wall whose face is at y = 10, 0.8 m beside it."""
    z = free_field(64, 64)
    z[:10] = BLOCKED
    asked = {"start": (9.0, 10.8, yaw), "goal": (40.0, 10.8, 0.0), "footprint": CAR}
    return problem(grid_of(z), **(asked | values))


def test_planners_of_headings_check_an_outline_at_its_yaw() -> None:
    route = plan(beside_a_wall(0.0), "hybrid_astar")
    assert route.length == pytest.approx(31.0)
    with pytest.raises(NonFreeError, match=r"start \(9.00, 10.80\): the footprint \(radius 2.57"):
        plan(beside_a_wall(0.0), "astar")


def test_an_outline_that_does_not_fit_at_its_yaw_is_reported_with_the_yaw() -> None:
    sentence = r"start \(9.00, 10.80\): the footprint \(at yaw -1.57 rad\) overlaps non-free"
    with pytest.raises(NonFreeError, match=sentence) as caught:
        plan(beside_a_wall(-np.pi / 2), "hybrid_astar")
    assert caught.value.nearest == (8.5, 12.5)
    assert caught.value.yaw == -np.pi / 2
    moved = beside_a_wall(-np.pi / 2, start=(*caught.value.nearest, -np.pi / 2))
    assert plan(moved, "hybrid_astar").audit == "clean"
