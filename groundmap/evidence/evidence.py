"""What one view says: one z per cell, as a dense block."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats32, Ints


class Evidence(NamedTuple):
    """A block of cells as one view sees them.

    A block and not a list, so that a cell has one z by construction; it is as large as what the
    view reaches and is gone once fused.
    """

    lower: Ints  #: shape (2,), cell ``[row, col]`` of the block's first entry
    z: Floats32  #: shape (rows, cols), in [-1, 1]; 0 says nothing
    #: shape (rows, cols) [m], see `groundmap.ConfidenceGrid.fuse`; None where heights play no part
    height: Floats32 | None = None

    def cells(self) -> Ints:
        """Return the cells ``[row, col]`` that are spoken of, shape (n, 2)."""
        return np.argwhere(self.z != 0) + self.lower
