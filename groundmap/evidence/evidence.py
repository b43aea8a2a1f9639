"""The evidence of one view: one z per cell, as a dense block."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats32, Ints


class Evidence(NamedTuple):
    """The evidence of one view in a block of cells.

    A block, unlike a list, has exactly one z per cell. It spans the range of the view, and is
    discarded after fusion.
    """

    lower: Ints  #: shape (2,), cell ``[row, col]`` of the block's first entry
    z: Floats32  #: shape (rows, cols), in [-1, 1]; 0 for no evidence
    #: shape (rows, cols) [m], see `groundmap.ConfidenceGrid.fuse`; None without heights
    height: Floats32 | None = None

    def cells(self) -> Ints:
        """Return the cells ``[row, col]`` with evidence, shape (n, 2)."""
        return np.argwhere(self.z != 0) + self.lower
