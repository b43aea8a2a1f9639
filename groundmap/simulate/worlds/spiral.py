"""A spiral corridor."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field

from groundmap.simulate.world import World
from groundmap.simulate.worlds.base import BuiltWorld


class Spiral(BuiltWorld):
    """A rectangular spiral corridor, closed at both ends; nothing is random.

    It starts at the origin towards +x and turns left. The whole width of the corridor is free.

    Examples
    --------
    >>> spiral = Spiral(corridor_width=2, wall_thickness=0.5, turns=1)
    >>> list(spiral.centre_line().coords)
    [(0.0, 0.0), (2.5, 0.0), (2.5, 2.5), (-2.5, 2.5), (-2.5, -2.5)]
    """

    corridor_width: float = Field(2.0, gt=0, description="distance of the walls [m]")
    wall_thickness: float = Field(0.2, gt=0, description="thickness of the walls [m]")
    turns: int = Field(2, ge=1, le=1000, description="number of turns [turns]")
    height: float = Field(2.5, gt=0, description="height of the walls [m]")

    def centre_line(self) -> shapely.LineString:
        """Return the centre line of the corridor, from the inside outwards [m, map]."""
        legs = np.arange(4 * self.turns)
        length = (legs // 2 + 1) * (self.corridor_width + self.wall_thickness)
        heading = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])[legs % 4]
        corners = np.cumsum(heading * length[:, None], axis=0)
        return shapely.LineString(np.concatenate([np.zeros((1, 2)), corners]))

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: walls on both sides of the corridor and at its ends."""
        corridor = self.centre_line().buffer(
            self.corridor_width / 2, cap_style="square", join_style="mitre"
        )
        outer = corridor.buffer(self.wall_thickness, join_style="mitre")
        return self.world(self.solids(outer - corridor, top=self.height), outer.bounds)
