"""Triangulation against projection; its covariance against differences and against samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import CameraError, InputError
from groundmap.view.stereo_rig import StereoRig

RIG = StereoRig(fx=700.0, fy=690.0, cx=320.0, cy=240.0, baseline=0.5)


def project(rig: StereoRig, xyz: Floats) -> Floats:
    """Pinhole projection into both images: (uL, uR, v) [px]."""
    x, y, z = np.moveaxis(xyz, -1, 0)
    left = rig.fx * x / z + rig.cx
    right = rig.fx * (x - rig.baseline) / z + rig.cx
    return np.stack([left, right, rig.fy * y / z + rig.cy], axis=-1)


@st.composite
def rigs(draw: st.DrawFn) -> StereoRig:
    return StereoRig(
        fx=draw(st.floats(200.0, 2000.0)),
        fy=draw(st.floats(200.0, 2000.0)),
        cx=draw(st.floats(0.0, 1000.0)),
        cy=draw(st.floats(0.0, 1000.0)),
        baseline=draw(st.floats(0.05, 2.0)),
        pixel_noise_px=draw(st.floats(0.1, 3.0)),
    )


@st.composite
def positions(draw: st.DrawFn) -> Floats:
    """Up to 20 points in front of a camera: x, y within the depth, depth 0.5 to 50 m."""
    n = draw(st.integers(1, 20))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    depth = rng.uniform(0.5, 50.0, n)
    return np.column_stack([rng.uniform(-1, 1, (n, 2)) * depth[:, None], depth])


@given(rigs(), positions())
def test_triangulation_inverts_projection(rig: StereoRig, xyz: Floats) -> None:
    found = rig.triangulate(project(rig, xyz))
    npt.assert_allclose(found.xyz, xyz, rtol=1e-8, atol=1e-8)
    assert found.kept.all()
    assert not found.dropped


@given(rigs(), positions())
def test_the_ends_of_segments_are_triangulated_like_points(rig: StereoRig, xyz: Floats) -> None:
    pixels = project(rig, np.concatenate([xyz, xyz[::-1] * 0.9]))
    as_points = rig.triangulate(pixels)
    as_segments = rig.triangulate(pixels.reshape(-1, 2, 3))
    npt.assert_array_equal(as_segments.xyz.reshape(-1, 3), as_points.xyz)
    npt.assert_array_equal(as_segments.covariance.reshape(-1, 3, 3), as_points.covariance)


@given(rigs(), positions())
def test_covariance_is_the_noise_through_the_numerical_jacobian(
    rig: StereoRig, xyz: Floats
) -> None:
    pixels = project(rig, xyz)
    step = 1e-3 * (pixels[:, 0] - pixels[:, 1]).min()
    columns = []
    for axis in range(3):
        offset = step * np.eye(3)[axis]
        ahead, back = rig.triangulate(pixels + offset), rig.triangulate(pixels - offset)
        columns.append((ahead.xyz - back.xyz) / (2 * step))
    jacobian = np.stack(columns, axis=-1)
    expected = rig.pixel_noise_px**2 * (jacobian @ np.swapaxes(jacobian, 1, 2))
    found = rig.triangulate(pixels).covariance
    scale = np.sqrt(np.einsum("nii,njj->nij", expected, expected))
    npt.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-4)


@pytest.mark.parametrize("xyz", [(0.0, 0.0, 10.0), (4.0, -1.5, 9.0), (-2.0, 1.4, 4.0)])
def test_covariance_agrees_with_many_noisy_matches(xyz: tuple[float, float, float]) -> None:
    # 100,000 samples know a variance to 0.5 % (one sigma); curvature adds (0.7 px / 35 px)².
    rng = np.random.default_rng(7)
    pixels = project(RIG, np.array([xyz]))
    noisy = pixels + rng.normal(0.0, RIG.pixel_noise_px, (100_000, 3))
    expected = np.cov(RIG.triangulate(noisy).xyz.T)
    found = RIG.triangulate(pixels).covariance[0]
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    npt.assert_allclose(found / scale, expected / scale, rtol=0, atol=0.03)


@given(positions())
def test_covariance_is_symmetric_and_positive(xyz: Floats) -> None:
    covariance = RIG.triangulate(project(RIG, xyz)).covariance
    npt.assert_array_equal(covariance, np.swapaxes(covariance, 1, 2))
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_the_standard_deviation_of_depth_grows_with_its_square() -> None:
    near, far = RIG.triangulate(project(RIG, np.array([(0, 0, 5.0), (0, 0, 10.0)]))).covariance
    assert np.sqrt(far[2, 2] / near[2, 2]) == pytest.approx(4.0)


BAD: dict[str, list[tuple[float, ...]]] = {
    "not_finite": [(np.nan, 0, 0), (0, np.inf, 0), (9, 1, -np.inf), (np.inf, np.inf, 0)],
    "no_disparity": [(5, 5, 0), (5, 6, 0), (-5, 5, 1)],
}


@given(
    st.lists(st.sampled_from(["good", *BAD]), max_size=12),
    st.lists(st.integers(0, 11), min_size=12, max_size=12),
)
def test_rows_without_a_point_are_dropped_and_counted_by_reason(
    kinds: list[str], choices: list[int]
) -> None:
    known: dict[str, list[tuple[float, ...]]] = {**BAD, "good": [(40.0, 5.0, 1.0)]}
    rows = [known[kind][i % len(known[kind])] for kind, i in zip(kinds, choices, strict=False)]
    found = RIG.triangulate(rows)
    assert found.kept.tolist() == [kind == "good" for kind in kinds]
    assert len(found.xyz) == len(found.covariance) == kinds.count("good")
    assert found.dropped == {kind: kinds.count(kind) for kind in BAD if kind in kinds}
    assert np.isfinite(found.xyz).all()


@pytest.mark.parametrize("bad_end", [0, 1])
@pytest.mark.parametrize("reason", BAD)
def test_a_segment_with_one_bad_end_is_dropped(bad_end: int, reason: str) -> None:
    good = (40.0, 5.0, 1.0)
    segments = np.array([[good, good], [good, good], [good, good]])
    segments[1, bad_end] = BAD[reason][0]
    found = RIG.triangulate(segments)
    assert found.xyz.shape == (2, 2, 3)
    assert found.covariance.shape == (2, 2, 3, 3)
    assert found.kept.tolist() == [True, False, True]
    assert found.dropped == {reason: 1}


def test_a_segment_bad_in_both_ways_counts_once() -> None:
    found = RIG.triangulate([[(np.nan, 5.0, 0.0), (1.0, 2.0, 0.0)]])
    assert found.dropped == {"not_finite": 1}


@pytest.mark.parametrize("shape", [(0, 3), (0, 2, 3)])
def test_no_matches_give_no_points(shape: tuple[int, ...]) -> None:
    found = RIG.triangulate(np.empty(shape))
    assert found.xyz.shape == shape
    assert found.covariance.shape == (*shape, 3)
    assert not found.dropped


@pytest.mark.parametrize(
    ("shape", "expected"),
    [((4, 2), "n, 3"), ((4,), "n, 3"), ((2, 3, 3), "n, 2, 3"), ((2, 2, 2), "n, 2, 3")],
)
def test_pixels_of_another_shape_are_refused(shape: tuple[int, ...], expected: str) -> None:
    with pytest.raises(InputError, match=rf"^pixels: expected shape \({expected}\)"):
        RIG.triangulate(np.ones(shape))


@pytest.mark.parametrize("name", ["fx", "fy", "baseline", "pixel_noise_px"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_numbers_of_a_rig_that_are_not_above_zero_are_refused(name: str, value: float) -> None:
    with pytest.raises(CameraError, match=rf"^{name}: expected a number above 0 \["):
        replace(RIG, **{name: value})  # type: ignore[arg-type] # mypy knows no names in a dict


@pytest.mark.parametrize("name", ["cx", "cy"])
def test_a_principal_point_that_is_not_finite_is_refused(name: str) -> None:
    with pytest.raises(CameraError, match=r"^cx, cy: expected finite numbers"):
        replace(RIG, **{name: np.nan})  # type: ignore[arg-type] # as above


def test_a_mounting_that_is_not_rigid_is_refused() -> None:
    with pytest.raises(CameraError, match=r"^T_base_camera: expected a rotation with orthonormal"):
        replace(RIG, T_base_camera=2.0 * np.eye(4))


def test_up_is_z_of_a_base_and_minus_y_of_a_bare_camera() -> None:
    mounting = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1.0]])
    npt.assert_array_equal(RIG.up, (0, -1, 0))
    npt.assert_array_equal(replace(RIG, T_base_camera=mounting).up, (0, 0, 1))
