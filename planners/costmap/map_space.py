"""What routes are checked and measured on, in two dimensions or three."""

from __future__ import annotations

import math
from typing import Protocol

import numpy.typing as npt

from groundmap.arrays import Bools, Floats, Ints
from groundmap.grid.window import GridWindow
from planners.problem.problem import PlanningProblem


class MapSpace(Protocol):
    """A map as a problem sees it: a `Costmap`; in 3-D, `Voxels`."""

    @property
    def problem(self) -> PlanningProblem:
        """What was asked."""
        ...

    @property
    def window(self) -> GridWindow:
        """The map's cells."""
        ...

    @property
    def blocked(self) -> Bools:
        """Cells that the footprint may not touch."""
        ...

    @property
    def nonfree(self) -> Bools:
        """Those among them that are non-free."""
        ...

    @property
    def traversable(self) -> Bools:
        """Cells on whose centre the footprint's centre may be."""
        ...

    @property
    def cleared(self) -> Bools:
        """Unknown cells that count as free."""
        ...

    @property
    def radius(self) -> float:
        """Distance that the footprint's centre keeps from what is blocked [m]."""
        ...

    @property
    def slack(self) -> float:
        """Shortfall of that distance that is put down to rounding, from start to goal [m]."""
        ...

    def to_cells(self, points: npt.ArrayLike) -> Floats:
        """Return positions in cells."""
        ...

    def clearance_of(
        self, points: npt.ArrayLike, *, to: Bools | None = None, limit: float = math.inf
    ) -> float:
        """Return the exact distance of a point or a polyline to what is blocked [m]."""
        ...

    def clearance_at(self, cells: Ints) -> Floats:
        """Return the distance of cells' centres to what is blocked [m]."""
        ...
