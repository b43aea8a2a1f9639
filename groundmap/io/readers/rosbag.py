"""Reader of ROS 1 bags, and ROS 2 bags in SQLite or MCAP, through the library ``rosbags``.

A view is a point cloud in the frame of a sensor, whose pose follows from the transforms and the
odometry of the bag at the stamp of the cloud. The root of the frames is the world, z up and in
metres (REP-103).
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.point_clouds import Cloud
from groundmap.io.readers.rosbag_content import CLOUD, BagContent, is_bag, read_bag
from groundmap.io.readers.sniffing import matching_files
from groundmap.io.readers.transforms import TransformTree
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap
from groundmap.view.frames import T_REP103_OPTICAL

BASES = ("base_link", "base_footprint", "base")
UP = np.array([0.0, 0.0, 1.0])
UPRIGHT = 0.7  # cosine of the angle between z of a sensor frame and z of the world
MOST_POINTS = 20_000  # of a cloud that are used, evenly
NOISE = 0.005  # standard deviation of a distance, as a share of its square [1/m]


class RosbagLog(SparseMapLog):
    """Views of the point clouds of a bag."""

    looks_for = "a ROS bag (.bag, .mcap, .db3, or a folder with metadata.yaml)"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file is a bag, or a folder one of ROS 2, by their first bytes."""
        return bool(matching_files(path, is_bag))

    def read_map(self, path: Path) -> SparseMap:
        """Read the clouds with most messages, and their poses."""
        files = matching_files(path, is_bag)
        folder = path.is_dir() and (path / "metadata.yaml").is_file()
        if not folder and len(files) > 1:
            names = ", ".join(file.name for file in files[:5])
            raise FileFormatError(path, "one bag", f"{len(files)}: {names}", hint="Give one.")
        content = read_bag(path if folder or not files else files[0])
        topic = _choose_topic(path, content)
        return _assemble(path, content, topic)


def _choose_topic(path: Path, content: BagContent) -> str:
    """Return the topic of clouds from a moving sensor, with ids if possible, of most messages."""
    usable = [
        topic
        for topic, clouds in content.clouds.items()
        if clouds.messages and content.tree.moves(clouds.frame)
    ]
    if usable:
        return max(
            usable,
            key=lambda topic: (content.clouds[topic].has_ids, content.clouds[topic].messages),
        )
    found = "; ".join(content.topics) or "no topic"
    if not content.clouds:
        expected = f"a topic of clouds ({CLOUD}) in the frame of a sensor, and its poses"
        raise FileFormatError(path, expected, f"the topics {found}", hint=RECORD)
    frames = ", ".join(f"{topic} in {clouds.frame}" for topic, clouds in content.clouds.items())
    raise FileFormatError(
        path,
        "clouds in a frame that moves (tf or odometry)",
        f"{frames}, and the topics {found}",
        hint="A cloud of the whole map has no visibility: record the cloud of each keyframe in the "
        "frame of the camera, and /tf and /tf_static.",
    )


RECORD = "Record the cloud of each keyframe in the frame of the camera, with /tf and /tf_static."


class _View(NamedTuple):
    stamp: float
    T_world_camera: Floats
    T_base_camera: Floats | None
    cloud: Cloud  # positions in the camera


def _assemble(path: Path, content: BagContent, topic: str) -> SparseMap:
    clouds = content.clouds[topic]
    dropped: Counter[str] = Counter()
    views = []
    for stamp, cloud in zip(clouds.stamps, clouds.clouds, strict=True):
        view = _view(content.tree, clouds.frame, stamp, cloud)
        if view is None:
            dropped["clouds_without_pose"] += 1
        else:
            views.append(view)
    if not views:
        raise FileFormatError(
            path, f"poses of {clouds.frame} at the times of {topic}", "none within 0.1 s"
        )
    notes = [
        f"clouds of {topic} in {clouds.frame}, poses in {content.tree.chain(clouds.frame)[-1]}"
    ]
    others = [name for name in content.clouds if name != topic]
    if others:
        notes.append(f"other clouds are not used: {', '.join(others)}")
    return _sparse(views, dropped, tuple(notes))


def _view(tree: TransformTree, frame: str, stamp: float, cloud: Cloud) -> _View | None:
    pose = tree.pose(frame, stamp)
    if pose is None:
        return None
    chain = tree.chain(frame)
    base = next((name for name in BASES if name in chain), None)
    T_base_sensor = None if base is None else tree.within(frame, base, stamp)
    if len(cloud.positions) > MOST_POINTS:
        step = -(-len(cloud.positions) // MOST_POINTS)
        cloud = Cloud(cloud.positions[::step], None if cloud.ids is None else cloud.ids[::step])
    if not _is_optical(frame, pose):  # x forward, z up
        pose = pose @ T_REP103_OPTICAL
        cloud = Cloud(cloud.positions @ T_REP103_OPTICAL[:3, :3], cloud.ids)
        if T_base_sensor is not None:
            T_base_sensor = T_base_sensor @ T_REP103_OPTICAL
    return _View(stamp, pose, T_base_sensor, cloud)


def _is_optical(frame: str, pose: Floats) -> bool:
    """Return whether a sensor frame has optical axes: by its name, or as its z is not up."""
    return "optical" in frame or abs(float(pose[2, 2])) < UPRIGHT


def _sparse(views: list[_View], dropped: Counter[str], notes: tuple[str, ...]) -> SparseMap:
    poses = np.array([view.T_world_camera for view in views])
    finite = [np.isfinite(view.cloud.positions).all(axis=1) for view in views]
    dropped["points_not_finite"] += int(sum((~keep).sum() for keep in finite))
    local = [view.cloud.positions[keep] for view, keep in zip(views, finite, strict=True)]
    owners = np.repeat(np.arange(len(views)), [len(points) for points in local])
    positions = np.concatenate(local)
    world = np.einsum("kij,kj->ki", poses[owners, :3, :3], positions) + poses[owners, :3, 3]
    mounted = [view.T_base_camera for view in views if view.T_base_camera is not None]
    # A sensor that sees to all sides is split into flat views.
    camera = Camera(model="point cloud", projection="fisheye")
    return SparseMap(
        system="ROS",
        T_world_camera=poses,
        landmarks=world,
        view_of=owners,
        landmark_of=np.arange(len(world)),
        ids=_ids(views, finite),
        names=tuple(f"{view.stamp:.9f}" for view in views),
        timestamps=np.array([view.stamp for view in views]),
        cameras=(camera,),
        covariance=_covariance(positions, poses[owners, :3, :3]),
        metric=True,
        up=UP,
        T_base_camera=np.array(mounted) if len(mounted) == len(views) else None,
        dropped=+dropped,
        notes=notes,
    )


def _ids(views: list[_View], finite: list[Any]) -> Any:
    ids = [
        np.full(len(keep), -1) if view.cloud.ids is None else view.cloud.ids
        for view, keep in zip(views, finite, strict=True)
    ]
    return np.concatenate([given[keep] for given, keep in zip(ids, finite, strict=True)])


def _covariance(positions: Floats, rotations: Floats) -> Floats:
    """Return the covariance of distances that are measured: along the ray by distance squared."""
    squared = np.maximum(np.einsum("ki,ki->k", positions, positions), 1e-12)
    rays = np.einsum("kij,kj->ki", rotations, positions) / np.sqrt(squared)[:, None]
    along, across = NOISE**2 * squared**2, (1.0 / 500.0) ** 2 * squared
    along = np.maximum(along, across)
    covariance: Floats = across[:, None, None] * np.eye(3)
    covariance += (along - across)[:, None, None] * np.einsum("ki,kj->kij", rays, rays)
    return covariance
