"""Extreme values: an error that names them or a right answer; warnings are errors here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from groundmap import (
    ConfidenceGrid,
    Features,
    GroundMapper,
    GroundPlane,
    StereoRig,
    View,
    fit_ground,
    pose_jumps,
)
from groundmap.errors import CameraError, InputError, SettingsError
from groundmap.evidence.triangulation import triangulate
from groundmap.view.frames import map_from_world

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
HUGE = [1e200, -1e300, 1.7e308]
NO_NUMBERS = [1j, np.nan, np.inf, "a", None, 10**400, {}, [1]]


def seen_grid() -> ConfidenceGrid:
    grid = ConfidenceGrid(resolution=0.5)
    grid.fuse(np.array([0, 0]), np.full((4, 4), -1.0, dtype=np.float32))
    return grid


def view_of(xyz: Any, covariance: Any = None) -> View:
    spread = np.tile(np.eye(3) * 1e-4, (len(xyz), 1, 1)) if covariance is None else covariance
    pose = map_from_world(np.eye(4), "optical")
    return View(T_map_base=pose, rig=RIG, points=Features.points(xyz, spread))


def mapped(view: View, **settings: Any) -> GroundMapper:
    mapper = GroundMapper(**settings)
    for standing in fit_ground([view], camera_height=1.5):
        mapper.integrate(standing)
    return mapper


@pytest.mark.parametrize("value", HUGE)
def test_places_beyond_numbers_of_cells_are_unknown(value: float) -> None:
    grid = seen_grid()
    assert grid.confidence_at((value, 0.25)) == 0.0
    assert grid.count_at([(value, 0.25), (0.25, 0.25)]).tolist() == [0, 1]  # type: ignore[union-attr]
    with pytest.raises(InputError, match=r"^bounds: expected a box of 268435456 cells at most"):
        grid.window((-abs(value), 0.0, abs(value), 1.0))
    with pytest.raises(InputError, match=r"^cells: expected whole numbers"):
        grid.window().cell_to_world((value, 0.0))


REFUSE_NO_NUMBERS: dict[str, Callable[[Any], object]] = {
    "xy": lambda value: seen_grid().confidence_at((value, 0.0)),
    "bounds": lambda value: seen_grid().window((0.0, 0.0, value, 1.0)),
    "cells": lambda value: seen_grid().window().cell_to_world((value, 0)),
    "resolution": lambda value: ConfidenceGrid(resolution=value),
    "origin": lambda value: ConfidenceGrid(origin=(value, 0.0)),
    "epsilon": lambda value: seen_grid().window().states(epsilon=value),
    "z": lambda value: seen_grid().fuse(np.array([0, 0]), np.array(value)),
    "points": lambda value: triangulate([(value, 0.0), (1.0, 1.0)]),
    "segments": lambda value: triangulate([(0.0, 0.0), (1.0, 1.0)], [(value, 1)]),
    "positions": lambda value: pose_jumps([(value, 0.0), (1.0, 1.0)]),
    "fx": lambda value: StereoRig(fx=value, fy=1.0, cx=0.0, cy=0.0, baseline=1.0),
    "camera_height": lambda value: GroundPlane.below_camera(RIG, value),
    "T_map_base": lambda value: View.from_pixels([[1.0], [value]], RIG),
}


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", REFUSE_NO_NUMBERS)
def test_what_is_no_real_number_is_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(InputError, match=f"^{name}: expected .*, got "):
        REFUSE_NO_NUMBERS[name](value)


@pytest.mark.parametrize("cell", [2**62, -(2**63)])
def test_cells_that_sums_would_overflow_from_are_refused(cell: int) -> None:
    z = np.ones((1, 1), dtype=np.float32)
    with pytest.raises(InputError, match=rf"^lower: expected cells within {2**60} of cell 0, got"):
        seen_grid().fuse(np.array([0, cell]), z)


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("entry", [(0, 0), (2, 1)])
def test_a_rotation_of_huge_entries_is_refused(entry: tuple[int, int], value: float) -> None:
    pose = np.eye(4)
    pose[entry] = value
    with pytest.raises(CameraError, match=r"^T_map_base: expected a rotation"):
        View(T_map_base=pose, rig=RIG)
    normal = [0.0, 0.0, 1.0]
    normal[entry[1]] = value
    with pytest.raises(InputError, match=r"^normal: expected a vector of length 1"):
        GroundPlane(normal=normal, offset=0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", HUGE)
def test_a_pose_beyond_any_map_is_refused(value: float) -> None:
    pose = map_from_world(np.eye(4), "optical")
    pose[0, 3] = value
    with pytest.raises(InputError, match=r"^T_map_base: expected a position within 1e\+08 m"):
        mapped(View(T_map_base=pose, rig=RIG))


@pytest.mark.parametrize("value", HUGE)
@pytest.mark.parametrize("axis", [0, 1])
def test_features_beyond_any_range_are_dropped_and_counted(axis: int, value: float) -> None:
    xyz = np.array([[0.0, 1.5, 6.0], [1.0, 0.5, 5.0]])
    xyz[1, axis] = value
    stats = mapped(view_of(xyz)).stats
    assert (stats.features_used, dict(stats.features_dropped)) == (1, {"out_of_range": 1})
    segment = Features.segments(xyz[None], np.tile(np.eye(3), (1, 2, 1, 1)))
    view = View(T_map_base=map_from_world(np.eye(4), "optical"), rig=RIG, segments=segment)
    assert dict(mapped(view).stats.features_dropped) == {"out_of_range": 1}


def test_pixels_whose_covariance_overflows_are_dropped() -> None:
    rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    disparity = 1e-80  # the depth is a number, its variance is none
    view = View.from_pixels(np.eye(4), rig, points_px=[(disparity, 0.0, 275.0)])
    assert dict(view.dropped) == {"not_finite": 1}


@pytest.mark.parametrize("sigma", [10.0, 19.0, 1e4, 1e150])
@pytest.mark.parametrize("model", ["ellipsoid", "gaussian", "radius", "none"])
def test_depths_of_any_uncertainty_make_no_kilometres_of_cells(sigma: float, model: str) -> None:
    covariance = np.diag([1e-4, 1e-4, sigma**2])[None]
    mapper = mapped(view_of([(0.5, 0.5, 5.0)], covariance), uncertainty=model)
    lower, upper = mapper.grid.bounds().reshape(2, 2)
    assert (upper - lower).max() <= 2 * 40.0 + 2 * 64 * mapper.grid.resolution
    assert mapper.stats.features_dropped["too_uncertain"] == int(sigma > 20.0)
    assert mapper.stats.features_used == int(sigma <= 20.0)


def test_a_segment_with_an_end_that_may_be_anywhere_is_dropped() -> None:
    covariance = np.tile(np.eye(3) * 1e-4, (1, 2, 1, 1))
    covariance[0, 1, 2, 2] = 1e6
    segment = Features.segments([[(0.0, 0.5, 5.0), (1.0, 0.5, 6.0)]], covariance)
    view = View(T_map_base=map_from_world(np.eye(4), "optical"), rig=RIG, segments=segment)
    assert dict(mapped(view).stats.features_dropped) == {"too_uncertain": 1}


@pytest.mark.parametrize("resolution", [1e-300, 5e-324, 1e-6, 0.0009])
def test_a_resolution_that_keeps_a_view_busy_for_minutes_is_refused(resolution: float) -> None:
    expected = r"^resolution: expected at least max_range / 20000, which is 0\.001 m, got "
    with pytest.raises(SettingsError, match=expected):
        GroundMapper(resolution=resolution)
    with pytest.raises(SettingsError, match=r"^support_width: expected at least max_range / 20000"):
        GroundMapper(support_width=resolution)


@pytest.mark.parametrize("name", ["max_range", "halo", "link_angle", "spread_sigmas", "doubt"])
@pytest.mark.parametrize("value", [1e300, 1.7e308, 10**400], ids=["1e300", "1.7e308", "10**400"])
def test_settings_beyond_all_use_are_refused(name: str, value: Any) -> None:
    with pytest.raises(SettingsError, match=f"^{name}: expected "):
        GroundMapper(**{name: value})
    with pytest.raises(SettingsError, match=r"^window: expected less than or equal to 10000"):
        next(fit_ground([], window=10**9))


@pytest.mark.parametrize("value", HUGE)
def test_points_whose_products_overflow_are_no_triangulation(value: float) -> None:
    with pytest.raises(
        InputError, match=r"^points: expected coordinates within 1e\+12 m, .* row 1"
    ):
        triangulate([(0.0, 0.0), (value, 0.0), (1.0, 1.0), (0.0, 1.0)])


@pytest.mark.parametrize("value", HUGE)
def test_poses_beyond_numbers_jump(value: float) -> None:
    assert [jump.view for jump in pose_jumps([(0, 0), (1, 0), (2, 0), (value, 0)])] == [3]
    assert [jump.view for jump in pose_jumps([(0, 0), (9, 0), (9, 1)], [0.0, 5e-324, 1.0])] == []
