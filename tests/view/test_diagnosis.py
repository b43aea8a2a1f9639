"""Likely mistakes in logs: each is named, and a log without one gives no false alarm."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import files
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

from groundmap import Features, StereoRig, View, fit_ground, read_views
from groundmap.arrays import Floats
from groundmap.errors import NoGroundPlaneError
from groundmap.view.diagnosis import SAMPLE, likely_mistakes
from groundmap.view.frames import T_REP103_OPTICAL, invert, map_from_world

SHARED = Path(__file__).parents[3] / "shared" / "data"
LOGS = [SHARED / name for name in ("kitti00_vo", "kitti_raw_vo", "kitti06_features")]
RIG = StereoRig(fx=700.0, fy=700.0, cx=620.0, cy=190.0, baseline=0.54)
MOUNT = T_REP103_OPTICAL.copy()
MOUNT[:3, 3] = 0.4, 0.1, 1.6


def camera_poses(views: int = 8) -> list[Floats]:
    """Return optical poses of a camera that drives a gentle left turn, in an optical world."""
    poses = []
    for number in range(views):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("y", -0.03 * number).as_matrix()
        pose[:3, 3] = -0.05 * number**2, 0.0, 1.2 * number
        poses.append(pose)
    return poses


def pixels_of(pose: Floats, rig: StereoRig = RIG) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return (uL, uR, v) and ids of the landmarks of a street, as seen from an optical pose."""
    rng = np.random.default_rng(5)
    ground = np.column_stack([rng.uniform(-6, 6, 900), np.full(900, 1.6), rng.uniform(3, 40, 900)])
    walls = np.column_stack(
        [rng.choice([-6.0, 6.0], 400), rng.uniform(-2, 1.6, 400), rng.uniform(3, 40, 400)]
    )
    world = np.concatenate([ground, walls])
    xyz = world @ invert(pose)[:3, :3].T + invert(pose)[:3, 3]
    scale = rig.fx / np.where(xyz[:, 2] > 2, xyz[:, 2], np.nan)
    pixels = np.column_stack(
        [
            xyz[:, 0] * scale + rig.cx,
            (xyz[:, 0] - rig.baseline) * scale + rig.cx,
            xyz[:, 1] * scale + rig.cy,
        ]
    )
    seen = (pixels > 0).all(axis=1) & (pixels < (2 * rig.cx, 2 * rig.cx, 2 * rig.cy)).all(axis=1)
    return pixels[seen], np.flatnonzero(seen)


def street(
    *,
    poses: Callable[[Floats], Floats] = lambda pose: map_from_world(pose, "optical"),
    rig: StereoRig = RIG,
    pixels: Callable[[Floats], Floats] = lambda pixels: pixels,
    ids: bool = True,
) -> list[View]:
    """Return the views of the drive with a mistake in its poses, its rig or its features."""
    views = []
    for pose in camera_poses():
        seen, landmarks = pixels_of(pose)
        views.append(
            View.from_pixels(
                poses(pose), rig, points_px=pixels(seen), point_ids=landmarks if ids else None
            )
        )
    return views


def read_w_first(pose: Floats) -> Floats:
    """Return the pose as read from a file with quaternions w x y z instead of x y z w."""
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    wrong = pose.copy()
    wrong[:3, :3] = Rotation.from_quat([w, x, y, z]).as_matrix()
    return wrong


def in_millimetres(pose: Floats) -> Floats:
    scaled = pose.copy()
    scaled[:3, 3] *= 1000.0
    return scaled


def base_pose(camera: Floats) -> Floats:
    """Return the pose of ``base_link`` in the map under an optical pose of the mounted camera."""
    return map_from_world(camera, "optical") @ invert(MOUNT)


MOUNTED = replace(RIG, T_base_camera=MOUNT)
W_FIRST, INVERTED = "order w x y z", "transform world to camera coordinates"
# A change of the poses, the rig, the reported cause, and whether its diagnosis needs landmark ids.
POSES: list[tuple[Callable[[Floats], Floats], StereoRig, str, bool]] = [
    (lambda pose: map_from_world(read_w_first(pose), "optical"), RIG, W_FIRST, False),
    (lambda pose: read_w_first(base_pose(pose)), MOUNTED, W_FIRST, False),
    (lambda pose: map_from_world(invert(pose), "optical"), RIG, INVERTED, True),
    (lambda pose: invert(base_pose(pose)), MOUNTED, INVERTED, True),
    (lambda pose: map_from_world(in_millimetres(pose), "optical"), RIG, "in millimetres", True),
    (
        lambda pose: map_from_world(map_from_world(pose, "optical"), "optical"),
        RIG,
        r"may be 'rep103' \(.*, not 'optical'",
        False,
    ),
    (lambda pose: pose, RIG, r"may be 'optical' \(.*, not 'rep103'", False),
    (base_pose, replace(RIG, T_base_camera=invert(MOUNT)), "T_base_camera may be inverted", True),
    (lambda pose: map_from_world(pose, "optical"), MOUNTED, "may be those of the camera", False),
]


@pytest.mark.parametrize(("poses", "rig", "cause", "needs_ids"), POSES)
@pytest.mark.parametrize("ids", [True, False])
def test_a_mistake_in_the_poses_is_the_only_cause_named(
    poses: Callable[[Floats], Floats], rig: StereoRig, cause: str, needs_ids: bool, ids: bool
) -> None:
    mistakes = likely_mistakes(street(poses=poses, rig=rig, ids=ids))
    if needs_ids and not ids:
        assert mistakes == []  # the poses alone are plausible
    else:
        assert len(mistakes) == 1
        assert mistakes[0].startswith("Likely cause: ")
        assert " Or " not in mistakes[0]
        assert re.search(cause, mistakes[0])


@pytest.mark.parametrize("how", [{}, {"camera_height": 1.6}])
def test_fit_ground_names_the_likely_cause_of_poses_that_it_refuses(
    how: dict[str, float],
) -> None:
    views = street(poses=POSES[0][0], ids=False)
    message = r"^view 0: up of the base is 180 degrees off .* Likely cause: the quaternions"
    with pytest.raises(NoGroundPlaneError, match=message):
        list(fit_ground(views, camera_height=how.get("camera_height")))


def test_a_causal_fit_does_not_wait_for_more_views_to_name_the_cause() -> None:
    def first_then_fail() -> Iterator[View]:
        yield street(poses=POSES[0][0])[0]
        raise AssertionError("the next view was requested")

    with pytest.raises(NoGroundPlaneError, match="Likely cause: the quaternions"):
        list(fit_ground(first_then_fail(), causal=True))


FEATURES: list[tuple[Callable[[Floats], Floats], StereoRig, str]] = [
    (lambda px: px[:, [1, 0, 2]], RIG, r"uL - uR is not above 0 in .* swapped"),
    (lambda px: px[:, [2, 2, 0]], RIG, r"columns \(u\) and rows \(v\)"),
    (lambda px: px, replace(RIG, baseline=RIG.baseline * RIG.fx), r"fx times .* would be 0\.54 m"),
    (lambda px: px, replace(RIG, baseline=540.0), r"or in millimetres \(0\.54 m\)"),
    (lambda px: px, replace(RIG, fx=4.0, fy=4.0), "focal length may be in millimetres"),
    (lambda px: px / RIG.fx, RIG, "may be normalised: expected pixels"),
    (lambda px: (px - (RIG.cx, RIG.cx, RIG.cy)) / RIG.fx, RIG, "may be normalised"),
    (lambda px: px, replace(RIG, cx=RIG.cy, cy=RIG.cx), "cx and cy may be swapped"),
]


@pytest.mark.parametrize(("pixels", "rig", "cause"), FEATURES)
def test_a_mistake_in_features_or_rig_is_named(
    pixels: Callable[[Floats], Floats], rig: StereoRig, cause: str
) -> None:
    views = street(pixels=pixels, rig=rig)
    (mistake,) = likely_mistakes(views)
    assert re.search(cause, mistake)


@pytest.mark.parametrize(("pixels", "rig", "cause"), FEATURES[:4])
def test_fit_ground_counts_what_was_dropped_and_names_the_cause_instead_of_asking_for_a_height(
    pixels: Callable[[Floats], Floats], rig: StereoRig, cause: str
) -> None:
    message = (
        rf"the 0 features of 6 views \(dropped: [\d,]+ (no_disparity|out_of_range)\): .*{cause}"
    )
    with pytest.raises(NoGroundPlaneError, match=message) as caught:
        list(fit_ground(street(pixels=pixels, rig=rig)))
    assert "camera_height" not in str(caught.value)


@pytest.mark.parametrize(
    ("axes", "scale", "cause"),
    [([2, 0, 1], -1.0, "XYZ may have other axes"), ([0, 1, 2], 1000.0, "in another unit")],
)
def test_a_mistake_in_xyz_is_named(axes: list[int], scale: float, cause: str) -> None:
    views = []
    for view in street():
        xyz = view.points.xyz[:, axes] * scale
        features = Features.points(xyz, view.points.covariance)
        views.append(View(T_map_base=view.T_map_base, rig=RIG, points=features))
    (mistake,) = likely_mistakes(views)
    assert re.search(cause, mistake)


@pytest.mark.parametrize("rig", [RIG, MOUNTED])
@pytest.mark.parametrize("ids", [True, False])
def test_a_log_without_mistake_gives_no_alarm(rig: StereoRig, ids: bool) -> None:
    poses = base_pose if rig is MOUNTED else lambda pose: map_from_world(pose, "optical")
    assert likely_mistakes(street(poses=poses, rig=rig, ids=ids)) == []


def test_a_camera_that_stands_still_or_reverses_gives_no_alarm() -> None:
    assert likely_mistakes(street()[:1] * 8) == []
    assert likely_mistakes(street()[::-1]) == []


def test_ids_that_number_the_features_of_each_view_give_no_alarm() -> None:
    views = street()
    for number, view in enumerate(views):
        points = replace(view.points, ids=np.arange(len(view.points)))
        views[number] = replace(view, points=points)
    assert likely_mistakes(views) == []


@pytest.mark.parametrize("views", [[], street()[:1]])
def test_an_empty_log_and_a_single_view_give_no_alarm(views: list[View]) -> None:
    assert likely_mistakes(views) == []


def test_the_bundled_log_gives_no_alarm() -> None:
    demo = read_views(str(files("planners") / "demo_data"))
    assert likely_mistakes(list(islice(demo, SAMPLE))) == []


@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.name)
def test_recorded_logs_give_no_alarm(path: Path) -> None:
    if not path.is_dir():
        pytest.skip(f"no recorded log in {path}")
    assert likely_mistakes(list(islice(read_views(path), SAMPLE))) == []
