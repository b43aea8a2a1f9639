"""The ground under simulated drives over slopes, crests and past verges."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from groundmap import GroundMapper, View, fit_ground
from groundmap.simulate import (
    DriveSettings,
    Relief,
    SensorSettings,
    World,
    drive,
    observe,
    sample_landmarks,
)

CAMERA_HEIGHT = 1.2
SENSOR = SensorSettings(camera_height=CAMERA_HEIGHT, max_points=400)
ROAD = ((0.0, 0.0), (30.0, 0.0))


@cache
def over_ramp(angle: float) -> tuple[View, ...]:
    """Return the views of a drive over a ramp of 7 m, from one level to another."""
    rise = 7.0 * float(np.tan(np.radians(angle)))
    return over(Relief(road=ROAD, along=((8.0, 0.0), (15.0, rise))))


def over(relief: Relief, *, length: float = 22.0) -> tuple[View, ...]:
    world = World(bounds=(0, -5, 30, 5), relief=relief)
    moves = drive(
        DriveSettings(stops=((1, 0, 0), (length, 0, 0)), every=0.7), np.random.default_rng(0)
    )
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    return tuple(observe(world, landmarks, moves.lifted(relief), SENSOR, seed=1))


def bare(views: tuple[View, ...]) -> list[View]:
    """Return the views of a camera whose height above the ground is unknown."""
    return [
        replace(view, T_map_base=view.T_map_camera, rig=replace(view.rig, T_base_camera=np.eye(4)))
        for view in views
    ]


def camera_height(view: View) -> float:
    assert view.plane is not None
    return float(view.plane.height(view.rig.T_base_camera[:3, 3]))


@pytest.mark.parametrize("angle", [-12.0, -5.0, -2.0, 2.0, 5.0, 12.0])
@pytest.mark.parametrize("how", [{}, {"camera_height": CAMERA_HEIGHT}, {"causal": True}])
def test_the_driven_lane_over_a_ramp_is_free(angle: float, how: dict[str, Any]) -> None:
    mapper = GroundMapper()
    off = []
    for view in fit_ground(over_ramp(angle), **how):
        mapper.integrate(view)
        off.append(abs(camera_height(view) - CAMERA_HEIGHT))
    lane = np.stack(np.meshgrid(np.arange(1.2, 22, 0.1), (-0.6, 0.0, 0.6)), axis=-1).reshape(-1, 2)
    assert np.max(mapper.grid.confidence_at(lane)) < 0.01
    assert max(off) < (0.25 if "causal" in how else 0.1)


@pytest.mark.parametrize("angle", [-12.0, 12.0])
def test_a_bare_camera_over_a_ramp_keeps_its_height(angle: float) -> None:
    for view in fit_ground(bare(over_ramp(angle))):
        assert camera_height(view) == pytest.approx(CAMERA_HEIGHT, abs=0.1)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_verge_does_not_lift_or_tilt_the_ground_under_the_wheels(side: float) -> None:
    verge = ((-5.0, 0.4), (-2.0, 0.0)) if side < 0 else ((2.0, 0.0), (5.0, 0.4))
    views = over(Relief(road=ROAD, across=verge), length=8.0)
    for view in fit_ground(views):
        assert view.plane is not None
        assert camera_height(view) == pytest.approx(CAMERA_HEIGHT, abs=0.03)
        wheels = view.plane.height(np.array([(4.0, -1.0, 0.0), (4.0, 1.0, 0.0)]))
        np.testing.assert_allclose(wheels, 0.0, atol=0.05)


def test_a_jump_of_the_poses_does_not_bend_the_ground() -> None:
    views = list(over(Relief(road=ROAD), length=12.0))
    moved = [view.T_map_base.copy() for view in views]
    for pose in moved[8:]:
        pose[2, 3] += 3.0
    jumped = [replace(view, T_map_base=pose) for view, pose in zip(views, moved, strict=True)]
    for view in fit_ground(jumped, camera_height=CAMERA_HEIGHT):
        assert view.plane is not None
        assert view.plane.strip is None


def test_a_robot_that_turns_on_the_spot_and_drives_back_has_level_ground() -> None:
    world = World(bounds=(-12, -12, 12, 12))
    stops = ((0, 0, 0), (4, 0, 0), (4, 0, 180), (0, 0, 180), (3, 0, 180))
    moves = drive(DriveSettings(stops=stops), np.random.default_rng(0))
    landmarks = sample_landmarks(world, np.random.default_rng(1))
    for view in fit_ground(observe(world, landmarks, moves, SENSOR, seed=1)):
        assert camera_height(view) == pytest.approx(CAMERA_HEIGHT, abs=0.05)
