"""A low box that is approached until it leaves the image, and then looked over."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
import pytest

from groundmap import GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Floats
from groundmap.view.frames import map_from_world

Fusion = Literal["average", "capped", "exponential", "log_odds", "absolute"]
RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
FACE = 6.0  # [m] ahead, the near face of the box; it is 0.8 m wide
PLACES = np.array([(6.03, y) for y in (-0.3, 0.0, 0.3)])


def ground_and_box(camera: float, top: float) -> tuple[Floats, Floats]:
    """Features of the ground, without what the box hides from the start, and of the box."""
    rng = np.random.default_rng(0)
    ground = np.column_stack(
        [rng.uniform(-5, 5, 3000), np.full(3000, camera), rng.uniform(1, 25, 3000)]
    )
    end = FACE * camera / (camera - top) if camera > top else np.inf
    hidden = (np.abs(ground[:, 0]) < 0.4) & (ground[:, 2] > FACE) & (ground[:, 2] < end)
    heights = rng.uniform(0.0, top, 60)
    box = np.column_stack([rng.uniform(-0.4, 0.4, 60), camera - heights, np.full(60, 6.03)])
    return ground[~hidden], box


def seen(features: Floats, at: float, camera: float, lowest_px: float = 480.0) -> View:
    """See features (x right, y down, z ahead) from `at` metres ahead, down to an image row."""
    x, y, z = (features - (0.0, 0.0, at)).T
    u, v = 700.0 * x / z + 320.0, 700.0 * y / z + 240.0
    inside = (z > 0.5) & (z < 19.0) & (np.abs(u - 320.0) < 320.0) & (v < lowest_px)
    pose = np.eye(4)
    pose[2, 3] = at
    pixels = np.column_stack([u, u - 350.0 / np.where(z == 0, 1.0, z), v])[inside]
    view = View.from_pixels(map_from_world(pose, "optical"), RIG, points_px=pixels)
    return view.with_plane(GroundPlane.below_camera(RIG, camera))


def see_often(mapper: GroundMapper, view: View, times: int) -> None:
    evidence = mapper.explain(view).evidence
    for _ in range(times):
        mapper.grid.fuse(*evidence)


def confidence(mapper: GroundMapper) -> npt.NDArray[np.float32]:
    values = mapper.grid.confidence_at(PLACES)
    assert isinstance(values, np.ndarray)
    return values


CASES = [(1.2, 0.5, 1.6), (1.65, 0.2, 3.5), (1.65, 0.6, 5.0), (0.8, 0.3, 2.0), (0.5, 0.6, 1.0)]
OTHERS: list[Fusion] = ["exponential", "log_odds", "absolute"]


@pytest.mark.parametrize(
    ("camera", "top", "leaves", "fusion"),
    [
        *((*case, fusion) for case in CASES for fusion in ("average", "capped")),
        *((*CASES[0], fusion) for fusion in OTHERS),
    ],
)
def test_a_box_that_has_left_the_image_is_not_free_and_free_again_when_it_is_gone(
    camera: float, top: float, leaves: float, fusion: Fusion
) -> None:
    mapper = GroundMapper(resolution=0.1, fusion=fusion)
    ground, box = ground_and_box(camera, top)
    both = np.concatenate([ground, box])
    lowest_px = 240.0 + 700.0 * max(camera - top, 0.02) / leaves
    see_often(mapper, seen(both, 0.0, camera, lowest_px), 20)
    for at in (FACE - 0.7 * leaves, FACE - 0.45 * leaves):
        see_often(mapper, seen(both, at, camera, lowest_px), 500)
        assert (confidence(mapper) > 0).all()
    # Taken away, and seen from where the ground behind it is in the image.
    see_often(mapper, seen(ground_and_box(camera, 0.0)[0], 0.0, camera), 1100)
    assert (confidence(mapper) < 0).all()
