"""The GTSAM visual-odometry set: valid files are read, invalid ones refused."""

from __future__ import annotations

import tempfile
import tracemalloc
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError
from groundmap.io import disk_sort, read_views, rows
from groundmap.view.frames import map_from_world

DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded data in {DATA}")

CALIBRATION = "700 700 0.0 320 240 0.5"
IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
AHEAD = "1 0 0 0 0 1 0 0 0 0 1 2.5 0 0 0 1"  # 2.5 m forward: z of the optical world
POSES = f"9 {AHEAD}\n4 {IDENTITY}\n"
FACTORS = """\
9 71 355.0 320.0 275.0 0 0 0
4 70 390.0 355.0 240.0 0 0 0
9 70 320.0 285.0 240.0 0 0 0
"""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "log")


def write_log(path: Path, *, poses: str = POSES, factors: str = FACTORS) -> Path:
    path.mkdir()
    (path / "VO_calibration.txt").write_text(CALIBRATION)  # no line end, as in published files
    (path / "VO_camera_poses.txt").write_text(poses)
    (path / "VO_stereo_factors.txt").write_text(factors)
    return path


def test_views_come_in_ascending_pose_id_whatever_the_order_of_the_rows(log: Path) -> None:
    first, second = read_views(log)
    npt.assert_array_equal(first.T_map_camera[:3, 3], (0, 0, 0))
    npt.assert_array_equal(second.T_map_camera[:3, 3], (2.5, 0, 0))
    assert first.points.ids.tolist() == [70]
    assert second.points.ids.tolist() == [71, 70]


def test_pixels_become_points_of_the_camera_frame(log: Path) -> None:
    _, view = read_views(log)
    npt.assert_allclose(view.points.xyz, [(0.5, 0.5, 10.0), (0.0, 0.0, 10.0)], atol=1e-12)


def test_a_log_is_sized_and_re_iterable(log: Path) -> None:
    views = read_views(log)
    assert len(views) == 2
    again = [view.points.ids.tolist() for view in views]
    assert again == [view.points.ids.tolist() for view in views]


def test_a_pose_without_factors_is_an_empty_view(tmp_path: Path) -> None:
    views = list(read_views(write_log(tmp_path / "log", poses=f"{POSES}6 {IDENTITY}\n")))
    assert [len(view.points) for view in views] == [1, 0, 2]


def test_ids_use_all_of_their_64_bits(tmp_path: Path) -> None:
    pose, landmark = (ord("x") << 56) + 1, (ord("l") << 56) + 3
    factors = f"{pose} {landmark} 355 320 275 0 0 0\n"
    log = write_log(
        tmp_path / "log", poses=f"{pose} {AHEAD}\n{pose - 1} {IDENTITY}\n", factors=factors
    )
    empty, view = read_views(log)
    assert len(empty.points) == 0
    assert view.points.ids.tolist() == [landmark]


@pytest.mark.parametrize("lines", [1, 2, 3, 7])
def test_the_chunk_size_does_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: int
) -> None:
    log = write_shuffled(tmp_path / "log", views=9, features=5)
    whole = list(read_views(log))
    monkeypatch.setattr(rows, "CHUNK_LINES", lines)
    monkeypatch.setattr(disk_sort, "CHUNK_ROWS", lines)
    for view, expected in zip(read_views(log), whole, strict=True):
        npt.assert_array_equal(view.points.xyz, expected.points.xyz)
        npt.assert_array_equal(view.points.ids, expected.points.ids)


def test_memory_does_not_grow_with_the_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rows, "CHUNK_LINES", 500)
    monkeypatch.setattr(disk_sort, "CHUNK_ROWS", 500)
    small = peak_memory(write_shuffled(tmp_path / "small", views=20, features=100))
    large = peak_memory(write_shuffled(tmp_path / "large", views=160, features=100))
    assert large < 1.5 * small


def test_iterations_of_one_log_do_not_disturb_each_other(tmp_path: Path) -> None:
    views = read_views(write_shuffled(tmp_path / "log", views=5, features=4))
    for first, second in zip(views, views, strict=True):
        npt.assert_array_equal(first.points.xyz, second.points.xyz)


def test_no_temporary_file_keeps_a_name(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    views = read_views(log)
    next(iter(views))
    assert list(scratch.iterdir()) == []


def test_features_without_a_point_are_counted_drops(tmp_path: Path) -> None:
    rows = ["320 320 240", "320 321 240", "nan 300 240", "inf 300 240", "355 320 275"]
    factors = "".join(f"4 {i} {row} 0 0 0\n" for i, row in enumerate(rows))
    view, _ = read_views(write_log(tmp_path / "log", factors=factors))
    assert view.dropped == {"no_disparity": 2, "not_finite": 2}
    assert view.points.ids.tolist() == [4]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("VO_calibration.txt", "", r"VO_calibration.txt: .* got 0 lines"),
        ("VO_calibration.txt", f"{CALIBRATION}\n{CALIBRATION}", "got 2 lines"),
        ("VO_calibration.txt", "700 700 0 320 240", "expected 6 columns, got 5 at line 1"),
        ("VO_calibration.txt", "700 700 0.2 320 240 0.5", "expected skew 0, got 0.2"),
        ("VO_calibration.txt", "700 700 0 320 240 0", r"baseline to be .* above 0 \[m\], got 0.0"),
        ("VO_calibration.txt", "nan 700 0 320 240 0.5", "fx to be .* got nan"),
        ("VO_camera_poses.txt", "", "VO_camera_poses.txt: expected at least one pose"),
        ("VO_camera_poses.txt", f"{POSES}4 {AHEAD}", "got another pose 4 at line 3"),
        ("VO_camera_poses.txt", "4 1 0 0 0", "expected 17 columns, got 5 at line 1"),
        ("VO_camera_poses.txt", f"4.5 {AHEAD}", "the first 1 integers, got '4.5 1 0"),
        ("VO_camera_poses.txt", f"{POSES}5 2{IDENTITY[1:]}", "orthonormal rows, .* at line 3"),
        ("VO_camera_poses.txt", f"5 -{IDENTITY}", "a reflection .* at line 1"),
        ("VO_camera_poses.txt", f"5 nan{IDENTITY[1:]}", "finite numbers, got nan at line 1"),
        ("VO_stereo_factors.txt", "", "VO_stereo_factors.txt: expected at least one factor"),
        ("VO_stereo_factors.txt", f"{FACTORS}9 72 355 32", "8 columns, got 4 at line 4. .* short"),
        ("VO_stereo_factors.txt", f"9 1 2 3 4 5 6 7 8\n{FACTORS}", "columns, got 9 at line 1"),
        ("VO_stereo_factors.txt", f"{FACTORS}\n9 72 x 0 0 0 0 0", "got '9 72 x .* at line 5"),
        ("VO_stereo_factors.txt", f"{FACTORS}9 0.5 0 0 0 0 0 0", "first 2 integers.* at line 4"),
        ("VO_stereo_factors.txt", f"{FACTORS}5 72 9 8 0 0 0 0", r"poses.txt, got 5 at line 4"),
        ("VO_stereo_factors.txt", f"{FACTORS}99 72 9 8 0 0 0 0", r"poses.txt, got 99 at line 4"),
    ],
)
def test_a_bad_file_is_refused_by_name_and_line(
    log: Path, name: str, text: str, message: str
) -> None:
    (log / name).write_text(text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_views(log)
    assert name in str(caught.value)


@pytest.mark.parametrize(
    "name", ["VO_calibration.txt", "VO_camera_poses.txt", "VO_stereo_factors.txt"]
)
def test_a_missing_file_is_named(log: Path, name: str) -> None:
    (log / name).unlink()
    with pytest.raises(
        FileFormatError, match=f"{name}: expected a readable file, got no file of that name"
    ):
        read_views(log)


@pytest.mark.parametrize(
    "name", ["VO_calibration.txt", "VO_camera_poses.txt", "VO_stereo_factors.txt"]
)
def test_binary_garbage_is_refused(log: Path, name: str) -> None:
    (log / name).write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(FileFormatError, match=f"{name}: expected .* at line 1"):
        read_views(log)


def test_byte_order_marks_and_crlf_are_ignored(log: Path) -> None:
    expected = [view.points.ids.tolist() for view in read_views(log)]
    path = log / "VO_stereo_factors.txt"
    path.write_bytes(b"\xef\xbb\xbf" + FACTORS.replace("\n", "\r\n").encode())
    assert [view.points.ids.tolist() for view in read_views(log)] == expected


@needs_data
@pytest.mark.parametrize(
    ("name", "views", "factors", "landmarks"),
    [("kitti00_vo", 77, 52_544, 15_638), ("kitti_raw_vo", 26, 8_189, 2_634)],
)
def test_a_recorded_drive_is_read_whole(
    name: str, views: int, factors: int, landmarks: int
) -> None:
    log = read_views(DATA / name)
    ids = np.concatenate([view.points.ids for view in log])
    assert (len(log), len(ids), len(np.unique(ids))) == (views, factors, landmarks)


@needs_data
def test_a_recorded_drive_agrees_with_its_own_triangulation() -> None:
    path = DATA / "kitti00_vo"
    factors = np.loadtxt(path / "VO_stereo_factors.txt")
    poses = np.loadtxt(path / "VO_camera_poses.txt")
    for row, view in zip(poses, read_views(path), strict=True):
        own = factors[factors[:, 0] == row[0]]
        npt.assert_array_equal(view.points.ids, own[:, 1])
        # Six digits leave a pixel 0.005 px off at most, and the depth as many parts of a disparity.
        off = np.abs(view.points.xyz - own[:, 5:]) / np.linalg.norm(own[:, 5:], axis=1)[:, None]
        assert (off.max(axis=1) < 0.01 / (own[:, 2] - own[:, 3])).all()
        npt.assert_array_equal(view.T_map_camera, map_from_world(row[1:].reshape(4, 4), "optical"))


def write_shuffled(path: Path, *, views: int, features: int) -> Path:
    """Write a log whose poses and factors are in random order, ids with gaps."""
    rng = np.random.default_rng(7)
    ids = 3 + 2 * rng.permutation(views)
    factors = [
        f"{pose} {landmark} {uR + 20:.3f} {uR:.3f} {v:.3f} 0 0 0\n"
        for pose, landmark, uR, v in zip(
            np.repeat(ids, features),
            rng.integers(0, 1000, views * features),
            *rng.uniform(0, 600, (2, views * features)),
            strict=True,
        )
    ]
    rng.shuffle(factors)
    poses = "".join(f"{pose} {IDENTITY}\n" for pose in ids)
    return write_log(path, poses=poses, factors="".join(factors))


def peak_memory(log: Path) -> int:
    tracemalloc.start()
    for _ in read_views(log):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak
