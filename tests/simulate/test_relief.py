"""Reliefs: heights of the ground, poses that stand on it, and what it hides."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.errors import InputError
from groundmap.simulate import Relief
from groundmap.simulate.drive import to_transforms

RAMP = Relief(road=[(0, 0), (40, 0)], along=[(10, 0), (20, 2)], across=[(3, 0), (5, -0.4)])


@given(st.floats(-10, 50), st.floats(-8, 8))
def test_heights_are_the_sum_of_both_profiles(x: float, y: float) -> None:
    along = 0.2 * min(max(x - 10.0, 0.0), 10.0)
    # Beyond the ends of the road, the distance to it is that to its end.
    beyond = float(np.hypot(max(-x, x - 40.0, 0.0), y))
    across = -0.2 * min(max(beyond - 3.0, 0.0), 2.0) if y > 0 else 0.0
    assert float(RAMP.height((x, y))) == pytest.approx(along + across, abs=1e-9)


def test_a_base_stands_level_with_the_ground_below_it() -> None:
    pose = RAMP.lift_poses(to_transforms([(15.0, 0.0, 0.0), (15.0, 0.0, np.pi / 2)]))
    slope = np.arctan(0.2)
    npt.assert_allclose(pose[:, :3, 3], [(15.0, 0.0, 1.0)] * 2, atol=1e-9)
    npt.assert_allclose(pose[0, :3, 2], (-np.sin(slope), 0.0, np.cos(slope)), atol=1e-9)
    npt.assert_allclose(pose[1, :3, 2], pose[0, :3, 2], atol=1e-9)
    npt.assert_allclose(
        pose[:, :3, :3] @ np.swapaxes(pose[:, :3, :3], 1, 2), [np.eye(3)] * 2, atol=1e-9
    )


def test_a_crest_hides_what_is_behind_it() -> None:
    hill = Relief(road=[(0, 0), (40, 0)], along=[(10, 0), (15, 2), (20, 0)])
    eye = np.array([2.0, 0.0, 1.0])
    targets = np.array([(13.0, 0.0, 1.2), (22.0, 0.0, 0.0), (22.0, 0.0, 6.0)])
    npt.assert_array_equal(hill.in_sight(eye, targets), [True, False, True])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"road": [(0, 0)]}, r"^road: expected at least two places"),
        ({"road": [(1, 1), (1, 1)]}, r"^road: expected at least two places"),
        ({"along": [(5, 0), (5, 1)]}, r"^along: expected rows by increasing distance"),
        ({"across": []}, r"^across: expected"),
        ({"along": [(5, np.inf)]}, r"along"),
    ],
)
def test_a_road_without_length_or_a_profile_out_of_order_is_refused(
    wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Relief(**({"road": [(0, 0), (9, 0)]} | wrong))
