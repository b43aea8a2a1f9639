"""Real maps of each system against figures that an independent reader computed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError
from groundmap.io import read_views
from groundmap.io.alignment import align
from groundmap.io.readers.base import SparseMapLog

DATA = Path(__file__).parents[4] / "shared" / "data" / "sparse_maps"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no samples in {DATA}")

# Path of a sample, and where its figures are.
SAMPLES = {
    "bal_dubrovnik_tiny": ("bal_dubrovnik_tiny",),
    "bundler_balbianello": ("bundler_balbianello",),
    "colmap_kitti06_mono": ("colmap_kitti06_mono",),
    "colmap_kitti06_mono/text": ("colmap_kitti06_mono",),
    "colmap_kitti06_stereo": ("colmap_kitti06_stereo",),
    "colmap_kitti06_stereo/text/points3D.txt": ("colmap_kitti06_stereo",),
    "nvm_22_photos/model.nvm": ("nvm_22_photos",),
    "openmvg_castle/sfm_data.bin": ("openmvg_castle", "sfm_data.bin"),
    "openmvg_castle/scene.mvs": ("openmvg_castle", "scene.mvs"),
    "openmvs_four_views": ("openmvs_four_views",),
    "opensfm_berlin": ("opensfm_berlin",),
    "opensfm_berlin/reconstruction.json": ("opensfm_berlin",),
    "orbslam2_webcam": ("orbslam2_webcam",),
    "ros2_kitti_raw_vo_mcap": ("ros2_kitti_raw_vo_mcap",),
    "ros2_kitti_raw_vo_sqlite3/kitti_raw_vo_sqlite3.db3": ("ros2_kitti_raw_vo_sqlite3",),
    "stella_c270_mono": ("stella_c270_mono",),
    "stella_room_equirect/mymap.msg": ("stella_room_equirect",),
}
REFUSED = {
    "colmap_arkit_no_points": "no landmarks",
    "kitti_odometry_00_first77": "a trajectory alone",
    "meshroom_house_poses_only": "without structure",
    "metashape_94_poses_only": "cameras of Metashape without points",
    "nerfstudio_phone": "without visibility",
    "openmvg_castle/sfm_data_views_only.json": "11 views without poses",
    "orbslam2_v101_no_visibility": "without visibility",
    "orbslam3_mh01_poses_only": "a trajectory alone",
    "ros_poses_only/nav2_turtlebot.mcap": "/odom",
    "ros_poses_only/tf_example.bag": "/tf",
    "rtabmap_small/411_nodes_no_features.db": "411 nodes without 3-D features",
    "rtabmap_small/empty_0.20.18.db": "0 nodes without 3-D features",
}


def opened(name: str) -> SparseMapLog:
    log = read_views(DATA / name)
    assert isinstance(log, SparseMapLog)
    return log


def figures_of(place: tuple[str, ...]) -> dict[str, Any]:
    sets = json.loads((DATA / "figures.json").read_text())
    figures: dict[str, Any] = sets[place[0]]["figures"]
    for part in place[1:]:
        figures = figures[part]
    return figures


@pytest.mark.parametrize("name", SAMPLES)
def test_counts_and_centres_are_those_of_the_figures(name: str) -> None:
    sparse, figures = opened(name).sparse, figures_of(SAMPLES[name])
    landmarks = figures.get("landmarks", figures.get("distinct_ids"))
    counts = (len(sparse), sparse.landmark_count, sparse.sightings)
    assert counts == (figures["views"], landmarks, figures["distinct_pairs"])
    atol = 1e-6 * figures["path_length"]
    npt.assert_allclose(sparse.centres.mean(axis=0), figures["mean_centre"], atol=atol)
    ups = -sparse.T_world_camera[:, :3, 1].mean(axis=0)
    npt.assert_allclose(ups, figures["camera_up_mean"], atol=1e-6)
    # Text and binary files of COLMAP list the images in another order.
    ends = [figures["first_centre"], figures["last_centre"]]
    for end in ends:
        assert np.linalg.norm(sparse.centres - end, axis=1).min() < atol
    mean = np.array(figures.get("landmark_mean") or figures["point_mean_map"])
    npt.assert_allclose(sparse.landmarks.mean(axis=0), mean, atol=1e-6 * np.abs(mean).max())


@pytest.mark.parametrize("name", REFUSED)
def test_a_sample_that_cannot_serve_is_refused(name: str) -> None:
    with pytest.raises(FileFormatError, match=REFUSED[name]):
        read_views(DATA / name)


def test_text_and_binary_models_hold_the_same_sightings() -> None:
    sets = []
    for name in ("colmap_kitti06_mono", "colmap_kitti06_mono/text"):
        sparse = opened(name).sparse
        assert sparse.ids is not None
        names = np.array(sparse.names)[sparse.view_of].tolist()
        ids = sparse.ids[sparse.landmark_of].tolist()
        sets.append(set(zip(names, ids, strict=True)))
    assert sets[0] == sets[1]


def test_a_camera_height_of_165_cm_gives_the_scale_of_the_street() -> None:
    views = align(opened("colmap_kitti06_mono"), camera_height=1.65)
    truth = figures_of(("colmap_kitti06_mono",))["to_truth"]["scale"]
    assert views.similarity.scale == pytest.approx(truth, rel=0.01)


def test_the_features_of_a_rgbd_camera_project_to_their_pixels() -> None:
    log = opened("rtabmap_small/one_node_rgbd.db")
    assert (len(log), log.sparse.sightings) == (1, 997)
    [view] = log
    centre = figures_of(("rtabmap_small", "one_node_rgbd.db"))["first_centre"]
    npt.assert_allclose(view.T_map_base[:3, 3], centre, atol=1e-6)
    assert log.sparse.pixels is not None
    camera = log.sparse.cameras[0]
    assert camera.cx is not None
    x, _, z = view.points.xyz.T
    npt.assert_allclose(camera.focal_px * x / z + camera.cx, log.sparse.pixels[:, 0], atol=0.2)


def test_orphan_stamps_of_culled_keyframes_are_counted() -> None:
    sparse = opened("orbslam2_webcam").sparse
    assert dict(sparse.dropped) == {"sightings_of_unknown_views": 378}
    assert "35 keyframes" in sparse.notes[0]
