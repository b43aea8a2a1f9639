"""Features of unknown depth: nothing is drawn beyond `max_range`, and they change nothing else."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest

from groundmap import Features, GridWindow, GroundMapper, StereoRig, View, fit_ground
from groundmap.arrays import Floats
from groundmap.view.frames import map_from_world

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
CAMERA = 1.2  # [m] above the ground
PLACES = [(0.5, 0.2, 8.0), (0.5, 0.6, 19.0), (3.0, 1.2, 8.0)]  # obstacles, and on the ground
Model = Literal["ellipsoid", "radius", "none"]


def world() -> Floats:
    rng = np.random.default_rng(0)
    ground = np.column_stack(
        [rng.uniform(-5, 5, 600), np.full(600, CAMERA), rng.uniform(1, 18, 600)]
    )
    wall = np.column_stack([rng.uniform(-5, 5, 100), rng.uniform(-0.5, 1, 100), np.full(100, 12.0)])
    return np.concatenate([ground, wall])


def along_rays(xyz: Floats, sigma: npt.ArrayLike) -> Floats:
    """Return covariances with a standard deviation along the ray, and a centimetre across."""
    rays = xyz / np.linalg.norm(xyz, axis=-1, keepdims=True)
    outer = rays[..., :, None] * rays[..., None, :]
    covariance: Floats = np.eye(3) * 1e-4 + outer * np.square(sigma)[..., None, None]
    return covariance


def mapped(
    sigma: float | None, place: tuple[float, float, float], *, model: Model, segment: bool = False
) -> tuple[GridWindow, GroundMapper]:
    points = world()
    view: dict[str, Any] = {}
    sigmas = np.full(len(points), 0.05)
    if sigma is not None and segment:
        ends = np.array([[place, np.add(place, (0.4, 0.0, 0.0))]])
        view["segments"] = Features.segments(ends, along_rays(ends, [[0.05, sigma]]))
    elif sigma is not None:
        points, sigmas = np.concatenate([points, [place]]), np.append(sigmas, sigma)
    seen = View(
        T_map_base=map_from_world(np.eye(4), "optical"),
        rig=RIG,
        points=Features.points(points, along_rays(points, sigmas)),
        **view,
    )
    mapper = GroundMapper(uncertainty=model)
    for fitted in fit_ground([seen], camera_height=CAMERA):
        mapper.integrate(fitted)
    return mapper.grid.window((-5, -30, 60, 30)), mapper


@pytest.mark.parametrize("model", ["ellipsoid", "radius", "none"])
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("segment", [False, True])
def test_a_feature_of_unknown_depth_changes_nothing_and_is_counted(
    place: tuple[float, float, float], model: Model, segment: bool
) -> None:
    without, _ = mapped(None, place, model=model)
    for sigma in (10.0, 20.0, 1e3, 1e150):
        window, mapper = mapped(sigma, place, model=model, segment=segment)
        assert np.array_equal(window.confidence, without.confidence)
        assert np.array_equal(window.count, without.count)
        assert mapper.stats.features_dropped["too_uncertain"] == 1


@pytest.mark.parametrize("model", ["ellipsoid", "radius", "none"])
@pytest.mark.parametrize("sigma", [0.5, 2.0, 4.0, 9.0])
def test_nothing_is_drawn_beyond_the_range(sigma: float, model: Model) -> None:
    for place in PLACES[:2]:
        window, mapper = mapped(sigma, place, model=model)
        cells = np.argwhere(window.confidence > 0)
        ranges = np.hypot(*window.cell_to_world(cells).T)
        assert ranges.max() <= mapper.settings.max_range + window.resolution


def test_a_far_feature_spreads_to_the_range() -> None:
    window, _ = mapped(2.0, (0.5, 0.6, 18.0), model="ellipsoid")
    ranges = np.hypot(*window.cell_to_world(np.argwhere(window.confidence > 0)).T)
    assert ranges.max() > 19.5
