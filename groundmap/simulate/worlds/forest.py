"""A forest of trunks."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from groundmap.simulate.shapes import pole
from groundmap.simulate.world import World
from groundmap.simulate.worlds.base import Box, BuiltWorld, check_bounds

TRIES = 30  # attempts to place a tree before it is omitted


class Forest(BuiltWorld):
    """Trunks of random radius, at least `spacing` from each other and from the edge of the forest.

    A clearing around the centre of the bounds is free. A robot narrower than `spacing` passes
    between any two trees, so all places where it fits are connected.

    Examples
    --------
    >>> forest = Forest(bounds=(0, 0, 12, 12), trees=20, clearing=1.5)
    >>> world = forest.make(np.random.default_rng(0))
    >>> len(world.solids)
    20
    >>> world.obstacles(0.15, 2.0).intersects(pole(6, 6, radius=1.5))
    False
    """

    bounds: Box = Field(
        (-12.0, -12.0, 12.0, 12.0), description="xmin, ymin, xmax, ymax of the forest [m]"
    )
    trees: int = Field(
        80, ge=0, le=10_000, description="number of trees, if there is room for them [trees]"
    )
    min_radius: float = Field(0.05, gt=0, description="radius of the thinnest trunk [m]")
    max_radius: float = Field(0.25, gt=0, description="radius of the thickest trunk [m]")
    spacing: float = Field(1.2, gt=0, description="least gap between two trunks [m]")
    clearing: float = Field(2.0, ge=0, description="radius of the clearing [m]")
    height: float = Field(4.0, gt=0, description="height of the trunks [m]")

    def check(self) -> None:
        """Refuse bounds without room for a tree, and radii that are not in ascending order."""
        check_bounds(self.bounds)
        xmin, ymin, xmax, ymax = self.bounds
        least = 2 * (self.spacing + self.max_radius)
        if min(xmax - xmin, ymax - ymin) < least:
            raise SettingsError("bounds", f"sides of at least {least:g} [m]", str(self.bounds))
        self.check_order("min_radius", "max_radius")

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: trees are placed one after the other where there is room."""
        # Trunks are given by centre and radius; the clearing is treated as the first of them.
        xmin, ymin, xmax, ymax = self.bounds
        clearing = self.clearing - self.spacing
        trunks = [((xmin + xmax) / 2, (ymin + ymax) / 2, clearing)]
        for _ in range(self.trees):
            for _ in range(TRIES):
                tree = self._tree(rng)
                if _gap(tree, np.array(trunks)) >= self.spacing:
                    trunks.append(tree)
                    break
        outlines = [pole(x, y, radius=radius) for x, y, radius in trunks[1:]]
        # A round trunk has no upright edges, unlike the twelve-sided pole that represents it.
        return self.world(self.solids(outlines, top=self.height, edges=False), self.bounds)

    def _tree(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """Return x, y and radius of a trunk inside the bounds less `spacing` [m]."""
        radius = rng.uniform(self.min_radius, self.max_radius)
        xmin, ymin, xmax, ymax = self.bounds
        off = self.spacing + radius
        return rng.uniform(xmin + off, xmax - off), rng.uniform(ymin + off, ymax - off), radius


def _gap(tree: tuple[float, float, float], trunks: Floats) -> float:
    """Return the distance from a trunk to the nearest of the others [m]."""
    x, y, radius = tree
    return float((np.hypot(trunks[:, 0] - x, trunks[:, 1] - y) - trunks[:, 2]).min()) - radius
