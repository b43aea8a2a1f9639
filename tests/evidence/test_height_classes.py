"""Height classes: nothing is lost, segments are clipped to the obstacle band and the range."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap import GroundPlane, StereoRig, View
from groundmap.arrays import Bools, Floats
from groundmap.errors import NoGroundPlaneError
from groundmap.evidence.ground_plane.height_classes import GroundView, flatten
from groundmap.settings import MapperSettings
from groundmap.view.frames import T_REP103_OPTICAL
from groundmap.view.view import Features
from oracles import in_map
from strategies import level_view, views

OPTIONS = MapperSettings()
STEP, TOP, FAR = OPTIONS.step_height, OPTIONS.robot_height, OPTIONS.max_range


def point_classes(view: View) -> tuple[Floats, dict[str, Bools]]:
    """Positions of points in the map, and the class of each, from the definitions."""
    assert view.plane is not None
    T_base = view.rig.T_base_camera
    base = view.points.xyz @ T_base[:3, :3].T + T_base[:3, 3]
    height = base @ view.plane.normal + view.plane.offset
    map_ = base @ view.T_map_base[:3, :3].T + view.T_map_base[:3, 3]
    up = T_base[:3, :3].T @ view.plane.normal
    sigma = np.sqrt([up @ matrix @ up for matrix in view.points.covariance])
    radius = np.hypot(*(map_ - view.T_map_camera[:3, 3])[:, :2].T)
    tolerance = np.maximum(STEP, 2 * sigma + radius * view.plane.sigma_tilt)
    inside = (radius >= OPTIONS.min_range) & (radius <= FAR)
    classes = {
        "too_near": radius < OPTIONS.min_range,
        "out_of_range": radius > FAR,
        "overhead": inside & (height > TOP),
        "ground": inside & (height <= TOP) & (np.abs(height) <= tolerance),
        "below_ground": inside & (height < -tolerance),
        "obstacle": inside & (height <= TOP) & (height > tolerance),
    }
    return map_[:, :2], classes


@settings(max_examples=100)
@given(views())
def test_features_are_used_or_dropped_by_a_reason(view: View) -> None:
    ground_view = flatten(view, OPTIONS)
    given_features = len(view.points) + len(view.segments) + view.dropped.total()
    assert ground_view.used + ground_view.dropped.total() == given_features
    assert all(count > 0 for count in ground_view.dropped.values())


@settings(max_examples=100)
@given(views())
def test_points_are_sorted_by_height_and_range(view: View) -> None:
    view = replace(view, segments=Features.segments([], []))
    ground_view = flatten(view, OPTIONS)
    xy, classes = point_classes(view)
    np.testing.assert_allclose(
        in_map(ground_view, ground_view.points), xy[classes["obstacle"]], atol=1e-9
    )
    np.testing.assert_allclose(
        in_map(ground_view, ground_view.supports), xy[classes["ground"]], atol=1e-9
    )
    np.testing.assert_allclose(
        in_map(ground_view, ground_view.drop_offs), xy[classes["below_ground"]], atol=1e-9
    )
    reasons = ("too_near", "out_of_range", "overhead", "below_ground")
    expected = Counter({reason: int(classes[reason].sum()) for reason in reasons})
    assert ground_view.dropped == +(view.dropped + expected)


@settings(max_examples=50)
@given(views())
def test_the_covariance_is_that_of_the_place_on_the_ground(view: View) -> None:
    ground_view = flatten(replace(view, segments=Features.segments([], [])), OPTIONS)
    _, classes = point_classes(view)
    rotation = view.T_map_camera[:2, :3]
    turn = np.array(
        [
            (ground_view.forward[0], ground_view.forward[1]),
            (-ground_view.forward[1], ground_view.forward[0]),
        ]
    )
    for found, covariance in zip(
        ground_view.covariance, view.points.covariance[classes["obstacle"]], strict=True
    ):
        expected = turn @ rotation @ covariance @ rotation.T @ turn.T
        np.testing.assert_allclose(found, expected, atol=1e-12)


@settings(max_examples=60)
@given(views())
def test_obstacles_lie_in_the_band_and_in_range(view: View) -> None:
    ground_view = flatten(view, OPTIONS)
    assert (ground_view.heights >= STEP - 1e-9).all()
    assert (ground_view.heights <= TOP + 1e-9).all()
    assert (np.hypot(*ground_view.points.T) <= FAR + 1e-9).all()
    assert ground_view.segments.shape[1] == 2
    np.testing.assert_array_equal(
        ground_view.segments.reshape(-1),
        np.arange(len(ground_view.points) - ground_view.segments.size, len(ground_view.points)),
    )


def test_the_frame_has_its_origin_below_the_camera_and_x_ahead() -> None:
    ground_view = flatten(level_view(points=[(5.0, 2.0, 1.0)], camera_height=1.3), OPTIONS)
    np.testing.assert_allclose(ground_view.points, [(5.0, 2.0)])
    np.testing.assert_allclose(ground_view.heights, [1.0])
    np.testing.assert_allclose(ground_view.forward, (1.0, 0.0))
    assert ground_view.camera_height == pytest.approx(1.3)


@pytest.mark.parametrize(
    ("height", "sigma", "tilt", "obstacle"),
    [
        (0.16, 0.0, 0.0, True),
        (0.14, 0.0, 0.0, False),
        (0.16, 0.1, 0.0, False),  # 2 sigma
        (0.21, 0.1, 0.0, True),
        (0.16, 0.0, 0.02, False),  # 10 m times the tilt
        (0.21, 0.0, 0.02, True),
        (0.29, 0.05, 0.02, False),  # both
        (0.31, 0.05, 0.02, True),
    ],
)
def test_the_tolerance_grows_with_what_is_not_known(
    height: float, sigma: float, tilt: float, obstacle: bool
) -> None:
    view = level_view(points=[(10.0, 0.0, height)], sigma=sigma, sigma_tilt=tilt)
    ground_view = flatten(view, OPTIONS)
    assert (len(ground_view.points), len(ground_view.supports)) == ((1, 0) if obstacle else (0, 1))


def test_what_is_over_the_robot_is_overhead_however_uncertain() -> None:
    ground_view = flatten(level_view(points=[(10.0, 0.0, TOP + 0.1)], sigma=1.5), OPTIONS)
    assert ground_view.dropped == Counter(overhead=1)
    assert ground_view.used == len(ground_view.points) == len(ground_view.supports) == 0


def clipped(first: tuple[float, float, float], last: tuple[float, float, float]) -> GroundView:
    return flatten(level_view(segments=[[first, last]]), OPTIONS)


def test_a_segment_that_rises_from_the_ground_starts_at_the_step() -> None:
    ground_view = clipped((4.0, -1.0, 0.0), (4.0, 1.0, 1.0))
    np.testing.assert_allclose(ground_view.heights, [STEP, 1.0])
    np.testing.assert_allclose(ground_view.points, [(4.0, -1.0 + 2.0 * STEP), (4.0, 1.0)])
    assert ground_view.segments.tolist() == [[0, 1]]
    assert ground_view.used == 1


def test_the_part_on_the_ground_supports_freespace() -> None:
    ground_view = clipped((4.0, -1.0, 0.0), (4.0, 1.0, 1.0))
    np.testing.assert_allclose(ground_view.supports[0], (4.0, -1.0))
    np.testing.assert_allclose(ground_view.supports[-1], (4.0, -1.0 + 2.0 * STEP))
    assert (np.abs(ground_view.support_heights) <= STEP + 1e-12).all()
    steps = np.hypot(*np.diff(ground_view.supports, axis=0).T)
    assert (steps <= OPTIONS.support_width + 1e-12).all()


def test_a_segment_that_leaves_the_band_ends_at_the_robots_height() -> None:
    ground_view = clipped((4.0, -1.0, 1.0), (4.0, 1.0, 3.0))
    np.testing.assert_allclose(ground_view.heights, [1.0, TOP])
    np.testing.assert_allclose(ground_view.points, [(4.0, -1.0), (4.0, 0.0)])


def test_a_segment_through_the_whole_band_is_clipped_at_both_ends() -> None:
    ground_view = clipped((4.0, 0.0, 4.0), (4.0, 5.0, -1.0))
    np.testing.assert_allclose(ground_view.heights, [TOP, STEP])
    np.testing.assert_allclose(ground_view.points, [(4.0, 2.0), (4.0, 4.0 - STEP)])


@settings(max_examples=60)
@given(st.floats(-0.5, 3.0), st.floats(-0.5, 3.0))
def test_a_clipped_segment_stays_on_its_line_and_in_the_band(low: float, high: float) -> None:
    ground_view = clipped((4.0, -2.0, low), (6.0, 2.0, high))
    places = np.linspace(0.0, 1.0, 2001)
    height = low + places * (high - low)
    inside = (height > STEP) & (height <= TOP)
    assert ground_view.used + ground_view.dropped.total() == 1
    if inside.sum() > 1:
        along = (ground_view.points[:, 0] - 4.0) / 2.0
        np.testing.assert_allclose(np.sort(along), places[inside][[0, -1]], atol=1e-3)
        np.testing.assert_allclose(ground_view.heights, low + along * (high - low), atol=1e-9)
        np.testing.assert_allclose(ground_view.points[:, 1], 4.0 * along - 2.0, atol=1e-9)


@pytest.mark.parametrize(
    ("low", "high", "interval"),
    [(0.3, 1.2, (0.3, 1.2)), (-0.5, 1.2, (STEP, 1.2)), (0.0, 5.0, (STEP, TOP))],
)
def test_a_vertical_segment_is_one_place_with_a_height_interval(
    low: float, high: float, interval: tuple[float, float]
) -> None:
    ground_view = clipped((5.0, 1.0, low), (5.0, 1.0, high))
    np.testing.assert_allclose(ground_view.points, [(5.0, 1.0), (5.0, 1.0)], atol=1e-12)
    np.testing.assert_allclose(ground_view.heights, interval)
    assert ground_view.used == 1


def test_a_segment_without_length_is_dropped_and_counted() -> None:
    ground_view = clipped((5.0, 1.0, 0.8), (5.0, 1.0, 0.8))
    assert len(ground_view.points) == ground_view.used == 0
    assert ground_view.dropped.total() == 1


@pytest.mark.parametrize(
    ("low", "high", "reason"), [(2.1, 3.0, "overhead"), (-1.0, -0.3, "below_ground")]
)
def test_segments_outside_the_bands_are_dropped_by_reason(
    low: float, high: float, reason: str
) -> None:
    ground_view = clipped((5.0, -1.0, low), (5.0, 1.0, high))
    assert ground_view.dropped == Counter({reason: 1})
    assert len(ground_view.points) == len(ground_view.supports) == ground_view.used == 0
    assert len(ground_view.drop_offs) == (reason == "below_ground")


def test_pieces_carry_the_number_of_their_feature() -> None:
    rising = [(4.0, -1.0, 0.0), (4.0, 1.0, 1.0)]
    wall = [(8.0, -1.0, 0.5), (8.0, 1.0, 0.5)]
    places = [(5.0, 0.0, 3.0), (6.0, 0.0, 0.0), (7.0, 0.0, 1.0)]
    ground_view = flatten(level_view(points=places, segments=[rising, wall]), OPTIONS)
    count = len(ground_view.points)
    assert ground_view.feature[:count].tolist() == [2, 3, 3, 4, 4]
    assert ground_view.feature[count] == 1
    assert set(ground_view.feature[count + 1 :].tolist()) == {3}
    assert len(ground_view.feature) == count + len(ground_view.supports)


def test_a_segment_below_the_ground_never_supports_freespace() -> None:
    ground_view = clipped((4.0, 0.0, 0.0), (6.0, 0.0, -1.0))
    np.testing.assert_allclose(ground_view.supports[:, 0].max(), 4.0 + 2.0 * STEP)


def test_a_segment_that_crosses_the_range_is_clipped_to_it() -> None:
    ground_view = clipped((10.0, 0.0, 0.5), (30.0, 0.0, 1.5))
    np.testing.assert_allclose(ground_view.points, [(10.0, 0.0), (FAR, 0.0)], atol=1e-9)
    np.testing.assert_allclose(ground_view.heights, [0.5, 1.0])


def test_a_segment_with_both_ends_out_of_range_keeps_what_is_inside() -> None:
    ground_view = clipped((12.0, -30.0, 1.0), (12.0, 30.0, 1.0))
    half = np.sqrt(FAR**2 - 12.0**2)
    np.testing.assert_allclose(ground_view.points, [(12.0, -half), (12.0, half)])


@pytest.mark.parametrize("ends", [((21.0, -3.0), (21.0, 3.0)), ((5.0, 30.0), (8.0, 40.0))])
def test_a_segment_out_of_range_is_dropped(
    ends: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    ground_view = clipped((*ends[0], 1.0), (*ends[1], 1.0))
    assert ground_view.dropped == Counter(out_of_range=1)
    assert len(ground_view.points) == 0


def test_points_out_of_range_are_dropped_by_reason() -> None:
    view = level_view(points=[(0.2, 0.0, 0.5), (25.0, 0.0, 0.5), (5.0, 0.0, 0.5)])
    ground_view = flatten(view, OPTIONS)
    assert ground_view.dropped == Counter(too_near=1, out_of_range=1)
    assert ground_view.used == len(ground_view.points) == 1


def test_a_view_without_a_ground_plane_is_refused() -> None:
    view = replace(level_view(points=[(5.0, 0.0, 0.5)]), plane=None)
    with pytest.raises(NoGroundPlaneError, match="the view has no ground plane"):
        flatten(view, OPTIONS)


@pytest.mark.parametrize(("degrees", "looks"), [(70.0, "ground"), (-70.0, "sky")])
def test_a_camera_that_looks_at_the_ground_or_the_sky_is_refused(
    degrees: float, looks: str
) -> None:
    turn = np.radians(degrees)
    pitch = np.eye(4)
    pitch[1:3, 1:3] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    view = replace(level_view(points=[(5.0, 0.0, 0.5)]), T_map_base=T_REP103_OPTICAL @ pitch)
    with pytest.raises(NoGroundPlaneError, match=f"the camera looks at the {looks}"):
        flatten(view, OPTIONS)


@settings(max_examples=50)
@given(views())
def test_features_below_the_ground_keep_their_height(view: View) -> None:
    view = replace(view, segments=Features.segments([], []))
    assert view.plane is not None
    ground_view = flatten(view, OPTIONS)
    _, classes = point_classes(view)
    T_base = view.rig.T_base_camera
    base = view.points.xyz[classes["below_ground"]] @ T_base[:3, :3].T + T_base[:3, 3]
    height = base @ view.plane.normal + view.plane.offset
    np.testing.assert_allclose(ground_view.drop_off_heights, height, atol=1e-9)
    assert (ground_view.drop_off_heights < 0).all()


def test_a_segment_below_the_ground_counts_by_its_middle() -> None:
    ground_view = clipped((5.0, -1.0, -1.0), (5.0, 2.0, -0.4))
    np.testing.assert_allclose(ground_view.drop_offs, [(5.0, 0.5)])
    np.testing.assert_allclose(ground_view.drop_off_heights, [-0.7])


def test_a_drop_off_is_as_sure_as_it_is_deep() -> None:
    # At 5 m, 0.15 m + 0.02 * 5 m is a hollow; another step deeper it is sure.
    for depth, sureness in ((0.2, 0.0), (0.25, 0.0), (0.31, 0.4), (0.4, 1.0), (2.0, 1.0)):
        ground_view = flatten(level_view(points=[(5.0, 0.0, -depth)]), OPTIONS)
        np.testing.assert_allclose(ground_view.drop_off_sureness, [sureness], atol=1e-6)
        assert ground_view.dropped == {"below_ground": 1}


@pytest.mark.parametrize(("cx", "border"), [(640.0, 640.0 / 700.0), (0.0, np.inf), (-3.0, np.inf)])
def test_the_images_borders_are_those_of_the_rig(cx: float, border: float) -> None:
    view = level_view(points=[(5.0, 0.0, 0.5)])
    ground_view = flatten(replace(view, rig=replace(view.rig, cx=cx)), OPTIONS)
    assert ground_view.border == pytest.approx(border)
    assert ground_view.baseline == view.rig.baseline


def test_a_view_without_features_is_empty() -> None:
    ground_view = flatten(level_view(), OPTIONS)
    assert [
        len(part) for part in (ground_view.points, ground_view.supports, ground_view.drop_offs)
    ] == [0, 0, 0]
    assert ground_view.used == ground_view.dropped.total() == len(ground_view.base) == 0


def test_the_base_is_where_the_pose_is() -> None:
    # The camera sits 0.5 m ahead of the base and 0.2 m left of it, and looks ahead.
    mount = np.array([[0, 0, 1, 0.5], [-1, 0, 0, 0.2], [0, -1, 0, 1.0], [0, 0, 0, 1.0]])
    rig = StereoRig(fx=700.0, fy=700.0, cx=640.0, cy=360.0, baseline=0.12, T_base_camera=mount)
    turned = np.array([[0, -1.0, 0, 3], [1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])
    ground = [(640.0, 619.0, 535.0)]  # disparity 21 pixels: 4 m ahead, 1 m below
    view = View.from_pixels(turned, rig, points_px=ground)
    ground_view = flatten(view.with_plane(GroundPlane.below_camera(rig, 1.0)), OPTIONS)
    np.testing.assert_allclose(ground_view.base, [(-0.5, -0.2)], atol=1e-12)
    np.testing.assert_allclose(in_map(ground_view, ground_view.base), [(3.0, 4.0)], atol=1e-12)
