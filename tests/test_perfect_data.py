"""Perfect data, figure 2 of the paper: new edges in freespace and in non-freespace."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from groundmap import CellState, Features, GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Bytes, Floats
from groundmap.settings import MapperSettings
from groundmap.view.frames import T_REP103_OPTICAL, invert

RIG_POSE = np.eye(4)
RIG_POSE[2, 3] = 0.5
RIG = StereoRig(
    fx=300.0, fy=300.0, cx=320.0, cy=240.0, baseline=0.1, T_base_camera=RIG_POSE @ T_REP103_OPTICAL
)
GROUND = GroundPlane(normal=np.array([0.0, 0.0, 1.0]), offset=0.0)
SHAPES = {
    "wall": [(2.0, y) for y in (-1.2, -0.8, -0.5, 0.1, 0.4, 0.8, 1.2)],  # x ahead, y left [m]
    "a": [(1.7, 0.6)],
    # Behind the one link of the wall that is too long to believe. Two edges, because a single
    # feature behind such a link is taken for a false match.
    "b": [(2.3, -0.21), (2.3, -0.19)],
}
BETWEEN = {"a": (4, 5), "b": (2, 3)}  # numbers of the wall's edges beside each new one


def view_of(edges: Floats, y: float) -> View:
    """Return the view of vertical edges (x, y) from beside the origin, without an error."""
    pose = np.eye(4)
    pose[1, 3] = y
    ends = np.stack([np.column_stack([edges, np.full(len(edges), z)]) for z in (0.0, 0.4)], axis=1)
    T_camera_map = invert(pose @ RIG.T_base_camera)
    in_camera = ends @ T_camera_map[:3, :3].T + T_camera_map[:3, 3]
    exact = np.broadcast_to(1e-12 * np.eye(3), (len(edges), 2, 3, 3)).copy()
    segments = Features.segments(in_camera, exact)
    points = Features.points(np.empty((0, 3)), np.empty((0, 3, 3)))
    return View(T_map_base=pose, rig=RIG, points=points, segments=segments, plane=GROUND)


@pytest.fixture(scope="module")
def mappers() -> tuple[GroundMapper, GroundMapper]:
    """Return the maps of the first view (figure 2.a) and of both (figure 2.b)."""
    wall = np.array(SHAPES["wall"])
    both = np.concatenate([wall, SHAPES["a"], SHAPES["b"]])
    settings = MapperSettings(resolution=0.02, fusion="absolute", uncertainty="none", max_range=4.0)
    maps = []
    for views in ([view_of(wall, 0.0)], [view_of(wall, 0.0), view_of(both, 0.1)]):
        mapper = GroundMapper(**settings.model_dump())
        for view in views:
            mapper.integrate(view)
        maps.append(mapper)
    return maps[0], maps[1]


def states_in(mapper: GroundMapper, edge: str) -> Bytes:
    """Return the states of the cells well inside the triangle of a new edge and the old chord."""
    wall, (left, right) = SHAPES["wall"], BETWEEN[edge]
    triangle = shapely.Polygon([wall[left], *SHAPES[edge], wall[right]]).buffer(-0.05)
    window = mapper.grid.window((0.0, -2.0, 4.0, 2.0))
    cells = np.argwhere(np.ones(window.count.shape))
    inside = shapely.contains_xy(triangle, *window.cell_to_world(cells).T)
    assert inside.sum() > 20
    states: Bytes = window.states().ravel()[inside]
    return states


def test_before_edge_a_is_free_and_b_lies_in_unknown_space(
    mappers: tuple[GroundMapper, GroundMapper],
) -> None:
    assert (states_in(mappers[0], "a") == CellState.FREE).all()
    assert (states_in(mappers[0], "b") == CellState.UNKNOWN).all()


def test_a_new_edge_in_freespace_makes_the_region_behind_its_surfaces_nonfree(
    mappers: tuple[GroundMapper, GroundMapper],
) -> None:
    assert (states_in(mappers[1], "a") == CellState.NONFREE).all()


def test_a_new_edge_in_nonfreespace_makes_the_region_before_its_surfaces_free(
    mappers: tuple[GroundMapper, GroundMapper],
) -> None:
    states = states_in(mappers[1], "b")
    assert (states == CellState.FREE).mean() > 0.9
    assert not (states == CellState.NONFREE).any()  # beside the old edges, cells stay unknown


def test_freespace_elsewhere_stays_as_it_was(mappers: tuple[GroundMapper, GroundMapper]) -> None:
    before = mappers[0].grid.window((0.0, -2.0, 4.0, 2.0))
    after = mappers[1].grid.window((0.0, -2.0, 4.0, 2.0))
    wall = SHAPES["wall"]
    triangle = shapely.Polygon([wall[4], *SHAPES["a"], wall[5]]).buffer(0.03)
    was_free = np.argwhere(before.states() == CellState.FREE)
    elsewhere = was_free[~shapely.contains_xy(triangle, *before.cell_to_world(was_free).T)]
    assert (after.states()[tuple(elsewhere.T)] == CellState.FREE).mean() > 0.995
