"""Polylines in cells: which cells they cross, how much of them lies in each."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from groundmap.arrays import Floats
from planners.geometry.polyline import cross_cells

COORDINATES = st.integers(-12, 12).map(lambda n: n / 4) | st.floats(-3, 3)
LINES = arrays(np.float64, st.tuples(st.integers(2, 8), st.integers(2, 3)), elements=COORDINATES)


@given(LINES)
def test_a_line_crosses_the_cells_of_its_pieces_in_order(line: Floats) -> None:
    pieces = [cross_cells(np.array(piece)) for piece in pairwise(line)]
    cells = np.concatenate([piece.cells for piece in pieces])
    lengths = np.concatenate([piece.lengths for piece in pieces])
    inside = lengths > 0 if lengths.any() else slice(1)
    whole = cross_cells(line)
    np.testing.assert_array_equal(whole.cells, cells[inside])
    np.testing.assert_array_equal(whole.lengths, lengths[inside])


@given(LINES)
def test_positions_along_the_line_are_in_the_crossed_cells(line: Floats) -> None:
    cells, lengths = cross_cells(line)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    corners = np.append(0.0, np.cumsum(steps))
    along = np.cumsum(lengths) - lengths / 2.0
    places = np.column_stack([np.interp(along, corners, axis) for axis in line.T])
    low = cells[:, ::-1]
    assert (places >= low - 1e-9).all()
    assert (places <= low + 1 + 1e-9).all()


def test_a_cell_comes_again_for_each_piece_in_it() -> None:
    cells, lengths = cross_cells(np.array([[0.25, 0.5], [0.75, 0.5], [1.5, 0.5], [0.5, 0.5]]))
    assert cells.tolist() == [[0, 0], [0, 0], [0, 1], [0, 1], [0, 0]]
    assert lengths.tolist() == [0.5, 0.25, 0.5, 0.5, 0.5]
