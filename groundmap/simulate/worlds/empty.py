"""Bare ground."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.simulate.world import World
from groundmap.simulate.worlds.base import Box, WorldGenerator, check_bounds


class Empty(WorldGenerator):
    """A flat ground without solids; all of it is traversable, and nothing is random.

    Examples
    --------
    >>> Empty(bounds=(0, 0, 8, 5)).make(np.random.default_rng(0)).solids
    ()
    """

    bounds: Box = Field(
        (-10.0, -10.0, 10.0, 10.0), description="xmin, ymin, xmax, ymax of the ground [m]"
    )

    def check(self) -> None:
        """Refuse empty bounds."""
        check_bounds(self.bounds)

    def make(self, rng: np.random.Generator) -> World:
        """Return the bare ground."""
        return self.world([], self.bounds)
