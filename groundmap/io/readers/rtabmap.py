"""Reader of RTAB-Map's databases.

A node is a view; its features have positions in the frame of the base. Optimised poses are used
where the database has them; those of odometry otherwise. Words are no landmarks: a word may occur
several times in a view.
"""

from __future__ import annotations

import zlib
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.files.databases import MAGIC, Database, has_tables, open_database
from groundmap.io.readers.base import SparseMapLog
from groundmap.io.readers.rtabmap_calibration import Calibration, read_calibration
from groundmap.io.readers.sniffing import head_of, single_file
from groundmap.sparse.cameras import Camera
from groundmap.sparse.sparse_map import SparseMap

EXPECTED = "a database of RTAB-Map"
TABLES = {"Node", "Data", "Admin"}
FEATURES = ("Feature", "Map_Node_Word")  # names of the table, since 0.12 and before
INTERMEDIATE = -9  # weight of nodes that are only part of the trajectory
MOST_POSES = 10_000_000
# Standard deviation of a depth, as a share of its square [1/m]: structured light and stereo with a
# baseline of 7.5 cm and a disparity that is certain to a fifth of a pixel.
DEPTH_NOISE = 0.005
UP = np.array([0.0, 0.0, 1.0])


class RtabmapLog(SparseMapLog):
    """Views of the nodes of RTAB-Map."""

    looks_for = "a database of RTAB-Map (.db)"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Return whether a file, or one in the folder, is a database with RTAB-Map's tables."""
        return single_file(path, is_rtabmap) is not None

    def read_map(self, path: Path) -> SparseMap:
        """Read a database."""
        file = single_file(path, is_rtabmap) or path
        with open_database(file, EXPECTED) as database:
            tables = database.tables()
            if not set(tables) >= TABLES:
                missing = sorted(TABLES - set(tables))[0]
                raise FileFormatError(file, f"{EXPECTED} with a table {missing}", "none")
            return _read(file, database, tables)


def is_rtabmap(path: Path) -> bool:
    """Return whether a file is a database with RTAB-Map's tables."""
    if not head_of(path).startswith(MAGIC):
        return False
    return has_tables(path, TABLES)


class _Node(NamedTuple):
    number: int
    stamp: float
    T_world_base: Floats
    calibration: Calibration


def _read(path: Path, database: Database, tables: dict[str, list[str]]) -> SparseMap:
    dropped: Counter[str] = Counter()
    optimised = _optimised_poses(path, database, tables)
    features = next((name for name in FEATURES if name in tables), None)
    count = 0
    if features is not None:
        query = f'SELECT count(*) FROM "{features}" WHERE depth_x IS NOT NULL'
        count = next(database.rows(query))[0]
    nodes = _nodes(path, database, optimised, dropped)
    if not count:
        total = next(database.rows("SELECT count(*) FROM Node"))[0]
        raise FileFormatError(
            path,
            "poses, landmarks, and which view saw which",
            f"{total:,} nodes without 3-D features",
            hint="Run rtabmap with Mem/RawDescriptorsKept true and a depth or stereo camera, so "
            "that features are kept."
            if total
            else "The database is empty: record a session.",
        )
    found = _features(path, database, str(features), nodes)
    notes = []
    if not optimised:
        notes.append("the database has no optimised poses, so those of odometry are used")
    return _assemble(nodes, found, dropped, tuple(notes))


def _pose(path: Path, blob: Any, what: str) -> Floats | None:
    """Return a transform from 12 numbers, row by row; None if there is none."""
    if blob is None:
        return None
    if not isinstance(blob, bytes) or len(blob) != 48:
        got = f"{len(blob)} bytes" if isinstance(blob, bytes) else repr(blob)[:60]
        raise FileFormatError(path, f"12 numbers (48 bytes) as {what}", got)
    rows = np.frombuffer(blob, "<f4").astype(np.float64).reshape(3, 4)
    if not np.isfinite(rows).all() or not rows.any():
        return None
    transform = np.eye(4)
    transform[:3] = rows
    return transform


def _optimised_poses(
    path: Path, database: Database, tables: dict[str, list[str]]
) -> dict[int, Floats]:
    if not {"opt_poses", "opt_ids"} <= set(tables["Admin"]):
        return {}
    row = next(database.rows("SELECT opt_ids, opt_poses FROM Admin"), None)
    if row is None or row[0] is None or row[1] is None:
        return {}
    ids = _unpack(path, row[0], "<i4").reshape(-1)
    poses = _unpack(path, row[1], "<f4").astype(np.float64).reshape(-1)
    if len(poses) != 12 * len(ids):
        got = f"{len(poses)} numbers for {len(ids)} nodes"
        raise FileFormatError(path, "12 numbers for each optimised pose", got)
    transforms = np.tile(np.eye(4), (len(ids), 1, 1))
    transforms[:, :3] = poses.reshape(-1, 3, 4)
    return dict(zip(ids.tolist(), transforms, strict=True))


def _unpack(path: Path, blob: Any, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Return a matrix: a zlib stream, then rows, columns and type as OpenCV has them."""
    item = np.dtype(dtype).itemsize
    if not isinstance(blob, bytes) or len(blob) < 12:
        raise FileFormatError(path, "a compressed matrix of optimised poses", repr(blob)[:60])
    rows, columns, _ = np.frombuffer(blob[-12:], "<i4").tolist()
    if rows < 0 or columns < 0 or rows * columns > 12 * MOST_POSES:
        raise FileFormatError(path, "a matrix of optimised poses", f"{rows} x {columns} numbers")
    size = rows * columns * item
    try:
        data = zlib.decompressobj().decompress(blob[:-12], size + 1)
    except zlib.error as error:
        raise FileFormatError(path, "a compressed matrix", f"damaged data ({error})") from error
    if len(data) != size:
        got = f"{len(data)} bytes or more"
        raise FileFormatError(path, f"{size} bytes of optimised poses", got)
    return np.frombuffer(data, dtype)


def _nodes(
    path: Path, database: Database, optimised: dict[int, Floats], dropped: Counter[str]
) -> list[_Node]:
    query = (
        "SELECT Node.id, Node.weight, Node.stamp, Node.pose, Data.calibration "
        "FROM Node JOIN Data ON Data.id = Node.id ORDER BY Node.id"
    )
    nodes = []
    for number, weight, stamp, blob, calibration in database.rows(query):
        if not isinstance(number, int):
            raise FileFormatError(path, "whole numbers as ids of nodes", repr(number)[:60])
        pose = optimised.get(number) if optimised else _pose(path, blob, "pose of a node")
        if weight == INTERMEDIATE:
            dropped["intermediate_nodes"] += 1
        elif pose is None:
            dropped["nodes_without_pose"] += 1
        elif not calibration:
            dropped["nodes_without_calibration"] += 1
        else:
            time = float(stamp) if isinstance(stamp, (int, float)) else 0.0
            nodes.append(_Node(number, time, pose, read_calibration(path, calibration)))
    return nodes


class _Features(NamedTuple):
    positions: Floats  # (k, 3) [base]
    owners: Ints  # (k,), rows of the nodes
    pixels: Floats  # (k, 2)


def _features(path: Path, database: Database, table: str, nodes: list[_Node]) -> _Features:
    """Return the features with a depth."""
    query = (
        f'SELECT node_id, pos_x, pos_y, depth_x, depth_y, depth_z FROM "{table}" '
        "WHERE depth_x IS NOT NULL ORDER BY node_id"
    )
    row_of = {node.number: row for row, node in enumerate(nodes)}
    rows = [row for row in database.rows(query) if row[0] in row_of]
    try:
        values = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 5)
    except (TypeError, ValueError) as error:
        raise FileFormatError(path, "numbers as features", f"others ({error})") from error
    owners = np.array([row_of[row[0]] for row in rows], dtype=np.int64)
    return _Features(values[:, 2:], owners, values[:, :2])


def _assemble(
    nodes: list[_Node], features: _Features, dropped: Counter[str], notes: tuple[str, ...]
) -> SparseMap:
    owners = features.owners
    T_world_base = np.array([node.T_world_base for node in nodes]).reshape(-1, 4, 4)
    T_base_camera = np.array([node.calibration.T_base_camera for node in nodes]).reshape(-1, 4, 4)
    poses = T_world_base @ T_base_camera
    world = np.einsum("kij,kj->ki", T_world_base[owners, :3, :3], features.positions)
    world += T_world_base[owners, :3, 3]
    stamps = np.array([node.stamp for node in nodes])
    return SparseMap(
        system="RTAB-Map",
        T_world_camera=poses,
        landmarks=world,
        view_of=owners,
        landmark_of=np.arange(len(world)),
        ids=np.full(len(world), -1),
        names=tuple(str(node.number) for node in nodes),
        timestamps=stamps if len(np.unique(stamps)) == len(stamps) else None,
        cameras=tuple(node.calibration.camera for node in nodes) or (Camera(model="none"),),
        camera_of=np.arange(len(nodes)),
        pixels=features.pixels,
        covariance=_covariance(world, poses, owners, nodes),
        metric=True,
        up=UP,
        T_base_camera=T_base_camera,
        dropped=+dropped,
        notes=notes,
    )


def _covariance(world: Floats, poses: Floats, owners: Ints, nodes: list[_Node]) -> Floats:
    """Return the covariance of measured depths: along the ray by depth squared, across by pixel."""
    offsets = world - poses[owners, :3, 3]
    squared = np.maximum(np.einsum("ki,ki->k", offsets, offsets), 1e-12)
    rays = np.einsum("ki,kj->kij", offsets, offsets) / squared[:, None, None]
    noise = np.array([node.calibration.camera.bearing_noise for node in nodes])[owners]
    along, across = DEPTH_NOISE**2 * squared**2, noise**2 * squared
    covariance: Floats = across[:, None, None] * np.eye(3)
    covariance += (along - across)[:, None, None] * rays
    return covariance
