"""The writer of folders of views: written views are restored, and writing is atomic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.io import read_views, write_views
from groundmap.view.frames import from_quaternion
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features, View

DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded data in {DATA}")

RIG = StereoRig(fx=700.1, fy=699.9, cx=320.3, cy=240.7, baseline=0.1, pixel_noise_px=0.3)
FORMS = pytest.mark.parametrize("features", ["csv", "npz"])


def make_view(rng: np.random.Generator, *, points: int = 3, segments: int = 2) -> View:
    return View(
        T_map_base=random_pose(rng),
        rig=RIG,
        points=Features.points(*random_features(rng, (points,)), rng.integers(-1, 9, points)),
        segments=Features.segments(*random_features(rng, (segments, 2))),
        timestamp=float(rng.uniform(0, 2e9)),
    )


def random_pose(rng: np.random.Generator) -> Floats:
    quaternion = rng.normal(size=4)
    return from_quaternion(rng.uniform(-1e3, 1e3, 3), quaternion / np.linalg.norm(quaternion))


def random_features(rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    xyz = rng.normal(size=(*shape, 3)) * 10.0 ** rng.uniform(-6, 6, (*shape, 1))
    xyz[..., 2] = np.abs(xyz[..., 2]) + 1e-9
    half = rng.normal(size=(*shape, 3, 3))
    covariance = half @ np.swapaxes(half, -1, -2)
    return xyz, covariance


def assert_same(got: View, expected: View) -> None:
    npt.assert_allclose(got.T_map_base, expected.T_map_base, rtol=0, atol=1e-12)
    npt.assert_array_equal(got.T_map_base[:3, 3], expected.T_map_base[:3, 3])
    for name in ("points", "segments"):
        for layer in ("xyz", "covariance", "ids"):
            ours, theirs = (
                getattr(getattr(got, name), layer),
                getattr(getattr(expected, name), layer),
            )
            npt.assert_array_equal(ours, theirs)
            assert ours.dtype == theirs.dtype


@given(
    seed=st.integers(0, 2**32 - 1),
    counts=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 3)), min_size=1, max_size=5),
    features=st.sampled_from(["csv", "npz"]),
)
def test_written_views_are_read_unchanged(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    counts: list[tuple[int, int]],
    features: str,
) -> None:
    rng = np.random.default_rng(seed)
    views = [make_view(rng, points=points, segments=segments) for points, segments in counts]
    path = tmp_path_factory.mktemp("round") / "views"
    write_views(iter(views), path, features=features)
    log = read_views(path)
    assert len(log) == len(views)
    for got, expected in zip(log, views, strict=True):
        assert_same(got, expected)
        assert got.timestamp == expected.timestamp


@given(
    xy=st.tuples(st.floats(-1e8, 1e8), st.floats(-1e8, 1e8)),
    depth=st.floats(min_value=5e-324, max_value=1e7),
    variances=st.lists(st.floats(min_value=0.0, allow_infinity=False), min_size=3, max_size=3),
    features=st.sampled_from(["csv", "npz"]),
)
def test_every_finite_float_is_restored_bit_by_bit(
    tmp_path_factory: pytest.TempPathFactory,
    xy: tuple[float, float],
    depth: float,
    variances: list[float],
    features: str,
) -> None:
    points = Features.points([(*xy, depth)], [np.diag(variances)])
    path = tmp_path_factory.mktemp("floats") / "views"
    write_views([View(T_map_base=np.eye(4), rig=RIG, points=points)], path, features=features)
    (view,) = read_views(path)
    assert view.points.xyz.tobytes() == points.xyz.tobytes()
    assert view.points.covariance.tobytes() == points.covariance.tobytes()


@FORMS
def test_the_rig_is_restored(tmp_path: Path, features: str) -> None:
    T_base_camera = random_pose(np.random.default_rng(3))
    rig = replace(RIG, T_base_camera=T_base_camera)
    write_views([View(T_map_base=np.eye(4), rig=rig)], tmp_path / "views", features=features)
    (view,) = read_views(tmp_path / "views")
    assert (view.rig.fx, view.rig.fy, view.rig.cx, view.rig.cy) == (700.1, 699.9, 320.3, 240.7)
    assert (view.rig.baseline, view.rig.pixel_noise_px) == (0.1, 0.3)
    npt.assert_array_equal(view.rig.T_base_camera, T_base_camera)


@FORMS
def test_a_view_without_a_timestamp_gets_its_index(tmp_path: Path, features: str) -> None:
    views = [View(T_map_base=np.eye(4), rig=RIG)] * 3
    write_views(views, tmp_path / "views", features=features)
    assert [view.timestamp for view in read_views(tmp_path / "views")] == [0.0, 1.0, 2.0]


@FORMS
@needs_data
def test_a_recorded_drive_is_restored(tmp_path: Path, features: str) -> None:
    drive = read_views(DATA / "kitti_raw_vo")
    write_views(drive, tmp_path / "views", features=features)
    for got, expected in zip(read_views(tmp_path / "views"), drive, strict=True):
        for layer in ("xyz", "covariance", "ids"):
            npt.assert_array_equal(getattr(got.points, layer), getattr(expected.points, layer))
        # The file's six digits leave its rotations orthonormal to 1e-6, not more.
        npt.assert_allclose(got.T_map_base, expected.T_map_base, rtol=0, atol=1e-6)


def test_the_world_is_written_as_rep103_with_a_pose_per_line(tmp_path: Path) -> None:
    T_map_base = from_quaternion(np.array([1 / 3, 2, 3]), np.array([0.0, 0.0, 0.0, 1.0]))
    view = View(T_map_base=T_map_base, rig=RIG, timestamp=0.1)
    write_views([view], tmp_path / "views")
    assert 'world = "rep103"' in (tmp_path / "views" / "rig.toml").read_text()
    comment, line = (tmp_path / "views" / "poses.txt").read_text().splitlines()
    assert comment == "# timestamp tx ty tz qx qy qz qw"
    assert line == "0.10000000000000001 0.33333333333333331 2 3 0 0 0 1"


@FORMS
def test_ids_beyond_2_53_are_kept_or_refused(tmp_path: Path, features: str) -> None:
    xyz, covariance = random_features(np.random.default_rng(0), (1,))
    points = Features.points(xyz, covariance, [2**53 + 1])
    view = View(T_map_base=np.eye(4), rig=RIG, points=points)
    if features == "npz":
        with pytest.raises(InputError, match=r"ids up to 2\*\*53, got larger ones in view 0"):
            write_views([view], tmp_path / "views", features=features)
    else:
        write_views([view], tmp_path / "views", features=features)
        assert next(iter(read_views(tmp_path / "views"))).points.ids.tolist() == [2**53 + 1]


@FORMS
def test_nothing_is_left_behind_when_the_views_fail(tmp_path: Path, features: str) -> None:
    def failing() -> Iterator[View]:
        yield make_view(np.random.default_rng(0))
        raise RuntimeError("lost the camera")

    with pytest.raises(RuntimeError, match="lost the camera"):
        write_views(failing(), tmp_path / "views", features=features)
    assert list(tmp_path.iterdir()) == []


@FORMS
def test_nothing_stays_beside_the_folder_when_it_is_written(tmp_path: Path, features: str) -> None:
    write_views([make_view(np.random.default_rng(0))], tmp_path / "views", features=features)
    assert [entry.name for entry in tmp_path.iterdir()] == ["views"]


def test_the_old_folder_stays_when_overwriting_fails(tmp_path: Path) -> None:
    view = make_view(np.random.default_rng(0))
    write_views([view], tmp_path / "views")
    with pytest.raises(InputError, match="views: expected at least one view, got none"):
        write_views([], tmp_path / "views", overwrite=True)
    assert_same(next(iter(read_views(tmp_path / "views"))), view)


def test_a_log_is_overwritten_by_its_own_views(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    views = [make_view(rng) for _ in range(3)]
    write_views(views, tmp_path / "views")
    write_views(read_views(tmp_path / "views"), tmp_path / "views", features="npz", overwrite=True)
    assert not (tmp_path / "views" / "points.csv").exists()
    for got, expected in zip(read_views(tmp_path / "views"), views, strict=True):
        assert_same(got, expected)


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    (tmp_path / "views").mkdir()
    write_views([make_view(np.random.default_rng(0))], tmp_path / "views")
    assert len(read_views(tmp_path / "views")) == 1


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    view = make_view(np.random.default_rng(0))
    write_views([view], tmp_path / "views")
    with pytest.raises(InputError, match=r"a new or empty folder, got .* Give overwrite=True"):
        write_views([view], tmp_path / "views")


def test_a_folder_with_anything_else_in_it_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(
        InputError, match=r"folder of views to overwrite, .*also holds 'thesis.tex'"
    ):
        write_views([make_view(np.random.default_rng(0))], tmp_path, overwrite=True)
    assert (tmp_path / "thesis.tex").exists()


def test_a_file_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "views").touch()
    with pytest.raises(InputError, match="a new or empty folder, got the file"):
        write_views([make_view(np.random.default_rng(0))], tmp_path / "views", overwrite=True)


def test_a_parent_that_does_not_exist_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file or directory"):
        write_views([make_view(np.random.default_rng(0))], tmp_path / "gone" / "views")


def test_two_rigs_are_refused(tmp_path: Path) -> None:
    view = make_view(np.random.default_rng(0))
    other = replace(view, rig=replace(RIG, T_base_camera=random_pose(np.random.default_rng(1))))
    with pytest.raises(InputError, match=r"views: expected one rig, got another in view 1. Write"):
        write_views([view, other], tmp_path / "views")


def test_a_timestamp_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    view = View(T_map_base=np.eye(4), rig=RIG, timestamp=float("nan"))
    with pytest.raises(InputError, match=r"timestamp: .* got nan in view 0"):
        write_views([view], tmp_path / "views")


def test_the_error_for_an_unknown_form_lists_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="features: expected one of csv, npz, got 'parquet'"):
        write_views([], tmp_path / "views", features="parquet")


@FORMS
def test_memory_holds_one_view_at_a_time(tmp_path: Path, features: str) -> None:
    alive: list[int] = []

    class Watched(View):
        def __del__(self) -> None:
            alive.pop()

    def views() -> Iterator[View]:
        for _ in range(20):
            assert len(alive) <= 1
            alive.append(1)
            yield Watched(T_map_base=np.eye(4), rig=RIG)

    write_views(views(), tmp_path / "views", features=features)
