"""Cells of a lattice, given by their indices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundmap.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class CellSet:
    """Cells of a lattice, such as those that the newest views saw as non-free.

    Parameters
    ----------
    cells : ndarray of int, shape (n, d)
        ``[row, col]``, in 3-D ``[layer, row, col]``; each cell once.
    resolution : float [m]
        Side of a cell.
    origin : ndarray, shape (d,) [m, map]
        Outer corner of cell (0, 0), x first.

    Examples
    --------
    >>> some = CellSet(np.array([[1, 0], [1, 2]]), 0.5, np.zeros(2))
    >>> len(some), some.centres().tolist(), some.mask(np.array([1, 1]), (1, 3)).tolist()
    (2, [[0.25, 0.75], [1.25, 0.75]], [[False, True, False]])
    """

    cells: Ints
    resolution: float
    origin: Floats

    def __len__(self) -> int:
        return len(self.cells)

    def centres(self) -> Floats:
        """Return the centres of the cells, shape (n, d) [m, map]."""
        return self.origin + (self.cells[:, ::-1] + 0.5) * self.resolution

    def mask(self, lower: Ints, shape: tuple[int, ...]) -> Bools:
        """Return which cells of a box are in the set.

        Parameters
        ----------
        lower : ndarray, shape (d,)
            First cell of the box.
        shape : tuple of int
            Cells of the box along each axis.
        """
        mask = np.zeros(shape, dtype=np.bool_)
        cells = self.cells - lower
        inside = np.logical_and.reduce((cells >= 0) & (cells < shape), axis=1)
        mask[tuple(cells[inside].T)] = True
        return mask
