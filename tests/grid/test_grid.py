"""The tile grid against its dense twin, its files, and what it refuses."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dense_grid import DenseGrid
from groundmap import CellState, ConfidenceGrid, GridWindow
from groundmap.arrays import Floats32, Ints
from groundmap.errors import FileFormatError, InputError, MergeError
from groundmap.grid.fusion import RULES, Absolute, Average, Capped, Exponential, LogOdds

RESOLUTION = 0.25  # a power of 2, so that borders between cells are exact
ORIGINS = {2: (3.5, -1.25), 3: (3.5, -1.25, 0.75)}
REACH = {2: 100, 3: 24}  # blocks begin within so many cells of cell 0: on 4 tiles a side
SIDE = {2: 90, 3: 20}  # so large a block spans up to 3 tiles a side


class Fuse(NamedTuple):
    lower: Ints
    z: Floats32
    height: Floats32 | None = None


class Merge(NamedTuple):
    views: list[Fuse]


class Copy(NamedTuple):
    pass


class Reload(NamedTuple):
    pass


Operation: TypeAlias = Fuse | Merge | Copy | Reload


@st.composite
def blocks(draw: st.DrawFn, ndim: int) -> Fuse:
    """Evidence with zeros of both signs, full marks, and anything between; some with heights."""
    corner = st.integers(-REACH[ndim], REACH[ndim])
    lower = np.array([draw(corner) for _ in range(ndim)])
    shape = [draw(st.integers(1, SIDE[ndim])) for _ in range(ndim)]
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    z = rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    z[rng.random(shape) < 0.1] = -1.0
    z[rng.random(shape) < draw(st.sampled_from([0.0, 0.5, 0.99, 1.0]))] = draw(
        st.sampled_from([0.0, -0.0])
    )
    if draw(st.booleans()):
        return Fuse(lower, z)
    height = rng.choice([-0.5, 0.0, 0.1, 0.15, 0.4, 0.6, 1.5, np.inf], shape).astype(np.float32)
    return Fuse(lower, z, height)


def operations(ndim: int) -> st.SearchStrategy[list[Operation]]:
    merges = st.builds(Merge, st.lists(blocks(ndim), max_size=3))
    return st.lists(st.one_of(blocks(ndim), merges, st.just(Copy()), st.just(Reload())), max_size=8)


def new_grid(ndim: int = 2) -> ConfidenceGrid:
    return ConfidenceGrid(resolution=RESOLUTION, origin=ORIGINS[ndim])


def new_twin(ndim: int = 2) -> DenseGrid:
    return DenseGrid.empty(REACH[ndim] + SIDE[ndim] + 1, ndim)


def see(grid: ConfidenceGrid, twin: DenseGrid, view: Fuse) -> None:
    grid.fuse(*view)
    twin.fuse(*view)


def reloaded(grid: ConfidenceGrid) -> ConfidenceGrid:
    with tempfile.TemporaryDirectory() as folder:
        grid.save(Path(folder) / "map")
        return ConfidenceGrid.load(Path(folder) / "map")


def contents(grid: ConfidenceGrid) -> dict[tuple[int, ...], tuple[bytes, ...]]:
    """Return all that the tiles hold, bit for bit."""
    held: dict[tuple[int, ...], tuple[bytes, ...]] = {
        index: (tile.confidence.tobytes(), tile.count.tobytes()) for index, tile in grid.tiles()
    }
    for layer in range(len(grid.heights)):
        for index, tile in grid.layer_tiles(layer):
            held[layer, *index] = (tile.confidence.tobytes(), tile.count.tobytes())
    return held


def built(views: list[Fuse], ndim: int) -> tuple[ConfidenceGrid, DenseGrid]:
    grid, twin = new_grid(ndim), new_twin(ndim)
    for view in views:
        see(grid, twin, view)
    return grid, twin


def run(todo: list[Operation], ndim: int) -> tuple[ConfidenceGrid, DenseGrid]:
    """Do the same to a grid and to its twin; what was left behind must not change any more."""
    grid, twin = new_grid(ndim), new_twin(ndim)
    left_behind = []
    for operation in todo:
        if isinstance(operation, Fuse):
            see(grid, twin, operation)
            continue
        left_behind.append((grid, contents(grid)))
        if isinstance(operation, Merge):
            other, other_twin = built(operation.views, ndim)
            left_behind.append((other, contents(other)))
            grid = grid.merge(other)
            twin.add(other_twin)
        else:
            grid = grid.copy() if isinstance(operation, Copy) else reloaded(grid)
    assert all(contents(older) == was for older, was in left_behind)
    return grid, twin


@given(operations(2))
@settings(max_examples=60)
def test_a_2d_grid_is_its_dense_twin_whatever_is_done(todo: list[Operation]) -> None:
    grid, twin = run(todo, 2)
    twin.assert_same_grid(grid)


@given(operations(3))
@settings(max_examples=25)
def test_a_3d_grid_is_its_dense_twin_whatever_is_done(todo: list[Operation]) -> None:
    grid, twin = run(todo, 3)
    twin.assert_same_grid(grid)


@pytest.mark.parametrize("ndim", [2, 3])
@given(data=st.data())
@settings(max_examples=30)
def test_a_window_holds_every_cell_that_its_box_touches(ndim: int, data: st.DataObject) -> None:
    grid, twin = built(data.draw(st.lists(blocks(ndim), max_size=2)), ndim)
    # Bounds in eighths of a cell, up to the edge of the twin.
    most = 8 * (twin.extent - 1)
    pairs = st.lists(st.integers(-most, most), min_size=2, max_size=2, unique=True)
    corners = np.array([sorted(data.draw(pairs)) for _ in range(ndim)]).T  # x first
    bounds = np.tile(grid.origin, 2) + corners.reshape(-1) / 8 * RESOLUTION
    lower, upper = corners[0, ::-1] // 8, -(-corners[1, ::-1] // 8)
    window = grid.window(bounds)
    npt.assert_array_equal(window.origin, grid.origin + lower[::-1] * RESOLUTION)
    assert window.count.shape == tuple(upper - lower)
    twin.assert_same(window, lower, upper)


@given(st.lists(blocks(2), max_size=4))
@settings(max_examples=30)
def test_the_window_without_bounds_is_the_box_around_the_observed_tiles(
    views: list[Fuse],
) -> None:
    grid, twin = built(views, 2)
    window = grid.window()
    assert window.count.sum() == twin.count[0].sum()
    touched = [index for index, _ in grid.tiles()]
    if touched:
        sides = np.ptp(np.array(touched), axis=0) + 1
        assert window.count.shape == tuple(sides * 64)
        again = grid.window(grid.bounds())
        npt.assert_array_equal(again.confidence, window.confidence)
        npt.assert_array_equal(again.origin, window.origin)


@given(st.floats(0.01, 2.0), st.floats(-100, 100), st.integers(-5, 5), st.integers(-5, 5))
def test_the_window_of_the_bounds_misses_nothing_at_any_resolution(
    resolution: float, x: float, row: int, col: int
) -> None:
    grid = ConfidenceGrid(resolution=resolution, origin=(x, -x))
    grid.tile((row, col)).count[...] = 1
    window = grid.window(grid.bounds())
    assert window.count.sum() == 64 * 64
    # Rounding may add a row of nothing, no more.
    assert max(window.count.shape) <= 66


def test_bounds_are_those_of_the_observed_tiles() -> None:
    grid = ConfidenceGrid(resolution=0.5, origin=(1.0, 2.0))
    npt.assert_array_equal(grid.bounds(), (1, 2, 1, 2))
    grid.tile((-1, 2))
    npt.assert_array_equal(grid.bounds(), (1 + 64, 2 - 32, 1 + 96, 2))


@given(blocks(2), blocks(2), blocks(2))
@settings(max_examples=30)
def test_merging_is_commutative(a: Fuse, b: Fuse, c: Fuse) -> None:
    (one, _), (other, twin) = built([a], 2), built([b, c], 2)
    forth, back = one.merge(other), other.merge(one)
    twin.fuse(*a)
    twin.assert_same_grid(forth)
    twin.assert_same_grid(back)
    # The same two products are added: not a bit differs.
    assert contents(forth) == contents(back)


@given(st.lists(blocks(2), max_size=6), st.lists(st.booleans(), min_size=6, max_size=6))
@settings(max_examples=30)
def test_views_split_over_two_grids_and_merged_are_one_grid(
    views: list[Fuse], side: list[bool]
) -> None:
    one, two, all_in_one = new_grid(), new_grid(), new_grid()
    for view, to_one in zip(views, side, strict=False):
        (one if to_one else two).fuse(*view)
        all_in_one.fuse(*view)
    merged = one.merge(two)
    bounds = all_in_one.bounds()
    if views and all_in_one.nbytes:
        npt.assert_array_equal(merged.bounds(), bounds)
        got, expected = merged.window(), all_in_one.window()
        npt.assert_array_equal(got.count, expected.count)
        npt.assert_allclose(got.confidence, expected.confidence, rtol=0, atol=2e-6)


def test_merging_with_an_empty_grid_changes_nothing() -> None:
    grid, _ = built([Fuse(np.array([-70, 3]), np.full((9, 99), 0.3, np.float32))], 2)
    assert contents(grid.merge(new_grid())) == contents(grid)
    assert contents(new_grid().merge(grid)) == contents(grid)


def test_trajectories_are_joined_by_merging() -> None:
    one, two = new_grid(), new_grid()
    one.trajectory, two.trajectory = np.ones((2, 3)), np.zeros((1, 3))
    npt.assert_array_equal(one.merge(two).trajectory, [[1, 1, 1], [1, 1, 1], [0, 0, 0]])


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (ConfidenceGrid(resolution=0.5), "one resolution: expected 1.0, got 0.5"),
        (ConfidenceGrid(resolution=1.0, frame="odom"), "one frame: expected map, got odom"),
        (
            ConfidenceGrid(resolution=1.0, origin=(0.0, 0.5)),
            r"one origin: expected \[0. 0.\], got \[0.  0.5\]",
        ),
        (ConfidenceGrid(resolution=1.0, origin=(0, 0, 0)), "one origin"),
        (ConfidenceGrid(resolution=1.0, rule=Capped(50)), "one rule"),
        (ConfidenceGrid(resolution=1.0, heights=(0.2, 0.6)), "one heights"),
    ],
)
def test_maps_that_do_not_add_up_are_refused(other: ConfidenceGrid, message: str) -> None:
    with pytest.raises(MergeError, match=message):
        ConfidenceGrid(resolution=1.0).merge(other)


@pytest.mark.parametrize("name", [name for name, rule in RULES.items() if not rule.mergeable])
def test_maps_of_rules_without_an_associative_merge_do_not_merge(name: str) -> None:
    grid = ConfidenceGrid(rule=RULES[name]())
    with pytest.raises(MergeError, match=f"'{name}' depends on the order of the views"):
        grid.merge(grid)


def test_capped_maps_do_not_merge() -> None:
    with pytest.raises(MergeError, match="'capped' depends on the order of the views"):
        ConfidenceGrid(rule=Capped(50)).merge(ConfidenceGrid(rule=Capped(50)))
    with pytest.raises(MergeError, match="one rule"):
        ConfidenceGrid(rule=Capped(50)).merge(ConfidenceGrid(rule=Capped(40)))


def test_memory_follows_what_was_seen_not_the_box_around_it() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    for cell in ((0, 0), (-100_000, 100_000)):  # 10 km apart in x and y
        grid.fuse(np.array(cell), np.full((1, 1), -1.0, np.float32))
    assert [index for index, _ in grid.tiles()] == [(-1563, 1562), (0, 0)]
    assert grid.nbytes == 2 * 64 * 64 * 8
    assert grid.count_at([(10_000.05, -9_999.95), (0.05, 0.05)]).tolist() == [1, 1]  # type: ignore[union-attr]


def test_evidence_that_says_nothing_touches_no_tile() -> None:
    grid = new_grid()
    grid.fuse(np.array([-500, -500]), np.zeros((1000, 1000), dtype=np.float32))
    assert grid.nbytes == 0
    grid.window((-50, -50, 50, 50))
    grid.confidence_at((1.0, 1.0))
    assert grid.nbytes == 0


def test_heights_take_memory_only_where_they_are_known() -> None:
    grid = ConfidenceGrid(resolution=0.1)
    cell, z = np.zeros(2, dtype=np.int64), np.full((1, 1), -1.0, np.float32)
    for height, layers in ((None, 0), (0.7, 0), (0.3, 1), (0.1, 2), (0.01, 3)):
        grid.fuse(cell, z, None if height is None else np.full((1, 1), height, np.float32))
        assert grid.nbytes == (1 + layers) * 64 * 64 * 8


def one_cell(*evidence: tuple[float, float], rule: Average | None = None) -> float:
    """Return the confidence of a cell that (z, height) was said of."""
    grid = ConfidenceGrid(resolution=1.0, rule=rule)
    for z, height in evidence:
        grid.fuse(
            np.array([0, 0]), np.full((1, 1), z, np.float32), np.full((1, 1), height, np.float32)
        )
    return float(grid.confidence_at((0.5, 0.5)))


@given(
    st.floats(-2.0, 2.0, width=32),
    st.lists(st.floats(0.0, 3.0, width=32), max_size=300),
    st.sampled_from([Average(), Capped(5), Exponential(0.3), LogOdds(), Absolute()]),
)
def test_what_was_seen_is_never_outvoted_by_sight_above_its_top(
    top: float, sights: list[float], rule: Average
) -> None:
    # A step of 0.15 m or less is no obstacle; sight above the last height refutes nothing.
    over = [(-1.0, max(sight, top, 0.15)) for sight in sights]
    assert one_cell((1.0, top), (1.0, top), *over, rule=rule) > 0.0


@pytest.mark.parametrize("rule", [Average(), Capped(5), Exponential(0.3), LogOdds(), Absolute()])
@pytest.mark.parametrize("top", [-1.0, 0.2, 0.5, 1.0, 2.0])
def test_what_was_taken_away_is_free_again_once_it_is_seen_low(top: float, rule: Average) -> None:
    there, over, low = [(1.0, top)] * 5, [(-0.1, 2.0)] * 50, [(-1.0, 0.0)] * 10
    assert one_cell(*there, *over, rule=rule) > 0.0
    assert one_cell(*there, *over, *low, rule=rule) < 0.0


def test_what_one_view_alone_saw_is_outvoted_by_sight_of_any_height() -> None:
    assert one_cell((1.0, 0.3), *[(-1.0, 1.5)] * 2) < 0.0


def test_ground_is_missing_until_it_is_touched() -> None:
    hole = [(1.0, -1.0)] * 5
    assert one_cell(*hole, *[(-1.0, 0.1)] * 50) > 0.0
    assert one_cell(*hole, *[(-1.0, 0.02)] * 10) < 0.0


def test_heights_of_another_shape_are_refused() -> None:
    z = np.ones((2, 2), np.float32)
    for height in (np.zeros((2, 3), np.float32), np.full((2, 2), np.nan, np.float32)):
        with pytest.raises(InputError, match=r"^height: expected heights of shape \(2, 2\)"):
            new_grid().fuse(np.array([0, 0]), z, height)


@pytest.mark.parametrize("heights", [(0.0, 1.0), (0.6, 0.15), (0.1, np.nan)])
def test_heights_that_do_not_ascend_are_refused(heights: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match=r"^heights: expected ascending numbers above 0"):
        ConfidenceGrid(heights=heights)


confidences = st.floats(-1.0, 1.0, width=32)


@given(confidences, st.integers(0, 5), st.sampled_from([0.01, 0.2]))
@example(0.0, 2, 0.01)
@example(float(np.float32(0.01)), 1, 0.01)
@example(-float(np.float32(0.01)), 1, 0.01)
def test_a_cell_has_one_of_four_states(value: float, count: int, epsilon: float) -> None:
    window = GridWindow(
        confidence=np.array([[value]], dtype=np.float32),
        count=np.array([[count]], dtype=np.uint32),
        origin=np.zeros(2),
        resolution=1.0,
    )
    if count == 0:
        expected = CellState.UNKNOWN
    elif value <= -np.float32(epsilon):
        expected = CellState.FREE
    elif value >= np.float32(epsilon):
        expected = CellState.NONFREE
    else:
        expected = CellState.CONTESTED
    assert window.states(epsilon=epsilon)[0, 0] == expected


def test_views_that_cancel_are_contested_not_unknown() -> None:
    grid = ConfidenceGrid(resolution=1.0)
    for z in (-1.0, 1.0):
        grid.fuse(np.array([0, 0]), np.full((1, 1), z, np.float32))
    assert grid.confidence_at((0.5, 0.5)) == 0.0
    assert grid.count_at((0.5, 0.5)) == 2
    states = grid.window((0, 0, 2, 1)).states()
    npt.assert_array_equal(states, [[CellState.CONTESTED, CellState.UNKNOWN]])


def test_areas_of_the_states_add_up_to_the_observed_tiles() -> None:
    grid = ConfidenceGrid(resolution=0.5)
    grid.fuse(np.array([0, 0]), np.array([[-1, -1, -1, 0.5, 0.001]], dtype=np.float32))
    hole = np.ones((1, 1), np.float32), np.full((1, 1), -0.5, np.float32)
    for corner in ((0, 0), (0, 0), (9, 9)):
        grid.fuse(np.array(corner), *hole)
    areas = {state: grid.area(state) for state in CellState}
    cell = 0.25
    assert areas[CellState.FREE] == 2 * cell
    assert areas[CellState.NONFREE] == 3 * cell
    assert areas[CellState.CONTESTED] == cell
    assert sum(areas.values()) == 64 * 64 * cell


cells_2d = st.tuples(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))
windows = st.builds(
    GridWindow,
    confidence=st.just(np.zeros((4, 6), np.float32)),
    count=st.just(np.zeros((4, 6), np.uint32)),
    origin=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)).map(np.array),
    resolution=st.floats(0.01, 10.0),
)


@given(windows, st.lists(cells_2d, min_size=1, max_size=5))
def test_the_centre_of_a_cell_is_in_it(window: GridWindow, cells: list[tuple[int, int]]) -> None:
    npt.assert_array_equal(window.world_to_cell(window.cell_to_world(cells)), cells)


@given(cells_2d)
def test_borders_belong_to_the_cell_they_open(cell: tuple[int, int]) -> None:
    window = ConfidenceGrid(resolution=RESOLUTION, origin=ORIGINS[2]).window((0, 0, 1, 1))
    row, col = cell
    corner = window.origin + np.array([col, row]) * RESOLUTION
    before = np.nextafter(corner, -np.inf)
    npt.assert_array_equal(window.world_to_cell(corner), [[row, col]])
    npt.assert_array_equal(window.world_to_cell((before[0], corner[1])), [[row, col - 1]])
    npt.assert_array_equal(window.world_to_cell((corner[0], before[1])), [[row - 1, col]])


def test_rows_grow_with_y_and_columns_with_x() -> None:
    window = ConfidenceGrid(resolution=0.5, origin=(10, 20)).window((9, 19, 12, 21))
    npt.assert_array_equal(window.world_to_cell([(9.1, 20.6), (11.9, 19.1)]), [[3, 0], [0, 5]])
    npt.assert_array_equal(window.cell_to_world([3, 0]), [[9.25, 20.75]])
    inside = window.contains(np.array([[0, 0], [3, 5], [4, 0], [0, 6], [-1, 0]]))
    assert inside.tolist() == [True, True, False, False, False]


def test_rows_layers_and_columns_of_a_3d_window() -> None:
    grid = ConfidenceGrid(resolution=1.0, origin=(0, 0, 0))
    grid.fuse(np.array([7, -1, 3]), np.full((1, 1, 1), 0.5, np.float32))  # layer, row, col
    assert grid.confidence_at((3.5, -0.5, 7.5)) == 0.5
    window = grid.window((3, -1, 6, 4, 0, 8))
    assert window.confidence.shape == (2, 1, 1)
    npt.assert_array_equal(window.world_to_cell((3.5, -0.5, 7.5)), [[1, 0, 0]])
    npt.assert_array_equal(window.cell_to_world([1, 0, 0]), [[3.5, -0.5, 7.5]])


@given(blocks(2), st.floats(0.01, 2.0), st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_positions_look_up_what_the_window_shows(block: Fuse, resolution: float, seed: int) -> None:
    grid = ConfidenceGrid(resolution=resolution, origin=(0.3, -0.7))
    grid.fuse(*block)
    rng = np.random.default_rng(seed)
    cells = block.lower + rng.integers(-2, np.array(block.z.shape) + 2, (20, 2))
    inside = rng.uniform(0.01, 0.99, (20, 2))
    xy = grid.origin + (cells[:, ::-1] + inside) * resolution
    window = grid.window((*(xy.min(axis=0) - 1), *(xy.max(axis=0) + 1)))
    rows, cols = window.world_to_cell(xy).T
    confidence, count = grid.confidence_at(xy), grid.count_at(xy)
    npt.assert_array_equal(confidence, window.confidence[rows, cols])
    npt.assert_array_equal(count, window.count[rows, cols])
    for place, value, times in zip(xy, confidence, count, strict=True):  # type: ignore[arg-type]
        assert (grid.confidence_at(place), grid.count_at(place)) == (value, times)


def test_one_position_gives_numbers_several_give_arrays() -> None:
    grid = ConfidenceGrid()
    assert isinstance(grid.confidence_at((0, 0)), float)
    assert isinstance(grid.count_at((0, 0)), int)
    assert np.shape(grid.confidence_at([(0, 0)])) == (1,)
    assert np.shape(grid.count_at(np.empty((0, 2)))) == (0,)


LOOKUPS = [
    ConfidenceGrid().confidence_at,
    ConfidenceGrid().count_at,
    ConfidenceGrid().window((0, 0, 1, 1)).world_to_cell,
]


@pytest.mark.parametrize("look_up", LOOKUPS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_positions_that_are_not_finite_are_refused(
    look_up: Callable[[object], object], bad: float
) -> None:
    with pytest.raises(InputError, match=r"^xy: expected finite numbers, got .* at index \(0, 1\)"):
        look_up((0.0, bad))
    with pytest.raises(InputError, match=r"at index \(2, 0\)"):
        look_up([(0, 0), (1, 1), (bad, 0)])


@pytest.mark.parametrize("look_up", LOOKUPS)
@pytest.mark.parametrize("xy", [(1.0, 2.0, 3.0), 1.0, [[1.0]], np.zeros((2, 2, 2))])
def test_positions_of_another_shape_are_refused(
    look_up: Callable[[object], object], xy: object
) -> None:
    with pytest.raises(InputError, match=r"^xy: expected shape \(n, 2\)"):
        look_up(xy)


def test_far_away_is_unknown() -> None:
    assert ConfidenceGrid().count_at((1e15, -1e15)) == 0
    assert ConfidenceGrid().confidence_at((1e300, 0.0)) == 0.0


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ((0, 0, np.nan, 1), "^bounds: expected finite numbers"),
        ((0, 0, np.inf, 1), "^bounds: expected finite numbers"),
        ((1, 0, 0, 1), "an upper corner above the lower one"),
        ((0, 0, 1, 0), "an upper corner above the lower one"),
        ((0, 0, 1), r"^bounds: expected shape \(4,\)"),
        ((0, 0, 0, 1, 1, 1), r"^bounds: expected shape \(4,\)"),
    ],
)
def test_bounds_that_are_no_box_are_refused(bounds: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        ConfidenceGrid().window(bounds)


@pytest.mark.parametrize("resolution", [0.0, -1.0, np.nan, np.inf])
def test_a_resolution_that_is_no_length_is_refused(resolution: float) -> None:
    with pytest.raises(InputError, match=r"^resolution: expected a number above 0 \[m\]"):
        ConfidenceGrid(resolution=resolution)


@pytest.mark.parametrize(
    ("origin", "message"),
    [((0.0,), "2 or 3 numbers"), ((0.0,) * 4, "2 or 3 numbers"), ((0.0, np.nan), "finite")],
)
def test_an_origin_that_is_no_place_is_refused(origin: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=f"^origin: expected {message}"):
        ConfidenceGrid(origin=origin)


# Files


def a_map(ndim: int = 2) -> ConfidenceGrid:
    """Return a small map with all that a file has to hold."""
    grid = ConfidenceGrid(
        resolution=0.1524, origin=[0.0, 1 / 3, 2 / 3][:ndim], frame="straße 5", rule=Capped(7)
    )
    rng = np.random.default_rng(5)
    for _ in range(9):
        shape = (12,) * ndim
        z, height = rng.uniform(-1, 1, shape), rng.uniform(-0.5, 1, shape)
        lower = rng.integers(-30, 30, ndim)
        grid.fuse(lower, z.astype(np.float32), height.astype(np.float32))
    grid.trajectory = rng.uniform(-9, 9, (4, 3))
    return grid


@pytest.mark.parametrize("ndim", [2, 3])
def test_a_map_comes_back_from_its_file_bit_for_bit(ndim: int, tmp_path: Path) -> None:
    grid = a_map(ndim)
    grid.save(tmp_path / "map.grid")
    back = ConfidenceGrid.load(tmp_path / "map.grid")
    assert contents(back) == contents(grid)
    assert back.trajectory.tobytes() == grid.trajectory.tobytes()
    assert back.origin.tobytes() == grid.origin.tobytes()
    assert (back.resolution, back.frame, back.rule) == (grid.resolution, grid.frame, grid.rule)
    assert [path.name for path in tmp_path.iterdir()] == ["map.grid"]


@pytest.mark.parametrize("ndim", [2, 3])
def test_an_empty_map_comes_back_empty(ndim: int, tmp_path: Path) -> None:
    grid = ConfidenceGrid(origin=(0.0,) * ndim)
    grid.save(tmp_path / "map")
    back = ConfidenceGrid.load(tmp_path / "map")
    assert (back.ndim, back.nbytes, back.rule) == (ndim, 0, Average())


def test_a_loaded_map_goes_on_where_it_was_saved(tmp_path: Path) -> None:
    grid = a_map()
    grid.save(tmp_path / "map")
    back = ConfidenceGrid.load(tmp_path / "map")
    for one in (grid, back):
        one.fuse(np.array([-20, -20]), np.full((40, 40), 0.25, np.float32))
    assert contents(back) == contents(grid)


def test_a_map_that_cannot_be_saved_leaves_the_older_file(tmp_path: Path) -> None:
    path = tmp_path / "map"
    a_map().save(path)
    older = path.read_bytes()
    broken = ConfidenceGrid()
    broken.trajectory = np.array([[{}, None, 0]])
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        broken.save(path)
    assert path.read_bytes() == older
    assert list(tmp_path.iterdir()) == [path]


def test_saving_into_a_missing_folder_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        a_map().save(tmp_path / "nowhere" / "map")


Arrays: TypeAlias = dict[str, np.ndarray[Any, np.dtype[Any]]]


def header_with(**values: object) -> Callable[[Arrays], object]:
    def change(arrays: Arrays) -> None:
        header = json.loads(str(arrays["header"]))
        arrays["header"] = np.array(json.dumps({**header, **values}))

    return change


def without(name: str) -> Callable[[Arrays], object]:
    return lambda arrays: arrays.pop(name)


def with_array(name: str, change: Callable[[Any], Any]) -> Callable[[Arrays], object]:
    return lambda arrays: arrays.update({name: change(arrays[name])})


TAMPERED: dict[str, Callable[[Arrays], object]] = {
    **{f"without {name}": without(name) for name in ("tiles", "confidence", "count")},
    **{f"without {name}_1": without(f"{name}_1") for name in ("tiles", "confidence", "count")},
    "heights that descend": header_with(heights=[0.6, 0.15]),
    "no heights": header_with(heights=None),
    "more heights than layers": header_with(heights=[0.1, 0.2, 0.3, 0.4]),
    "without trajectory": without("trajectory"),
    "of another format": header_with(format="zip"),
    "of a newer version": header_with(version=3),
    "version in words": header_with(version="one"),
    "no resolution": header_with(resolution=None),
    "resolution 0": header_with(resolution=0),
    "resolution NaN": header_with(resolution=float("nan")),
    "origin with NaN": header_with(origin=[0.0, float("nan")]),
    "origin of another dimension": header_with(origin=[0.0, 0.0, 0.0]),
    "a frame that is no name": header_with(frame=5),
    "unknown rule": header_with(rule={"name": "mean"}),
    "rule without its name": header_with(rule={}),
    "rule with more to it": header_with(rule={"name": "average", "cap": 3}),
    "cap in words": header_with(rule={"name": "capped", "cap": "many"}),
    "cap of 2.5": header_with(rule={"name": "capped", "cap": 2.5}),
    "tiles of another dimension": with_array("tiles", lambda t: np.hstack([t, t[:, :1]])),
    "tiles between tiles": with_array("tiles", lambda t: t + 0.5),
    "a tile twice": with_array("tiles", lambda t: np.repeat(t[:1], len(t), axis=0)),
    "fewer tiles than contents": with_array("tiles", lambda t: t[:-1]),
    "more tiles than contents": with_array("tiles", lambda t: np.vstack([t, t[-1:] + 1])),
    "tiles of one cell": with_array("confidence", lambda c: c[:, :1, :1]),
    "confidence in float64": with_array("confidence", lambda c: c.astype(np.float64)),
    "confidence NaN": with_array("confidence", lambda c: c * np.float32(np.nan)),
    "confidence beyond 1": with_array("confidence", lambda c: c + np.float32(3.0)),
    "count with a sign": with_array("count", lambda c: c.astype(np.int32)),
    "trajectory of pairs": with_array("trajectory", lambda t: t[:, :2]),
    "trajectory NaN": with_array("trajectory", lambda t: t * np.nan),
    "trajectory in words": with_array("trajectory", lambda t: np.full(t.shape, "here")),
}


@pytest.mark.parametrize("how", TAMPERED)
def test_a_tampered_file_is_refused(how: str, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    a_map().save(path)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    TAMPERED[how](arrays)
    np.savez(path, **arrays)
    with pytest.raises(FileFormatError, match=r"map\.npz: expected .*, got "):
        ConfidenceGrid.load(path)


def test_a_file_written_by_numpy_itself_loads_if_nothing_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    a_map().save(path)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    np.savez(path, **arrays)
    assert contents(ConfidenceGrid.load(path)) == contents(a_map())


def map_bytes() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        a_map().save(Path(folder) / "map")
        return (Path(folder) / "map").read_bytes()


GOOD = map_bytes()


@given(st.integers(0, len(GOOD) - 1))
def test_a_truncated_file_is_refused(length: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        path.write_bytes(GOOD[:length])
        with pytest.raises(FileFormatError, match="a groundmap-grid file, got something else"):
            ConfidenceGrid.load(path)


@given(st.integers(0, len(GOOD) - 1), st.integers(0, 7))
@settings(max_examples=200)
def test_a_file_with_a_wrong_bit_is_refused_or_loads_the_same(place: int, bit: int) -> None:
    damaged = bytearray(GOOD)
    damaged[place] ^= 1 << bit
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map"
        path.write_bytes(damaged)
        try:
            back = ConfidenceGrid.load(path)
        except FileFormatError:
            return
    assert contents(back) == contents(a_map())
    assert (back.resolution, back.frame, back.rule) == (0.1524, "straße 5", Capped(7))


def test_a_tile_exists_once_a_cell_in_it_has_evidence() -> None:
    grid = ConfidenceGrid(resolution=1.0)
    grid.fuse(np.array([-1, 70]), np.full((1, 1), -1.0, dtype=np.float32))
    assert grid.has_tile((-1, 1))
    assert not grid.has_tile((0, 1))


@pytest.mark.parametrize("lower", [[], np.empty((0, 2), dtype=int), [[0, 0], [1, 1]]])
def test_a_block_has_one_lower_cell(lower: Any) -> None:
    grid = ConfidenceGrid(resolution=0.5)
    with pytest.raises(InputError, match=r"^lower: expected 2 whole numbers, got \d cells"):
        grid.fuse(lower, np.full((2, 2), -1.0, dtype=np.float32))


def test_heights_of_uneven_rows_are_refused() -> None:
    z = np.full((2, 2), -0.5, dtype=np.float32)
    uneven: Any = [[0.1, 0.2], [0.3]]
    with pytest.raises(InputError, match=r"height: expected heights of shape \(2, 2\) \[m\]"):
        ConfidenceGrid().fuse(np.array([0, 0]), z, uneven)
