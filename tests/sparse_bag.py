"""Small bags of ROS: clouds of a camera on a robot, with transforms or odometry."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES: Any = STORE.types
OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # x y z w of optical axes in base_link
POINTS = [(0.0, 1.0, 5.0), (np.nan, 0.0, 1.0), (1.0, 0.5, 8.0)]


def stamp(time: float) -> Any:
    return TYPES["builtin_interfaces/msg/Time"](sec=int(time), nanosec=round(1e9 * (time % 1)))


def header(time: float, frame: str) -> Any:
    return TYPES["std_msgs/msg/Header"](stamp=stamp(time), frame_id=frame)


def transform(
    time: float, parent: str, child: str, place: tuple[float, float, float],
    turn: tuple[float, float, float, float] = (0, 0, 0, 1),
) -> Any:  # fmt: skip
    x, y, z, w = turn
    return TYPES["geometry_msgs/msg/TransformStamped"](
        header=header(time, parent),
        child_frame_id=child,
        transform=TYPES["geometry_msgs/msg/Transform"](
            translation=TYPES["geometry_msgs/msg/Vector3"](*place),
            rotation=TYPES["geometry_msgs/msg/Quaternion"](x, y, z, w),
        ),
    )


def cloud(time: float, frame: str) -> Any:
    dtype = np.dtype(
        {
            "names": ["x", "y", "z", "id"],
            "formats": ["<f4", "<f4", "<f4", "<u4"],
            "offsets": [0, 4, 8, 16],
            "itemsize": 32,
        }
    )
    rows = np.zeros(len(POINTS), dtype)
    for row, point in enumerate(POINTS):
        rows[row] = (*point, 40 + row)
    field = TYPES["sensor_msgs/msg/PointField"]
    fields = [field(name, offset, 7, 1) for name, offset in (("x", 0), ("y", 4), ("z", 8))]
    return TYPES["sensor_msgs/msg/PointCloud2"](
        header=header(time, frame),
        height=1,
        width=len(POINTS),
        fields=[*fields, field("id", 16, 6, 1)],
        is_bigendian=False,
        point_step=32,
        row_step=32 * len(POINTS),
        data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=False,
    )


def messages(*, clouds: bool = True) -> list[tuple[str, str, Any, float]]:
    tf = TYPES["tf2_msgs/msg/TFMessage"]
    fixed = transform(0.0, "base_link", "camera_optical", (0.3, 0.0, 1.5), OPTICAL)
    found = [("/tf_static", "tf2_msgs/msg/TFMessage", tf([fixed]), 1.0)]
    for time in (1.0, 2.0, 3.0):
        moved = transform(time, "odom", "base_link", (time, 0.0, 0.0))
        found.append(("/tf", "tf2_msgs/msg/TFMessage", tf([moved]), time))
    if clouds:
        for time in (1.5, 2.5, 9.0):  # between two poses, and long after the last
            message = cloud(time, "camera_optical")
            found.append(("/points", "sensor_msgs/msg/PointCloud2", message, time + 0.04))
    return found


def write_bag2(
    path: Path,
    found: list[tuple[str, str, Any, float]],
    storage: str,
    *,
    compressed: bool = False,
) -> Path:
    """Write a bag of ROS 2, in chunks of the storage compressed by zstd on request."""
    writer = Writer2(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, message, time in found:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = STORE.serialize_cdr(message, kind)
            writer.write(connections[topic], round(1e9 * time), data)
    return path


def files_of(found: list[tuple[str, str, Any, float]], storage: str) -> dict[str, bytes]:
    """Return the files of a bag of ROS 2."""
    with TemporaryDirectory() as folder:
        path = write_bag2(Path(folder) / "bag", found, storage)
        return {file.name: file.read_bytes() for file in sorted(path.iterdir())}


def write_bag1(bag: Path) -> Path:
    """Write a bag of ROS 1: odometry of a scanner, and its clouds."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types: Any = store.types
    with Writer1(bag) as writer:
        links = {
            "/odom": writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store),
            "/points": writer.add_connection(
                "/points", "sensor_msgs/msg/PointCloud2", typestore=store
            ),
        }
        make = types["std_msgs/msg/Header"]
        for time in (1, 2):
            at = types["builtin_interfaces/msg/Time"](sec=time, nanosec=0)
            zeros = np.zeros(36)
            vector = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            odometry = types["nav_msgs/msg/Odometry"](
                header=make(seq=0, stamp=at, frame_id="odom"),
                child_frame_id="lidar",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](
                    pose=types["geometry_msgs/msg/Pose"](
                        position=types["geometry_msgs/msg/Point"](float(time), 0.0, 1.0),
                        orientation=types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                    ),
                    covariance=zeros,
                ),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](
                    twist=types["geometry_msgs/msg/Twist"](linear=vector, angular=vector),
                    covariance=zeros,
                ),
            )
            scan = cloud(time, "lidar")
            scan = types["sensor_msgs/msg/PointCloud2"](
                **{**vars(scan), "header": make(seq=0, stamp=at, frame_id="lidar")}
            )
            for topic, message in (("/odom", odometry), ("/points", scan)):
                kind = links[topic].msgtype
                writer.write(links[topic], 10**9 * time, store.serialize_ros1(message, kind))
    return bag


def ros1_file() -> dict[str, bytes]:
    """Return a bag of ROS 1."""
    with TemporaryDirectory() as folder:
        return {"drive.bag": write_bag1(Path(folder) / "drive.bag").read_bytes()}
