"""Scale and level of logs, measured on a known scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.io import read_views
from groundmap.io.align import ScalePoints, align
from groundmap.io.log import ViewLog
from sparse_scene import colmap_binary, make_scene


def log_of(folder: Path, *, tilt_degrees: float = 0.0, views: int = 12) -> ViewLog:
    scene = make_scene(views=views, landmarks=300, tilt=np.radians(tilt_degrees))
    folder.mkdir()
    for name, data in colmap_binary(scene).items():
        (folder / name).write_bytes(data)
    return read_views(folder)


@pytest.mark.parametrize("tilt", [0, 10, 20, 40, 120])
def test_a_tilted_world_is_turned_until_its_ground_is_level(tmp_path: Path, tilt: int) -> None:
    views = align(log_of(tmp_path / "map", tilt_degrees=tilt))
    assert views.ground is not None
    assert views.ground.camera_height == pytest.approx(1.5, abs=1e-4)
    first, *_, last = views
    npt.assert_allclose(first.T_map_camera[:3, 2], (1, 0, 0), atol=1e-3)
    npt.assert_allclose(last.T_map_camera[2, 2], 0.0, atol=1e-3)
    heights = (first.points.xyz @ first.T_map_camera[:3, :3].T)[:, 2]
    assert heights.min() == pytest.approx(-1.5, rel=1e-3)


def test_the_height_of_the_camera_gives_the_scale(tmp_path: Path) -> None:
    views = align(log_of(tmp_path / "map", tilt_degrees=30), camera_height=3.0)
    assert views.similarity.scale == pytest.approx(2.0, rel=1e-4)
    raw, scaled = next(iter(views.log)), next(iter(views))
    npt.assert_allclose(scaled.points.xyz, views.similarity.scale * raw.points.xyz, rtol=1e-9)
    npt.assert_allclose(scaled.points.covariance, 4.0 * raw.points.covariance, rtol=1e-4)
    assert scaled.rig.baseline == pytest.approx(2.0 * raw.rig.baseline, rel=1e-4)


@pytest.mark.parametrize(
    ("points", "scale"),
    [
        (ScalePoints("front/0.png", "front/10.png", 4.0), 0.5),
        (ScalePoints("0,0,0", "0,3,4", 1.0), 0.2),
    ],
)
def test_two_places_and_their_distance_give_the_scale(
    tmp_path: Path, points: ScalePoints, scale: float
) -> None:
    views = align(log_of(tmp_path / "map"), scale_points=points)
    assert views.similarity.scale == pytest.approx(scale, rel=2e-3)


def test_ids_of_landmarks_are_places(tmp_path: Path) -> None:
    scene = make_scene(views=12, landmarks=300)
    apart = float(np.linalg.norm(scene.landmarks[0] - scene.landmarks[5]))
    points = ScalePoints(str(scene.ids[0]), str(scene.ids[5]), 2.0)
    views = align(log_of(tmp_path / "map"), scale_points=points)
    assert views.similarity.scale == pytest.approx(2.0 / apart)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale": 0.0}, "scale: expected a number above 0, got 0.0"),
        ({"scale": 1.0, "camera_height": 1.0}, "one option .*, got scale and camera_height"),
        ({"scale_points": ScalePoints("a", "1,2,3", 1.0)}, "scale_points: .* got 'a'"),
        ({"scale_points": ScalePoints("9", "1,2,3", 1.0)}, "scale_points: .* got '9'"),
        ({"scale_points": ScalePoints("1,2,3", "1,2,3", 1.0)}, "two different places"),
        ({"scale_points": ScalePoints("1,2,3", "1,2,4", -1.0)}, "distance: expected .* above 0"),
    ],
)
def test_invalid_scales_are_refused(
    tmp_path: Path, options: dict[str, object], message: str
) -> None:
    log = log_of(tmp_path / "map", views=3)
    with pytest.raises(InputError, match=message):
        align(log, **options)  # type: ignore[arg-type]


def test_a_camera_height_needs_ground(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    scene = make_scene(views=3, landmarks=9)
    folder.mkdir()
    for name, data in colmap_binary(scene).items():
        (folder / name).write_bytes(data)
    with pytest.raises(NoGroundPlaneError, match=r"give the scale by --scale or --scale-points"):
        align(read_views(folder), camera_height=1.0)
