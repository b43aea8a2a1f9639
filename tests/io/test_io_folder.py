"""Folders of views: valid files are read, invalid ones refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError
from groundmap.io import read_views, rows

RIG = """\
world = "optical"
fx = 700
fy = 700.0
cx = 320.0
cy = 240.0
baseline = 0.5
"""
POSES = """\
# timestamp tx ty tz qx qy qz qw
10.0 0 0 0 0 0 0 1

10.5 0 0 2.5 0 0 0 1  # forward
11.0 1 0 2.5 0 0 0.70710678118 0.70710678118
"""
POINTS = """\
view,id,uL,uR,v
0,7,355.0,320.0,275.0
0,-1,390.0,355.0,240.0
2,7,320.0,285.0,240.0
"""
SEGMENTS = """\
view,id,uL0,uR0,v0,uL1,uR1,v1
1,3,355.0,320.0,275.0,355.0,320.0,205.0
"""
XYZ_POINTS = """\
view,id,x,y,z,cxx,cxy,cxz,cyy,cyz,czz
0,7,1,2,3,11,12,13,22,23,33
"""
MOUNTED = "T_base_camera = [[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 1.1], [0, 0, 0, 1]]\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "views"
    path.mkdir()
    (path / "rig.toml").write_text(RIG)
    (path / "poses.txt").write_text(POSES)
    (path / "points.csv").write_text(POINTS)
    (path / "segments.csv").write_text(SEGMENTS)
    return path


def test_pixels_become_points_and_segments_of_their_views(folder: Path) -> None:
    views = list(read_views(folder))
    assert [len(view.points) for view in views] == [2, 0, 1]
    assert [len(view.segments) for view in views] == [0, 1, 0]
    assert views[0].points.ids.tolist() == [7, -1]
    npt.assert_allclose(views[0].points.xyz, [(0.5, 0.5, 10), (1, 0, 10)], atol=1e-12)
    npt.assert_allclose(views[1].segments.xyz, [[(0.5, 0.5, 10), (0.5, -0.5, 10)]], atol=1e-12)


def test_an_optical_world_is_rotated(folder: Path) -> None:
    views = list(read_views(folder))
    assert [view.timestamp for view in views] == [10.0, 10.5, 11.0]
    npt.assert_array_equal(views[1].T_map_camera[:3, 3], (2.5, 0, 0))
    npt.assert_array_equal(views[2].T_map_camera[:3, 3], (2.5, -1, 0))
    # A quarter turn about the optical axis takes the camera's right to its down: -z of the map.
    npt.assert_allclose(views[2].T_map_camera[:3, 0], (0, 0, -1), atol=1e-9)


def test_a_rep103_world_is_the_map(folder: Path) -> None:
    (folder / "rig.toml").write_text(RIG.replace("optical", "rep103") + MOUNTED)
    view = list(read_views(folder))[1]
    npt.assert_array_equal(view.T_map_base[:3, 3], (0, 0, 2.5))
    npt.assert_array_equal(view.T_map_camera[:3, 3], (0.2, 0, 3.6))


def test_a_log_is_sized_and_re_iterable(folder: Path) -> None:
    views = read_views(folder)
    assert len(views) == 3
    assert [len(v.points) for v in views] == [len(v.points) for v in views]


def test_xyz_columns_fill_a_symmetric_covariance(folder: Path) -> None:
    (folder / "points.csv").write_text(XYZ_POINTS)
    points = next(iter(read_views(folder))).points
    npt.assert_array_equal(points.xyz, [(1, 2, 3)])
    npt.assert_array_equal(points.covariance, [[(11, 12, 13), (12, 22, 23), (13, 23, 33)]])


@pytest.mark.parametrize("left", ["points.csv", "segments.csv"])
def test_one_of_the_tables_is_enough(folder: Path, left: str) -> None:
    for name in {"points.csv", "segments.csv"} - {left}:
        (folder / name).unlink()
    counts = [len(view.points) + len(view.segments) for view in read_views(folder)]
    assert counts == ([2, 0, 1] if left == "points.csv" else [0, 1, 0])


def test_a_table_without_rows_gives_empty_views(folder: Path) -> None:
    (folder / "segments.csv").unlink()
    (folder / "points.csv").write_text(POINTS.splitlines()[0])
    assert [len(view.points) for view in read_views(folder)] == [0, 0, 0]


def test_ids_in_a_csv_use_all_of_their_64_bits(folder: Path) -> None:
    (folder / "points.csv").write_text(f"view,id,uL,uR,v\n0,{2**63 - 1},355,320,275\n")
    assert next(iter(read_views(folder))).points.ids.tolist() == [2**63 - 1]


@pytest.mark.parametrize("lines", [1, 2, 3])
def test_the_chunk_size_does_not_matter(
    folder: Path, monkeypatch: pytest.MonkeyPatch, lines: int
) -> None:
    whole = list(read_views(folder))
    monkeypatch.setattr(rows, "CHUNK_LINES", lines)
    for view, expected in zip(read_views(folder), whole, strict=True):
        npt.assert_array_equal(view.points.xyz, expected.points.xyz)
        npt.assert_array_equal(view.segments.xyz, expected.segments.xyz)


def test_the_first_view_is_there_before_the_last_row_is_read(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rows, "CHUNK_LINES", 1)
    (folder / "points.csv").write_text(f"{POINTS}2,oops\n")
    views = iter(read_views(folder))
    assert len(next(views).points) == 2
    next(views)
    with pytest.raises(FileFormatError, match=r"points.csv: .* at line 5"):
        next(views)


def test_features_without_a_point_are_counted_drops(folder: Path) -> None:
    pixels = ["320,320,240", "320,321,240", "nan,300,240", "inf,300,240", "355,320,275"]
    points = "view,id,uL,uR,v\n" + "".join(f"0,{i},{row}\n" for i, row in enumerate(pixels))
    (folder / "points.csv").write_text(points)
    view = next(iter(read_views(folder)))
    assert view.dropped == {"no_disparity": 2, "not_finite": 2}
    assert view.points.ids.tolist() == [4]


def test_xyz_behind_the_camera_is_a_counted_drop(folder: Path) -> None:
    (folder / "points.csv").write_text(
        f"{XYZ_POINTS}0,8,1,2,-3,1,0,0,1,0,1\n0,9,1,2,0,1,0,0,1,0,1\n0,9,1,nan,3,1,0,0,1,0,1\n"
    )
    view = next(iter(read_views(folder)))
    assert view.dropped == {"behind_camera": 2, "not_finite": 1}
    assert view.points.ids.tolist() == [7]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "world to be a value, got none"),
        (
            lambda text: text + "base_line = 2\n",
            "base_line to be a setting of RigFile, got an unknown key. Did you mean 'baseline'",
        ),
        (
            lambda text: text + "zzz = 2\n",
            "zzz to be .*, got an unknown key. There are: T_base_camera, .*, world",
        ),
        (lambda text: text.replace("cx = 320.0\n", ""), "cx to be a value, got none"),
        (
            lambda text: text.replace("optical", "ned"),
            "world to be 'optical' or 'rep103', got 'ned'",
        ),
        (lambda text: text.replace('"optical"', "[]"), "world to be 'optical' or 'rep103', got "),
        (lambda text: text.replace("700.0", '"700.0"'), "fy to be a valid number, got '700.0'"),
        (lambda text: text.replace("700.0", "true"), "fy to be a valid number, got True"),
        (
            lambda text: text.replace("0.5", "0.0"),
            r"baseline to be a number above 0 \[m\], got 0.0",
        ),
        (lambda text: text.replace("0.5", "-0.5"), "baseline to be a number above 0 .*, got -0.5"),
        (lambda text: text.replace("320.0", "nan"), "cx to be a finite number, got nan"),
        (lambda text: text + "pixel_noise_px = 0\n", "pixel_noise_px to be a number above 0"),
        (lambda text: text + "T_base_camera = [[1, 0], [2]]\n", "T_base_camera to be .* got "),
        (lambda text: text + MOUNTED.replace("0.2", "0.2, 3"), "T_base_camera to be .*4, 4"),
        (lambda text: text + MOUNTED.replace("-1", "-2", 1), "T_base_camera .* orthonormal"),
        (lambda text: text[:-6], "a TOML file, got something else"),
    ],
)
def test_a_bad_rig_is_refused(folder: Path, change: Callable[[str], str], message: str) -> None:
    (folder / "rig.toml").write_text(change(RIG))
    with pytest.raises(FileFormatError, match=f"rig.toml: expected .*{message}"):
        read_views(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "at least one pose, got an empty file"),
        ("# timestamp tx ty tz\n\n", "at least one pose, got an empty file"),
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0", "8 columns, got 5 at line 2. .* cut short"),
        ("1 0 0 0 0 0 0 1\n\n2 x 0 0 0 0 0 1", "8 numbers, got '2 x 0 0 0 0 0 1' at line 3"),
        ("1,0,0,0,0,0,0,1\n", "8 columns, got 1 at line 1. .* white space .*, not by commas."),
        ("1, 0, 0, 0, 0, 0, 0, 1\n", "8 numbers, .* white space in this file, not by commas."),
        ("1;0;0;0;0;0;0;1\n", "8 columns, got 1 at line 1. .* not by semicolons."),
        ("1 0,5 0 0 0 0 0 1\n", "8 numbers, .* Numbers have a decimal point, not a comma."),
        (f"{'1 ' * 12}\n", "8 columns, timestamp tx .*, got 12. .* KITTI's 3 x 4 matrices"),
        ("1 0 0 0 1 0 0 1\n", "length 1 .*, got length 1.414 at line 1"),
        ("1 0 0 0 0 0 0 0\n", "length 1 .*, got length 0 at line 1"),
        ("1 0 0 0 nan 0 0 1\n", "length 1 .*, got length nan at line 1"),
        ("1 inf 0 0 0 0 0 1\n", "finite numbers, got inf at line 1"),
        ("1 0 0 0 0 0 0 1\nnan 0 0 0 0 0 0 1\n", "a finite timestamp, got nan at line 2"),
    ],
)
def test_a_bad_pose_is_refused_by_line(folder: Path, text: str, message: str) -> None:
    (folder / "poses.txt").write_text(text)
    with pytest.raises(FileFormatError, match=f"poses.txt: expected {message}"):
        read_views(folder)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("points.csv", "", "the columns view,id,uL,uR,v or view,id,x.* got none"),
        ("points.csv", SEGMENTS, "the columns view,id,uL,uR,v or .* got 'view,id,uL0,uR0"),
        ("segments.csv", POINTS, "the columns view,id,uL0,.* got 'view,id,uL,uR,v'"),
        ("points.csv", f"{POINTS}2,7,320.0,28", "5 columns, got 4 at line 5. .* cut short"),
        ("points.csv", f"{POINTS}\n2,7,1,2,3,4", "5 columns, got 6 at line 6"),
        (
            "points.csv",
            f"{POINTS}2 7 320 280 1",
            "5 columns, got 1 at line 5. .* not by white space",
        ),
        (
            "points.csv",
            f"{XYZ_POINTS}\n1,-1,1,2,3,1,0,0,1,0,-0.5\n",
            "a covariance that is a positive semi-definite matrix, got the eigenvalue -0.5 at line",
        ),
        ("points.csv", f"{POINTS}2,7,320.0,,240", "numbers, .* got '2,7,320.0,,240' at line 5"),
        ("points.csv", f"{POINTS}2,7.5,320.0,285.0,240", "first 2 integers, got .* at line 5"),
        (
            "points.csv",
            f"{POINTS}1,7,320,285,240",
            "ascending.* view 1 after view 2 at line 5. Sort",
        ),
        ("points.csv", f"{POINTS}3,7,320,285,240", "a view from 0 to 2, got 3 at line 5"),
        ("points.csv", "view,id,uL,uR,v\n-1,7,320,285,240", "view from 0 to 2, got -1 at line 2"),
        ("segments.csv", f"{SEGMENTS}0,3,1,2,3,4,5,6\n", "view 0 after view 1 at line 3"),
    ],
)
def test_a_bad_table_is_refused_by_line(folder: Path, name: str, text: str, message: str) -> None:
    (folder / name).write_text(text)
    with pytest.raises(FileFormatError, match=f"{name}: expected .*{message}"):
        list(read_views(folder))


@pytest.mark.parametrize("lines", [1, 2])
def test_an_unsorted_view_is_seen_across_chunks(
    folder: Path, monkeypatch: pytest.MonkeyPatch, lines: int
) -> None:
    monkeypatch.setattr(rows, "CHUNK_LINES", lines)
    (folder / "points.csv").write_text(f"{POINTS}1,7,320,285,240\n")
    with pytest.raises(FileFormatError, match="view 1 after view 2 at line 5"):
        list(read_views(folder))


@pytest.mark.parametrize("name", ["rig.toml", "poses.txt"])
def test_a_missing_file_is_named(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(
        FileFormatError, match=f"{name}: expected a .*file, got no file of that name"
    ):
        read_views(folder)


def test_a_folder_without_features_is_refused(folder: Path) -> None:
    (folder / "points.csv").unlink()
    (folder / "segments.csv").unlink()
    with pytest.raises(FileFormatError, match=r"one of points.csv, segments.csv and features.npz"):
        read_views(folder)


@pytest.mark.parametrize("name", ["rig.toml", "poses.txt", "points.csv", "segments.csv"])
def test_binary_garbage_is_refused(folder: Path, name: str) -> None:
    (folder / name).write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(FileFormatError, match=f"{name}: expected"):
        list(read_views(folder))


def archive(folder: Path, **arrays: object) -> None:
    for name in ("points.csv", "segments.csv"):
        (folder / name).unlink(missing_ok=True)
    columns = {f"{kind}_columns": COLUMNS[kind] for kind in arrays if kind in COLUMNS}
    np.savez(folder / "features.npz", **{**columns, **arrays})  # type: ignore[arg-type]


COLUMNS = {
    "points": POINTS.splitlines()[0].split(","),
    "segments": SEGMENTS.splitlines()[0].split(","),
}
POINT_ROWS = np.loadtxt(POINTS.splitlines(), delimiter=",", skiprows=1)


def test_an_archive_is_read_like_tables(folder: Path) -> None:
    (folder / "segments.csv").unlink()
    from_tables = list(read_views(folder))
    archive(folder, points=POINT_ROWS)
    for view, expected in zip(read_views(folder), from_tables, strict=True):
        npt.assert_array_equal(view.points.xyz, expected.points.xyz)
        npt.assert_array_equal(view.points.ids, expected.points.ids)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({}, "arrays named points, .* got neither points nor segments"),
        ({"point": POINT_ROWS, "segments": np.empty((0, 8))}, "arrays named .* got 'point'"),
        ({"points": POINT_ROWS[:, :4]}, r"points of shape \(n, 5\), got shape \(3, 4\)"),
        ({"points": np.array([["a"] * 5])}, r"points of numbers of shape \(n, 5\)"),
        ({"points": POINT_ROWS, "points_columns": ["view", "id"]}, "columns .* got 'view,id'"),
        ({"points": POINT_ROWS, "points_columns": 3}, "the columns .* got '3'"),
        ({"points": POINT_ROWS + 0.5}, "whole numbers in column view, got 0.5 in row 0 of points"),
        ({"points": POINT_ROWS * np.nan}, "whole numbers in column view, got nan in row 0"),
        ({"points": POINT_ROWS * [1, np.inf, 1, 1, 1]}, "numbers in column id, got inf in row 0"),
        ({"points": POINT_ROWS[::-1]}, "ascending order, got view 0 after view 2 in row 1. Sort"),
        ({"points": POINT_ROWS + 1}, "a view from 0 to 2, got 3 in row 2"),
        ({"points": np.array([{}])}, "an archive of arrays"),
    ],
)
def test_a_bad_archive_is_refused(folder: Path, arrays: dict[str, object], message: str) -> None:
    archive(folder, **arrays)
    with pytest.raises(FileFormatError, match=f"features.npz: expected .*{message}"):
        list(read_views(folder))


@pytest.mark.parametrize("kept", [0.0, 0.4, 0.99])
def test_a_truncated_archive_is_refused(folder: Path, kept: float) -> None:
    archive(folder, points=POINT_ROWS)
    whole = (folder / "features.npz").read_bytes()
    (folder / "features.npz").write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(FileFormatError, match=r"features.npz: expected an archive of arrays"):
        read_views(folder)


def test_a_bare_array_is_refused(folder: Path) -> None:
    archive(folder, points=POINT_ROWS)
    with open(folder / "features.npz", "wb") as stream:
        np.save(stream, POINT_ROWS)
    with pytest.raises(FileFormatError, match=r"features.npz: expected an archive of arrays"):
        read_views(folder)


def test_tables_beside_an_archive_are_refused(folder: Path) -> None:
    archive(folder, points=POINT_ROWS)
    (folder / "points.csv").write_text(POINTS)
    with pytest.raises(FileFormatError, match=r"got both features.npz and points.csv"):
        read_views(folder)
