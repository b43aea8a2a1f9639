"""The simulated rig: its description triangulates projected places back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from groundmap.simulate.drive import to_transforms
from groundmap.simulate.sensor import NEAREST, SensorSettings
from strategies import rngs


@st.composite
def sensors(draw: st.DrawFn) -> SensorSettings:
    rng = draw(rngs())
    return SensorSettings(
        fx=rng.uniform(300.0, 900.0),
        baseline=rng.uniform(0.05, 1.0),
        camera_height=rng.uniform(0.3, 2.0),
        camera_forward=rng.uniform(-0.5, 0.5),
        pitch=rng.uniform(-0.5, 0.5),
        max_range=rng.uniform(5.0, 30.0),
    )


def pose_of(rng: np.random.Generator) -> Floats:
    pose: Floats = to_transforms(rng.uniform((-9, -9, -np.pi), (9, 9, np.pi))[None])[0]
    return pose


def pinhole(sensor: SensorSettings, pose: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return the pixels of places, and right, down and depth, by the axes of the camera."""
    heading = pose[:3, 0]
    eye = pose[:3, 3] + sensor.camera_forward * heading + (0.0, 0.0, sensor.camera_height)
    up = np.array([0.0, 0.0, 1.0])
    cos, sin = np.cos(sensor.pitch), np.sin(sensor.pitch)
    forward = cos * heading - sin * up
    down = -sin * heading - cos * up
    right = np.cross(heading, up)
    own = (places - eye) @ np.stack([right, down, forward], axis=1)
    x, y, z = own.T
    left_px = sensor.width_px / 2 + sensor.fx * x / z
    right_px = sensor.width_px / 2 + sensor.fx * (x - sensor.baseline) / z
    return np.stack([left_px, right_px, sensor.height_px / 2 + sensor.fx * y / z], axis=1), own


@given(sensors(), rngs())
def test_projection_is_that_of_a_pinhole_camera(
    sensor: SensorSettings, rng: np.random.Generator
) -> None:
    pose, places = pose_of(rng), rng.uniform((-15, -15, -1), (15, 15, 3), (200, 3))
    pixels, seen = sensor.project(pose, places)
    expected, own = pinhole(sensor, pose, places)
    right, _, depth = own.T
    inside = (depth > NEAREST) & (np.hypot(right, depth) < sensor.max_range)
    for column in (expected[:, 0], expected[:, 1]):
        inside &= (column >= 0) & (column <= sensor.width_px)
    inside &= (expected[:, 2] >= 0) & (expected[:, 2] <= sensor.height_px)
    np.testing.assert_array_equal(seen, inside)
    np.testing.assert_allclose(pixels[seen], expected[seen], atol=1e-8)


@given(sensors(), rngs())
def test_projected_places_triangulate_back(
    sensor: SensorSettings, rng: np.random.Generator
) -> None:
    pose, places = pose_of(rng), rng.uniform((-15, -15, -1), (15, 15, 3), (200, 3))
    pixels, seen = sensor.project(pose, places)
    back = sensor.rig.triangulate(pixels[seen])
    assert back.kept.all()
    T_map_camera = pose @ sensor.rig.T_base_camera
    in_map = back.xyz @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    np.testing.assert_allclose(in_map, places[seen], atol=1e-9, rtol=0)


def ahead(places: list[tuple[float, float, float]], **options: Any) -> list[bool]:
    sensor = SensorSettings(pitch=0.0, camera_height=1.0, fx=640.0, **options)
    found: list[bool] = sensor.project(np.eye(4), np.array(places))[1].tolist()
    return found


def test_places_in_one_image_only_are_not_seen() -> None:
    # 1280 px at f = 640 px: 45 degrees to both sides; the right camera is 0.5 m to the right.
    at_left_rim = [(5.0, 4.51, 1.0), (5.0, 4.49, 1.0)]  # 4.5 m left of the left, 5 m of the right
    at_right_rim = [(5.0, -5.01, 1.0), (5.0, -4.99, 1.0)]
    assert ahead([*at_left_rim, *at_right_rim], baseline=0.5) == [False, True, False, True]


def test_places_above_below_behind_too_near_or_too_far_are_not_seen() -> None:
    up = 5.0 * 360.0 / 640.0
    assert ahead([(5.0, 0.0, 1.0 + up + 0.01), (5.0, 0.0, 1.0 + up - 0.01)]) == [False, True]
    assert ahead([(5.0, 0.0, 1.0 - up - 0.01), (5.0, 0.0, 1.0 - up + 0.01)]) == [False, True]
    assert ahead([(-5.0, 0.0, 1.0), (0.0, 0.0, 1.0)]) == [False, False]
    assert ahead([(0.19, -0.05, 1.0), (0.21, -0.05, 1.0)], baseline=0.05) == [False, True]
    assert ahead([(9.99, 0.0, 1.0), (10.01, 0.0, 1.0)], max_range=10.0) == [True, False]


def test_a_camera_pitched_down_sees_nearer_ground() -> None:
    pixels, _ = SensorSettings(pitch=0.2).project(np.eye(4), np.array([(1 / np.tan(0.2), 0, 0.0)]))
    np.testing.assert_allclose(pixels[0, [0, 2]], (640.0, 360.0), atol=1e-9)


def test_no_places_project_to_no_pixels() -> None:
    pixels, seen = SensorSettings().project(np.eye(4), np.empty((0, 3)))
    assert (pixels.shape, seen.shape) == ((0, 3), (0,))


@pytest.mark.parametrize(
    ("options", "claimed"),
    [
        ({"pixel_noise_px": 0.3}, 0.3),
        ({"pixel_noise_px": 0.3, "assumed_noise_px": 0.8}, 0.8),
        ({"pixel_noise_px": 0.0}, 1e-3),  # a rig without any is refused
    ],
)
def test_the_default_noise_of_the_rig_is_the_true_one(
    options: dict[str, Any], claimed: float
) -> None:
    assert SensorSettings(**options).rig.pixel_noise_px == claimed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fx": 0.0}, r"^fx: expected greater than 0"),
        ({"baseline": -0.1}, r"^baseline: expected greater than 0"),
        ({"width_px": 0}, r"^width_px: expected greater than 0"),
        ({"camera_height": 0.0}, r"^camera_height: expected greater than 0"),
        ({"max_points": -1}, r"^max_points: expected greater than or equal to 0"),
        ({"pitch": float("nan")}, r"^pitch: expected a finite number"),
        ({"assumed_noise_px": 0.0}, r"^assumed_noise_px: expected greater than 0"),
        ({"basline": 0.5}, r"^basline: expected a setting of SensorSettings, .*'baseline'\?"),
        ({"mising": 0.5}, r"Did you mean 'missing'\?"),  # the matcher's are the sensor's, too
    ],
)
def test_an_invalid_sensor_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        SensorSettings(**options)
