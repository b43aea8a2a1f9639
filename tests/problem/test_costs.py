"""Costs of cells: Nav2's scale and formula, higher for little clearance or confidence."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, UNSEEN, free_field, grid_of
from planners import CostSettings, PlanningProblem
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import DIAGONAL, ONE
from planners.problem.costs import (
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    MAX_NON_OBSTACLE,
    NO_INFORMATION,
    cell_costs,
)

ONES = np.ones((1, 1), dtype=np.bool_)


def cost(clearance: float, confidence: float, settings: CostSettings, *, known: bool = True) -> int:
    """Return the cost of a single cell with a footprint of 0.5 m."""
    value = cell_costs(
        settings,
        np.array([[clearance]]),
        np.array([[confidence]], dtype=np.float32),
        ONES if known else ~ONES,
        radius=0.5,
        penalise=not known,
    )
    return int(value[0, 0])


@given(st.floats(0.5, 4), st.floats(0.5, 4), st.floats(0.1, 10))
def test_a_cell_with_more_clearance_never_costs_more(a: float, b: float, factor: float) -> None:
    settings = CostSettings(clearance_weight=1.0, cost_scaling_factor=factor)
    near, far = min(a, b), max(a, b)
    assert cost(near, -1.0, settings) >= cost(far, -1.0, settings)


@given(st.floats(-1, -0.01), st.floats(-1, -0.01))
def test_a_cell_of_higher_confidence_never_costs_more(a: float, b: float) -> None:
    settings = CostSettings(confidence_weight=2.0)
    assert cost(9.0, max(a, b), settings) >= cost(9.0, min(a, b), settings)


def test_inflation_is_that_of_nav2() -> None:
    settings = CostSettings(clearance_weight=1.0, inflation_radius=2.0, cost_scaling_factor=3.0)
    for clearance in (0.5, 0.7, 1.0, 1.9):
        expected = round(MAX_NON_OBSTACLE * np.exp(-3.0 * (clearance - 0.5)))
        assert cost(clearance, -1.0, settings) == expected
    assert cost(2.0, -1.0, settings) == 0


def test_unknown_cells_cost_their_weight_at_any_confidence() -> None:
    settings = CostSettings(unknown_weight=3.0, clearance_weight=1.0)
    assert cost(9.0, 0.0, settings, known=False) == round(252 * 3 / 4)


@pytest.mark.parametrize("key", list(CostSettings.model_fields))
def test_negative_costs_are_refused(key: str) -> None:
    with pytest.raises(SettingsError, match=f"{key}: expected greater than or equal to 0"):
        CostSettings(**{key: -0.1})


def test_the_four_costs_of_nav2_are_where_they_belong() -> None:
    z = free_field(20, 20)
    z[10, 10], z[10, 16] = BLOCKED, UNSEEN
    problem = PlanningProblem(grid_of(z), start=(4.5, 4.5), goal=(15, 4), footprint=1.4)
    costmap = Costmap.of(problem)
    row, col = -costmap.lower_cell
    costs = costmap.costs[row : row + 20, col : col + 20]
    assert costs[10, 10] == LETHAL_OBSTACLE
    assert costs[10, 16] == NO_INFORMATION
    assert costs[10, 9] == costs[11, 11] == costs[10, 15] == INSCRIBED_INFLATED_OBSTACLE
    assert costs[10, 8] == costs[8, 10] == 0
    assert costmap.uniform
    np.testing.assert_array_equal(costmap.steps[:, 0], [ONE, DIAGONAL])


def test_a_move_through_the_most_expensive_cells_costs_one_plus_the_weight() -> None:
    settings = CostSettings(confidence_weight=2.0, clearance_weight=1.0)
    problem = PlanningProblem(
        grid_of(free_field(8, 8)), start=(4, 4), goal=(5, 5), footprint=0, costs=settings
    )
    steps = Costmap.of(problem).steps
    assert not Costmap.of(problem).uniform
    assert steps[0, 504] == 4 * ONE
    assert (np.diff(steps, axis=1) > 0).all()


def test_penalised_unknown_space_is_traversable_at_extra_cost() -> None:
    z = np.where(np.arange(20) < 10, FREE, UNSEEN) * np.ones((20, 1))
    problem = PlanningProblem(
        grid_of(z), start=(3, 10), goal=(17, 10), footprint=1, unknown="penalise", clear_start=False
    )
    costmap = Costmap.of(problem)
    assert not costmap.blocked.any()
    assert not costmap.uniform
    assert {*np.unique(costmap.costs).tolist()} == {0, MAX_NON_OBSTACLE}
