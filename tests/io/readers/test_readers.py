"""Every reader against a known scene, written by code of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

import sparse_scene
from groundmap.io import read_views
from groundmap.io.readers.base import SparseMapLog
from sparse_scene import Files, Scene, make_scene

SCENE = make_scene()
WRITERS: dict[str, Callable[[Scene], Files]] = {
    "bal": sparse_scene.bal,
    "bundler": sparse_scene.bundler,
    "colmap_binary": sparse_scene.colmap_binary,
    "colmap_text": sparse_scene.colmap_text,
    "meshroom": sparse_scene.meshroom,
    "nvm": sparse_scene.nvm,
    "openmvg_binary": sparse_scene.openmvg_binary,
    "openmvg_json": sparse_scene.openmvg_json,
    "openmvs": sparse_scene.openmvs,
    "opensfm": sparse_scene.opensfm,
    "orbslam": sparse_scene.orbslam,
    "rtabmap": sparse_scene.rtabmap,
    "stella_msgpack": sparse_scene.stella_msgpack,
    "stella_sqlite": sparse_scene.stella_sqlite,
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
