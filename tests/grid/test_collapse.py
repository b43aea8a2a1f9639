from __future__ import annotations

import numpy as np
import pytest

from groundmap import CellState, ConfidenceGrid
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.grid.collapse import as_planes, ground_heights

LEVEL = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])


def voxels(resolution: float = 0.25, planes: Floats = LEVEL) -> ConfidenceGrid:
    grid = ConfidenceGrid(resolution=resolution, origin=(0.0, 0.0, 0.0))
    grid.planes = planes
    return grid


def put(grid: ConfidenceGrid, box: tuple[float, ...], z: float) -> None:
    """Fuse one value into the voxels of a box: xmin, ymin, zmin, xmax, ymax, zmax [m]."""
    corners = np.rint(np.array(box).reshape(2, 3) / grid.resolution).astype(np.int64)
    shape = tuple((corners[1] - corners[0])[::-1].tolist())
    grid.fuse(corners[0, ::-1], np.full(shape, z, dtype=np.float32))


def test_a_column_is_nonfree_if_any_voxel_in_the_band_is() -> None:
    grid = voxels()
    put(grid, (0, 0, 0.25, 2, 2, 2), -1.0)
    put(grid, (1, 1, 1.5, 1.25, 1.25, 1.75), 1.0)
    put(grid, (1, 1, 1.5, 1.25, 1.25, 1.75), 0.8)
    flat = grid.collapse()
    assert flat.ndim == 2
    assert flat.confidence_at((1.1, 1.1)) == pytest.approx(0.8 / 3)  # with the free view
    assert flat.count_at((1.1, 1.1)) == 3
    assert flat.confidence_at((0.6, 1.1)) == -1.0


def test_a_doubtful_voxel_does_not_block_a_column_that_is_free_below_it() -> None:
    grid = voxels()
    put(grid, (0, 0, 0.25, 2, 1, 0.5), -1.0)
    put(grid, (0, 0, 1.5, 2, 2, 1.75), 0.2)
    flat = grid.collapse()
    assert (flat.area(CellState.FREE), flat.area(CellState.NONFREE)) == (2.0, 2.0)
    assert grid.collapse(doubtful=0.0).area(CellState.NONFREE) == 4.0
    put(grid, (0, 0, 1.5, 2, 2, 1.75), 0.2)
    assert grid.collapse().area(CellState.NONFREE) == 4.0


def test_what_is_above_or_below_the_band_does_not_count() -> None:
    grid = voxels()
    put(grid, (0, 0, 0.25, 2, 2, 2), -1.0)
    put(grid, (0, 0, 0, 2, 2, 0.25), 1.0)  # ground
    put(grid, (1, 1, 2, 2, 2, 2.5), 1.0)  # a lintel
    flat = grid.collapse(high=2.0)
    assert flat.area(CellState.FREE) == 4.0
    assert flat.area(CellState.NONFREE) == 0.0
    assert grid.collapse(high=2.25).area(CellState.NONFREE) == 1.0


def test_free_space_above_a_box_does_not_make_its_column_free() -> None:
    grid = voxels()
    put(grid, (0, 0, 0.75, 2, 2, 2), -1.0)
    assert grid.collapse().area(CellState.FREE) == 0.0
    assert grid.collapse(free_below=1.0).area(CellState.FREE) == 4.0


def test_the_band_follows_ground_that_climbs() -> None:
    slope = 0.2
    x = np.arange(0.0, 40.0, 2.0)
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    planes = np.column_stack([x, np.ones_like(x), slope * x, np.tile(normal, (len(x), 1))])
    grid = voxels(planes=planes)
    for start in range(40):
        bottom = np.floor(slope * start / 0.25) * 0.25
        put(grid, (start, 0, bottom, start + 1, 2, bottom + 0.25), 1.0)
        put(grid, (start, 0, bottom + 0.25, start + 1, 2, bottom + 1.5), -1.0)
    flat = grid.collapse(low=0.25, high=1.0, free_below=0.75)
    assert flat.area(CellState.FREE) == 80.0
    grid.planes = LEVEL
    assert grid.collapse(low=0.25, high=1.0, free_below=0.75).area(CellState.NONFREE) > 0.0


def test_the_height_of_the_ground_is_the_mean_of_the_nearest_planes() -> None:
    tilted = np.array([0.6, 0.0, 0.8])
    planes = np.array([[0.0, 0.0, 1.0, *tilted], [4.0, 0.0, 3.0, 0.0, 0.0, 1.0]])
    heights = ground_heights(planes, np.array([[2.0, 0.0], [0.0, 5.0]]))
    np.testing.assert_allclose(heights, [0.5 * (1.0 - 1.5 + 3.0), 0.5 * (1.0 + 3.0)])


def test_each_column_is_what_its_voxels_say() -> None:
    rng = np.random.default_rng(1)
    grid = voxels(resolution=0.5)
    for _ in range(3):
        z = rng.choice([-1.0, -0.3, 0.0, 0.0, 0.4], size=(12, 40, 30)).astype(np.float32)
        grid.fuse(np.array([-2, -17, -9]), z)
    flat = grid.collapse(low=0.2, high=2.6, free_below=1.5, doubtful=0.5)
    window = grid.window((-4.5, -8.5, -1.0, 10.5, 11.5, 5.0))
    for row, col in np.ndindex(40, 30):
        confidence, count = window.confidence[:, row, col], window.count[:, row, col]
        height = (np.arange(12) - 2 + 0.5) * 0.5
        seen = (count > 0) & (height - 0.25 >= 0.2) & (height <= 2.6)
        low = seen & (height < 1.5)
        if (low & (confidence <= -0.01)).any():
            seen &= ~((confidence >= 0.01) & (confidence * count <= 0.5))
            low &= seen
        expected = (0.0, 0)
        if (seen & (confidence >= 0.01)).any():
            at = np.where(seen, confidence, -9.0).argmax()
            expected = (confidence[at], count[at])
        elif low.any():
            at = np.where(low, confidence, 9.0).argmin()
            expected = (confidence[at], count[at])
        place = ((col - 9 + 0.5) * 0.5, (row - 17 + 0.5) * 0.5)
        assert (flat.confidence_at(place), flat.count_at(place)) == expected


def test_collapsed_maps_keep_rule_frame_and_trajectory() -> None:
    grid = voxels()
    put(grid, (0, 0, 0.25, 2, 2, 2), -1.0)
    grid.trajectory = np.array([[1.0, 1.0, 0.5]])
    flat = grid.collapse()
    assert (flat.rule, flat.frame, flat.resolution) == (grid.rule, grid.frame, grid.resolution)
    np.testing.assert_array_equal(flat.trajectory, grid.trajectory)


def test_a_2d_map_is_its_own_collapse() -> None:
    grid = ConfidenceGrid(resolution=0.5)
    grid.fuse(np.array([0, 0]), np.array([[-0.5, 0.5]], dtype=np.float32))
    flat = grid.collapse()
    assert flat is not grid
    np.testing.assert_array_equal(flat.window().confidence, grid.window().confidence)


def test_planes_are_kept_by_copies_merges_and_files(tmp_path: object) -> None:
    a, b = voxels(), voxels(planes=LEVEL + np.eye(6)[:1])
    put(a, (0, 0, 0, 1, 1, 1), -1.0)
    both = a.merge(b).copy()
    np.testing.assert_array_equal(both.planes[:, 0], [0.0, 1.0])
    both.save(f"{tmp_path}/map.npz")
    np.testing.assert_array_equal(ConfidenceGrid.load(f"{tmp_path}/map.npz").planes, both.planes)


def test_a_map_without_ground_planes_is_refused() -> None:
    grid = voxels(planes=np.empty((0, 6)))
    put(grid, (0, 0, 0, 1, 1, 1), -1.0)
    with pytest.raises(InputError, match=r"map: expected ground planes of its views.*fit_ground"):
        grid.collapse()


def test_a_band_without_voxels_is_refused() -> None:
    grid = voxels()
    put(grid, (0, 0, 0, 1, 1, 1), -1.0)
    with pytest.raises(InputError, match=r"band: expected heights .* with voxels .* 5 to 7 m"):
        grid.collapse(low=5.0, high=7.0, free_below=6.0)


@pytest.mark.parametrize(
    ("low", "high", "free_below"), [(1.0, 0.5, 0.7), (0.1, 0.5, 0.7), (0.5, 2.0, 0.4)]
)
def test_heights_that_do_not_ascend_are_refused(low: float, high: float, free_below: float) -> None:
    with pytest.raises(InputError, match=r"band: expected low < free_below <= high"):
        voxels().collapse(low=low, high=high, free_below=free_below)


def test_heights_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(InputError, match=r"band: expected numbers \[m\], got nan"):
        voxels().collapse(low=float("nan"))


@pytest.mark.parametrize(
    ("planes", "message"),
    [
        ([[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]], "normals that point up"),
        ([[0.0, 0.0, np.nan, 0.0, 0.0, 1.0]], "finite numbers"),
        ([[0.0, 0.0, 1.0]], r"shape \(n, 6\)"),
    ],
)
def test_damaged_planes_are_refused(planes: list[list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        as_planes(planes)
