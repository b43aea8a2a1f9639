"""Correction after the fact: a map with corrected poses is one that was mapped anew."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from groundmap import ConfidenceGrid, GroundMapper, GroundPlane, View
from groundmap.arrays import Floats
from groundmap.errors import CameraError, InputError
from groundmap.view.frames import T_REP103_OPTICAL
from registration_scenes import RIG, seen_from, street, transform


def drive(count: int = 20) -> list[View]:
    """Return views of a street, with the ground below them."""
    rng = np.random.default_rng(0)
    points = street(rng, 300)
    plane = GroundPlane.below_camera(RIG, 1.6)
    views = []
    for k in range(count):
        pose = transform((0.0, 0.0, 1.0 * k))
        view = seen_from(points, pose, rng)
        views.append(replace(view, T_map_base=T_REP103_OPTICAL @ pose, plane=plane))
    return views


def mapped(views: list[View], poses: Floats, **settings: Any) -> GroundMapper:
    mapper = GroundMapper(keep_views=True, **settings)
    for view, pose in zip(views, poses, strict=True):
        mapper.integrate(replace(view, T_map_base=pose))
    return mapper


def poses_of(views: list[View]) -> Floats:
    return np.array([view.T_map_base for view in views])


def assert_equal(one: ConfidenceGrid, other: ConfidenceGrid) -> None:
    """Check that all tiles of two maps are equal, bit for bit."""
    pairs = [(dict(one.tiles()), dict(other.tiles()))]
    for layer in range(len(one.heights)):
        pairs.append((dict(one.layer_tiles(layer)), dict(other.layer_tiles(layer))))
    for ours, theirs in pairs:
        assert ours.keys() == theirs.keys()
        for index, tile in ours.items():
            np.testing.assert_array_equal(tile.count, theirs[index].count)
            np.testing.assert_array_equal(tile.confidence, theirs[index].confidence)
    np.testing.assert_array_equal(one.trajectory, other.trajectory)


@pytest.mark.parametrize("fusion", ["average", "capped"])
@pytest.mark.parametrize("some", [slice(None), slice(4, 6), slice(0, 0), slice(19, 20)])
def test_corrected_poses_give_the_map_of_these_poses(fusion: str, some: slice) -> None:
    views = drive()
    poses = poses_of(views)
    mapper = mapped(views, poses, fusion=fusion)
    corrected = poses.copy()
    corrected[some, :2, 3] += np.linspace(0.1, 30.0, 20)[some, None]
    before = len(dict(mapper.grid.tiles()))
    assert mapper.refuse(corrected) == len(corrected[some])
    assert_equal(mapper.grid, mapped(views, corrected, fusion=fusion).grid)
    mapper.refuse(poses)
    assert len(dict(mapper.grid.tiles())) == before
    assert_equal(mapper.grid, mapped(views, poses, fusion=fusion).grid)


def test_views_can_follow_a_correction() -> None:
    views = drive()
    poses = poses_of(views)
    mapper = mapped(views[:10], poses[:10])
    poses[:10, 1, 3] += 0.5
    mapper.refuse(poses[:10])
    for view in views[10:]:
        mapper.integrate(view)
    assert_equal(mapper.grid, mapped(views, poses).grid)


def test_views_within_the_tolerance_stay() -> None:
    views = drive(4)
    poses = poses_of(views)
    mapper = mapped(views, poses)
    near = poses.copy()
    near[:, 0, 3] += 0.01
    assert mapper.refuse(near, tolerance=0.02) == 0
    assert_equal(mapper.grid, mapped(views, poses).grid)
    turned = poses @ transform((0, 0, 0), (0.0, 0.01, 0.0))
    assert mapper.refuse(turned, tolerance=0.02) == 4
    assert mapper.refuse(poses, tolerance=0.02, turn_tolerance=0.02) == 0


def test_only_tiles_that_moved_views_touch_are_changed() -> None:
    views = drive()
    poses = poses_of(views)
    mapper = mapped(views, poses)
    tiles = dict(mapper.grid.tiles())
    poses[18:, 1, 3] += 0.4
    mapper.refuse(poses)
    same = [index for index, tile in mapper.grid.tiles() if tiles.get(index) is tile]
    touched = {tuple(index) for index in (mapper.changed // 64).tolist()}
    assert same
    assert not touched & set(same)


def test_a_mapper_without_views_and_wrong_poses_are_refused() -> None:
    views = drive(2)
    poses = poses_of(views)
    with pytest.raises(InputError, match=r"a mapper that keeps its views.*keep_views=True"):
        GroundMapper().refuse(poses)
    mapper = mapped(views, poses)
    with pytest.raises(
        InputError, match=r"poses: expected shape \(2, 4, 4\), got shape \(1, 4, 4\)"
    ):
        mapper.refuse(poses[:1])
    with pytest.raises(CameraError, match="T_map_base"):
        mapper.refuse(2.0 * poses)
    assert_equal(mapper.grid, mapped(views, poses).grid)
