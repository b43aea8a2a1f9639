"""The evidence of one view: one z per cell, as a dense block."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats32, Ints


class Evidence(NamedTuple):
    """The evidence of one view in a block of cells.

    A block, unlike a list, has exactly one z per cell. It spans the range of the view, and is
    discarded after fusion.
    """

    lower: (
        Ints  #: shape (d,), cell of the first entry: ``[row, col]``, in 3-D ``[layer, row, col]``
    )
    z: Floats32  #: shape (rows, cols), in 3-D (layers, rows, cols), in [-1, 1]; 0 for no evidence
    #: shape of `z` [m], see `groundmap.ConfidenceGrid.fuse`; None without heights
    height: Floats32 | None = None

    def cells(self) -> Ints:
        """Return the cells ``[row, col]`` with evidence, shape (n, d)."""
        return np.argwhere(self.z != 0) + self.lower


class Counts(NamedTuple):
    """Number of features of one view by their use."""

    used: int  #: features that became evidence
    dropped: Counter[str]  #: other features, by reason
    seen_through: int = 0  #: features behind a surface, with a line of sight below its top
    through_viewpoint: int = 0  #: links and segments nearer than min_range
