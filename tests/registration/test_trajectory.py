"""Poses of a drive from its features: little drift, closed loops, and named refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from command_line import run
from groundmap import View, estimate_poses, write_views
from groundmap.arrays import Floats
from groundmap.errors import InputError, RegistrationError
from groundmap.registration.pose_graph import Edge, solve_pose_graph
from groundmap.view.frames import T_REP103_OPTICAL, invert
from registration_scenes import seen_from, street, transform

STEPS = [transform((0.02 * k, 0.0, 0.7 * k), (0.0, 0.01 * k, 0.0)) for k in range(6)]


def drive(seed: int = 0) -> list[View]:
    rng = np.random.default_rng(seed)
    points = street(rng, 500)
    return [seen_from(points, pose, rng) for pose in STEPS]


def lost(view: View) -> View:
    """Return a view with few features."""
    return replace(view, points=view.points.select(np.arange(8)))


def off(found: Floats, true: Floats) -> float:
    return float(np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1).max())


def test_estimated_poses_follow_the_drive_and_ignore_given_ones() -> None:
    views = [replace(view, T_map_base=np.eye(4)) for view in drive()]
    found = estimate_poses(views)
    assert off(found.poses, np.array(STEPS)) < 0.03
    assert [(edge.first, edge.second) for edge in found.edges] == [(k, k + 1) for k in range(5)]


def test_refined_poses_correct_given_ones() -> None:
    rng = np.random.default_rng(1)
    views = drive()
    given = [
        view
        if k == 0
        else replace(view, T_map_base=view.T_map_base @ transform(rng.normal(0, 0.1, 3)))
        for k, view in enumerate(views)
    ]
    found = estimate_poses(given, mode="refine")
    assert off(np.array([view.T_map_base for view in given]), np.array(STEPS)) > 0.1
    assert off(found.poses, np.array(STEPS)) < 0.03
    assert not found.refused


def test_a_view_that_agrees_with_none_is_named() -> None:
    views = drive()
    views[3] = lost(views[3])
    with pytest.raises(RegistrationError, match=r"pose of view 3 cannot be estimated: relative to"):
        estimate_poses(views)


def test_refining_keeps_the_given_step_where_registration_is_refused() -> None:
    views = drive()
    views[3] = lost(views[3])
    found = estimate_poses(views, mode="refine")
    assert list(found.refused) == [3]
    assert "too few" in found.refused[3]
    assert off(found.poses, np.array(STEPS)) < 0.03


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(InputError, match="mode: expected 'estimate' or 'refine', got 'guess'"):
        estimate_poses([], mode="guess")  # type: ignore[arg-type] # that it is refused is the point


def test_a_place_that_is_seen_again_closes_the_trajectory() -> None:
    rng = np.random.default_rng(3)
    points = street(rng, 300)
    along = 0.5 * np.minimum(np.arange(25), 24 - np.arange(25))  # forwards, then back
    true = np.array([transform((0.0, 0.0, z)) for z in along])
    found = estimate_poses([seen_from(points, pose, rng) for pose in true])
    assert found.closures
    assert all(second - first > 20 for first, second in found.closures)
    assert off(found.poses, true) < 0.03


def ring(count: int) -> Floats:
    """Return poses on a circle that look along it, shape (n, 4, 4)."""
    angles = np.linspace(0.0, 2 * np.pi, count)
    poses = [transform((0, 0, 0), (0, 0, angle)) @ transform((5.0, 0.0, 0.0)) for angle in angles]
    return np.array(poses)


def test_a_closed_loop_removes_the_drift() -> None:
    rng = np.random.default_rng(0)
    true = ring(30)
    noise = np.diag([0.02, 0.02, 0.02, 0.01, 0.01, 0.01]) ** 2
    edges, chain = [], [true[0]]
    for k in range(29):
        error = rng.multivariate_normal(np.zeros(6), noise)
        step = invert(true[k]) @ true[k + 1] @ transform(tuple(error[:3]), error[3:])
        edges.append(Edge(k, k + 1, step, noise))
        chain.append(chain[-1] @ step)
    drifted = np.array(chain)
    closed = solve_pose_graph(
        drifted, [*edges, Edge(0, 29, invert(true[0]) @ true[29], noise / 100)]
    )
    np.testing.assert_allclose(closed[29], true[29], atol=0.02)
    assert off(closed, true) < 0.6 * off(drifted, true)
    np.testing.assert_allclose(closed[0], drifted[0])


def test_a_chain_stays_as_it_is() -> None:
    true = ring(8)
    edges = [Edge(k, k + 1, invert(true[k]) @ true[k + 1], np.eye(6)) for k in range(7)]
    moved = true.copy()
    moved[1:, :3, 3] += np.random.default_rng(2).normal(0, 0.3, (7, 3))
    np.testing.assert_allclose(solve_pose_graph(moved, edges), true, atol=1e-6)


def test_one_false_edge_hardly_bends_the_graph() -> None:
    true = ring(12)
    pairs = [(k, k + d) for d in (1, 2, 3) for k in range(12 - d)]
    edges = [Edge(i, j, invert(true[i]) @ true[j], 1e-4 * np.eye(6)) for i, j in pairs]
    false = Edge(
        0, 11, transform((3.0, 1.0, 0.0), Rotation.random(rng=1).as_rotvec()), 1e-4 * np.eye(6)
    )
    assert off(solve_pose_graph(true, [*edges, false]), true) < 0.05


def test_the_command_maps_with_estimated_poses(
    tmp_path: Path,
) -> None:
    views = drive()
    write_views([replace(view, T_map_base=T_REP103_OPTICAL) for view in views], tmp_path / "log")
    out = tmp_path / "map.npz"
    result = run(
        "map",
        tmp_path / "log",
        "--out",
        out,
        "--poses",
        "estimate",
        "--camera-height",
        "1.6",
        "--json",
    ).json
    assert result["poses"] == "estimate"
    assert result["registered"] == 5
    assert "register" in result["stages_s"]
