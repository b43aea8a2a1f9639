"""Recognition of formats, and poses that replace those of a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError, InputError
from groundmap.io import FORMATS, ViewLog, read_views
from groundmap.io.folder import FolderLog
from groundmap.io.gtsam import GtsamLog

DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recorded data in {DATA}")

IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
FORWARD = "1 0 0 0 0 1 0 0 0 0 1 {} 0 0 0 1"


@pytest.fixture
def gtsam(tmp_path: Path) -> Path:
    """Views 4 and 9, both at the origin."""
    path = tmp_path / "gtsam"
    path.mkdir()
    (path / "VO_calibration.txt").write_text("700 700 0.0 320 240 0.5")
    (path / "VO_camera_poses.txt").write_text(f"9 {IDENTITY}\n4 {IDENTITY}\n")
    (path / "VO_stereo_factors.txt").write_text("9 71 355 320 275 0 0 0\n")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Views at 100.0 s and 100.5 s, both at the origin."""
    path = tmp_path / "folder"
    path.mkdir()
    (path / "rig.toml").write_text(
        'world = "optical"\nfx = 700\nfy = 700\ncx = 320\ncy = 240\nbaseline = 0.5\n'
    )
    (path / "poses.txt").write_text("100.0 0 0 0 0 0 0 1\n100.5 0 0 0 0 0 0 1\n")
    (path / "points.csv").write_text("view,id,uL,uR,v\n")
    return path


def test_both_formats_are_recognised_by_their_files(gtsam: Path, folder: Path) -> None:
    assert type(read_views(gtsam)) is FORMATS["gtsam"] is GtsamLog
    assert type(read_views(str(folder))) is FORMATS["folder"] is FolderLog


def test_a_named_format_is_forced(folder: Path) -> None:
    (folder / "VO_calibration.txt").touch()
    assert isinstance(read_views(folder, format="folder"), FolderLog)


@needs_data
def test_a_folder_of_images_with_poses_is_not_taken_for_views() -> None:
    with pytest.raises(
        FileFormatError, match=r"kitti06_stereo: .* got images of KITTI without features"
    ):
        read_views(DATA / "kitti06_stereo")


def test_an_unknown_format_lists_the_nearest_first(folder: Path) -> None:
    with pytest.raises(InputError, match=r"format: expected one of folder, .*, got 'foldr'"):
        read_views(folder, format="foldr")
    with pytest.raises(InputError, match=r"format: expected one of gtsam, .*, got 'gstam'"):
        read_views(folder, format="gstam")


def test_the_error_for_an_unrecognised_folder_lists_the_files_of_each_format(
    tmp_path: Path,
) -> None:
    with pytest.raises(FileFormatError, match=r"\(gtsam: VO_cal.*; folder: rig.toml.*an empty fol"):
        read_views(tmp_path)
    (tmp_path / "notes.doc").write_text("")
    with pytest.raises(FileFormatError, match=r"got none of them, but notes.doc"):
        read_views(tmp_path)


def test_a_device_is_no_log() -> None:
    with pytest.raises(FileFormatError, match=r"^/dev/null: expected .*, got a device, pipe or "):
        read_views("/dev/null")


def test_a_path_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"gone: expected a folder or file .* got nothing of"):
        read_views(tmp_path / "gone")


def test_a_file_of_a_log_stands_for_its_folder(gtsam: Path, folder: Path) -> None:
    assert len(read_views(folder / "poses.txt")) == 2
    assert len(read_views(gtsam / "VO_stereo_factors.txt")) == 2


def test_a_folder_with_two_formats_asks(folder: Path) -> None:
    (folder / "VO_calibration.txt").touch()
    with pytest.raises(FileFormatError, match=r"gtsam and folder. Choose one: --format gtsam, or"):
        read_views(folder)


def test_the_downloaded_names_of_gtsam_have_suffixes(gtsam: Path) -> None:
    (gtsam / "VO_camera_poses.txt").rename(gtsam / "VO_camera_poses00s.txt")
    (gtsam / "VO_stereo_factors.txt").rename(gtsam / "VO_stereo_factors00s.txt")
    assert len(read_views(gtsam)) == 2
    (gtsam / "VO_camera_poses_large.txt").write_text(f"1 {IDENTITY}\n")
    (gtsam / "VO_stereo_factors_large.txt").write_text("1 71 355 320 275 0 0 0\n")
    with pytest.raises(FileFormatError, match=r"one set, got VO_stereo_factors00s.txt and VO_"):
        read_views(gtsam)
    assert len(read_views(gtsam / "VO_stereo_factors_large.txt")) == 1


def forward(views: ViewLog) -> list[float]:
    return [float(view.T_map_base[0, 3]) for view in views]


@pytest.mark.parametrize(
    "text",
    [
        f"9 {FORWARD.format(2)}\n7 {FORWARD.format(5)}\n4 {FORWARD.format(1)}\n",
        "9 0 0 2 0 0 0 1\n7.0 0 0 5 0 0 0 1\n4.0 0 0 1 0 0 0 1\n",
    ],
)
def test_poses_replace_those_of_a_gtsam_log_by_id(gtsam: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "other.txt").write_text(text)
    views = read_views(gtsam, poses=tmp_path / "other.txt")
    assert forward(views) == [1, 2]
    assert [len(view.points) for view in views] == [0, 1]


@pytest.mark.parametrize(
    "text",
    [
        "100.0 0 0 1 0 0 0 1\n100.5004 0 0 2 0 0 0 1\n",
        f"1 {FORWARD.format(2)}\n0 {FORWARD.format(1)}\n",
    ],
)
def test_poses_replace_those_of_a_folder_row_by_row(
    folder: Path, tmp_path: Path, text: str
) -> None:
    (tmp_path / "other.txt").write_text(text)
    views = read_views(folder, poses=str(tmp_path / "other.txt"))
    assert forward(views) == [1, 2]
    assert [view.timestamp for view in views] == [100.0, 100.5]


@pytest.mark.parametrize(
    ("log", "text", "message"),
    [
        ("gtsam", f"9 {IDENTITY}\n", "a pose for view 4, got none with that id"),
        ("gtsam", f"4 {IDENTITY}\n4 {IDENTITY}\n", "one pose per id, got another pose 4 at line 2"),
        ("gtsam", "4.5 0 0 0 0 0 0 1\n9 0 0 0 0 0 0 1\n", "a pose for view 4, got none"),
        ("gtsam", "", "at least one pose, got an empty file"),
        ("gtsam", "4 1 2 3\n", "8 columns, got 4 at line 1"),
        ("folder", "100 0 0 0 0 0 0 1\n", "2 poses, one per view, got 1"),
        ("folder", "100 0 0 0 0 0 0 1\n7 0 0 0 0 0 0 1", "timestamp of view 1, 100.5, got 7 at"),
        ("folder", f"0 {IDENTITY}\n2 {IDENTITY}\n", "a pose for view 1, got none with that id"),
        ("folder", f"0 {IDENTITY}\n1 2{IDENTITY[1:]}", "orthonormal rows, .* at line 2"),
    ],
)
def test_poses_that_do_not_match_are_refused(
    request: pytest.FixtureRequest, tmp_path: Path, log: str, text: str, message: str
) -> None:
    (tmp_path / "other.txt").write_text(text)
    with pytest.raises(FileFormatError, match=f"other.txt: expected .*{message}"):
        read_views(request.getfixturevalue(log), poses=tmp_path / "other.txt")


def test_a_pose_file_that_does_not_exist_is_named(gtsam: Path) -> None:
    with pytest.raises(
        FileFormatError, match=r"gone.txt: expected a readable file, got no file of that name"
    ):
        read_views(gtsam, poses=gtsam / "gone.txt")


@needs_data
def test_the_own_poses_of_a_recorded_drive_change_nothing() -> None:
    path = DATA / "kitti_raw_vo"
    with_poses = read_views(path, poses=path / "VO_camera_poses.txt")
    for view, expected in zip(with_poses, read_views(path), strict=True):
        npt.assert_array_equal(view.T_map_base, expected.T_map_base)
        assert np.array_equal(view.points.ids, expected.points.ids)
