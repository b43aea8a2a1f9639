"""`map` and `info` of sparse maps: what they print about the source, its unit and its ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from command_line import run
from sparse_scene import colmap_binary, make_scene


def model(folder: Path, *, tilt_degrees: float = 0.0) -> Path:
    scene = make_scene(views=12, landmarks=300, tilt=np.radians(tilt_degrees))
    folder.mkdir()
    for name, data in colmap_binary(scene).items():
        (folder / name).write_bytes(data)
    return folder


def test_map_counts_what_it_read_and_states_the_height_of_the_camera(tmp_path: Path) -> None:
    ran = run("map", model(tmp_path / "m"), "--out", tmp_path / "m.npz", "--json")
    assert ran.code == 0
    assert ran.json["source"]["system"] == "COLMAP"
    assert (ran.json["source"]["views"], ran.json["source"]["landmarks"]) == (12, 300)
    assert ran.json["camera_height"]["median"] == pytest.approx(1.5, abs=0.01)
    assert ran.json["metric"] is False
    assert "COLMAP: 12 views, 300 landmarks" in ran.err
    assert "ground 1.50 below the camera, 1.50 to 1.50; if it is 1.4 m: --scale 0.93" in ran.err
    assert "warning: the unit of the source is unknown" in ran.err


def test_the_map_of_a_tilted_world_is_that_of_the_level_one(tmp_path: Path) -> None:
    areas = []
    for tilt in (0, 10, 20, 40):
        source = model(tmp_path / f"m{tilt}", tilt_degrees=tilt)
        options = ("--camera-height", "1.5", "--out", tmp_path / "m.npz", "--json")
        summary = run("map", source, *options).json
        areas.append((summary["area_free_m2"], summary["area_nonfree_m2"]))
        assert summary["metric"] is True
        assert summary["warnings"] == []
    np.testing.assert_allclose(areas, np.broadcast_to(areas[0], (4, 2)), rtol=0.01)


def test_a_tilted_world_that_is_not_levelled_is_a_warning(tmp_path: Path) -> None:
    source = model(tmp_path / "m", tilt_degrees=20)
    ran = run("map", source, "--no-level", "--scale", "1", "--out", tmp_path / "m.npz")
    assert "warning: the ground is tilted by 20 degrees in the world of the source" in ran.err


def test_info_describes_a_source_and_names_the_next_command(tmp_path: Path) -> None:
    source = model(tmp_path / "m", tilt_degrees=40)
    ran = run("info", source, "--json")
    assert ran.json["format"] == "colmap"
    assert ran.json["sightings"] == len(make_scene(views=12, landmarks=300).pairs)
    assert ran.json["camera_height"] == pytest.approx(1.5, abs=1e-3)
    assert ran.json["next"] == f"groundmap map {source} --camera-height METRES --out map.npz"


def test_without_ground_the_error_says_that_the_unit_is_unknown(tmp_path: Path) -> None:
    source = model(tmp_path / "m")
    ran = run("map", source, "--scale", "0.001", "--out", tmp_path / "m.npz")
    assert ran.code == 2
    assert "no plane between 0.1 and 5 m below the camera" in ran.err
