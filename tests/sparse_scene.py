"""A small known scene, and writers of it in the formats of SLAM and SfM systems.

The writers are independent of the readers: each writes a format as its system documents it.
"""

from __future__ import annotations

import json
import sqlite3
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
from scipy.spatial.transform import Rotation

from groundmap.arrays import Floats

Files = dict[str, bytes]

FOCAL, WIDTH, HEIGHT = 500.0, 1280, 720


@dataclass(frozen=True)
class Scene:
    """A drive of five views past landmarks on the ground and on two walls."""

    rotations: Floats  #: shape (n, 3, 3), camera to world
    centres: Floats  #: shape (n, 3) [world]
    landmarks: Floats  #: shape (m, 3) [world]
    pairs: list[tuple[int, int]]  #: (view, landmark), sorted
    ids: list[int] = field(default_factory=list)  #: of the landmarks, with gaps

    def in_camera(self, view: int, landmark: int) -> Floats:
        """Return a landmark in the frame of a camera."""
        offset = self.landmarks[landmark] - self.centres[view]
        moved: Floats = offset @ self.rotations[view]
        return moved

    def pixel(self, view: int, landmark: int) -> tuple[float, float]:
        """Return the column and row of a landmark in a view."""
        x, y, z = self.in_camera(view, landmark)
        return FOCAL * x / z + WIDTH / 2, FOCAL * y / z + HEIGHT / 2

    def seen_by(self, view: int) -> list[int]:
        """Return the landmarks that a view saw."""
        return [landmark for number, landmark in self.pairs if number == view]

    def views_of(self, landmark: int) -> list[int]:
        """Return the views that saw a landmark."""
        return [view for view, number in self.pairs if number == landmark]

    def translation(self, view: int) -> Floats:
        """Return the translation of world to camera."""
        moved: Floats = -self.rotations[view].T @ self.centres[view]
        return moved

    def quaternion(self, view: int, *, inverse: bool) -> Floats:
        """Return x y z w of camera to world, or of its inverse."""
        rotation = Rotation.from_matrix(self.rotations[view])
        found: Floats = (rotation.inv() if inverse else rotation).as_quat()
        return found


def make_scene(*, views: int = 5, landmarks: int = 60, tilt: float = 0.0) -> Scene:
    """Return a scene in an optical world (y down), the ground 1.5 below the cameras.

    Parameters
    ----------
    views, landmarks : int
    tilt : float [rad]
        Of the world about an oblique axis.
    """
    rng = np.random.default_rng(4)
    turn = Rotation.from_rotvec(tilt * np.array([0.8, 0.0, 0.6])).as_matrix()
    yaw = 0.02 * np.arange(views)
    rotations = Rotation.from_rotvec(np.outer(yaw, [0.0, 1.0, 0.0])).as_matrix()
    centres = np.column_stack([0.05 * np.arange(views), np.zeros(views), 0.8 * np.arange(views)])
    third = landmarks // 3
    ground = np.column_stack(
        [rng.uniform(-2, 2, third), np.full(third, 1.5), rng.uniform(3, 14, third)]
    )
    walls = [
        np.column_stack(
            [np.full(third, side), rng.uniform(-0.5, 1.4, third), rng.uniform(3, 14, third)]
        )
        for side in (-3.0, 3.0)
    ]
    points = np.concatenate([ground, *walls])
    scene = Scene(turn @ rotations, centres @ turn.T, points @ turn.T, [])
    pairs = []
    for view in range(views):
        for landmark in range(len(points)):
            x, y, z = scene.in_camera(view, landmark)
            if z > 1.0 and abs(x) < z and abs(y) < z * 0.7:
                pairs.append((view, landmark))
    ids = [7 + 3 * landmark for landmark in range(len(points))]
    return Scene(scene.rotations, scene.centres, scene.landmarks, pairs, ids)


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


def colmap_text(scene: Scene) -> Files:
    """Return a model of COLMAP in text files."""
    cameras = f"# a comment\n3 SIMPLE_RADIAL {WIDTH} {HEIGHT} {FOCAL} {WIDTH / 2} {HEIGHT / 2} 0\n"
    images = "# a comment\n"
    for view in range(len(scene.centres)):
        x, y, z, w = scene.quaternion(view, inverse=True)
        pose = " ".join(f"{value:.17g}" for value in (w, x, y, z, *scene.translation(view)))
        images += f"{10 + view} {pose} 3 front/{view}.png\n1.5 2.5 -1"
        for landmark in scene.seen_by(view):
            column, row = scene.pixel(view, landmark)
            images += f" {column:.17g} {row:.17g} {scene.ids[landmark]}"
        images += "\n"
    points = "# a comment\n"
    for landmark, xyz in enumerate(scene.landmarks):
        track = " ".join(f"{10 + view} 0" for view in scene.views_of(landmark))
        place = " ".join(f"{value:.17g}" for value in xyz)
        points += f"{scene.ids[landmark]} {place} 1 2 3 0.5 {track}\n"
    return {
        "cameras.txt": cameras.encode(),
        "images.txt": images.encode(),
        "points3D.txt": points.encode(),
    }


def tum(scene: Scene) -> bytes:
    """Return the trajectory of a scene, a view every 0.1 s."""
    lines = []
    for view, centre in enumerate(scene.centres):
        pose = " ".join(
            f"{value:.9f}" for value in (*centre, *scene.quaternion(view, inverse=False))
        )
        lines.append(f"{1700000000 + 0.1 * view:.6f} {pose}\n")
    return "".join(lines).encode()


def orbslam(scene: Scene) -> Files:
    """Return keyframes, and map points with the stamps of their keyframes, one of them culled."""
    lines = []
    for landmark, xyz in enumerate(scene.landmarks):
        stamps = [f"{1700000000 + 0.1 * view:.6f}" for view in scene.views_of(landmark)]
        if landmark == 4:
            stamps.append("1700000000.050000")
        lines.append(" ".join([*(f"{value:.9f}" for value in xyz), *stamps]) + "\n")
    return {"KeyFrameTrajectory.txt": tum(scene), "points.txt": "".join(lines).encode()}


def bundler(scene: Scene) -> Files:
    """Return a Bundler file with an unregistered camera in front, and the list of its images."""
    lines = ["# Bundle file v0.3", f"{len(scene.centres) + 1} {len(scene.landmarks)}"]
    lines += ["0 0 0", *["0 0 0"] * 4]
    flip = np.diag([1.0, -1.0, -1.0])
    for view in range(len(scene.centres)):
        rotation = flip @ scene.rotations[view].T
        lines.append(f"{FOCAL} 0 0")
        lines += [_row(row) for row in (*rotation, flip @ scene.translation(view))]
    for landmark, place in enumerate(scene.landmarks):
        seen = scene.views_of(landmark)
        lines += [_row(place), "1 2 3"]
        words = [str(len(seen))]
        for view in seen:
            column, row = scene.pixel(view, landmark)
            words.append(f"{view + 1} 0 {column - WIDTH / 2:.17g} {HEIGHT / 2 - row:.17g}")
        lines.append(" ".join(words))
    names = "".join(f"{view}.jpg 0 {FOCAL}\n" for view in range(len(scene.centres) + 1))
    return {"bundle.out": _text(lines), "list.txt": names.encode()}


def bal(scene: Scene) -> Files:
    """Return a problem of "Bundle Adjustment in the Large"."""
    lines = [f"{len(scene.centres)} {len(scene.landmarks)} {len(scene.pairs)}"]
    for view, landmark in scene.pairs:
        column, row = scene.pixel(view, landmark)
        lines.append(f"{view} {landmark} {column - WIDTH / 2:.17g} {HEIGHT / 2 - row:.17g}")
    flip = np.diag([1.0, -1.0, -1.0])
    for view in range(len(scene.centres)):
        vector = Rotation.from_matrix(flip @ scene.rotations[view].T).as_rotvec()
        values = [*vector, *(flip @ scene.translation(view)), FOCAL, 0.0, 0.0]
        lines += [f"{value:.17g}" for value in values]
    lines += [f"{value:.17g}" for value in scene.landmarks.ravel()]
    return {"problem.txt": _text(lines)}


def nvm(scene: Scene) -> Files:
    """Return a file of VisualSFM with two models, of which the second is empty of points."""
    lines = ["NVM_V3 ", "", str(len(scene.centres))]
    for view, centre in enumerate(scene.centres):
        x, y, z, w = scene.quaternion(view, inverse=True)
        lines.append(f"my photo {view}.jpg\t{FOCAL} {_row((w, x, y, z, *centre))} 0 0")
    lines += ["", str(len(scene.landmarks))]
    for landmark, place in enumerate(scene.landmarks):
        seen = scene.views_of(landmark)
        words = [_row(place), "1 2 3", str(len(seen))]
        for view in seen:
            column, row = scene.pixel(view, landmark)
            words.append(f"{view} 0 {column - WIDTH / 2:.17g} {row - HEIGHT / 2:.17g}")
        lines.append(" ".join(words))
    lines += ["", "1", f"other.jpg\t{FOCAL} 1 0 0 0 0 0 0 0 0", "0", "", "0", "#the end"]
    return {"model.nvm": _text(lines)}


def opensfm(scene: Scene) -> Files:
    """Return a reconstruction of OpenSfM and its tracks, one of them not reconstructed."""
    shots = {}
    for view in range(len(scene.centres)):
        vector = Rotation.from_matrix(scene.rotations[view].T).as_rotvec()
        shots[f"{view}.jpg"] = {
            "rotation": vector.tolist(),
            "translation": scene.translation(view).tolist(),
            "camera": "v2 phone",
            "capture_time": 1700000000.0 + view,
            "gps_dop": 999999.0,
        }
    camera = {"projection_type": "brown", "width": WIDTH, "height": HEIGHT}
    camera |= {"focal_x": FOCAL / WIDTH, "focal_y": FOCAL / WIDTH, "c_x": 0.0, "c_y": 0.0}
    points = {
        str(number): {"coordinates": place.tolist(), "color": [1, 2, 3]}
        for number, place in zip(scene.ids, scene.landmarks, strict=True)
    }
    whole: dict[str, Any] = {"cameras": {"v2 phone": camera}, "shots": shots, "points": points}
    whole["reference_lla"] = {"latitude": 0.0, "longitude": 0.0, "altitude": 0.0}
    part = {"cameras": {"v2 phone": camera}, "shots": {}, "points": {}}
    rows = ["OPENSFM_TRACKS_VERSION_v2", "0.jpg\t99999\t5\t0.1\t0.1\t0.001\t1\t2\t3\t-1\t-1"]
    for view, landmark in scene.pairs:
        column, row = scene.pixel(view, landmark)
        x, y = (column - WIDTH / 2) / WIDTH, (row - HEIGHT / 2) / WIDTH
        rows.append(
            f"{view}.jpg\t{scene.ids[landmark]}\t{landmark}\t{x}\t{y}\t0.001\t1\t2\t3\t-1\t-1"
        )
    return {"reconstruction.json": json.dumps([part, whole]).encode(), "tracks.csv": _text(rows)}


def openmvg_json(scene: Scene) -> Files:
    """Return sfm_data of OpenMVG in JSON, with a view that has no pose."""
    views, poses = [], []
    for view in range(len(scene.centres) + 1):
        data = {"local_path": "", "filename": f"{view}.jpg", "width": WIDTH, "height": HEIGHT}
        data |= {"id_view": view, "id_intrinsic": 0, "id_pose": 20 + view}
        value = {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649, "data": data}}
        views.append({"key": view, "value": value})
    for view, centre in enumerate(scene.centres):
        pose = {"rotation": scene.rotations[view].T.tolist(), "center": centre.tolist()}
        poses.append({"key": 20 + view, "value": pose})
    camera: dict[str, Any] = {"width": WIDTH, "height": HEIGHT, "focal_length": FOCAL}
    camera |= {"principal_point": [WIDTH / 2, HEIGHT / 2], "disto_k3": [0.0, 0.0, 0.0]}
    kind: dict[str, Any] = {"polymorphic_id": 2147483649, "polymorphic_name": "pinhole_radial_k3"}
    kind["ptr_wrapper"] = {"id": 2147483660, "data": camera}
    structure = []
    for landmark, place in enumerate(scene.landmarks):
        seen = [
            {"key": view, "value": {"id_feat": 0, "x": list(scene.pixel(view, landmark))}}
            for view in scene.views_of(landmark)
        ]
        value = {"X": place.tolist(), "observations": seen}
        structure.append({"key": scene.ids[landmark], "value": value})
    whole = {"sfm_data_version": "0.3", "root_path": "", "views": views}
    whole |= {"intrinsics": [{"key": 0, "value": kind}], "extrinsics": poses}
    whole |= {"structure": structure, "control_points": []}
    return {"sfm_data.json": json.dumps(whole).encode()}


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


def meshroom(scene: Scene) -> Files:
    """Return a scene of Meshroom with structure; all numbers are texts."""
    views, poses = [], []
    for view in range(len(scene.centres) + 1):
        numbers = {"viewId": str(900 + view), "poseId": str(500 + view), "intrinsicId": "77"}
        views.append(numbers | {"path": f"{view}.jpg", "width": str(WIDTH), "height": str(HEIGHT)})
    for view, centre in enumerate(scene.centres):
        transform = {
            "rotation": [f"{value:.17g}" for value in scene.rotations[view].ravel()],
            "center": [f"{value:.17g}" for value in centre],
        }
        poses.append({"poseId": str(500 + view), "pose": {"transform": transform, "locked": "0"}})
    camera = {"intrinsicId": "77", "width": str(WIDTH), "height": str(HEIGHT), "type": "radial3"}
    camera |= {"pxFocalLength": str(FOCAL)}
    structure = [
        {
            "landmarkId": str(scene.ids[landmark]),
            "X": [f"{value:.17g}" for value in place],
            "observations": [
                {"observationId": str(900 + view), "featureId": "0", "x": ["1", "2"]}
                for view in scene.views_of(landmark)
            ],
        }
        for landmark, place in enumerate(scene.landmarks)
    ]
    whole = {"version": ["1", "2", "6"], "views": views, "intrinsics": [camera]}
    whole |= {"poses": poses, "structure": structure}
    return {"sfm.sfm": json.dumps(whole).encode()}


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


def _row(values: Iterable[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
