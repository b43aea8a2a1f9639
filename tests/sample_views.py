"""Views that tests of several rooms use."""

from __future__ import annotations

import numpy as np

from groundmap import StereoRig, View


def few_views(count: int) -> list[View]:
    """A mounted camera over a few ground points that have no ids."""
    T_base_camera = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1.0]])
    rig = StereoRig(fx=500, fy=500, cx=320, cy=240, baseline=0.2, T_base_camera=T_base_camera)
    rng = np.random.default_rng(0)
    depth = rng.uniform(3.0, 8.0, 30)
    u = 320 + rng.uniform(-200, 200, 30)
    pixels = np.column_stack([u, u - 100.0 / depth, 240 + 500.0 / depth])
    return [View.from_pixels(np.eye(4), rig, points_px=pixels) for _ in range(count)]
