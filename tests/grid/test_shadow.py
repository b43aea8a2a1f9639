"""The region that new surfaces cut off from freespace, and the rule that reads it."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats, Floats32
from groundmap.errors import InputError
from groundmap.grid.fusion import Absolute, Average
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.shadow import behind_new_surfaces
from groundmap.grid.window import CellState

LOWER = np.array([0, 0])


def cells_on_the_way(cell: tuple[int, ...], eye: Floats) -> list[tuple[int, ...]]:
    """Return the cells between a cell's centre and a point, by sorting all crossings of faces."""
    centre = np.array(cell) + 0.5
    way = eye - centre
    planes = np.arange(-3.0, 15.0)[:, None]
    crossings = ((planes - centre) / way).ravel()
    shares = np.sort(np.concatenate([crossings[(crossings > 0) & (crossings < 1)], [0.0, 1.0]]))
    middles = 0.5 * (shares[:-1] + shares[1:])[:, None]
    return [tuple(one) for one in np.floor(centre + middles * way).astype(int).tolist()][1:]


def hidden_by_crossings(free: Bools, z: Floats32, eye: Floats) -> Bools:
    hidden = np.zeros(free.shape, dtype=np.bool_)
    for cell in zip(*np.nonzero(free & (z == 0)), strict=True):
        for one in cells_on_the_way(tuple(map(int, cell)), eye):
            inside = all(0 <= i < n for i, n in zip(one, free.shape, strict=True))
            if not inside or not free[one] or z[one] < 0:
                break
            if z[one] > 0:
                hidden[cell] = True
                break
    return hidden


@given(st.integers(2, 3), st.integers(0, 2**32 - 1))
def test_hidden_cells_are_those_whose_sorted_crossings_meet_a_new_surface_first(
    ndim: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    shape = (7, 9) if ndim == 2 else (3, 5, 4)
    free = rng.random(shape) < 0.85
    z = rng.choice([0.0, -1.0, 1.0], shape, p=[0.8, 0.1, 0.1]).astype(np.float32)
    eye = rng.uniform(-1.0, np.array(shape) + 1.0) + 1e-4  # off the corners of cells
    npt.assert_array_equal(behind_new_surfaces(free, z, eye), hidden_by_crossings(free, z, eye))


def view_of_wall(column: int) -> Floats32:
    """Free cells up to a wall across all rows."""
    z = np.zeros((5, 12), dtype=np.float32)
    z[:, :column], z[:, column] = -1.0, 1.0
    return z


@pytest.mark.parametrize(("rule", "behind"), [(Absolute(), CellState.NONFREE), (Average(), 1)])
def test_only_absolute_makes_the_region_behind_a_new_wall_nonfree(
    rule: Average, behind: int
) -> None:
    grid = ConfidenceGrid(resolution=1.0, rule=rule)
    grid.fuse(LOWER, view_of_wall(9))
    z = view_of_wall(4)
    free = np.asarray(grid.window((0, 0, 12, 5)).states() == CellState.FREE)
    grid.fuse(LOWER, z, None, behind_new_surfaces(free, z, (2.5, 0.5)))
    states = grid.window((0, 0, 12, 5)).states()
    assert (states[:, 5:9] == behind).all()
    assert (states[:, 10:] == CellState.UNKNOWN).all()


def test_an_old_wall_casts_no_shadow_on_the_free_room_behind_it() -> None:
    free = np.ones((5, 12), dtype=np.bool_)
    free[:, 4] = False  # the wall, mapped before
    assert not behind_new_surfaces(free, view_of_wall(4), (2.5, 0.5)).any()


@pytest.mark.parametrize("shadow", [np.zeros((2, 2), np.bool_), np.zeros((5, 12))])
def test_a_shadow_of_another_shape_or_type_is_refused(shadow: Bools) -> None:
    grid = ConfidenceGrid(resolution=1.0, rule=Absolute())
    with pytest.raises(InputError, match=r"^shadow: expected bool of shape \(5, 12\), got"):
        grid.fuse(LOWER, view_of_wall(4), None, shadow)
