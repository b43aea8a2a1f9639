"""Smoothing: features of one surface agree on where it is; those of two surfaces do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.smooth import MOST, smooth_along_rays
from groundmap.evidence.ground_plane.ray_smoothing import smooth_features
from groundmap.settings import MapperSettings
from strategies import flat_view, rngs

SETTINGS = MapperSettings()
DISPARITY = 0.004  # [1/m], standard deviation of an inverse range: the same at every range


def in_inverse_range(
    bearings: npt.ArrayLike, inverse: npt.ArrayLike, sigma: npt.ArrayLike = DISPARITY
) -> GroundView:
    """View of features by bearing and inverse range, and the standard deviation of the latter."""
    t, radius = np.asarray(bearings, dtype=np.float64), 1.0 / np.asarray(inverse)
    ray = np.stack([np.cos(t), np.sin(t)], axis=-1)
    along = np.broadcast_to(sigma, t.shape) * radius**2
    return flat_view(
        radius[:, None] * ray,
        heights=np.linspace(0.2, 1.9, len(t)),
        covariance=along[:, None, None] ** 2 * ray[:, :, None] * ray[:, None, :]
        + 1e-12 * np.eye(2),
        camera_height=1.2,
    )


def inverse_of(ground_view: GroundView) -> Floats:
    inverse: Floats = 1.0 / np.hypot(*ground_view.points.T)
    return inverse


def bearings_of(ground_view: GroundView) -> Floats:
    bearings: Floats = np.arctan2(ground_view.points[:, 1], ground_view.points[:, 0])
    return bearings


def wall(rng: np.random.Generator, slant: float, count: int = 200) -> tuple[Floats, Floats]:
    """Bearings of features on a straight wall 6 m ahead, 5 m wide, and their true inverse range."""
    along = np.linspace(-2.5, 2.5, count) + rng.uniform(-0.01, 0.01, size=count)
    x, y = 6.0 + along * np.sin(slant), along * np.cos(slant)
    return np.arctan2(y, x), 1.0 / np.hypot(x, y)


# The kernel


class Row(NamedTuple):
    """Features by bearing: inverse range and its standard deviation."""

    bearings: Floats
    inverse: Floats
    sigma: Floats


def fitted(i: int, row: Row, half_width: float, gate: float) -> tuple[float, float]:
    """Weighted least squares through the neighbours of one feature: value there and its sigma."""
    bearings, inverse, sigma = row
    near = np.abs(bearings - bearings[i]) <= min(half_width * inverse[i], 0.2)
    near &= np.abs(inverse - inverse[i]) <= gate * np.hypot(sigma, sigma[i])
    x, y, weight = bearings[near] - bearings[i], inverse[near], 1.0 / sigma[near]
    if near.sum() < 3:
        return float(inverse[i]), float(sigma[i])
    moments = np.vander(x, 2).T * weight**2 @ np.vander(x, 2)
    level = np.linalg.det(moments) <= 1e-3 * np.prod(np.diag(moments))
    degree = 0 if near.sum() == 3 or level else 1
    design = np.vander(x, degree + 1) * weight[:, None]
    value, *_ = np.linalg.lstsq(design, y * weight, rcond=None)
    deviation = np.sqrt(np.linalg.inv(design.T @ design)[-1, -1])
    return float(np.clip(value[-1], y.min(), y.max())), float(deviation)


@settings(max_examples=150)
@given(rngs(), st.sampled_from([0.0, 0.1, 0.25, 1.0]), st.sampled_from([0.5, 2.0, 50.0]))
def test_each_feature_moves_to_a_line_fitted_through_its_neighbours(
    rng: np.random.Generator, half_width: float, gate: float
) -> None:
    count = int(rng.integers(0, 60))
    bearings = np.sort(rng.uniform(-0.5, 0.5, size=count))
    inverse = rng.choice([0.1, 0.2, 0.5]) + rng.normal(scale=0.01, size=count)
    sigma = rng.uniform(0.002, 0.02, size=count)
    row = Row(bearings, inverse, sigma)
    found, deviation = np.empty(count), np.empty(count)
    smooth_along_rays(*row, half_width, gate, found, deviation)
    expected = [fitted(i, row, half_width, gate) for i in range(count)]
    twin = np.array(expected).reshape(-1, 2)
    np.testing.assert_allclose(found, twin[:, 0], rtol=1e-9)
    np.testing.assert_allclose(deviation, twin[:, 1], rtol=1e-6)


def test_a_steep_fit_does_not_carry_a_feature_behind_the_viewpoint() -> None:
    # Three that are sure rise steeply; beside them one that knows nothing of its range.
    bearings, inverse = np.array([0.0, 0.010, 0.011, 0.012]), np.array([0.1, 0.3, 0.38, 0.46])
    found, deviation = np.empty(4), np.empty(4)
    sigma = np.array([1.0, 0.01, 0.01, 0.01])
    smooth_along_rays(bearings, inverse, sigma, 1.0, 20.0, found, deviation)
    assert np.polyfit(bearings[1:], inverse[1:], 1)[1] < -0.4  # where the line would carry it
    assert found[0] == 0.1
    assert (found >= 0.1).all()


# What it does to a view


@pytest.mark.parametrize("slant", [-1.0, -0.5, 0.0, 0.5, 1.0])
def test_a_noisy_straight_wall_gets_straighter_and_stays_where_it_is(slant: float) -> None:
    rng = np.random.default_rng(8)
    before, after = [], []
    for _ in range(30):
        bearings, truth = wall(rng, slant)
        noisy = truth + rng.normal(scale=DISPARITY, size=len(truth))
        found = inverse_of(smooth_features(in_inverse_range(bearings, noisy), SETTINGS))
        many = np.abs(bearings[:, None] - bearings) <= 0.25 * noisy[:, None]
        crowded = many.sum(axis=1) >= 12
        assert crowded.sum() > 150
        before.append((noisy - truth)[crowded])
        after.append((found - truth)[crowded])
    raw, smooth = np.concatenate(before), np.concatenate(after)
    assert np.sqrt((smooth**2).mean()) < np.sqrt((raw**2).mean()) / 2
    # Neighbours share their errors: some 20 are one sample.
    assert abs(smooth.mean()) < 4 * DISPARITY / np.sqrt(len(raw)) + 0.02 * DISPARITY


def test_the_nearest_of_many_features_of_a_wall_is_no_longer_far_before_it() -> None:
    rng = np.random.default_rng(9)
    bearings, truth = wall(rng, 0.0)
    noisy = truth + rng.normal(scale=DISPARITY, size=len(truth))
    found = inverse_of(smooth_features(in_inverse_range(bearings, noisy), SETTINGS))
    assert (noisy - truth).max() > 2 * DISPARITY
    assert (found - truth).max() < 1.5 * DISPARITY


@pytest.mark.parametrize(("apart", "meet"), [(3.0, False), (1.0, True)])
def test_surfaces_farther_apart_than_the_gate_stay_apart(apart: float, meet: bool) -> None:
    # The gate is two standard deviations of the difference: 2.8 of each feature's own.
    bearings = np.linspace(-0.03, 0.03, 40)
    inverse = 0.2 + np.where(np.arange(40) % 2, 0.5, -0.5) * apart * DISPARITY
    found = inverse_of(smooth_features(in_inverse_range(bearings, inverse), SETTINGS))
    if meet:
        assert np.abs(found - 0.2).max() < 0.3 * apart * DISPARITY
    else:
        np.testing.assert_allclose(found, inverse, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 2])
def test_lone_features_and_pairs_stay_put(count: int) -> None:
    ground_view = in_inverse_range([0.1, 0.101][:count], [0.2, 0.203][:count])
    there = smooth_features(ground_view, SETTINGS)
    np.testing.assert_allclose(there.points, ground_view.points, rtol=1e-15)
    np.testing.assert_array_equal(there.covariance, ground_view.covariance)
    np.testing.assert_allclose(there.heights, ground_view.heights, rtol=1e-15)


def test_three_features_meet_at_their_weighted_mean() -> None:
    ground_view = in_inverse_range([0.1, 0.11, 0.12], [0.2, 0.203, 0.206], [0.004, 0.004, 0.002])
    found = inverse_of(smooth_features(ground_view, SETTINGS))
    np.testing.assert_allclose(found, (0.2 + 0.203 + 4 * 0.206) / 6, rtol=1e-6)


@pytest.mark.parametrize(("width", "moves"), [(0.24, True), (0.26, False)])
def test_neighbours_are_as_near_across_the_line_of_sight_as_the_setting_says(
    width: float, moves: bool
) -> None:
    ground_view = in_inverse_range([-width * 0.2, 0.0, width * 0.2], [0.202, 0.2, 0.202])
    middle = inverse_of(smooth_features(ground_view, SETTINGS))[1]
    assert (middle > 0.201) == moves


def scattered(rng: np.random.Generator) -> GroundView:
    """Features on a few surfaces ahead, more or less sure, with ground and a segment."""
    count = int(rng.integers(2, 80))
    inverse = rng.choice([0.08, 0.2, 0.6], size=count) + rng.normal(scale=0.01, size=count)
    sigma = rng.uniform(0.0, 0.02, size=count) * rng.choice([0.0, 1.0], size=count, p=[0.1, 0.9])
    ground_view = in_inverse_range(rng.uniform(-0.6, 0.6, size=count), inverse, sigma)
    supports = rng.uniform((1.0, -4.0), (9.0, 4.0), size=(9, 2))
    return ground_view._replace(
        supports=supports,
        support_heights=np.zeros(9),
        feature=np.arange(count + 9),
        segments=np.array([(0, 1)]),
    )


@settings(max_examples=100)
@given(rngs())
def test_features_keep_their_bearing_and_their_line_of_sight(rng: np.random.Generator) -> None:
    ground_view = scattered(rng)
    there = smooth_features(ground_view, SETTINGS)
    np.testing.assert_allclose(bearings_of(there), bearings_of(ground_view), atol=1e-12)
    # Seen from the camera, they are as far above or below the horizon as they were.
    before = (ground_view.heights - ground_view.camera_height) * inverse_of(ground_view)
    after = (there.heights - ground_view.camera_height) * inverse_of(there)
    np.testing.assert_allclose(after, before, atol=1e-12)


@settings(max_examples=100)
@given(rngs())
def test_no_feature_moves_beyond_its_neighbours(rng: np.random.Generator) -> None:
    ground_view = scattered(rng)
    before, after = inverse_of(ground_view), inverse_of(smooth_features(ground_view, SETTINGS))
    near = (
        np.abs(bearings_of(ground_view)[:, None] - bearings_of(ground_view))
        <= 0.25 * before[:, None] + 1e-12
    )
    low = np.where(near, before, np.inf).min(axis=1)
    high = np.where(near, before, -np.inf).max(axis=1)
    assert ((after >= low - 1e-12) & (after <= high + 1e-12)).all()


@settings(max_examples=100)
@given(rngs())
def test_covariance_never_grows_and_never_shrinks_below_a_quarter(
    rng: np.random.Generator,
) -> None:
    ground_view = scattered(rng)
    before, after = (
        np.linalg.norm(v.covariance, axis=(1, 2))
        for v in (ground_view, smooth_features(ground_view, SETTINGS))
    )
    assert (after <= before * (1 + 1e-12)).all()
    assert (after >= before * (0.25 - 1e-12)).all()


def test_covariance_shrinks_as_that_of_a_mean_does_down_to_a_quarter() -> None:
    for count, share in ((3, 1 / 3), (40, 0.25)):
        ground_view = in_inverse_range(np.linspace(-0.03, 0.03, count), np.full(count, 0.2))
        shrunk = smooth_features(ground_view, SETTINGS).covariance[count // 2]
        np.testing.assert_allclose(shrunk, share * ground_view.covariance[count // 2], rtol=1e-6)


@settings(max_examples=50)
@given(rngs())
def test_ground_segments_and_tallies_are_left_alone(rng: np.random.Generator) -> None:
    ground_view = scattered(rng)
    there = smooth_features(ground_view, SETTINGS)
    for name in ("viewpoint", "forward", "supports", "support_heights", "segments", "feature"):
        np.testing.assert_array_equal(getattr(there, name), getattr(ground_view, name))
    assert (there.used, there.dropped, there.camera_height) == (
        ground_view.used,
        ground_view.dropped,
        1.2,
    )


@settings(max_examples=100)
@given(rngs())
def test_the_order_of_the_features_does_not_matter(rng: np.random.Generator) -> None:
    ground_view = scattered(rng)
    order = rng.permutation(len(ground_view.points))
    shuffled = ground_view._replace(
        points=ground_view.points[order],
        covariance=ground_view.covariance[order],
        heights=ground_view.heights[order],
    )
    one, other = smooth_features(ground_view, SETTINGS), smooth_features(shuffled, SETTINGS)
    np.testing.assert_array_equal(one.points[order], other.points)
    np.testing.assert_array_equal(one.covariance[order], other.covariance)
    np.testing.assert_array_equal(one.heights[order], other.heights)


def test_without_smoothing_and_without_features_nothing_changes() -> None:
    ground_view = scattered(np.random.default_rng(2))
    assert smooth_features(ground_view, MapperSettings(smoothing=0.0)) is ground_view
    assert len(smooth_features(flat_view(supports=[(3.0, 0.0)]), SETTINGS).points) == 0


def test_what_is_nearer_than_min_range_stays_put_even_right_below_the_camera() -> None:
    # Segments may begin there; where sight has no bearing there is nothing to agree on.
    places = [(0.0, 0.0), (3.0, 0.1), (0.2, 0.01), (0.21, 0.01), (0.22, 0.01)]
    ground_view = flat_view(places, [(0, 1)], heights=0.3, covariance=0.1)
    np.testing.assert_array_equal(smooth_features(ground_view, SETTINGS).points, ground_view.points)


def test_of_a_crowd_at_one_bearing_only_so_many_are_averaged() -> None:
    inverse = np.full(2 * MOST + 3, 0.2)
    inverse[-1] *= 1.01  # near enough to be of the same surface
    smooth = inverse_of(
        smooth_features(in_inverse_range(np.zeros(len(inverse)), inverse), SETTINGS)
    )
    assert smooth[0] == pytest.approx(0.2, abs=1e-15)
    assert smooth[-1] == pytest.approx(0.2 + 0.002 / (MOST + 1), rel=1e-9)
