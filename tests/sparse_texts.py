"""Writers of a known scene in the text formats of SLAM and SfM systems.

They are independent of the readers: each writes a format as its system documents it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from sparse_scene import FOCAL, HEIGHT, WIDTH, Files, Scene


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
    return {
        "reconstruction.json": json.dumps([part, whole], indent=1).encode(),
        "tracks.csv": _text(rows),
    }


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
    return {"sfm_data.json": json.dumps(whole, indent=1).encode()}


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
    return {"sfm.sfm": json.dumps(whole, indent=1).encode()}


def _row(values: Iterable[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values)


def _text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
