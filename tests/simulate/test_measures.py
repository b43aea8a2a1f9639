"""Measures: the truth scores best, an empty map scores nothing, planted errors are found."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import GridWindow
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive, to_transforms
from groundmap.simulate.measures import measure
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.truth import Truth, truth_of
from groundmap.simulate.world import Solid, World
from strategies import rngs

BOUNDS = (0.0, 0.0, 10.0, 8.0)
RESOLUTION = 0.2
SHAPE = (40, 50)
SENSOR = SensorSettings(max_range=12.0)

# A wall across, whose faces lie within cells: its cells are columns 20 to 22.
WALL = World(bounds=BOUNDS, solids=(Solid(shapely.box(4.07, 0, 4.53, 8), top=1.0),))
EMPTY = World(bounds=BOUNDS)


def truth(world: World, *poses: tuple[float, float, float]) -> Truth:
    transforms = to_transforms(poses or [(0.5, 4.0, 0.0)])
    moves = Drive(transforms, transforms, np.arange(len(transforms), dtype=np.float64))
    window = ConfidenceGrid(resolution=RESOLUTION).window(BOUNDS)
    return truth_of(world, moves, SENSOR, window, MapperSettings())


def mapped(free: Bools, nonfree: Bools) -> GridWindow:
    """Return a map of one view with these cells; non-free overrides free."""
    grid = ConfidenceGrid(resolution=RESOLUTION)
    z = np.where(nonfree, 1.0, np.where(free, -1.0, 0.0)).astype(np.float32)
    grid.fuse(np.array([0, 0]), z)
    return grid.window(BOUNDS)


def true_map(known: Truth) -> GridWindow:
    return mapped(known.visible & ~known.nonfree, known.nonfree)


def random_truth(rng: np.random.Generator) -> Truth:
    solids = []
    for _ in range(rng.integers(1, 5)):
        x, y = rng.uniform((2.0, 0.0), (8.0, 6.0))
        outline = shapely.box(x, y, x + rng.uniform(0.3, 2.0), y + rng.uniform(0.3, 2.0))
        solids.append(Solid(outline, top=1.0))
    world = World(bounds=BOUNDS, solids=tuple(solids))
    return truth(world, (0.5, 4.0, 0.0), (1.0, 3.0, 0.3), (1.0, 5.0, -0.3))


@settings(max_examples=25)
@given(rngs())
def test_the_truth_as_a_map_has_perfect_measures(rng: np.random.Generator) -> None:
    known = random_truth(rng)
    found = measure(true_map(known), known)
    assert found.free_recall == found.free_precision == 1.0
    assert found.nonfree_recall == found.nonfree_precision == 1.0
    assert found.false_free == found.false_free_beyond_cell == found.false_free_beyond == 0.0
    assert found.false_free_depth == 0.0
    assert found.unknown == 0.0
    assert found.boundary_mean is not None
    assert found.boundary_p95 is not None
    assert found.boundary_mean <= found.boundary_p95 <= RESOLUTION / np.sqrt(2.0) + 1e-6
    assert found.visible_m2 == pytest.approx((known.visible & ~known.nonfree).sum() * 0.04)


def test_a_wall_that_ends_at_cell_borders_is_measured_like_any_other() -> None:
    aligned = World(bounds=BOUNDS, solids=(Solid(shapely.box(4, 0, 4.4, 8), top=1.0),))
    known = truth(aligned)
    found = measure(true_map(known), known)
    assert found.nonfree_precision == 1.0
    assert found.boundary_mean == pytest.approx(RESOLUTION / 2.0)
    erased = measure(mapped(np.ones(SHAPE, dtype=np.bool_), known.nonfree & False), known)
    assert erased.free_precision is not None
    assert erased.free_precision < 1.0


@given(rngs(), st.booleans())
def test_an_empty_map_has_no_recall(rng: np.random.Generator, wiped: bool) -> None:
    known = random_truth(rng)
    nothing = np.zeros(SHAPE, dtype=np.bool_)
    window = mapped(nothing, nothing)
    if wiped:  # contested counts as unknown
        window.count[...] = 2
    found = measure(window, known)
    assert found.free_recall == 0.0
    assert found.nonfree_recall == (0.0 if len(known.surfaces) else None)
    assert found.free_precision is found.nonfree_precision is found.false_free is None
    assert found.boundary_mean is found.boundary_p95 is None
    assert found.unknown == 1.0


@pytest.mark.parametrize("past", [1, 3, 8])
def test_a_free_cell_behind_a_wall_is_found_with_its_share_and_depth(past: int) -> None:
    known = truth(WALL)
    free = known.visible & ~known.nonfree
    planted = np.zeros(SHAPE, dtype=np.bool_)
    planted[20, 19 + past] = True  # columns up to 19 are free and in line
    found = measure(mapped(free | planted, known.nonfree & ~planted), known)
    depth = (past - 0.5) * RESOLUTION  # from its centre to the border of column 19
    share = 1.0 / (free.sum() + 1)
    assert found.false_free == pytest.approx(share)
    assert found.false_free_depth == pytest.approx(depth)
    assert found.false_free_beyond_cell == pytest.approx(share if depth > RESOLUTION else 0.0)
    assert found.false_free_beyond == pytest.approx(share if depth > 0.3 else 0.0)
    assert found.free_recall == found.nonfree_recall == 1.0


def test_a_block_of_free_cells_behind_a_wall_counts_cell_by_cell() -> None:
    known = truth(WALL)
    free = known.visible & ~known.nonfree
    planted = np.zeros(SHAPE, dtype=np.bool_)
    planted[10:14, 30:35] = True
    found = measure(mapped(free | planted, known.nonfree), known)
    assert found.false_free == pytest.approx(20.0 / (free.sum() + 20))
    assert found.false_free == found.false_free_beyond == found.false_free_beyond_cell
    assert found.false_free_depth == pytest.approx((34.5 - 20.0) * RESOLUTION)
    assert found.free_precision == 1.0  # the area behind the wall is not observable


@pytest.mark.parametrize("cols", [-2, 2])
def test_a_wall_two_cells_off_shows_at_the_boundary(cols: int) -> None:
    # The face at x = 4.07 is 0.03 m before the middle of column 20.
    known = truth(World(bounds=BOUNDS, solids=(Solid(shapely.box(4.07, -1, 8, 9), top=1.0),)))
    assert measure(true_map(known), known).boundary_mean == pytest.approx(0.03)
    ground, wall = known.in_line | known.nonfree, np.arange(50) >= 20 + cols
    found = measure(mapped(~wall & ground, wall & ground), known)
    assert found.boundary_mean == pytest.approx(abs(0.2 * cols + 0.03))


def test_free_in_a_wall_is_less_precise_and_false() -> None:
    known = truth(WALL)
    free = known.visible & ~known.nonfree
    found = measure(mapped(free | known.nonfree, np.zeros(SHAPE, dtype=np.bool_)), known)
    assert found.nonfree_recall == 0.0
    assert found.free_precision is not None
    assert found.free_precision < 1.0
    assert found.false_free == pytest.approx(3 * 40 / (free.sum() + 3 * 40))
    assert found.false_free_depth == pytest.approx(2.5 * RESOLUTION)


def test_free_where_an_obstacle_reaches_into_a_cell_in_line_is_false() -> None:
    # Column 20 is from 4.0 to 4.2 m: its middle is in line, and its end in the wall.
    known = truth(World(bounds=BOUNDS, solids=(Solid(shapely.box(4.15, 0, 4.53, 8), top=1.0),)))
    planted = known.nonfree & known.in_line
    assert np.unique(np.argwhere(planted)[:, 1]).tolist() == [20]
    free = (known.visible & ~known.nonfree) | planted
    found = measure(mapped(free, known.nonfree & ~planted), known)
    assert found.false_free == pytest.approx(planted.sum() / free.sum())
    assert found.false_free_depth == pytest.approx(RESOLUTION / 2.0)
    assert found.false_free_beyond_cell == 0.0


def test_nonfree_on_open_ground_is_not_precise() -> None:
    known = truth(WALL)
    ghost = np.zeros(SHAPE, dtype=np.bool_)
    ghost[20, 8:12] = True
    found = measure(mapped(known.visible & ~known.nonfree, known.nonfree | ghost), known)
    held = np.unique(np.floor(known.surfaces[:, 1] / RESOLUTION)).size
    assert found.nonfree_precision == pytest.approx(held / (held + 4))
    open_ground = (known.visible & ~known.nonfree).sum()
    assert found.free_recall == pytest.approx(1.0 - 4 / open_ground)


def test_a_world_without_obstacles_has_nothing_to_recall() -> None:
    known = truth(EMPTY)
    found = measure(true_map(known), known)
    assert found.free_recall == found.free_precision == 1.0
    assert found.nonfree_recall is found.nonfree_precision is None
    assert found.boundary_mean is found.boundary_p95 is None
    assert found.false_free == found.false_free_depth == 0.0


def test_borders_beyond_ten_metres_of_every_view_are_not_measured() -> None:
    near = truth(WALL, (0.5, 4.0, 0.0))
    far = Truth(**{**vars(near), "viewpoints": np.array([(-30.0, 4.0)])})
    window = true_map(near)
    assert measure(window, near).boundary_mean is not None
    assert measure(window, far).boundary_mean is None


def test_a_free_map_of_a_world_without_free_cells_has_infinite_depth() -> None:
    known = truth(World(bounds=BOUNDS, solids=(Solid(shapely.box(-1, -1, 11, 9), top=1.0),)))
    assert known.nonfree.all()
    found = measure(mapped(np.ones(SHAPE, dtype=np.bool_), known.nonfree & False), known)
    assert found.false_free == found.false_free_beyond == found.false_free_beyond_cell == 1.0
