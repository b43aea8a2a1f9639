"""Ties: whole-pixel columns put features exactly on the bearings where surfaces end."""

from __future__ import annotations

import numpy as np
import pytest

from groundmap import Features, GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Floats
from groundmap.evidence.ground_plane.view_parts import ViewParts
from groundmap.view.frames import map_from_world

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
CAMERA = 1.2  # [m] above the ground


def in_whole_columns(rng: np.random.Generator, *, whole_disparities: bool) -> Floats:
    """Features of the ground and of six walls, some of them seen through, shape (n, 3)."""
    depth = rng.uniform(2, 19, 400)
    sets = [np.column_stack([rng.uniform(-0.4, 0.4, 400) * depth, np.full(400, CAMERA), depth])]
    for _ in range(6):
        along, turn = rng.uniform(-1, 1, int(rng.integers(8, 30))), rng.uniform(0, np.pi)
        heights, depth_0 = rng.uniform(0.1, 1.6, len(along)), rng.uniform(4, 16)
        x = rng.uniform(-0.35, 0.35) * depth_0 + along * np.cos(turn)
        sets.append(np.column_stack([x, CAMERA - heights, depth_0 + along * np.sin(turn)]))
    x, y, z = np.concatenate(sets).T
    u, v = np.round(700.0 * x / z), 700.0 * y / z
    disparity = 350.0 / z * (1.0 + 0.01 * rng.normal(size=len(z)))
    if whole_disparities:
        disparity = np.maximum(np.round(disparity), 1.0)
    z = 350.0 / disparity
    return np.column_stack([u * z / 700.0, v * z / 700.0, z])


def explained(xyz: Floats) -> ViewParts:
    rays = xyz / np.linalg.norm(xyz, axis=1, keepdims=True)
    variance = (0.5 * xyz[:, 2] ** 2 / 350.0) ** 2
    spread = variance[:, None, None] * rays[:, :, None] * rays[:, None, :]
    points = Features.points(xyz, 1e-4 * np.eye(3) + spread)
    view = View(T_map_base=map_from_world(np.eye(4), "optical"), rig=RIG, points=points)
    parts: ViewParts = GroundMapper().explain(
        view.with_plane(GroundPlane.below_camera(RIG, CAMERA))
    )
    return parts


@pytest.mark.parametrize("whole_disparities", [False, True])
def test_rounding_of_the_input_changes_no_map(whole_disparities: bool) -> None:
    """The viewpoint is on the corner of a cell, so borders of sight pass through centres, too."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        xyz = in_whole_columns(rng, whole_disparities=whole_disparities)
        once = explained(xyz)
        again = explained(xyz * (1.0 + 1e-13 * rng.uniform(-1, 1, xyz.shape)))
        assert np.array_equal(once.evidence.z < 0, again.evidence.z < 0)
        assert np.array_equal(once.evidence.z > 0, again.evidence.z > 0)
        np.testing.assert_allclose(once.evidence.z, again.evidence.z, rtol=0, atol=1e-6)
        hiding = (parts.fan.contradictions.hiding.sum() for parts in (once, again))
        assert len(set(hiding)) == 1


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.7])
@pytest.mark.parametrize("nudge", [0.0, 1e-13, -1e-13])
@pytest.mark.parametrize("end", [-0.24, 0.24])
def test_a_feature_at_the_bearing_of_a_surface_s_end_is_seen_through_it(
    end: float, nudge: float, turn: float
) -> None:
    bearing = np.arctan2(end, 6.0) + nudge
    wall = np.array([(-0.24, 0.2, 6.0), (0.24, 0.2, 6.0)])
    behind = 9.0 / np.cos(bearing) * np.array([np.sin(bearing), 0.0, np.cos(bearing)])
    behind[1] = 0.9  # on a line of sight that is below the wall's top at its range
    rotation = np.array(
        [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    )
    parts = explained(np.concatenate([wall, behind[None]]) @ rotation.T)
    [link] = np.flatnonzero(parts.surfaces.kind == 1)
    assert parts.fan.contradictions.against[link] == 1.0
