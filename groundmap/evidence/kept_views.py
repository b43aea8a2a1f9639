"""Views that a mapper keeps, with their evidence, to correct their poses after the fact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Floats32, Ints
from groundmap.evidence.evidence import Evidence
from groundmap.view.view import View


class KeptView(NamedTuple):
    """A view as it is mapped, and its evidence without the empty cells of the block."""

    view: View
    lower: Ints  #: shape (d,), cell of the block's first entry
    shape: tuple[int, ...]  #: of the block
    places: Ints  #: shape (n,), places of the cells with evidence in the flat block
    z: Floats32  #: shape (n,)
    height: Floats32 | None  #: shape (n,) [m]
    planes: Floats  #: shape (k, 6), ground that the map keeps, see `ConfidenceGrid.planes`

    @classmethod
    def of(cls, view: View, evidence: Evidence, planes: Floats) -> KeptView:
        """Return a view with its evidence.

        Parameters
        ----------
        view : View
        evidence : Evidence
        planes : ndarray, shape (k, 6)
        """
        places = np.flatnonzero(evidence.z)
        height = None if evidence.height is None else evidence.height.reshape(-1)[places]
        z = evidence.z.reshape(-1)[places]
        return cls(view, evidence.lower, evidence.z.shape, places, z, height, planes)

    def evidence(self) -> Evidence:
        """Return the evidence as a block; cells without evidence have a height of 0."""
        return Evidence(
            self.lower,
            self._block(self.z),
            None if self.height is None else self._block(self.height),
        )

    def cells(self) -> Ints:
        """Return the cells with evidence, shape (n, d)."""
        return np.stack(np.unravel_index(self.places, self.shape), axis=1) + self.lower

    def _block(self, values: Floats32) -> Floats32:
        block = np.zeros(self.shape, dtype=np.float32)
        block.reshape(-1)[self.places] = values
        return block


def moved_views(
    kept: list[KeptView], poses: Floats, tolerance: float, turn_tolerance: float
) -> list[int]:
    """Return the views whose pose differs from a new one by more than a tolerance.

    Parameters
    ----------
    kept : list of KeptView
    poses : ndarray, shape (n, 4, 4) [m, map]
    tolerance : float [m]
    turn_tolerance : float [rad]
    """
    old = np.array([one.view.T_map_base for one in kept]).reshape(-1, 4, 4)
    shift = np.linalg.norm(poses[:, :3, 3] - old[:, :3, 3], axis=1)
    # The norm of the difference of two rotations is sqrt(8) sin(angle / 2), 0 if they are equal.
    apart = np.linalg.norm(poses[:, :3, :3] - old[:, :3, :3], axis=(1, 2))
    turned = 2.0 * np.arcsin(np.clip(apart / np.sqrt(8.0), 0.0, 1.0))
    stays = (shift <= tolerance) & (turned <= turn_tolerance)
    return np.flatnonzero(~stays).tolist()


def unique_cells(cells: Ints) -> Ints:
    """Return cells, shape (n, d), each once, in the order of their indices."""
    if not len(cells):
        return cells
    if cells.shape[1] != 2:
        return np.unique(cells, axis=0)
    lower = cells.min(axis=0)
    width = int(cells[:, 1].max() - lower[1]) + 1
    keys = np.unique((cells[:, 0] - lower[0]) * width + (cells[:, 1] - lower[1]))
    once: Ints = np.stack([keys // width, keys % width], axis=1) + lower
    return once
