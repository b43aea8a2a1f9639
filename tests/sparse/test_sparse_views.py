"""Views from sparse maps: borders, order, and wide cameras split into flat images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.testing as npt

from groundmap.sparse.cameras import Camera, equirectangular
from groundmap.sparse.sparse_map import SparseMap
from groundmap.sparse.views import SparseViews
from groundmap.view.frames import T_REP103_OPTICAL


def all_around(camera: Camera) -> SparseMap:
    """Return a view with landmarks in all directions, at all heights."""
    rng = np.random.default_rng(1)
    landmarks = rng.normal(size=(400, 3)) * (3.0, 1.0, 3.0)
    return SparseMap(
        system="test",
        T_world_camera=np.eye(4)[None],
        landmarks=landmarks,
        view_of=np.zeros(400, dtype=np.int64),
        landmark_of=np.arange(400),
        cameras=(camera,),
    )


def test_a_spherical_view_becomes_four_flat_ones_that_keep_every_landmark() -> None:
    sparse = all_around(equirectangular("sphere", 1920, 960))
    views = SparseViews(sparse)
    assert (len(views), views.split) == (4, 1)
    split = list(views)
    seen = set()
    for view in split:
        assert view.dropped.total() == 0
        position = view.points.xyz @ view.T_map_camera[:3, :3].T + view.T_map_camera[:3, 3]
        expected = sparse.landmarks[view.points.ids] @ T_REP103_OPTICAL[:3, :3].T
        npt.assert_allclose(position, expected, atol=1e-12)
        seen |= set(view.points.ids.tolist())
        assert abs(view.T_map_camera[2, 2]) < 1e-12  # looks along the horizon
    assert seen == set(range(400))
    twice = sum(len(view.points) for view in split) - 400
    assert 0 < twice < 100  # neighbours overlap by 10 degrees of 90


def test_a_flat_camera_is_not_split_and_drops_what_is_behind_it() -> None:
    views = list(SparseViews(all_around(Camera(model="flat", focal_px=500, width=1000))))
    assert len(views) == 1
    assert 100 < views[0].dropped["behind_camera"] < 300


def test_a_fisheye_camera_is_split_only_if_it_sees_widely() -> None:
    wide = all_around(Camera(model="fisheye", projection="fisheye"))
    assert SparseViews(wide).split == 1
    ahead = np.abs(wide.landmarks[:, 0]) < wide.landmarks[:, 2]
    ahead &= np.abs(wide.landmarks[:, 1]) < wide.landmarks[:, 2]
    narrow = replace(
        wide, view_of=np.zeros(ahead.sum(), dtype=np.int64), landmark_of=np.flatnonzero(ahead)
    )
    assert SparseViews(narrow).split == 0


def test_without_an_image_size_the_sightings_are_the_border() -> None:
    sparse = SparseMap(
        system="test",
        T_world_camera=np.eye(4)[None],
        landmarks=np.array([(2.0, 0.0, 4.0), (-3.0, 0.0, 4.0)]),
        view_of=np.array([0, 0]),
        landmark_of=np.array([0, 1]),
    )
    [view] = SparseViews(sparse)
    assert view.rig.cx / view.rig.fx == 0.75


def test_views_are_in_the_order_of_their_times_or_of_the_numbers_in_their_names() -> None:
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = [2.0, 0.0, 1.0]
    sparse = SparseMap(
        system="test",
        T_world_camera=poses,
        landmarks=np.array([(0.0, 0.0, 5.0)]),
        view_of=np.arange(3),
        landmark_of=np.zeros(3, dtype=np.int64),
        names=("left/10.png", "left/1.png", "left/9.png"),
    )
    timed = replace(sparse, names=(), timestamps=np.array([30.0, 10.0, 20.0]))
    for given in (sparse, timed):
        assert [-view.T_map_camera[1, 3] for view in SparseViews(given)] == [0.0, 1.0, 2.0]
