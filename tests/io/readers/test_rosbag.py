"""Bags of ROS 1 and 2: clouds of a camera on a robot, with transforms or odometry."""

from __future__ import annotations

import bz2
import struct
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError
from groundmap.io import read_views
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.transforms import TransformTree
from groundmap.view.frames import T_REP103_OPTICAL
from sparse_bag import POINTS, cloud, messages, write_bag1, write_bag2


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_clouds_become_views_at_the_interpolated_pose(tmp_path: Path, storage: str) -> None:
    log = read_views(write_bag2(tmp_path / "bag", messages(), storage))
    assert isinstance(log, SparseMapLog)
    npt.assert_allclose(log.sparse.centres, [(1.8, 0, 1.5), (2.8, 0, 1.5)], atol=1e-12)
    assert dict(log.sparse.dropped) == {"clouds_without_pose": 1, "points_not_finite": 2}
    assert (log.sparse.landmark_count, log.sparse.sightings, log.sparse.metric) == (2, 4, True)
    first, second = log
    npt.assert_allclose(first.points.xyz, [POINTS[0], POINTS[2]], atol=1e-6)
    assert first.points.ids.tolist() == [40, 42]
    npt.assert_allclose(first.rig.T_base_camera[:3, :3], T_REP103_OPTICAL[:3, :3], atol=1e-12)
    assert second.timestamp == pytest.approx(2.5)


def test_a_file_of_a_bag_is_read_like_its_folder(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", messages(), "mcap")
    [file] = folder.glob("*.mcap")
    assert len(read_views(file)) == len(read_views(folder)) == 2


def test_a_bag_without_clouds_lists_its_topics(tmp_path: Path) -> None:
    bag = write_bag2(tmp_path / "bag", messages(clouds=False), "sqlite3")
    with pytest.raises(FileFormatError, match=r"topics /tf \(tf2_msgs/msg/TFMessage, 3\); /tf_st"):
        read_views(bag)


def test_a_cloud_of_the_whole_map_has_no_visibility(tmp_path: Path) -> None:
    whole = ("/map", "sensor_msgs/msg/PointCloud2", cloud(2.0, "odom"), 2.0)
    bag = write_bag2(tmp_path / "bag", [*messages(clouds=False), whole], "mcap")
    with pytest.raises(FileFormatError, match=r"clouds in a frame that moves .* got /map in odom"):
        read_views(bag)


def test_odometry_places_a_base_without_transforms(tmp_path: Path) -> None:
    log = read_views(write_bag1(tmp_path / "drive.bag"))
    assert isinstance(log, SparseMapLog)
    # The frame has z up: x forward becomes z of the camera.
    npt.assert_allclose(log.sparse.centres, [(1, 0, 1), (2, 0, 1)])
    npt.assert_allclose(log.sparse.T_world_camera[0], T_REP103_OPTICAL + np.array(
        [(0, 0, 0, 1), (0, 0, 0, 0), (0, 0, 0, 1), (0, 0, 0, 0)]
    ))  # fmt: skip
    npt.assert_allclose(log.sparse.landmarks[0], (1.0, 1.0, 6.0), atol=1e-6)


def test_poses_are_known_between_close_transforms_only() -> None:
    tree = TransformTree()
    for time in (0.0, 0.5, 5.0):
        pose = np.eye(4)
        pose[0, 3] = time
        tree.add("map", "base", time, pose)
    tree.add("base", "camera", None, np.eye(4))
    assert tree.chain("camera") == ["camera", "base", "map"]
    for time, x in ((0.25, 0.25), (0.5, 0.5), (5.05, 5.0)):
        found = tree.pose("camera", time)
        assert found is not None
        assert found[0, 3] == pytest.approx(x)
    assert tree.pose("camera", 2.0) is None
    assert tree.pose("camera", 5.2) is None


def test_a_chunk_that_is_larger_than_it_states_is_refused(tmp_path: Path) -> None:
    stated = 100
    data = bz2.compress(bytes(10**6))
    fields = (b"op=\x05", b"compression=bz2", b"size=" + struct.pack("<I", stated))
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    record = struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data
    bag = tmp_path / "lies.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n" + record)
    with pytest.raises(FileFormatError, match=r"100 bytes in chunk 0, as it states, got 101 or mo"):
        read_views(bag)


def test_compressed_bags_are_read(tmp_path: Path) -> None:
    folder = write_bag2(tmp_path / "bag", messages(), "mcap", compressed=True)
    assert len(read_views(folder)) == 2
