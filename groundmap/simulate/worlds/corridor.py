"""A closed loop of corridors."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field

from groundmap.simulate.world import World
from groundmap.simulate.worlds.base import Box, BuiltWorld, require


class Corridor(BuiltWorld):
    """A rectangular ring of corridor around a solid core, with niches and pilasters in its walls.

    The origin is the centre of the core. The centre line of the ring is free, and so is the area
    within ``corridor_width / 2 - pillar_size`` of it.

    Examples
    --------
    >>> corridor = Corridor(length=20, width=12, corridor_width=2)
    >>> corridor.centre_line().bounds
    (-9.0, -5.0, 9.0, 5.0)
    """

    length: float = Field(20.0, gt=0, description="distance of the outer walls along x [m]")
    width: float = Field(12.0, gt=0, description="distance of the outer walls along y [m]")
    corridor_width: float = Field(
        2.5, gt=0, description="distance of the outer walls from the core [m]"
    )
    wall_thickness: float = Field(
        0.2, gt=0, description="thickness of the outer walls, behind niches [m]"
    )
    height: float = Field(2.5, gt=0, description="height of walls and core [m]")
    niches: int = Field(6, ge=0, le=1000, description="recesses in outer walls and core [niches]")
    niche_width: float = Field(1.2, gt=0, description="width of a niche along the wall [m]")
    niche_depth: float = Field(0.5, gt=0, description="depth of a niche [m]")
    pillars: int = Field(
        8, ge=0, le=1000, description="pilasters on outer walls and core [pillars]"
    )
    pillar_size: float = Field(0.4, gt=0, description="side of the square of a pilaster [m]")

    def check(self) -> None:
        """Refuse a core too small for its niches, and pilasters that close the corridor."""
        room = 2 * self.niche_depth + max(self.niche_width, self.pillar_size)
        for name in ("length", "width"):
            least = 2 * self.corridor_width + room
            require(name, getattr(self, name), least, "the corridor and a core with niches")
        require("corridor_width", self.corridor_width, 2 * self.pillar_size, "two pilasters")

    def centre_line(self) -> shapely.LinearRing:
        """Return the centre line of the corridor, once around [m, map]."""
        return self._rectangle(self.corridor_width / 2).exterior

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: outer walls and core, with niches cut out and pilasters added."""
        hall, core = self._rectangle(0.0), self._rectangle(self.corridor_width)
        size, width, depth = self.pillar_size, self.niche_width, self.niche_depth
        added, cut = [], []
        for _ in range(self.niches):
            if rng.uniform() < 0.5:
                cut.append(self._at_wall(rng, hall.bounds, width, depth))
            else:
                cut.append(self._at_wall(rng, core.bounds, width, -depth))
        for _ in range(self.pillars):
            if rng.uniform() < 0.5:
                added.append(self._at_wall(rng, hall.bounds, size, -size))
            else:
                added.append(self._at_wall(rng, core.bounds, size, size))
        open_ = shapely.union_all([hall - core, *cut])
        outer = open_.envelope.buffer(self.wall_thickness, join_style="mitre")
        walls = shapely.union_all([outer - open_, *added])
        return self.world(self.solids(walls, top=self.height), outer.bounds)

    def _rectangle(self, inset: float) -> shapely.Polygon:
        x, y = self.length / 2 - inset, self.width / 2 - inset
        return shapely.box(-x, -y, x, y)

    def _at_wall(
        self, rng: np.random.Generator, bounds: Box, width: float, depth: float
    ) -> shapely.Polygon:
        """Return a rectangle at a random place along a wall: outside, or inside if depth < 0."""
        xmin, ymin, xmax, ymax = bounds
        along_x = rng.uniform() < (xmax - xmin) / (xmax - xmin + ymax - ymin)
        low, high = (xmin, xmax) if along_x else (ymin, ymax)
        # Niches keep off the corners, so that those of two walls never cut one off.
        start = rng.uniform(low + self.niche_depth, high - self.niche_depth - width)
        if rng.uniform() < 0.5:
            wall, end = (ymax, ymax + depth) if along_x else (xmax, xmax + depth)
        else:
            wall, end = (ymin, ymin - depth) if along_x else (xmin, xmin - depth)
        across, along = sorted([wall, end]), [start, start + width]
        (x0, x1), (y0, y1) = (along, across) if along_x else (across, along)
        return shapely.box(x0, y0, x1, y1)
