"""Slopes ahead: changes of slope are found, steps and bushes are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.view.slopes_ahead import slopes_ahead

REACH = 20.0


def road(rng: np.random.Generator, n: int = 600) -> Floats:
    """Return features of a level road, with noise of 2 cm."""
    return np.column_stack(
        [rng.uniform(0, REACH, n), rng.uniform(-4, 4, n), rng.normal(0, 0.02, n)]
    )


def heights(changes: list[tuple[float, float]], at: Floats) -> Floats:
    return sum(
        (slope * np.maximum(at - distance, 0.0) for distance, slope in changes), np.zeros(len(at))
    )


def test_nearly_every_ramp_ahead_is_followed_within_a_step() -> None:
    followed = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        slope = rng.choice([-1.0, 1.0]) * np.tan(np.radians(rng.uniform(2.0, 13.0)))
        points = road(rng, 1000)
        points[:, 2] += slope * np.maximum(points[:, 0] - rng.uniform(0.0, 10.0), 0.0)
        found = heights(list(slopes_ahead(points, REACH)), points[:, 0])
        followed += np.quantile(np.abs(points[:, 2] - found), 0.9) < 0.15
    assert followed >= 57


@pytest.mark.parametrize("angle", [-10.0, -5.0, 5.0, 10.0])
def test_a_ramp_that_ends_is_followed_to_its_end(angle: float) -> None:
    points = road(np.random.default_rng(1), 1500)
    points[:, 2] += np.tan(np.radians(angle)) * np.clip(points[:, 0] - 4.0, 0.0, 7.0)
    found = heights(list(slopes_ahead(points, REACH)), points[:, 0])
    assert np.quantile(np.abs(points[:, 2] - found), 0.9) < 0.15


@given(
    st.sampled_from([-0.6, -0.3, -0.2, 0.2, 0.3, 0.6]), st.floats(2, 14), st.integers(0, 2**32 - 1)
)
@settings(max_examples=30)
def test_a_step_is_no_slope(step: float, at: float, seed: int) -> None:
    points = road(np.random.default_rng(seed), 1000)
    points[:, 2] += step * (points[:, 0] > at)
    assert slopes_ahead(points, REACH) == []


@given(st.floats(3, 15), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_bush_or_a_wall_on_the_way_is_no_slope(at: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = road(rng)
    points = points[points[:, 0] < at]
    bush = np.column_stack(
        [rng.uniform(at, at + 4, 300), rng.uniform(-4, 4, 300), rng.uniform(0, 1.5, 300)]
    )
    assert slopes_ahead(np.concatenate([points, bush]), REACH) == []


@given(st.floats(2, 6), st.floats(-2.5, -1.2), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_landing_below_an_edge_that_hides_the_way_down_is_no_slope(
    edge: float, depth: float, seed: int
) -> None:
    points = road(np.random.default_rng(seed), 1500)
    points = points[(points[:, 0] < edge) | (points[:, 0] > edge + 8.0)]
    points[:, 2] += depth * (points[:, 0] > edge)
    assert slopes_ahead(points, REACH) == []


def test_features_beside_the_way_say_nothing_about_it() -> None:
    points = road(np.random.default_rng(3), 2000)
    beside = np.abs(points[:, 1]) > 2.0
    points[beside, 2] += 0.2 * points[beside, 0]
    assert slopes_ahead(points, REACH) == []


def test_without_features_no_slope_is_known() -> None:
    assert slopes_ahead(np.empty((0, 3)), REACH) == []
