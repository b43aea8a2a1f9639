"""The ray caster: exact traversal, one z per cell, non-free before free."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from groundmap import Features, GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Floats, Floats32
from groundmap.errors import NoGroundPlaneError, SettingsError
from groundmap.view.frames import map_from_world
from planners.compare.kernels.raycast import cast_rays
from planners.compare.raycast import FREE, RayCaster

SIZE = 12  # [cells]
HEIGHT = 1.5  # [m], of the camera
RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)

places = st.tuples(*[st.floats(0.0, SIZE - 1e-6)] * 2)
corners = st.tuples(*[st.integers(0, 2 * SIZE - 1).map(lambda half: half / 2)] * 2)


def cast(origin: npt.ArrayLike, *ends: npt.ArrayLike) -> Floats32:
    z = np.zeros((SIZE, SIZE), dtype=np.float32)
    cast_rays(z, np.array(origin, dtype=np.float64), np.array(ends, dtype=np.float64), FREE)
    return z


def cut_at_borders(origin: Floats, end: Floats) -> Floats32:
    """Return what a ray sets, from the middles of its pieces between borders of cells."""
    cuts = [0.0, 1.0]
    for start, stop in zip(origin, end, strict=True):
        if start != stop:
            borders = np.arange(SIZE + 1)
            cuts += [t for t in (borders - start) / (stop - start) if 0.0 < t < 1.0]
    cuts = sorted(cuts)
    middles = 0.5 * (np.array(cuts[1:]) + cuts[:-1])
    visited = origin + middles[:, None] * (end - origin)
    z = np.zeros((SIZE, SIZE), dtype=np.float32)
    for x, y in (origin, *visited, end):
        z[int(y), int(x)] = FREE
    return z


def view_of(*seen: tuple[float, float, float], segments: npt.ArrayLike = ()) -> View:
    """Return a view along x of points: ahead, to the left, above the ground [m]."""
    return View(
        T_map_base=map_from_world(np.eye(4), "optical"),
        rig=RIG,
        points=Features.points(in_camera(seen).reshape(-1, 3), np.zeros((len(seen), 3, 3))),
        segments=Features.segments(
            in_camera(segments).reshape(-1, 2, 3), np.zeros((len(np.array(segments)), 2, 3, 3))
        ),
        plane=GroundPlane.below_camera(RIG, HEIGHT),
    )


def in_camera(places: npt.ArrayLike) -> Floats:
    x, y, height = np.array(places, dtype=np.float64).reshape(-1, 3).T
    return np.stack([-y, HEIGHT - height, x], axis=1)


def mapped(view: View) -> RayCaster:
    caster = RayCaster(resolution=0.25)
    caster.integrate(view)
    return caster


@given(places | corners, places | corners)
def test_a_ray_sets_all_cells_that_it_crosses_and_none_that_it_does_not_touch(
    origin: tuple[float, float], end: tuple[float, float]
) -> None:
    z = cast(origin, end)
    ray = shapely.LineString([origin, end])
    rows, cols = np.indices(z.shape)
    cells = shapely.box(cols, rows, cols + 1, rows + 1)
    inside = shapely.box(cols + 1e-6, rows + 1e-6, cols + 1 - 1e-6, rows + 1 - 1e-6)
    assert (z[shapely.intersects(inside, ray)] == FREE).all()
    assert (shapely.distance(cells, ray)[z == FREE] < 1e-9).all()


@given(st.integers(0, 2**32 - 1).map(np.random.default_rng))
def test_the_kernel_equals_a_slow_implementation(rng: np.random.Generator) -> None:
    origin, *ends = rng.uniform(0.0, SIZE, (6, 2))
    twins = [cut_at_borders(origin, end) for end in ends]
    np.testing.assert_array_equal(cast(origin, *ends), np.min(twins, axis=0))


def test_an_obstacle_is_non_free_with_free_cells_before_it_and_nothing_behind() -> None:
    grid = mapped(view_of((4.1, 0.1, 0.8))).grid
    along = grid.confidence_at([(3.6, 0.1), (4.1, 0.1), (4.4, 0.1)])
    np.testing.assert_array_equal(along, [-1.0, 1.0, 0.0])


def test_a_ground_feature_is_free_up_to_itself_and_nothing_behind() -> None:
    grid = mapped(view_of((4.1, 0.1, 0.0))).grid
    along = grid.confidence_at([(3.6, 0.1), (4.1, 0.1), (4.4, 0.1)])
    np.testing.assert_array_equal(along, [-1.0, -1.0, 0.0])


def test_non_free_wins_over_the_rays_that_pass_through() -> None:
    for height in (0.0, 0.8):
        grid = mapped(view_of((4.1, 0.1, 0.5), (6.1, 0.15, height))).grid
        np.testing.assert_array_equal(grid.confidence_at([(4.1, 0.1), (5.1, 0.1)]), [1.0, -1.0])


def test_many_rays_through_a_cell_are_one_update() -> None:
    caster = mapped(view_of(*[(5.0, y, 0.5) for y in np.linspace(-1.0, 1.0, 40)]))
    assert caster.grid.window().count.max() == 1


def test_both_ends_of_a_segment_are_features() -> None:
    grid = mapped(view_of(segments=[[(4.1, 1.1, 0.5), (4.1, -1.1, 0.5)]])).grid
    np.testing.assert_array_equal(
        grid.confidence_at([(4.1, 1.1), (4.1, -1.1), (4.1, 0.1)]), [1.0, 1.0, 0.0]
    )


def test_a_view_without_features_observes_only_its_own_cell() -> None:
    assert not mapped(view_of()).grid.window((-2.0, -2.0, 2.0, 2.0)).confidence.any()


def test_a_drop_off_is_nonfree_where_the_mapper_has_it() -> None:
    view = view_of((4.1, 0.1, -1.0), (4.12, 0.1, -1.0))
    mapper = GroundMapper(**mapped(view).settings.model_dump())
    mapper.integrate(view)
    bounds = (0.0, -1.0, 5.0, 1.0)
    ours, theirs = mapped(view).grid.window(bounds), mapper.grid.window(bounds)
    assert (ours.confidence > 0).sum() > 1
    np.testing.assert_array_equal(ours.confidence > 0, theirs.confidence > 0)


def test_a_view_without_ground_is_refused() -> None:
    view = View(T_map_base=map_from_world(np.eye(4), "optical"), rig=RIG)
    with pytest.raises(NoGroundPlaneError, match="the view has no ground plane"):
        RayCaster().integrate(view)


def test_an_unknown_setting_names_the_nearest() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'resolution'"):
        RayCaster(resolutoin=0.1)
