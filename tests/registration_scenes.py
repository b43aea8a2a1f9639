"""Scenes of point features for tests of the registration: views with a known motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from groundmap import StereoRig, View
from groundmap.arrays import Floats

RIG = StereoRig(fx=700.0, fy=700.0, cx=600.0, cy=200.0, baseline=0.5, pixel_noise_px=0.3)


def transform(translation: npt.ArrayLike, rotation: npt.ArrayLike = (0, 0, 0)) -> Floats:
    """Return a rigid transform from a translation [m] and a rotation vector [rad]."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(rotation).as_matrix()
    matrix[:3, 3] = translation
    return matrix


def street(rng: np.random.Generator, count: int = 400) -> Floats:
    """Return points on the ground and on walls beside a street, shape (n, 3) [m, optical]."""
    ground = rng.uniform((-4, 1.5, 4), (4, 1.7, 30), (count // 3, 3))
    walls = rng.uniform((-1, -3, 4), (1, 1.5, 40), (count - len(ground), 3))
    walls[:, 0] += rng.choice([-5.0, 5.0], len(walls))
    return np.concatenate([ground, walls])


def seen_from(
    points: Floats,
    T_world_camera: Floats,
    rng: np.random.Generator,
    *,
    ids: bool = False,
    rig: StereoRig = RIG,
) -> View:
    """Return the view of points from a pose, with pixel noise, in a random order.

    With `ids`, landmark ids are the rows of `points`.
    """
    order = rng.permutation(len(points))
    local = (points[order] - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    ahead = local[:, 2] > 0.5
    x, y, z = local[ahead].T
    left, disparity = rig.cx + rig.fx * x / z, rig.fx * rig.baseline / z
    pixels = np.stack([left, left - disparity, rig.cy + rig.fy * y / z], axis=1)
    pixels += rng.normal(0.0, rig.pixel_noise_px, pixels.shape)
    inside = (abs(pixels[:, 0] - 600) < 600) & (abs(pixels[:, 2] - 200) < 200)
    inside &= pixels[:, 0] - pixels[:, 1] > 1.0
    names = order[ahead][inside]
    return View.from_pixels(
        T_world_camera @ np.linalg.inv(rig.T_base_camera),
        rig,
        points_px=pixels[inside],
        point_ids=names if ids else None,
    )
