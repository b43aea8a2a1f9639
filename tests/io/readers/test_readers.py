"""Every reader against a known scene, written by code of its own."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import msgpack
import numpy as np
import numpy.testing as npt
import pytest

import sparse_binaries
import sparse_texts
from groundmap.errors import FileFormatError
from groundmap.io import read_views
from groundmap.io.readers.assembly import find_ids
from groundmap.io.readers.base import SparseMapLog
from sparse_scene import Files, Scene, make_scene

SCENE = make_scene()
WRITERS: dict[str, Callable[[Scene], Files]] = {
    "bal": sparse_texts.bal,
    "bundler": sparse_texts.bundler,
    "colmap_binary": sparse_binaries.colmap_binary,
    "colmap_text": sparse_texts.colmap_text,
    "meshroom": sparse_texts.meshroom,
    "nvm": sparse_texts.nvm,
    "openmvg_binary": sparse_binaries.openmvg_binary,
    "openmvg_json": sparse_texts.openmvg_json,
    "openmvs": sparse_binaries.openmvs,
    "opensfm": sparse_texts.opensfm,
    "orbslam": sparse_texts.orbslam,
    "rtabmap": sparse_binaries.rtabmap,
    "stella_msgpack": sparse_binaries.stella_msgpack,
    "stella_sqlite": sparse_binaries.stella_sqlite,
}
MEASURED = {"rtabmap"}  # a landmark for each sighting
# Written with nine digits, or with single precision.
ATOL = {"orbslam": 1e-7, "openmvs": 1e-5, "rtabmap": 1e-5}


def write(files: Files, folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def opened(path: Path) -> SparseMapLog:
    log = read_views(path)
    assert isinstance(log, SparseMapLog)
    return log


def pairs_of(log: SparseMapLog) -> set[tuple[int, int]]:
    """Return the sightings as rows of the scene, found by position."""
    sparse = log.sparse
    near = np.linalg.norm(sparse.landmarks[:, None] - SCENE.landmarks[None], axis=2)
    rows = near.argmin(axis=1)
    return set(zip(sparse.view_of.tolist(), rows[sparse.landmark_of].tolist(), strict=True))


@pytest.mark.parametrize("name", WRITERS)
def test_poses_landmarks_and_sightings_are_those_of_the_scene(name: str, tmp_path: Path) -> None:
    log = opened(write(WRITERS[name](SCENE), tmp_path / "map"))
    sparse, atol = log.sparse, ATOL.get(name, 1e-11)
    npt.assert_allclose(sparse.centres, SCENE.centres, atol=atol)
    npt.assert_allclose(sparse.T_world_camera[:, :3, :3], SCENE.rotations, atol=atol)
    if name in MEASURED:
        assert sparse.landmark_count == len(SCENE.pairs)
    else:
        assert sparse.landmark_count == len(SCENE.landmarks)
        npt.assert_allclose(sparse.landmarks, SCENE.landmarks, atol=atol)
    assert pairs_of(log) == set(SCENE.pairs)


@pytest.mark.parametrize("name", WRITERS)
def test_views_hold_the_landmarks_in_the_frame_of_their_camera(name: str, tmp_path: Path) -> None:
    log = opened(write(WRITERS[name](SCENE), tmp_path / "map"))
    assert len(log) == len(SCENE.centres)
    for number, view in enumerate(log):
        expected = [SCENE.in_camera(number, landmark) for landmark in SCENE.seen_by(number)]
        npt.assert_allclose(np.sort(view.points.xyz, axis=0), np.sort(expected, axis=0), atol=1e-6)
        assert np.linalg.eigvalsh(view.points.covariance).min() > 0


def changed(files: Files, name: str, old: bytes, new: bytes) -> Files:
    assert old in files[name]
    return files | {name: files[name].replace(old, new)}


def test_images_of_colmap_may_lack_the_line_of_their_points(tmp_path: Path) -> None:
    files = sparse_texts.colmap_text(SCENE)
    lines = files["images.txt"].decode().splitlines()
    bare = "\n".join([lines[0], *lines[1::2]]) + "\n"
    # The tracks of the points are then the sightings.
    log = opened(write(files | {"images.txt": bare.encode()}, tmp_path / "map"))
    assert pairs_of(log) == set(SCENE.pairs)
    assert log.sparse.pixels is None


@pytest.mark.parametrize("camera", ["17 2 1280 720", "16 6 500 500 640 360 0.5 1.0"])
def test_the_newest_camera_models_of_colmap_are_wide(tmp_path: Path, camera: str) -> None:
    model, count, *params = camera.split()
    head = struct.pack("<QIiQQ", 1, 3, int(model), 1280, 720)
    data = head + struct.pack(f"<{count}d", *map(float, params))
    files = sparse_binaries.colmap_binary(SCENE) | {"cameras.bin": data}
    sparse = opened(write(files, tmp_path / "map")).sparse
    assert sparse.cameras[0].projection != "perspective"


def test_an_unknown_camera_model_is_named(tmp_path: Path) -> None:
    files = changed(sparse_texts.colmap_text(SCENE), "cameras.txt", b"SIMPLE_RADIAL", b"MAGIC_LENS")
    with pytest.raises(FileFormatError, match=r"SIMPLE_PINHOLE, .* got 'MAGIC_LENS' at line 2"):
        read_views(write(files, tmp_path / "map"))


def test_other_models_of_a_project_are_named(tmp_path: Path) -> None:
    for number in ("0", "1"):
        write(
            {f"sparse/{number}/{n}": d for n, d in sparse_binaries.colmap_binary(SCENE).items()},
            tmp_path / "project",
        )
    notes = opened(tmp_path / "project").sparse.notes
    assert notes == ("the project has other models, which are not used: 1",)


@pytest.mark.parametrize("layout", ["id", "count", "index"])
def test_other_layouts_of_points_with_keyframes_are_read(tmp_path: Path, layout: str) -> None:
    rows = []
    for number, place in enumerate(SCENE.landmarks):
        seen = SCENE.views_of(number)
        words = [f"{value:.9f}" for value in place]
        stamps = [f"{1700000000 + 0.1 * view:.6f}" for view in seen]
        if layout == "id":
            words = [str(3 * number), *words, *stamps]
        elif layout == "count":
            words = [*words, str(len(seen)), *stamps]
        else:
            words = [*words, *map(str, seen)]
        rows.append(" ".join(words))
    files = {"traj.txt": sparse_texts.tum(SCENE), "points.txt": "\n".join(rows).encode()}
    assert pairs_of(opened(write(files, tmp_path / "map"))) == set(SCENE.pairs)


def test_landmarks_of_depth_cameras_at_the_origin_are_dropped(tmp_path: Path) -> None:
    content = msgpack.unpackb(sparse_binaries.stella_msgpack(SCENE)["map.msg"])
    content["landmarks"][str(SCENE.ids[3])]["pos_w"] = [0.0, 0.0, 0.0]
    content["landmarks"][str(SCENE.ids[5])]["pos_w"] = [1e13, 0.0, 0.0]
    log = opened(write({"map.msg": msgpack.packb(content)}, tmp_path / "map"))
    lost = [pair for pair in SCENE.pairs if pair[1] in (3, 5)]
    dropped = log.sparse.dropped
    counts = (dropped["sightings_in_the_camera"], dropped["sightings_of_invalid_landmarks"])
    assert sum(counts) + dropped["sightings_too_far"] == len(lost)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_truncated_file_is_refused_or_shorter(name: str, share: float, tmp_path: Path) -> None:
    files = WRITERS[name](SCENE)
    largest = max(files, key=lambda file: len(files[file]))
    cut = files[largest][: int(share * len(files[largest]))]
    write(files | {largest: cut}, tmp_path)
    sightings = 0
    with suppress(FileFormatError):
        sightings = opened(tmp_path).sparse.sightings
    assert sightings < len(SCENE.pairs)


def test_poses_of_another_file_replace_those_of_a_map(tmp_path: Path) -> None:
    folder = write(sparse_texts.orbslam(SCENE), tmp_path / "map")
    moved = replace(SCENE, centres=SCENE.centres + np.array([0.0, 0.0, 0.5]))
    (tmp_path / "poses.txt").write_bytes(sparse_texts.tum(moved))
    log = read_views(folder, poses=tmp_path / "poses.txt")
    assert isinstance(log, SparseMapLog)
    npt.assert_allclose(log.sparse.centres, moved.centres, atol=1e-7)


@pytest.mark.parametrize("spread", [1, 10**6, 2**55])
def test_ids_are_found_however_far_they_are_apart(spread: int) -> None:
    ids = np.array([5, 1, 3]) * spread
    wanted = np.array([3, 5, 4, 1, -7]) * spread
    rows, known = find_ids(ids, wanted)
    assert known.tolist() == [True, True, False, True, False]
    assert rows[known].tolist() == [2, 0, 1]


def test_a_map_among_thousands_of_images_is_found(tmp_path: Path) -> None:
    for number in range(1000):
        (tmp_path / f"{number}.jpg").touch()
    assert opened(write(sparse_texts.nvm(SCENE), tmp_path)).sparse.sightings == len(SCENE.pairs)


def test_a_folder_with_maps_of_two_systems_asks(tmp_path: Path) -> None:
    write(sparse_texts.nvm(SCENE), tmp_path)
    write(sparse_binaries.colmap_binary(SCENE), tmp_path)
    with pytest.raises(FileFormatError, match=r"colmap and nvm. Choose one: --format colmap, or "):
        read_views(tmp_path)
    assert opened(tmp_path / "model.nvm").sparse.system == "VisualSFM"
    log = read_views(tmp_path, format="colmap")
    assert isinstance(log, SparseMapLog)


@pytest.mark.parametrize(
    ("file", "data"),
    [
        ("reconstruction.json", b'[{"cameras": ' + b"[" * 100_000),
        ("sfm_data.json", b'{"sfm_data_version": ' + b'{"a": ' * 5000 + b"1" + b"}" * 5001),
        ("map.msg", b"\x81\xa7cameras" + b"\x91" * 100_000),
        ("map.msg", b"\x81\xa7cameras\xdd\xff\xff\xff\xff"),
        ("scene.mvs", b"MVSI" + struct.pack("<IIQ", 6, 0, 2**60)),
        ("sfm_data.bin", b"\x01\x03" + bytes(7) + b"0.3" + struct.pack("<Q", 2**50)),
        ("bundle.out", b"# Bundle file v0.3\n1e300 5\n"),
        ("model.nvm", b"NVM_V3\n\n99999999999\n"),
    ],
)
def test_absurd_depths_and_counts_are_refused_at_once(
    tmp_path: Path, file: str, data: bytes
) -> None:
    (tmp_path / file).write_bytes(data)
    with pytest.raises(FileFormatError, match=file):
        read_views(tmp_path)


def test_a_header_of_names_is_skipped(tmp_path: Path) -> None:
    files = sparse_texts.orbslam(SCENE)
    names = b"timestamp tx ty tz qx qy qz qw\n"
    files["KeyFrameTrajectory.txt"] = names + files["KeyFrameTrajectory.txt"]
    assert pairs_of(opened(write(files, tmp_path / "map"))) == set(SCENE.pairs)
