"""Files that cannot serve: one sentence says what they lack, and where it is found."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest

import sparse_scene
from groundmap.errors import FileFormatError
from groundmap.io import read_views
from groundmap.io.readers.base import SparseMapLog
from sparse_scene import Files, make_scene

SCENE = make_scene()
POINTS = b"v 1 2 3\nv 4 5 6\n"
PLY = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n" + (
    b"property float z\nend_header\n1 2 3\n"
)
KITTI = b"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n"
FRAME = {"file_path": "a.png", "transform_matrix": [[1, 0, 0, 0]] * 4}
SFM = {"views": [{"viewId": "1", "poseId": "2"}], "intrinsics": [], "poses": []}


def without(files: Files, *names: str) -> Files:
    return {name: data for name, data in files.items() if name not in names}


REFUSED: dict[str, tuple[Files, str]] = {
    "trajectory": ({"traj.txt": sparse_scene.tum(SCENE)}, r"a trajectory alone \(traj.txt\)"),
    "kitti": ({"poses.txt": KITTI}, r"a trajectory alone \(poses.txt\)"),
    "points": ({"cloud.ply": PLY}, r"points alone \(cloud.ply\)"),
    "orbslam": (
        {"KeyFrameTrajectory.txt": sparse_scene.tum(SCENE), "MapPoints.obj": POINTS},
        r"a trajectory \(KeyFrameTrajectory.txt\) and points \(MapPoints.obj\) without visibility.*"
        "--guess-visibility",
    ),
    "nerfstudio": (
        {"transforms.json": json.dumps({"frames": [FRAME]}).encode()},
        "poses of nerfstudio or NeRF without visibility.*COLMAP folder",
    ),
    "metashape": (
        {"cameras.xml": b"<?xml version='1.0'?>\n<document version='1.5.0'>\n<chunk label='1'>"},
        "cameras of Metashape without points.*Bundler",
    ),
    "meshroom": (
        {"cameras.sfm": json.dumps(SFM).encode()},
        "cameras of Meshroom without structure.*StructureFromMotion",
    ),
    "openmvg": (
        {"sfm_data.json": json.dumps({"sfm_data_version": "0.3", "views": []}).encode()},
        "0 views without poses.*openMVG_main_SfM",
    ),
    "opensfm": (
        without(sparse_scene.opensfm(SCENE), "tracks.csv"),
        "no tracks.csv beside it.*copy it here",
    ),
    "colmap": (
        without(sparse_scene.colmap_binary(SCENE), "points3D.bin"),
        "cameras.bin, images.bin, points3D.bin, got no points3D.bin",
    ),
    "atlas": ({"map.osa": b"22 serialization::archive 17 0 0"}, "an atlas of ORB-SLAM3"),
    "g2o": ({"graph.g2o": b"VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"}, "a pose graph without landmarks"),
    "database": (
        {
            "database.db": sparse_scene.database_of(
                [("CREATE TABLE two_view_geometries (a)", ()), ("CREATE TABLE images (a)", ())]
            )
        },
        "before the reconstruction.*colmap mapper",
    ),
    "kitti images": ({"image_0/000000.png": b"", "poses.txt": KITTI}, "images of KITTI without"),
    "euroc": ({"mav0/cam0/data.csv": b"", "mav0/imu0/data.csv": b""}, "images of EuRoC without"),
    "images": ({"a.jpg": b""}, "images without features"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_known_file_that_cannot_serve_is_named(name: str, tmp_path: Path) -> None:
    files, message = REFUSED[name]
    for file, data in files.items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_bytes(data)
    with pytest.raises(FileFormatError, match=message):
        read_views(tmp_path)


def test_the_file_itself_is_refused_like_its_folder(tmp_path: Path) -> None:
    (tmp_path / "traj.txt").write_bytes(sparse_scene.tum(SCENE))
    with pytest.raises(FileFormatError, match=r"a trajectory alone \(traj.txt\)"):
        read_views(tmp_path / "traj.txt")


def test_visibility_is_guessed_only_on_request_and_labelled(tmp_path: Path) -> None:
    (tmp_path / "KeyFrameTrajectory.txt").write_bytes(sparse_scene.tum(SCENE))
    lines = [f"v {x} {y} {z}" for x, y, z in SCENE.landmarks.tolist()]
    (tmp_path / "points.obj").write_text("\n".join(lines))
    log = read_views(tmp_path, guess_visibility=True)
    assert isinstance(log, SparseMapLog)
    pairs = set(zip(log.sparse.view_of.tolist(), log.sparse.landmark_of.tolist(), strict=True))
    right = len(pairs & set(SCENE.pairs)) / len(pairs)
    assert right > 0.8  # nothing hides anything in this scene
    assert "guessed" in log.sparse.notes[0]


def test_a_rtabmap_database_without_optimised_poses_says_so(tmp_path: Path) -> None:
    files = sparse_scene.rtabmap(SCENE, optimised=False)
    (tmp_path / "rtabmap.db").write_bytes(files["rtabmap.db"])
    log = read_views(tmp_path)
    assert isinstance(log, SparseMapLog)
    assert log.sparse.notes == (
        "the database has no optimised poses, so those of odometry are used",
    )


def test_a_rtabmap_database_without_features_counts_its_nodes(tmp_path: Path) -> None:
    tables = ["Node (id, weight, stamp, pose)", "Data (id, calibration)", "Admin (version)"]
    statements = [(f"CREATE TABLE {table}", ()) for table in tables]
    (tmp_path / "a.db").write_bytes(sparse_scene.database_of([*statements]))
    with pytest.raises(FileFormatError, match=r"0 nodes without 3-D features. The database is em"):
        read_views(tmp_path / "a.db")


def test_a_locked_database_is_named(tmp_path: Path) -> None:
    path = tmp_path / "rtabmap.db"
    path.write_bytes(sparse_scene.rtabmap(SCENE)["rtabmap.db"])
    connection = sqlite3.connect(path)
    connection.execute("BEGIN EXCLUSIVE")
    try:
        with pytest.raises(FileFormatError, match=r"locked.*close that, or copy the file"):
            read_views(path)
    finally:
        connection.close()
