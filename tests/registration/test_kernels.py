"""The compiled loops against slow and simple computations."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from groundmap import Features
from groundmap.arrays import Floats, Ints
from groundmap.registration.feature_set import FeatureSet, bearings_of, bins_of, feature_set
from groundmap.registration.kernels.alignment import (
    match_features,
    score_poses,
)
from groundmap.registration.kernels.normal_equations import normal_equations
from groundmap.registration.kernels.triangles import (
    find_candidates,
    match_triangles,
    poses_of_triangles,
)

POSE = np.eye(4)[:3]


def some_features(rng: np.random.Generator, count: int) -> FeatureSet:
    xyz = rng.uniform((-3, -1, 3), (3, 1, 9), (count, 3))
    half = rng.normal(0, 0.05, (count, 3, 3))
    features = Features.points(xyz, half @ np.swapaxes(half, 1, 2) + 1e-5 * np.eye(3))
    return feature_set(features, rng.integers(0, 2, count))


def distances(a: FeatureSet, b: FeatureSet, gate: float) -> Floats:
    """Return squared Mahalanobis distances of all pairs, infinite for unequal labels."""
    squares = np.full((len(a.xyz), len(b.xyz)), np.inf)
    for i in range(len(a.xyz)):
        inflation = np.diag([gate, gate, gate * a.bearings[i, 2]]) ** 2
        for j in range(len(b.xyz)):
            if a.labels[i] == b.labels[j]:
                difference = a.bearings[i] - b.bearings[j]
                total = a.bearing_covariance[i] + b.bearing_covariance[j] + inflation
                squares[i, j] = difference @ np.linalg.solve(total, difference)
    return squares


def match(a: FeatureSet, b: FeatureSet, gate: float) -> tuple[Ints, Floats, Floats]:
    partner = np.empty(len(a.xyz), dtype=np.int64)
    residuals, information = np.zeros((len(a.xyz), 3)), np.zeros((len(a.xyz), 3, 3))
    arrays = (a.xyz, a.covariance, a.labels, b.bearings, b.bearing_covariance, b.labels)
    count = match_features(POSE, *arrays, *bins_of(b), gate, 9.0, partner, residuals, information)
    assert count == (partner >= 0).sum()
    return partner, residuals, information


@pytest.mark.parametrize("seed", range(5))
def test_each_feature_takes_the_nearest_that_none_before_is_nearer_to(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = some_features(rng, 60), some_features(rng, 300)
    partner, residuals, information = match(a, b, 0.005)
    squares = distances(a, b, 0.005)
    expected, taken = np.full(60, -1), np.full(300, np.inf)
    for i in range(60):
        free = np.where(squares[i] < taken, squares[i], np.inf)
        best = int(np.argmin(free))
        if free[best] <= 9.0:
            expected[expected == best] = -1
            expected[i], taken[best] = best, free[best]
    assert (expected >= 0).sum() >= 8
    np.testing.assert_array_equal(partner, expected)
    for row in np.flatnonzero(partner >= 0):
        square = float(residuals[row] @ information[row] @ residuals[row])
        assert square == pytest.approx(squares[row, partner[row]], rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_scores_count_features_with_another_in_the_gate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = some_features(rng, 50), some_features(rng, 70)
    scores = np.zeros(1, dtype=np.int64)
    noise = a.inverse_depth_noise, b.inverse_depth_noise
    gate = 0.02
    score_poses(
        POSE[None],
        a.xyz,
        noise[0],
        a.labels,
        b.bearings,
        noise[1],
        b.labels,
        *bins_of(b),
        gate,
        scores,
    )
    apart = np.abs(a.bearings[:, None] - b.bearings[None])
    deep = gate * a.bearings[:, None, 2] + 2.0 * (noise[0][:, None] + noise[1][None])
    meets = (apart[:, :, :2] <= gate).all(axis=2) & (apart[:, :, 2] <= deep)
    meets &= a.labels[:, None] == b.labels[None]
    assert scores[0] == meets.any(axis=1).sum()


def test_normal_equations_are_those_of_numerical_derivatives() -> None:
    rng = np.random.default_rng(1)
    a, b = some_features(rng, 60), some_features(rng, 80)
    partner, residuals, information = match(a, b, 0.01)
    scale = 1e12  # all weights are 1
    arrays = (partner, residuals, information)
    matrix, right = normal_equations(POSE, a.xyz, *arrays, scale, np.eye(6))
    expected, expected_right = np.zeros((6, 6)), np.zeros(6)
    for i in np.flatnonzero(partner >= 0):
        design = np.empty((3, 6))
        for k in range(6):
            step = np.zeros(6)
            step[k] = 1e-6
            turned = Rotation.from_rotvec(step[3:]).apply(a.xyz[i]) + step[:3]
            design[:, k] = (bearings_of(turned[None])[0][0] - a.bearings[i]) / 1e-6
        expected += design.T @ information[i] @ design
        expected_right -= design.T @ information[i] @ residuals[i]
    np.testing.assert_allclose(matrix, expected, rtol=1e-3, atol=1e-3 * np.abs(matrix).max())
    np.testing.assert_allclose(right, expected_right, rtol=1e-3, atol=1e-3 * np.abs(right).max())


def test_triangles_match_where_all_three_sides_agree() -> None:
    rng = np.random.default_rng(2)
    a = some_features(rng, 12)
    turn = Rotation.from_rotvec((0.0, 0.05, 0.0))
    moved = turn.apply(a.xyz) + np.array([0.1, 0.0, -0.3])
    order = np.argsort(moved[:, 0])
    b = feature_set(Features.points(moved[order], a.covariance[order]), a.labels[order])
    triangles = np.array([[0, 1, 2], [3, 4, 5], [6, 8, 10]])
    start, partner = find_candidates(
        a.xyz, b.xyz, np.zeros(12), a.labels, b.labels, np.full(12, 1.5)
    )
    for i in range(12):
        near = np.linalg.norm(a.xyz[i] - b.xyz, axis=1) <= 1.5
        expected = np.flatnonzero(near & (b.labels == a.labels[i]))
        assert partner[start[i] : start[i + 1]].tolist() == expected.tolist()
    matched = np.empty((3000, 4), dtype=np.int64)
    arrays = (a.xyz, a.covariance, b.xyz, b.covariance, b.spread, a.labels, b.labels)
    count = match_triangles(triangles, *arrays, start, partner, 1.0, 0.1, matched)
    found = {tuple(row) for row in matched[:count].tolist()}
    true = {(n, *np.argsort(order)[rows].tolist()) for n, rows in enumerate(triangles)}
    assert true <= found
    for number, rows in enumerate(triangles):
        for corners in permutations(range(12), 3):
            if (number, *corners) in found:
                assert sides_agree(a, rows, b, np.array(corners))
    poses = np.empty((count, 3, 4))
    poses_of_triangles(triangles, matched[:count], a.xyz, b.xyz, poses)
    for row, pose in zip(matched[:count].tolist(), poses, strict=True):
        if tuple(row) in true:
            np.testing.assert_allclose(pose[:, :3], turn.as_matrix(), atol=1e-9)
            np.testing.assert_allclose(pose[:, 3], (0.1, 0.0, -0.3), atol=1e-9)


def sides_agree(a: FeatureSet, rows: Ints, b: FeatureSet, corners: Ints) -> bool:
    """Return whether the lengths of two triangles agree within their standard deviations."""
    for one, two in ((0, 1), (0, 2), (1, 2)):
        variance, lengths = 0.0, []
        for features, triangle in ((a, rows), (b, corners)):
            i, j = triangle[one], triangle[two]
            side = features.xyz[j] - features.xyz[i]
            lengths.append(np.linalg.norm(side))
            unit = side / lengths[-1]
            variance += unit @ (features.covariance[i] + features.covariance[j]) @ unit
        if abs(lengths[0] - lengths[1]) > np.sqrt(variance) + 1e-9:
            return False
    return True
