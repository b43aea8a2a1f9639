"""Writers of a known scene in the binary formats of SLAM and SfM systems.

They are independent of the readers: each writes a format as its system documents it.
"""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterable

import msgpack
import numpy as np
from scipy.spatial.transform import Rotation

from sparse_scene import FOCAL, HEIGHT, WIDTH, Files, Scene


def colmap_binary(scene: Scene) -> Files:
    """Return a model of COLMAP in binary files, with a keypoint that is no landmark."""
    cameras = struct.pack("<QIiQQ4d", 1, 3, 1, WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
    images = struct.pack("<Q", len(scene.centres))
    for view in range(len(scene.centres)):
        x, y, z, w = scene.quaternion(view, inverse=True)
        images += struct.pack("<I7d", 10 + view, w, x, y, z, *scene.translation(view))
        images += struct.pack("<I", 3) + f"front/{view}.png".encode() + b"\0"
        seen = scene.seen_by(view)
        images += struct.pack("<Q", len(seen) + 1) + struct.pack("<ddq", 1.5, 2.5, -1)
        for landmark in seen:
            images += struct.pack("<ddq", *scene.pixel(view, landmark), scene.ids[landmark])
    points = struct.pack("<Q", len(scene.landmarks))
    for landmark, xyz in enumerate(scene.landmarks):
        views = scene.views_of(landmark)
        points += struct.pack("<Q3d3Bd", scene.ids[landmark], *xyz, 1, 2, 3, 0.5)
        points += struct.pack("<Q", len(views))
        for view in views:
            points += struct.pack("<II", 10 + view, 1 + scene.seen_by(view).index(landmark))
    return {"cameras.bin": cameras, "images.bin": images, "points3D.bin": points}


def openmvg_binary(scene: Scene) -> Files:
    """Return sfm_data of OpenMVG in cereal's portable binary form."""

    def text(value: str) -> bytes:
        return struct.pack("<Q", len(value)) + value.encode()

    def vector(values: Iterable[float]) -> bytes:
        numbers = list(values)
        return struct.pack(f"<Q{len(numbers)}d", len(numbers), *numbers)

    data = b"\1" + text("0.3") + text("/images") + struct.pack("<Q", len(scene.centres) + 1)
    for view in range(len(scene.centres) + 1):
        data += struct.pack("<III", view, 0x40000000, 0x80000001 + view)
        data += text("") + text(f"{view}.jpg")
        data += struct.pack("<5I", WIDTH, HEIGHT, view, 0, 20 + view)
    data += struct.pack("<QII", 1, 0, 0x80000001) + text("pinhole_radial_k3")
    data += struct.pack("<IIId", 0x80000020, WIDTH, HEIGHT, FOCAL)
    data += vector([WIDTH / 2, HEIGHT / 2]) + vector([0, 0, 0])
    data += struct.pack("<Q", len(scene.centres))
    for view, centre in enumerate(scene.centres):
        data += struct.pack("<IQ", 20 + view, 3)
        data += b"".join(vector(row) for row in scene.rotations[view].T) + vector(centre)
    data += struct.pack("<Q", len(scene.landmarks))
    for landmark, place in enumerate(scene.landmarks):
        seen = scene.views_of(landmark)
        data += struct.pack("<I", scene.ids[landmark]) + vector(place)
        data += struct.pack("<Q", len(seen))
        for view in seen:
            data += struct.pack("<II", view, 0) + vector(scene.pixel(view, landmark))
    return {"sfm_data.bin": data + struct.pack("<Q", 0)}


def openmvs(scene: Scene) -> Files:
    """Return a scene of OpenMVS, version 6, with a camera that is turned on its platform."""

    def text(value: str) -> bytes:
        return struct.pack("<Q", len(value)) + value.encode()

    turn = Rotation.from_rotvec([0.0, 0.3, 0.0]).as_matrix()
    offset = np.array([0.1, 0.0, 0.0])
    matrix = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    data = b"MVSI" + struct.pack("<IIQ", 6, 0, 1) + text("platform") + struct.pack("<Q", 1)
    data += text("camera") + text("") + struct.pack("<II", WIDTH, HEIGHT)
    data += struct.pack("<21d", *matrix.ravel(), *turn.ravel(), *offset)
    data += struct.pack("<Q", len(scene.centres))
    for view, centre in enumerate(scene.centres):
        platform = turn.T @ scene.rotations[view].T
        data += struct.pack("<12d", *platform.ravel(), *(centre - platform.T @ offset))
    data += struct.pack("<Q", len(scene.centres) + 1)
    for view in range(len(scene.centres) + 1):
        pose = view if view < len(scene.centres) else 0xFFFFFFFF
        data += text(f"{view}.jpg") + text("") + struct.pack("<IIII", 0, 0, pose, view)
    data += struct.pack("<Q", len(scene.landmarks))
    for landmark, place in enumerate(scene.landmarks):
        seen = scene.views_of(landmark)
        data += struct.pack("<3fQ", *place, len(seen))
        data += b"".join(struct.pack("<If", view, 1.0) for view in seen)
    return {"scene.mvs": data + bytes(64)}


def stella_msgpack(scene: Scene) -> Files:
    """Return a map of stella_vslam in msgpack, with keypoints that are no landmarks."""
    camera = {"model_type": "Perspective", "setup_type": "Monocular", "cols": WIDTH, "rows": HEIGHT}
    camera |= {"fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    landmarks = {
        str(number): {"1st_keyfrm": 0, "pos_w": place.tolist(), "ref_keyfrm": 0}
        for number, place in zip(scene.ids, scene.landmarks, strict=True)
    }
    keyframes = {}
    for view in reversed(range(len(scene.centres))):
        seen = scene.seen_by(view)
        points = [{"pt": [1.0, 2.0], "ang": 0.0, "oct": 0}]
        points += [{"pt": list(scene.pixel(view, lm)), "ang": 0.0, "oct": 0} for lm in seen]
        keyframes[str(3 * view)] = {
            "ts": 100.0 + view,
            "cam": "webcam",
            "rot_cw": scene.quaternion(view, inverse=True).tolist(),
            "trans_cw": scene.translation(view).tolist(),
            "n_keypts": len(points),
            "undist_keypts": points,
            "lm_ids": [-1, *(scene.ids[landmark] for landmark in seen)],
        }
    whole = {"cameras": {"webcam": camera}, "keyframes": keyframes, "landmarks": landmarks}
    return {"map.msg": msgpack.packb(whole)}


def stella_sqlite(scene: Scene) -> Files:
    """Return a map of stella_vslam in SQLite."""
    camera = {"model_type": "Perspective", "setup_type": "Stereo", "cols": WIDTH, "rows": HEIGHT}
    camera |= {"fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    names = ", ".join(camera)
    statements: list[tuple[str, tuple[object, ...]]] = [
        (f"CREATE TABLE cameras (id INTEGER, name BLOB, {names})", ()),
        (
            f"INSERT INTO cameras VALUES (0, ?{', ?' * len(camera)})",
            (b"webcam", *(v.encode() if isinstance(v, str) else v for v in camera.values())),
        ),
        (
            "CREATE TABLE keyframes (id INTEGER, src_frm_id INTEGER, ts REAL, cam BLOB, "
            "orb_params BLOB, pose_cw BLOB, n_keypts INTEGER, undist_keypts BLOB)",
            (),
        ),
        ("CREATE TABLE landmarks (id INTEGER, first_keyfrm INTEGER, pos_w BLOB)", ()),
        ("CREATE TABLE associations (id INTEGER, lm_ids BLOB)", ()),
    ]
    for number, place in zip(scene.ids, scene.landmarks, strict=True):
        values: tuple[object, ...] = (number, 0, place.tobytes())
        statements.append(("INSERT INTO landmarks VALUES (?, ?, ?)", values))
    for view in range(len(scene.centres)):
        seen = scene.seen_by(view)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = scene.rotations[view].T, scene.translation(view)
        keypoints = b"".join(
            struct.pack("<5f2i", *scene.pixel(view, landmark), 31, 0, 1, 0, -1) for landmark in seen
        )
        values = (view, None, 100.0 + view, b"webcam", b"", pose.T.tobytes(), len(seen), keypoints)
        statements.append(("INSERT INTO keyframes VALUES (?, ?, ?, ?, ?, ?, ?, ?)", values))
        ids = np.array([scene.ids[landmark] for landmark in seen], dtype="<i4")
        statements.append(("INSERT INTO associations VALUES (?, ?)", (view, ids.tobytes())))
    return {"map.db": database_of(statements)}


def rtabmap(scene: Scene, *, optimised: bool = True) -> Files:
    """Return a database of RTAB-Map; a landmark is a feature in each node that saw it.

    Parameters
    ----------
    scene : Scene
    optimised : bool, default True
        Whether the database has optimised poses; those of odometry are then off by a metre.
    """
    base_camera = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1.0]])
    matrix = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    calibration = struct.pack("<11i", 0, 21, 1, 0, WIDTH, HEIGHT, 9, 0, 0, 0, 12)
    calibration += struct.pack("<9d12f", *matrix.ravel(), *base_camera[:3].ravel())
    statements: list[tuple[str, tuple[object, ...]]] = [
        ("CREATE TABLE Node (id INTEGER, weight INTEGER, stamp FLOAT, pose BLOB)", ()),
        ("CREATE TABLE Data (id INTEGER, calibration BLOB)", ()),
        (
            "CREATE TABLE Feature (node_id INTEGER, word_id INTEGER, pos_x FLOAT, pos_y FLOAT, "
            "depth_x FLOAT, depth_y FLOAT, depth_z FLOAT)",
            (),
        ),
        ("CREATE TABLE Admin (version TEXT, opt_ids BLOB, opt_poses BLOB)", ()),
    ]
    bases = []
    for view, centre in enumerate(scene.centres):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = scene.rotations[view], centre
        base = pose @ np.linalg.inv(base_camera)
        bases.append(base)
        odometry = base.copy()
        odometry[0, 3] += 1.0 if optimised else 0.0
        blob = odometry[:3].astype("<f4").tobytes()
        statements.append(("INSERT INTO Node VALUES (?, 0, ?, ?)", (view + 1, 50.0 + view, blob)))
        statements.append(("INSERT INTO Data VALUES (?, ?)", (view + 1, calibration)))
        for landmark in scene.seen_by(view):
            place = base_camera[:3, :3] @ scene.in_camera(view, landmark) + base_camera[:3, 3]
            values: tuple[object, ...] = (view + 1, -1, *scene.pixel(view, landmark), *place)
            statements.append(("INSERT INTO Feature VALUES (?, ?, ?, ?, ?, ?, ?)", values))
    matrices = np.array(bases)[:, :3].astype("<f4").reshape(1, -1)
    ids = np.arange(1, len(bases) + 1, dtype="<i4").reshape(1, -1)
    packed = [
        zlib.compress(array.tobytes()) + struct.pack("<3i", *array.shape, kind)
        for array, kind in ((ids, 4), (matrices, 5))
    ]
    values = ("0.21.1", *(packed if optimised else (None, None)))
    statements.append(("INSERT INTO Admin VALUES (?, ?, ?)", values))
    return {"rtabmap.db": database_of(statements)}


def database_of(statements: list[tuple[str, tuple[object, ...]]]) -> bytes:
    """Return the file of a database that statements create."""
    connection = sqlite3.connect(":memory:")
    for statement, values in statements:
        connection.execute(statement, values)
    connection.commit()
    data: bytes = connection.serialize()
    connection.close()
    return data
