"""Why there is no route: the enclosed end, the nearest reachable cell, the narrow passage."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest
from hypothesis import given, settings

from groundmap.grid.grid import ConfidenceGrid
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import EnclosedError, NonFreeError, PlanningProblem, Route, UnknownSpaceError, plan
from planners.costmap.costmap import Costmap
from planners.no_route import explain_no_route, widest_route
from planners.search.distance_field import reachable
from planners.search.widest_path import WidestRoute
from strategies import rngs

T = TypeVar("T")

UNKNOWN = 0.0  # no evidence
CAR = [(-0.5, -0.4), (1.5, -0.4), (1.5, 0.4), (-0.5, 0.4)]  # 0.8 m wide, 3.10 m at any heading
FACTS: dict[str, Any] = {"area": 3.0, "nearest": (1.0, 2.0), "distance": 1.5}


def halves(*, gap: int) -> ConfidenceGrid:
    """Return a map of 32 m x 32 m, halved by a wall with a gap [cells of 0.5 m]."""
    z = free_field(64, 64)
    z[:, 30:32] = BLOCKED
    z[40 : 40 + gap, 30:32] = FREE
    return grid_of(z, resolution=0.5)


def across(grid: ConfidenceGrid, footprint: Any) -> PlanningProblem:
    return PlanningProblem(grid, start=(6.25, 6.25), goal=(26.25, 6.25), footprint=footprint)


def failure(problem: PlanningProblem) -> EnclosedError:
    with pytest.raises(EnclosedError, match=r"no route: the .* is enclosed") as caught:
        plan(problem)
    return caught.value


def test_a_narrow_gap_is_reported_with_its_place_and_the_required_width() -> None:
    error = failure(across(halves(gap=3), 0.9))
    assert (error.widest_gap, error.needed, error.bottleneck) == (1.5, 1.8, (15.5, 20.75))
    tail = (
        ". The widest passage is about 1.50 m wide at (15.50, 20.75); the footprint needs 1.80 m."
    )
    assert str(error).endswith(tail)


def test_an_outline_needs_the_width_of_its_disc_at_any_heading() -> None:
    error = failure(across(halves(gap=3), CAR))
    assert error.needed == pytest.approx(2 * math.hypot(1.5, 0.4))
    assert error.turning == "any"
    assert str(error).endswith("(15.50, 20.75); the footprint needs 3.10 m to fit at any heading.")


def car(*, width: float, rear: float = -0.5) -> list[tuple[float, float]]:
    half = width / 2.0
    return [(rear, -half), (1.5, -half), (1.5, half), (rear, half)]


def test_planners_of_headings_need_the_width_of_the_inscribed_disc() -> None:
    problem = across(halves(gap=1), car(width=0.9))
    narrow = explain_no_route(Costmap.of(problem), headings=True)
    assert narrow.needed == 0.9
    assert (narrow.widest_gap, narrow.turning) == (0.5, "planned")
    assert str(narrow).endswith(
        "0.50 m wide at (15.50, 20.25); the footprint needs at least 0.90 m."
    )
    for gap, outline in ((3, CAR), (1, car(width=0.5)), (1, car(width=0.8, rear=0.5))):
        wide = explain_no_route(Costmap.of(across(halves(gap=gap), outline)), headings=True)
        assert str(wide) == (
            "no route: a search over one pose per cell and heading found no drivable motion. "
            "Use a smaller turning radius, a smaller footprint, or a map with smaller cells."
        )


def test_a_width_near_the_required_one_is_an_estimate() -> None:
    facts = FACTS | {"widest_gap": 1.0, "slack": 0.1}
    assert "is about 1.00 m wide; the footprint needs 1.05 m." in str(
        EnclosedError("goal", **facts, needed=1.05)
    )
    assert "is 1.00 m wide; the footprint needs 1.15 m." in str(
        EnclosedError("goal", **facts, needed=1.15)
    )


def test_a_slanted_gap_exceeds_its_lattice_width_by_less_than_the_slack() -> None:
    z = free_field(40, 40)
    z[:18, :20] = z[20:, 23:] = BLOCKED  # corners at (20, 18) and (23, 20)
    ends: dict[str, Any] = {"start": (10.5, 30.5), "goal": (30.5, 10.5), "clear_start": False}
    problem = PlanningProblem(grid_of(z), footprint=1.75, **ends)
    true_width = math.hypot(3, 2)
    assert widest_route(problem).width <= true_width <= widest_route(problem).width + 0.7072
    assert "about 3.16 m wide" in str(failure(problem))


def test_a_passage_that_misses_the_cell_centres_is_distinguished_from_one_that_is_too_narrow() -> (
    None
):
    error = failure(across(halves(gap=2), 0.45))
    assert error.widest_gap > error.needed
    sentence = (
        "The widest passage is 1.00 m wide at (15.50, 20.50), which is enough for the footprint "
        "(0.90 m), but it does not follow cell centres. Use a map with smaller cells, or plan with "
        "'hybrid_astar'."
    )
    assert str(error).endswith(sentence)


def test_without_a_passage_there_is_no_bottleneck() -> None:
    error = failure(across(halves(gap=0), 0.9))
    assert (error.widest_gap, error.bottleneck) == (0.0, None)
    assert str(error).endswith("No passage connects start and goal, however narrow the footprint.")


@given(rngs())
@settings(max_examples=25, deadline=None)
def test_the_widest_route_has_the_same_width(rng: np.random.Generator) -> None:
    z = free_field(48, 48)
    for row, col in rng.integers(0, 48, (60, 2)).tolist():
        z[row : row + 4, col : col + 4] = BLOCKED
    z[:8, :8] = z[-8:, -8:] = FREE
    problem = PlanningProblem(grid_of(z), start=(4, 4), goal=(43.3, 43.6), footprint=2.5)
    widest, found = attempt(widest_route, problem), attempt(plan, problem)
    if isinstance(found, Route):
        assert isinstance(widest, WidestRoute)
        assert widest.width >= 2 * found.min_clearance - 1e-9
    else:
        width = widest.width if isinstance(widest, WidestRoute) else widest.widest_gap
        assert found.widest_gap == pytest.approx(width)


def attempt(ask: Callable[[PlanningProblem], T], problem: PlanningProblem) -> T | EnclosedError:
    try:
        return ask(problem)
    except EnclosedError as error:
        return error


def test_the_end_with_the_smaller_reachable_area_is_fenced_in() -> None:
    z = free_field(64, 64)
    z[:, 20:22] = BLOCKED
    left = PlanningProblem(grid_of(z), start=(9.5, 9.5), goal=(40.5, 9.5), footprint=1.5)
    right = PlanningProblem(grid_of(z), start=(40.5, 9.5), goal=(9.5, 9.5), footprint=1.5)
    assert (failure(left).place, failure(right).place) == ("start", "goal")
    # Of the 20 x 64 cells of the left part, a rim of one cell is nearer than 1.5 m to its border.
    assert failure(left).area == failure(right).area == 18 * 62
    assert failure(left).nearest == (18.5, 9.5)
    assert failure(left).distance == 22.0


def test_reach_shrinks_with_the_radius() -> None:
    costmap = Costmap.of(across(halves(gap=3), 0.9))
    xy = costmap.problem.start_xy
    wide, own, narrow = (reachable(costmap, xy, radius=radius) for radius in (2.0, 0.9, 0.5))
    assert not (wide & ~own).any()
    assert not (own & ~narrow).any()
    assert narrow[:, 40:].any()
    assert not own[:, 40:].any()


def test_widths_are_shown_with_the_decimals_that_tell_them_apart() -> None:
    nearly = EnclosedError("goal", **FACTS, widest_gap=0.5999, needed=0.6)
    assert str(nearly).endswith("is 0.5999 m wide; the footprint needs 0.6000 m.")
    same = EnclosedError("goal", **FACTS, widest_gap=0.6, needed=0.6)
    assert "is 0.60 m wide, which is enough for the footprint (0.60 m), but" in str(same)


def test_in_space_volumes_are_enclosed_and_gaps_not_measured() -> None:
    facts = FACTS | {"nearest": (1.0, 2.0, 0.5)}
    error = EnclosedError("start", **facts, widest_gap=math.nan, needed=0.6)
    assert str(error) == (
        "no route: the start is enclosed in a space of 3.0 m³; the reachable "
        "cell nearest to the goal is (1.00, 2.00, 0.50), 1.50 m away."
    )


def test_a_footprint_that_fits_nowhere_is_no_enclosure() -> None:
    with pytest.raises(NonFreeError, match=r"start \(6.25, 6.25\): the footprint"):
        plan(across(halves(gap=3), 9.5))


def test_unknown_space_around_the_start_is_named_with_two_ways_out() -> None:
    z = free_field(30, 80)
    z[:, 18:22] = UNKNOWN  # what a camera at the start sees begins behind it
    problem = PlanningProblem(grid_of(z), start=(15.5, 15.5), goal=(70.5, 15.5), footprint=2.0)
    error = failure(problem)
    assert error.way_out is not None
    assert error.way_out.place == (24.5, 15.5)
    assert error.way_out.distance == 9.0
    assert str(error).endswith(
        "The cause is unknown space around the start: a camera does not see the ground that it "
        "starts on. Start from (24.50, 15.50), 9.00 m away, or, if the ground around the start is "
        "free, give clear_start_radius=12.0 (--clear-start-radius 12.0)."
    )
    for mended in (
        replace(problem, start=error.way_out.place),
        replace(problem, clear_start_radius=error.way_out.clear_start_radius),
    ):
        assert plan(mended).length > 0


def test_an_unknown_start_is_named_with_its_ways_out_too() -> None:
    z = free_field(30, 80)
    z[:, :24] = UNKNOWN
    problem = PlanningProblem(grid_of(z), start=(20.5, 15.5), goal=(70.5, 15.5), footprint=1.0)
    with pytest.raises(
        UnknownSpaceError, match=r"Start from \(25\.50, 15\.50\), 5\.00 m"
    ) as caught:
        plan(problem)
    assert caught.value.way_out is not None
    assert plan(replace(problem, start=caught.value.way_out.place)).length > 0


@pytest.mark.parametrize("options", [{"clear_start": False}, {"start": (70.5, 15.5)}])
def test_the_start_is_no_cause_where_a_wall_is_or_nothing_is_cleared(
    options: dict[str, Any],
) -> None:
    z = free_field(30, 80)
    z[:, 18:22] = UNKNOWN if "clear_start" in options else BLOCKED
    ends: dict[str, Any] = {"start": (15.5, 15.5), "goal": (70.5, 15.5)} | options
    if "start" in options:
        ends["goal"] = (15.5, 15.5)
    error = failure(PlanningProblem(grid_of(z), footprint=2.0, **ends))
    assert error.way_out is None
