"""Uncertainty models: how far a feature spreads, in which direction, and how surely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from scipy import ndimage

import groundmap
from groundmap import GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Bools, Floats
from groundmap.evidence.uncertainty import MODELS, Ellipsoid, Exact, Radius
from groundmap.grid.window import CellState
from groundmap.view.frames import map_from_world
from strategies import pixels_of, pose, rig, rngs

DIRECTIONS = np.linspace(0.0, np.pi, 20001)


def covariances(rng: np.random.Generator, count: int) -> Floats:
    factors = rng.normal(scale=0.5, size=(count, 2, 2))
    return factors @ np.swapaxes(factors, 1, 2)


def deviation(covariance: Floats, bearings: Floats) -> Floats:
    """Standard deviation of one covariance in each direction."""
    rays = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    variance: Floats = ((rays @ covariance) * rays).sum(axis=1)
    return np.sqrt(np.maximum(variance, 0.0))


def edges(rng: np.random.Generator, count: int) -> Floats:
    return rng.uniform((3.0, -5.0), (12.0, 5.0), size=(count, 2, 2))


def test_models_go_by_their_names() -> None:
    assert set(MODELS) == {"ellipsoid", "gaussian", "radius", "none"}
    assert all(model.name == name for name, model in MODELS.items())


@settings(max_examples=50)
@given(rngs())
def test_the_ellipsoid_reaches_along_the_line_of_sight(rng: np.random.Generator) -> None:
    xy, covariance = rng.uniform(-9.0, 9.0, size=(5, 2)), covariances(rng, 5)
    expected = [
        deviation(matrix, np.array([np.arctan2(y, x)]))[0]
        for (x, y), matrix in zip(xy, covariance, strict=True)
    ]
    np.testing.assert_allclose(Ellipsoid().sigma(xy, covariance), expected)


@settings(max_examples=50)
@given(rngs())
def test_the_radius_is_the_deviation_in_the_worst_direction(rng: np.random.Generator) -> None:
    xy, covariance = rng.uniform(-9.0, 9.0, size=(5, 2)), covariances(rng, 5)
    expected = [deviation(matrix, DIRECTIONS).max() for matrix in covariance]
    np.testing.assert_allclose(Radius().sigma(xy, covariance), expected, rtol=1e-6)


@settings(max_examples=20)
@given(rngs())
def test_without_a_model_of_uncertainty_nothing_spreads(rng: np.random.Generator) -> None:
    ends = edges(rng, 4)
    reach = np.zeros((4, 2))
    assert not Exact().sigma(ends[:, 0], covariances(rng, 4)).any()
    np.testing.assert_array_equal(Exact().outline(ends, reach), ends[:, [0, 1, 1, 0]])
    assert all((part == 1.0).all() for part in Exact().evidence(reach, 0.1))


@settings(max_examples=50)
@given(rngs())
def test_the_ellipsoids_outline_is_what_the_reach_sweeps_along_the_rays(
    rng: np.random.Generator,
) -> None:
    ends, reach = edges(rng, 4), rng.uniform(0.1, 2.0, size=(4, 2))
    radius = np.hypot(ends[..., 0], ends[..., 1])
    for outline, pair, far, long in zip(
        Ellipsoid().outline(ends, reach), ends, radius, reach, strict=True
    ):
        near, beyond = pair * (1 - long / far)[:, None], pair * (1 + long / far)[:, None]
        expected = shapely.MultiPoint([*near, *beyond])
        assert shapely.hausdorff_distance(shapely.MultiPoint(outline), expected) < 1e-9
        assert shapely.Polygon(outline).is_valid


@settings(max_examples=25)
@given(rngs())
def test_the_radius_outline_and_caps_lie_within_the_radius(rng: np.random.Generator) -> None:
    ends, radius = edges(rng, 4), rng.uniform(0.1, 2.0, size=4)
    reach = np.stack([radius, radius], axis=1)
    model = Radius()
    caps = model.caps(reach)
    for outline, pair, cap, width in zip(
        model.outline(ends, reach), ends, caps, radius, strict=True
    ):
        spread = shapely.union_all(
            [
                shapely.Polygon(outline),
                *shapely.buffer(shapely.points(pair), cap, quad_segs=100),
            ]
        )
        expected = shapely.LineString(pair).buffer(width, quad_segs=100)
        assert shapely.symmetric_difference(spread, expected).area < 2e-3


@pytest.mark.parametrize("resolution", [0.05, 0.1524, 1.0])
@pytest.mark.parametrize("reach", [0.0, 0.01, 0.3, 2.0])
def test_a_ray_through_the_spread_adds_up_to_one_cell_at_most(
    resolution: float, reach: float
) -> None:
    both = np.full((1, 2), reach)
    expected = 1.0 if reach == 0 else min(1.0, resolution / (2.0 * reach))
    for model in (Ellipsoid(), Radius()):
        on_surface, around = model.evidence(both, resolution)
        assert around.item() == pytest.approx(expected)
        on = min(1.0, 4.0 * expected) if model.name == "ellipsoid" else expected
        assert on_surface.item() == pytest.approx(on)
        assert around.item() * max(2.0 * reach, resolution) == pytest.approx(resolution)


@pytest.mark.parametrize(
    ("sigma", "on_surface"),
    [(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (1.02, 0.980), (2.0, 0.5), (4.0, 0.25)],
)
def test_a_surface_is_sure_up_to_a_standard_deviation_of_one_cell(
    sigma: float, on_surface: float
) -> None:
    resolution = 0.1
    reach = np.full((1, 2), 2.0 * sigma * resolution)  # two standard deviations
    found, around = Ellipsoid().evidence(reach, resolution)
    assert found.item() == pytest.approx(on_surface, abs=1e-3)
    assert found.item() >= around.item()


@settings(max_examples=50)
@given(rngs())
def test_the_less_is_known_of_a_surface_the_less_it_says(rng: np.random.Generator) -> None:
    reach = np.sort(rng.uniform(0.0, 3.0, size=20))
    for model in (Ellipsoid(), Radius()):
        for said in model.evidence(np.stack([reach, reach], axis=1), 0.1524):
            assert (np.diff(said) <= 0.0).all()
            assert ((said > 0.0) & (said <= 1.0)).all()


@pytest.mark.parametrize("model", ["ellipsoid", "radius"])
def test_only_a_radius_has_caps(model: str) -> None:
    reach = np.array([[0.2, 0.5]])
    expected = reach if model == "radius" else np.zeros((1, 2))
    np.testing.assert_array_equal(MODELS[model].caps(reach), expected)


# A doorway, 1.0 m wide, approached

WALL, HALF_DOOR, EYE = 10.0, 0.5, 1.0


def doorway(rng: np.random.Generator, distance: float) -> View:
    """View of a wall across the way with a door in it, with half a pixel of noise."""
    stereo = rig(mounted=True)
    here = WALL - distance
    sides = np.array([-1.0, 1.0])
    posts = np.repeat(HALF_DOOR + np.array([0.0, 0.35, 0.7, 1.1, 1.5]), 2) * np.tile(sides, 5)
    low_high = np.array([0.1, 1.9])
    vertical = np.stack(
        [np.stack([np.full(2, WALL), np.full(2, y), low_high], axis=1) for y in posts]
    )
    boards = np.array(
        [
            [(WALL, side * HALF_DOOR, height), (WALL, side * (HALF_DOOR + 1.6), height)]
            for side in sides
            for height in (0.3, 1.2, 1.8)
        ]
    )
    beside = rng.uniform((HALF_DOOR, 0.2), (HALF_DOOR + 1.6, 1.9), size=(60, 2))
    on_wall = np.column_stack([np.full(60, WALL), beside[:, 0] * np.tile(sides, 30), beside[:, 1]])
    floor = rng.uniform((here + 0.5, -0.45), (WALL + 5.0, 0.45), size=(120, 2))
    seen = visible_pixels(stereo, here, np.concatenate([on_wall, np.pad(floor, ((0, 0), (0, 1)))]))
    cut = visible_pixels(stereo, here, np.concatenate([vertical, boards]))
    return View.from_pixels(
        pose(here - 0.2, -0.06, 0.0, mounted=True),
        stereo,
        points_px=seen + rng.normal(scale=0.5, size=seen.shape),
        segments_px=cut + rng.normal(scale=0.5, size=cut.shape),
    )


def visible_pixels(stereo: groundmap.StereoRig, here: float, places: Floats) -> Floats:
    """Pixels of features that lie in the images of a camera `EYE` up at x = `here`."""
    x, y, z = np.moveaxis(places, -1, 0)
    pixels = pixels_of(stereo, np.stack([-y, EYE - z, x - here], axis=-1))
    inside = (pixels > 0) & (pixels < (2 * stereo.cx, 2 * stereo.cx, 2 * stereo.cy))
    return pixels[inside.reshape(len(pixels), -1).all(axis=1)]


def door_map(model: str) -> groundmap.ConfidenceGrid:
    rng = np.random.default_rng(20)
    approach = [doorway(rng, distance) for distance in np.arange(6.0, 0.9, -0.25)]
    mapper = GroundMapper(uncertainty=model)
    for view in groundmap.fit_ground(approach, camera_height=EYE):
        mapper.integrate(view)
    return mapper.grid


def test_a_door_stays_open_and_the_wall_beside_it_closed() -> None:
    grid = door_map("ellipsoid")
    through = grid.window((WALL - 0.6, -0.3, WALL + 0.6, 0.3))
    assert (through.states() == CellState.FREE).all()
    beside = grid.window((WALL - 1.0, -1.5, WALL + 1.0, 1.5))
    free = beside.states() == CellState.FREE
    assert joins_front_and_back(free)
    x, y = np.moveaxis(
        beside.cell_to_world(np.argwhere(np.ones_like(free))).reshape(*free.shape, 2), -1, 0
    )
    wall = np.abs(y) > HALF_DOOR
    assert not joins_front_and_back(free & wall)
    stands = wall & (np.abs(x - WALL) < grid.resolution / 2)
    assert stands.any()
    assert (beside.states()[stands] == CellState.NONFREE).all()


def joins_front_and_back(free: Bools) -> bool:
    """Whether a path through free cells, side by side, leads from low x to high x."""
    label, _ = ndimage.label(free)
    front, back = set(label[:, 0].tolist()), set(label[:, -1].tolist())
    return bool((front & back) - {0})


def test_a_gaussian_falls_off_from_the_surface_and_sums_to_one_cell() -> None:
    model, resolution = MODELS["gaussian"], 0.01
    reach = np.array([[0.4, 0.4]])
    _, around = model.evidence(reach, resolution)
    assert (np.diff(model.falloff) < 0).all()
    cells_per_shell = 0.4 / resolution / len(model.falloff)
    along_ray = 2.0 * around[0] * model.falloff.sum() * cells_per_shell
    assert along_ray == pytest.approx(1.0)
    sigmas = 2.0 * (np.arange(4) + 0.5) / 4
    ratios = model.falloff / np.exp(-0.5 * sigmas**2)
    np.testing.assert_allclose(ratios, ratios[0])


def test_a_wall_is_nonfree_in_gaussian_steps_on_a_2d_map() -> None:
    ends = [[(420.0, 414.0, 240.0), (220.0, 214.0, 240.0)]]
    rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.1)
    view = View.from_pixels(map_from_world(np.eye(4), "optical"), rig, segments_px=ends)
    view = view.with_plane(GroundPlane.below_camera(rig, 1.0))
    used = GroundMapper(uncertainty="gaussian", resolution=0.05)
    used.integrate(view)
    depth, sigma = 70.0 / 6.0, (70.0 / 6.0) ** 2 * 0.5 * np.sqrt(2.0) / 70.0
    for side in (-1.0, 1.0):
        x = depth + side * sigma * np.array([0.25, 0.75, 1.25, 1.75])
        z = np.asarray(used.grid.confidence_at(np.column_stack([x, np.zeros(4)])))
        np.testing.assert_allclose(z / z[0], MODELS["gaussian"].falloff, rtol=1e-5)
    assert used.grid.confidence_at((depth, 0.0)) > z[0]
