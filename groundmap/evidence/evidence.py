"""The evidence of one view: one z per cell, as a dense block."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from groundmap.arrays import FARTHEST_CELL, Bools, Floats, Floats32, Ints
from groundmap.errors import InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.shadow import behind_new_surfaces
from groundmap.grid.window import CellState
from groundmap.printable import format_value

MARGIN = 1  # [cells] around the drawn shapes, for rounding


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
    #: shape (rows, cols), region between new surfaces and the older boundary of freespace; only
    #: for rules that read it
    shadow: Bools | None = None

    def cells(self) -> Ints:
        """Return the cells ``[row, col]`` that the evidence changes, shape (n, 2)."""
        changed = self.z != 0 if self.shadow is None else (self.z != 0) | self.shadow
        return np.argwhere(changed) + self.lower


class Counts(NamedTuple):
    """Number of features of one view by their use."""

    used: int  #: features that became evidence
    dropped: Counter[str]  #: other features, by reason
    seen_through: int = 0  #: features behind a surface, with a line of sight below its top
    through_viewpoint: int = 0  #: links and segments nearer than min_range


def block_around(places: Floats, resolution: float, *, most_cells: int) -> tuple[Floats, Ints]:
    """Return the first cell of the block around places, and its shape; x comes first in both.

    Parameters
    ----------
    places : ndarray, shape (n, d) [cells]
        The first is the viewpoint.
    resolution : float [m]
    most_cells : int
        Largest number of cells in the block.

    Raises
    ------
    InputError
        The places are too far from the origin, or the block has more cells.
    """
    if not (np.abs(places) < FARTHEST_CELL).all():
        raise InputError(
            "view",
            f"evidence within {FARTHEST_CELL * resolution:.3g} m of the origin",
            f"a viewpoint at {format_value((places[0] * resolution).tolist())} m",
            hint="Is a pose wrong?",
        )
    lower = np.floor(places.min(axis=0)) - MARGIN
    shape = (np.floor(places.max(axis=0)) - lower).astype(np.int64) + 1 + MARGIN
    if np.prod(shape.astype(np.float64)) > most_cells:
        raise InputError(
            "resolution",
            f"one that cuts a view into {most_cells} cells at most",
            f"{resolution} m, which makes {' x '.join(map(str, shape))}",
            hint="Give a coarser resolution, or a smaller max_range [m].",
        )
    return lower, shape


def add_shadow(evidence: Evidence, grid: ConfidenceGrid, viewpoint: Floats) -> Evidence:
    """Return the evidence with the region that its new surfaces hide (paper, section 4.2).

    Parameters
    ----------
    evidence : Evidence
        Not yet fused.
    grid : ConfidenceGrid
        Map of the earlier views.
    viewpoint : ndarray, shape (d,) [m, map]
    """
    lower, upper = evidence.lower[::-1], (evidence.lower + evidence.z.shape)[::-1]
    inside = np.concatenate([lower + 0.25, upper - 0.25])  # of the first cell and the last
    cells = grid.window(np.tile(grid.origin, 2) + inside * grid.resolution)
    free = cells.states() == CellState.FREE
    eye = (viewpoint - cells.origin) / grid.resolution
    return evidence._replace(shadow=behind_new_surfaces(free, evidence.z, eye[::-1]))
