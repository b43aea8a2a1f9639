"""Ground fitting on synthetic roads: the fitted planes, the views read, and the refused input."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from groundmap import Features, GroundMapper, GroundPlane, StereoRig, View, fit_ground
from groundmap.arrays import Floats
from groundmap.errors import InputError, NoGroundPlaneError, SettingsError
from groundmap.view.frames import T_REP103_OPTICAL, invert

RIG = StereoRig(fx=700.0, fy=700.0, cx=620.0, cy=190.0, baseline=0.54)


def pose_at(x: float, y: float = 0.0, yaw: float = 0.0) -> Floats:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    pose[:3, 3] = x, y, 0.0
    return pose


def look(rng: np.random.Generator, xyz: Floats, *, noise_px: float = 0.3) -> Features:
    """Return the features of points in the camera frame, from noisy pixels."""
    x, y, z = xyz.T
    scale = RIG.fx / z
    pixels = np.stack([x * scale + RIG.cx, (x - RIG.baseline) * scale + RIG.cx, y * scale + RIG.cy])
    seen = RIG.triangulate(pixels.T + rng.normal(0.0, noise_px, (len(xyz), 3)))
    return Features.points(seen.xyz, seen.covariance)


def street(rng: np.random.Generator, camera: Floats, ground: Floats, n: int) -> Features:
    """Return 55 % road, 40 % walls, cars and poles on it, and 5 % outliers all over.

    `camera` and `ground` take from the camera and from a frame on the ground (z its normal,
    origin below the camera) to the map.
    """
    n_road, n_wall = int(0.55 * n), int(0.4 * n)
    road = np.column_stack([rng.uniform(2, 18, n_road), rng.uniform(-6, 6, n_road)])
    side = rng.choice([-7.0, -2.5, 4.0, 8.0], n_wall) + rng.normal(0, 0.05, n_wall)
    walls = np.column_stack([rng.uniform(2, 18, n_wall), side])
    outliers = rng.uniform((2, -8, -3), (18, 8, 4), (n - n_road - n_wall, 3))
    on_ground = np.concatenate(
        [
            np.column_stack([road, rng.normal(0, 0.01, n_road)]),
            np.column_stack([walls, rng.uniform(0.0, 2.5, n_wall)]),
            outliers,
        ]
    )
    T_camera_ground = invert(camera) @ ground
    in_camera = on_ground @ T_camera_ground[:3, :3].T + T_camera_ground[:3, 3]
    return look(rng, in_camera[in_camera[:, 2] > 1.0])


def drive(
    *,
    pitch: float = 0.0,
    roll: float = 0.0,
    height: float = 1.6,
    n_views: int = 11,
    n_features: int = 200,
    seed: int = 0,
) -> list[View]:
    """Return views of a bare camera, a metre apart, over ground that is tilted against it."""
    rng = np.random.default_rng(seed)
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_euler("xy", (roll, pitch), degrees=True).as_matrix()
    views = []
    for number in range(n_views):
        # The camera keeps its angles to the ground and its height above it.
        base = tilt @ pose_at(float(number), yaw=0.02 * number) @ invert(tilt)
        below = np.eye(4)
        below[2, 3] = -height
        ground = base @ tilt @ below
        camera = base @ T_REP103_OPTICAL
        features = street(rng, camera, ground, n_features)
        views.append(View(T_map_base=camera, rig=RIG, points=features, timestamp=float(number)))
    return views


def tilt_between(normal: Floats, expected: Floats) -> float:
    """Return the angle between two unit vectors [deg]."""
    return float(np.degrees(2 * np.arcsin(np.linalg.norm(normal - expected) / 2)))


def plane_of(view: View) -> GroundPlane:
    assert view.plane is not None
    return view.plane


def same(one: GroundPlane, other: GroundPlane, *, atol: float = 0.0) -> bool:
    pairs = ((one.normal, other.normal), (one.offset, other.offset))
    close = all(np.allclose(a, b, rtol=0.0, atol=atol) for a, b in pairs)
    return close and one.support == other.support


def emptied(view: View) -> View:
    return View(T_map_base=view.T_map_base, rig=view.rig, timestamp=view.timestamp)


@given(
    st.floats(-5, 5), st.floats(-4, 4), st.floats(0.8, 2.2), st.booleans(),
    st.integers(0, 2**32 - 1),
)  # fmt: skip
@settings(max_examples=25)
def test_a_tilted_road_is_found_among_obstacles_and_outliers(
    pitch: float, roll: float, height: float, causal: bool, seed: int
) -> None:
    views = drive(pitch=pitch, roll=roll, height=height, seed=seed)
    tilt = Rotation.from_euler("xy", (roll, pitch), degrees=True).as_matrix()
    normal = T_REP103_OPTICAL[:3, :3].T @ tilt[:, 2]  # in the frame of a bare camera
    fitted = list(fit_ground(views, causal=causal))
    # A causal window of the first views holds less than promised to be enough.
    for view in fitted[5:]:
        plane = plane_of(view)
        assert tilt_between(plane.normal, normal) < 0.5
        assert plane.offset == pytest.approx(height, abs=0.03)
        assert plane.support > 0


def test_sigma_tilt_covers_the_real_error_and_is_not_below_its_floor() -> None:
    for view in fit_ground(drive(pitch=2.0, seed=4)):
        plane = plane_of(view)
        normal = T_REP103_OPTICAL[:3, :3].T @ Rotation.from_euler("y", 2, degrees=True).as_matrix()
        assert 0.005 <= plane.sigma_tilt < 0.02
        assert np.radians(tilt_between(plane.normal, normal[:, 2])) < 2 * plane.sigma_tilt


@given(st.floats(-np.pi, np.pi), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-50, 50))
@settings(max_examples=15)
def test_turning_and_shifting_the_map_does_not_change_the_planes(
    yaw: float, x: float, y: float, z: float
) -> None:
    views = drive(pitch=1.0, roll=-2.0, n_views=6, n_features=120)
    motion = pose_at(x, y, yaw)
    motion[2, 3] = z
    moved = [replace(view, T_map_base=motion @ view.T_map_base) for view in views]
    for one, other in zip(fit_ground(views), fit_ground(moved), strict=True):
        assert same(plane_of(one), plane_of(other), atol=1e-6)


@given(st.integers(0, 7), st.integers(1, 6), st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_a_causal_window_never_uses_later_views(at: int, window: int, seed: int) -> None:
    views = drive(n_views=8, n_features=80)
    other = drive(pitch=4.0, height=0.9, n_views=8, n_features=80, seed=seed)
    planes = [plane_of(view) for view in fit_ground(views, causal=True, window=window)]
    changed = views[: at + 1] + other[at + 1 :]
    again = [plane_of(view) for view in fit_ground(changed, causal=True, window=window)]
    assert all(same(*pair) for pair in zip(planes[: at + 1], again[: at + 1], strict=True))


@pytest.mark.parametrize("causal", [True, False])
@pytest.mark.parametrize("window", [1, 2, 3, 4, 5, 10, 11])
def test_a_plane_is_fitted_to_as_many_views_as_the_window_has(window: int, causal: bool) -> None:
    views = drive(n_views=24, n_features=60)
    middle = 12
    plane = plane_of(list(fit_ground(views, window=window, causal=causal))[middle])
    used = []
    for number in range(len(views)):
        changed = [*views]
        points = views[number].points
        changed[number] = replace(views[number], points=points.select(np.arange(0, len(points), 2)))
        again = plane_of(list(fit_ground(changed, window=window, causal=causal))[middle])
        if not same(plane, again):
            used.append(number)
    assert len(used) == window
    assert used == list(range(used[0], used[0] + window))
    assert middle in used
    assert not causal or used[-1] == middle


@pytest.mark.parametrize(
    ("causal", "max_range", "ahead"), [(True, 20.0, 0), (False, 1.5, 3), (False, 6.5, 7)]
)
def test_views_are_read_for_half_a_window_or_the_track_in_range_ahead(
    causal: bool, max_range: float, ahead: int
) -> None:
    read = []

    def source() -> Iterator[View]:
        for number, view in enumerate(drive(n_views=12, n_features=60)):  # a metre apart
            read.append(number)
            yield view

    views = fit_ground(source(), window=7, causal=causal, max_range=max_range, camera_height=1.6)
    for number, _ in enumerate(views):
        assert len(read) == min(number + 1 + ahead, 12)


def test_no_more_than_200_views_are_read_ahead_of_a_robot_at_rest() -> None:
    read = []

    def source() -> Iterator[View]:
        for number in range(300):
            read.append(number)
            yield View(T_map_base=pose_at(0.0), rig=mounted_rig())

    next(fit_ground(source(), camera_height=1.2))
    assert len(read) == 201


def test_nothing_is_read_before_the_first_view_is_requested() -> None:
    def source() -> Iterator[View]:
        raise AssertionError("read too early")
        yield

    fit_ground(source())


@pytest.mark.parametrize("n_views", [0, 1, 2, 5, 6, 7, 20])
@pytest.mark.parametrize("causal", [True, False])
def test_every_view_is_returned_once_in_order(n_views: int, causal: bool) -> None:
    views = drive(n_views=n_views, n_features=60)
    fitted = list(fit_ground(views, causal=causal))
    assert [view.timestamp for view in fitted] == [float(i) for i in range(n_views)]
    for view, given_view in zip(fitted, views, strict=True):
        npt.assert_array_equal(view.points.xyz, given_view.points.xyz)
        assert given_view.plane is None


@pytest.mark.parametrize("causal", [True, False])
def test_empty_views_in_between_stand_on_the_ground_of_their_neighbours(causal: bool) -> None:
    views = drive(pitch=2.0, height=1.6)
    views = [emptied(view) if number in (5, 6, 8) else view for number, view in enumerate(views)]
    for view in list(fit_ground(views, causal=causal))[3:]:
        assert plane_of(view).offset == pytest.approx(1.6, abs=0.03)
        assert plane_of(view).support > 0


def test_a_plane_is_carried_along_where_features_are_too_few() -> None:
    views = drive(n_views=6)
    views[3:] = [emptied(view) for view in views[3:]]
    planes = [plane_of(view) for view in fit_ground(views, window=1)]
    assert [plane.support > 0 for plane in planes] == [True, True, True, False, False, False]
    for carried in planes[3:]:
        npt.assert_array_equal(carried.normal, planes[2].normal)
        assert carried.offset == planes[2].offset
        assert carried.sigma_tilt == planes[2].sigma_tilt


@pytest.mark.parametrize("n_features", [0, 3, 11])
def test_too_few_features_without_an_earlier_plane_are_refused_with_a_hint(
    n_features: int,
) -> None:
    views = drive(n_views=3, n_features=200)
    views[0] = replace(views[0], points=views[0].points.select(np.arange(n_features)))
    message = rf"the {n_features} features of 1 views: give the height .* T_base_camera"
    with pytest.raises(NoGroundPlaneError, match=message):
        next(fit_ground(views, causal=True))


def test_of_two_levels_the_ground_is_the_lower_even_with_fewer_features() -> None:
    rng = np.random.default_rng(8)
    n = 400
    raised = rng.random(n) < 0.55  # 0.7 m above the road, as the tops of a row of cars
    xyz = np.column_stack(
        [rng.uniform(-5, 5, n), np.where(raised, 0.9, 1.6), rng.uniform(3, 12, n)]
    )
    view = View(T_map_base=T_REP103_OPTICAL, rig=RIG, points=look(rng, xyz))
    (standing,) = fit_ground([view])
    assert plane_of(standing).offset == pytest.approx(1.6, abs=0.03)


def test_features_on_one_line_are_no_plane() -> None:
    along = np.linspace(3, 15, 50)
    xyz = np.column_stack([np.zeros(50), np.full(50, 1.6), along])
    features = Features.points(xyz, np.broadcast_to(1e-4 * np.eye(3), (50, 3, 3)))
    view = View(T_map_base=T_REP103_OPTICAL, rig=RIG, points=features)
    with pytest.raises(NoGroundPlaneError, match="contains enough of the 50 features of 1 views"):
        list(fit_ground([view]))


def test_walls_alone_are_no_ground() -> None:
    rng = np.random.default_rng(2)
    xyz = np.column_stack(
        [rng.choice([-4.0, 4.0], 200), rng.uniform(-4.0, 0.0, 200), rng.uniform(3, 15, 200)]
    )
    features = Features.points(xyz, np.broadcast_to(1e-4 * np.eye(3), (200, 3, 3)))
    view = View(T_map_base=T_REP103_OPTICAL, rig=RIG, points=features)
    with pytest.raises(
        NoGroundPlaneError, match=r"no plane between 0\.1 and 5 m below the camera contains enough"
    ):
        list(fit_ground([view]))


def mounted_rig(pitch: float = 10.0) -> StereoRig:
    mounting = np.eye(4)
    mounting[:3, :3] = Rotation.from_euler("y", pitch, degrees=True).as_matrix()
    mounting[:3, 3] = 0.4, 0.1, 1.2
    return replace(RIG, T_base_camera=mounting @ T_REP103_OPTICAL)


def test_a_mounted_rig_stands_on_the_ground_of_its_base_where_features_are_too_few() -> None:
    view = View(T_map_base=pose_at(3.0, 2.0, 1.0), rig=mounted_rig())
    (standing,) = fit_ground([view])
    npt.assert_array_equal(plane_of(standing).normal, (0, 0, 1))
    assert plane_of(standing).offset == 0.0
    assert plane_of(standing).support == 0


@given(st.floats(-20, 20), st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_a_mounted_rig_finds_the_ground_in_its_base(pitch: float, seed: int) -> None:
    rig, rng = mounted_rig(pitch), np.random.default_rng(seed)
    views = []
    for number in range(6):
        base = pose_at(number, yaw=-0.05 * number)
        camera = base @ rig.T_base_camera
        features = street(rng, camera, base, 200)
        views.append(View(T_map_base=base, rig=rig, points=features))
    for view in fit_ground(views):
        plane = plane_of(view)
        assert plane.support > 0
        assert tilt_between(plane.normal, np.array([0.0, 0.0, 1.0])) < 0.5
        assert plane.height(rig.T_base_camera[:3, 3]) == pytest.approx(1.2, abs=0.03)


def test_the_ends_of_segments_are_features_too() -> None:
    views = drive(pitch=2.0, n_views=5)
    as_segments = []
    for view in views:
        pairs = view.points.select(np.arange(len(view.points) // 2 * 2))
        ends = Features.segments(pairs.xyz.reshape(-1, 2, 3), pairs.covariance.reshape(-1, 2, 3, 3))
        as_segments.append(View(T_map_base=view.T_map_base, rig=RIG, segments=ends))
    for view in fit_ground(as_segments):
        assert plane_of(view).offset == pytest.approx(1.6, abs=0.03)


def test_features_out_of_range_are_left_out() -> None:
    # Beyond 8 m the road drops by a step of a metre.
    views = []
    for view in drive(n_views=5, n_features=400):
        xyz = view.points.xyz.copy()
        xyz[xyz[:, 2] > 8.5, 1] += 1.0
        points = Features.points(xyz, view.points.covariance)
        views.append(View(T_map_base=view.T_map_base, rig=RIG, points=points))
    for view in fit_ground(views, max_range=8.0):
        assert plane_of(view).offset == pytest.approx(1.6, abs=0.03)


def test_a_given_plane_is_the_plane_of_every_view() -> None:
    plane = GroundPlane(normal=np.array([0.0, -1.0, 0.0]), offset=1.23)
    fitted = list(fit_ground([*drive(n_views=2), emptied(drive(n_views=1)[0])], plane=plane))
    assert len(fitted) == 3
    assert all(view.plane is plane for view in fitted)


def test_a_given_camera_height_is_level_ground_that_far_below() -> None:
    for view in fit_ground(drive(n_views=2), camera_height=1.4):
        npt.assert_array_equal(plane_of(view).normal, (0, -1, 0))
        assert plane_of(view).offset == 1.4


def test_plane_and_camera_height_together_are_refused() -> None:
    plane = GroundPlane(normal=np.array([0.0, -1.0, 0.0]), offset=1.0)
    with pytest.raises(InputError, match="expected plane or camera_height, got both"):
        list(fit_ground([], plane=plane, camera_height=1.0))


@pytest.mark.parametrize("height", [0.0, -1.0, np.nan])
def test_a_camera_height_that_is_not_above_zero_is_refused(height: float) -> None:
    with pytest.raises(InputError, match=r"^camera_height: expected a number above 0"):
        list(fit_ground(drive(n_views=1), camera_height=height))


def test_an_unknown_setting_names_the_nearest() -> None:
    with pytest.raises(SettingsError, match=r"^casual: .* Did you mean 'causal'\?"):
        list(fit_ground([], casual=True))


def with_pose(view: View, pose: Floats) -> View:
    return replace(view, T_map_base=pose)


@pytest.mark.parametrize(
    ("pitch", "message"), [(90.0, "looks at the ground"), (-80.0, "looks at the sky")]
)
@pytest.mark.parametrize("how", [{}, {"camera_height": 1.5}])
def test_a_camera_that_looks_at_the_ground_or_the_sky_is_refused(
    pitch: float, message: str, how: dict[str, float]
) -> None:
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_euler("y", pitch, degrees=True).as_matrix()
    views = [with_pose(view, tilt @ view.T_map_base) for view in drive(n_views=2)]
    with pytest.raises(NoGroundPlaneError, match=message):
        list(fit_ground(views, **how))  # type: ignore[arg-type]


def test_poses_of_the_wrong_world_are_refused() -> None:
    views = [with_pose(view, invert(T_REP103_OPTICAL) @ view.T_map_base) for view in drive()]
    with pytest.raises(NoGroundPlaneError, match="whether their world frame is 'optical'"):
        list(fit_ground(views))


def test_a_causal_window_returns_the_views_before_a_refused_one() -> None:
    views = drive(n_views=4)
    views[3] = with_pose(views[3], np.eye(4))
    fitted: Iterable[View] = fit_ground(views, causal=True)
    assert len(list(islice(fitted, 3))) == 3
    with pytest.raises(NoGroundPlaneError, match="looks at the sky"):
        next(iter(fitted))


def slope_ahead(angle: float, height: float, start: float, seed: int) -> list[View]:
    """Return views of a level road that goes down (or up) a ramp, 10 m after its origin."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 60.0, 1500), rng.uniform(-5.0, 5.0, 1500)
    road = np.column_stack([x, y, np.maximum(x - 10.0, 0.0) * np.tan(np.radians(angle))])
    views = []
    for number in range(6):
        pose = pose_at(start + 0.7 * number)
        pose[2, 3] = height
        camera = pose @ T_REP103_OPTICAL
        seen = road @ invert(camera)[:3, :3].T + invert(camera)[:3, 3]
        seen = seen[(seen[:, 2] > 1.0) & (seen[:, 2] < 25.0)]
        views.append(View(T_map_base=camera, rig=RIG, points=look(rng, seen)))
    return views


@given(
    st.floats(-14, 14), st.floats(0.3, 1.6), st.sampled_from([0.0, 3.0]), st.integers(0, 2**32 - 1)
)
@settings(max_examples=40)
def test_fitted_planes_are_within_the_camera_heights_of_the_settings(
    angle: float, height: float, start: float, seed: int
) -> None:
    views = slope_ahead(angle, height, start, seed)
    try:
        fitted = list(fit_ground(views, lowest_camera=0.25, highest_camera=2.5))
    except NoGroundPlaneError as error:
        assert "no plane between 0.25 and 2.5 m below the camera" in str(error)  # noqa: PT017
        return
    for view in fitted:
        assert 0.25 <= plane_of(view).height(RIG.T_base_camera[:3, 3]) <= 2.5


@pytest.mark.parametrize("angle", [-12.0, -11.0, -10.0, -8.0])
@pytest.mark.parametrize("height", [0.3, 0.6])
def test_a_ramp_down_ahead_is_mapped_or_refused(angle: float, height: float) -> None:
    mapper = GroundMapper()
    try:
        for view in fit_ground(slope_ahead(angle, height, 0.0, 0)):
            mapper.integrate(view)
    except NoGroundPlaneError as error:
        assert "give the height of the camera" in str(error)  # noqa: PT017


PLANE_ABOVE = r"got one 0\.5 m above it\. The offset of a GroundPlane .* --camera-height"


def test_a_given_plane_above_the_camera_is_refused_with_the_view_and_the_height() -> None:
    plane = GroundPlane(normal=np.array([0.0, -1.0, 0.0]), offset=-0.5)
    views = drive(n_views=2)
    with pytest.raises(NoGroundPlaneError, match=rf"^view 0 \(timestamp 0 s\): .*{PLANE_ABOVE}"):
        list(fit_ground(views, plane=plane))
    mapper = GroundMapper()
    mapper.integrate(views[0].with_plane(replace(plane, offset=1.6)))
    with pytest.raises(NoGroundPlaneError, match=rf"^view 1 \(timestamp 1 s\): .*{PLANE_ABOVE}"):
        mapper.integrate(views[1].with_plane(plane))


def test_the_ground_of_a_base_above_its_camera_is_refused() -> None:
    mounting = np.eye(4)
    mounting[2, 3] = -0.5
    rig = replace(RIG, T_base_camera=mounting @ T_REP103_OPTICAL)
    with pytest.raises(NoGroundPlaneError, match=rf"^view 0: .*{PLANE_ABOVE}"):
        list(fit_ground([View(T_map_base=pose_at(0.0), rig=rig)]))


def test_camera_heights_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(SettingsError, match=r"^lowest_camera: expected at most highest_camera, 1"):
        list(fit_ground([], lowest_camera=2.0, highest_camera=1.0))
