"""Figures of moving and thin things apart, and of the band that a robot sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from groundmap import ConfidenceGrid, Features, StereoRig, View
from groundmap.arrays import Floats
from groundmap.evaluate.held_out import HeldOut, judge
from groundmap.evaluate.landmark_kinds import LandmarkKinds, kinds_of
from groundmap.view.frames import map_from_world

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)


def seen(ahead: float, landmarks: dict[int, tuple[float, float]], sigma: float) -> View:
    """See landmarks at (x, y) in the map from `ahead` metres along x, facing along x."""
    pose = np.eye(4)
    pose[2, 3] = ahead
    xyz = np.array([(-y, 0.5, x - ahead) for x, y in landmarks.values()])
    points = Features.points(xyz, np.tile(sigma**2 * np.eye(3), (len(xyz), 1, 1)), list(landmarks))
    return View(T_map_base=map_from_world(pose, "optical"), rig=RIG, points=points)


@pytest.mark.parametrize(("sigma", "moving"), [(0.05, [2, 3]), (0.5, [2])])
def test_landmarks_move_if_their_places_differ_by_more_than_their_uncertainty(
    sigma: float, moving: list[int]
) -> None:
    views = [
        seen(float(k), {1: (12.0, 1.0), 2: (20.0 - 3 * k, -1.0), 3: (12.0 + 0.3 * k, 0.0)}, sigma)
        for k in range(4)
    ]
    assert kinds_of(views, []).moving.tolist() == moving
    once = [seen(0.0, {5: (9.0, 0.0)}, 0.05)]
    assert kinds_of(once, []).moving.tolist() == []


def test_things_of_up_to_five_landmarks_within_a_metre_are_thin() -> None:
    def cluster(x: float, count: int) -> Floats:
        return np.column_stack([x + 0.1 * np.arange(count), np.zeros(count)])

    places = np.concatenate([cluster(0.0, 5), cluster(10.0, 6), cluster(20.0, 1)])
    ids = np.arange(len(places))
    # The same landmark in several views counts once.
    kinds = kinds_of([seen(0.0, {1: (9.0, 0.0)}, 0.1)], [(places, ids), (places[:5], ids[:5])])
    assert kinds.thin.tolist() == [0, 1, 2, 3, 4, 11]


def test_moving_and_thin_things_and_the_swept_band_have_figures_of_their_own() -> None:
    grid = ConfidenceGrid(resolution=0.25)
    z = np.full((32, 64), -1.0, dtype=np.float32)  # 8 m x 16 m, free
    z[:, 40:44] = 1.0
    grid.fuse(np.array([0, 0]), z)
    obstacles = np.array([(10.1, 1.0), (10.1, 2.0), (4.0, 2.0), (5.0, 3.0)])
    held_out = HeldOut(obstacles, np.empty((0, 2)), np.empty((0, 2)), np.array([7, 8, 7, 9]))
    kinds = LandmarkKinds(moving=np.array([7]), thin=np.array([8, 9]))
    drive = np.array([(0.1, 4.0), (15.9, 4.0)])
    figures = judge(grid, held_out, drive, kinds).figures()
    assert (figures.moving, figures.moving_in_free, figures.moving_near_nonfree) == (2, 0.5, 0.5)
    assert (figures.thin, figures.thin_in_free, figures.thin_near_nonfree) == (2, 0.5, 0.5)
    # From x = 5.1 - 0.8 to 15.9 + 0.8 m, of which 1 m is blocked; the map ends at 16 m.
    assert figures.swept_nonfree == pytest.approx(1.0 / 12.2, abs=0.02)
    assert figures.swept_free == pytest.approx(10.6 / 12.2, abs=0.02)
    alone = judge(grid, held_out, drive).figures()
    assert (alone.moving, alone.thin, alone.obstacles) == (0, 0, 4)
