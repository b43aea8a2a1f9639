"""The clouds and transforms of a bag, read with the library ``rosbags``."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError, InputError
from groundmap.files.databases import MAGIC, has_tables
from groundmap.io.readers.bag_chunks import BAG1, MCAP, check_chunks
from groundmap.io.readers.point_clouds import Cloud, WrongCloudError, id_field, read_cloud
from groundmap.io.readers.sniffing import head_of
from groundmap.io.readers.transforms import TransformTree

EXPECTED = "a ROS bag"
CLOUD = "sensor_msgs/msg/PointCloud2"
TF = "tf2_msgs/msg/TFMessage"
OLD_TF = "tf/msg/tfMessage"
ODOMETRY = "nav_msgs/msg/Odometry"
WANTED = {CLOUD, TF, OLD_TF, ODOMETRY}
MOST_POINTS = 50_000_000  # of all clouds of a bag
SHOWN_TOPICS = 12
# Exceptions of the library and of its decoders for damaged bags, collected by damaging bags.
DAMAGES = (OSError, EOFError, ValueError, ArithmeticError, LookupError, RuntimeError, TypeError,
           AttributeError, AssertionError, MemoryError, struct.error, zlib.error,
           sqlite3.Error)  # fmt: skip


@dataclass
class Clouds:
    """The clouds of a topic."""

    frame: str
    has_ids: bool = False
    stamps: list[float] = field(default_factory=list)
    clouds: list[Cloud] = field(default_factory=list)

    @property
    def messages(self) -> int:
        """Number of messages."""
        return len(self.clouds)


@dataclass
class BagContent:
    """What a bag contains, as far as maps need it."""

    tree: TransformTree = field(default_factory=TransformTree)
    clouds: dict[str, Clouds] = field(default_factory=dict)
    topics: list[str] = field(default_factory=list)  #: each with its type and number of messages


def is_bag(path: Path) -> bool:
    """Return whether a file is a bag: of ROS 1, in MCAP, or a database with its tables."""
    head = head_of(path)
    if head.startswith((BAG1, MCAP)):
        return True
    if not head.startswith(MAGIC):
        return False
    return has_tables(path, {"topics", "messages"})


def read_bag(path: Path) -> BagContent:
    """Read the clouds, transforms and odometry of a bag.

    Raises
    ------
    InputError
        The library is not installed.
    FileFormatError
        A damaged bag.
    """
    try:
        import apsw
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.rosbag1 import ReaderError as ReaderError1
        from rosbags.rosbag2 import ReaderError as ReaderError2
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError
    except ImportError as error:
        hint = "pip install 'groundmap[bags]'"
        raise InputError(str(path), "the library rosbags for bags", "none", hint=hint) from error
    own = (AnyReaderError, ReaderError1, ReaderError2, SerdeError, TypesysError, apsw.Error)
    content = BagContent()
    try:
        check_chunks(path)
        with AnyReader([path]) as reader:
            _read(path, reader, content)
    except InputError:
        raise
    except WrongCloudError as error:
        raise FileFormatError(path, f"{EXPECTED} with whole clouds", str(error)) from error
    except (*own, *DAMAGES) as error:
        got = f"a damaged one ({type(error).__name__}: {error})"
        raise FileFormatError(path, EXPECTED, got, hint="Was it cut short?") from error
    return content


def _read(path: Path, reader: Any, content: BagContent) -> None:
    connections = list(reader.connections)
    content.topics = _describe(connections)
    wanted = [connection for connection in connections if connection.msgtype in WANTED]
    odometry: list[tuple[str, str, float, Floats]] = []
    points = 0
    for connection, _, raw in reader.messages(connections=wanted) if wanted else ():
        message = reader.deserialize(raw, connection.msgtype)
        if connection.msgtype == CLOUD:
            points += _add_cloud(content, connection.topic, message)
            if points > MOST_POINTS:
                raise FileFormatError(path, f"at most {MOST_POINTS} points", "more")
        elif connection.msgtype == ODOMETRY:
            pose = _pose(message.pose.pose.position, message.pose.pose.orientation)
            frames = (_frame(message.header.frame_id), _frame(message.child_frame_id))
            odometry.append((*frames, _stamp(message.header), pose))
        else:
            fixed = connection.topic.endswith("static")
            for transform in message.transforms:
                _add_transform(content.tree, transform, fixed=fixed)
    # Odometry is the pose of frames that no transform places.
    placed = {child for _, child, _, _ in odometry if content.tree.has_parent(child)}
    for parent, child, time, pose in odometry:
        if child and child not in placed:
            content.tree.add(parent, child, time, pose)


def _describe(connections: list[Any]) -> list[str]:
    counts: dict[tuple[str, str], int] = {}
    for connection in connections:
        key = (str(connection.topic), str(connection.msgtype))
        counts[key] = counts.get(key, 0) + int(connection.msgcount)
    lines = [f"{topic} ({kind}, {count:,})" for (topic, kind), count in sorted(counts.items())]
    if len(lines) > SHOWN_TOPICS:
        return [*lines[:SHOWN_TOPICS], f"{len(lines) - SHOWN_TOPICS} more"]
    return lines


def _add_cloud(content: BagContent, topic: str, message: Any) -> int:
    frame = _frame(message.header.frame_id)
    clouds = content.clouds.setdefault(topic, Clouds(frame))
    if clouds.frame != frame:
        raise WrongCloudError(f"clouds of {topic} in {clouds.frame} and {frame}")
    cloud = read_cloud(message)
    clouds.has_ids = clouds.has_ids or id_field(message) is not None
    clouds.stamps.append(_stamp(message.header))
    clouds.clouds.append(cloud)
    return len(cloud.positions)


def _add_transform(tree: TransformTree, message: Any, *, fixed: bool) -> None:
    pose = _pose(message.transform.translation, message.transform.rotation)
    parent, child = _frame(message.header.frame_id), _frame(message.child_frame_id)
    tree.add(parent, child, None if fixed else _stamp(message.header), pose)


def _frame(name: str) -> str:
    return str(name).lstrip("/")


def _stamp(header: Any) -> float:
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def _pose(position: Any, orientation: Any) -> Floats:
    quaternion = [orientation.x, orientation.y, orientation.z, orientation.w]
    values = np.array([position.x, position.y, position.z, *quaternion], dtype=np.float64)
    # As in tf, a quaternion is normalised, however long it is.
    if not np.isfinite(values).all() or not 0.1 < np.linalg.norm(values[3:]) < 10.0:
        raise WrongCloudError(f"a pose of {values.tolist()}")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
    pose[:3, 3] = values[:3]
    return pose
