"""Aisles between racks."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field

from groundmap.arrays import Floats
from groundmap.simulate.world import Solid, World
from groundmap.simulate.worlds.base import BuiltWorld, require

PALLET = (1.2, 0.8)  # [m], along the rack and across
PALLET_HEIGHT = (0.3, 1.4)  # [m]


class Warehouse(BuiltWorld):
    """A hall of identical racks, with aisles between them and pallets in the aisles.

    The origin is the inner corner of the hall, and the racks run along x. Cross aisles run along y,
    before, between and behind the blocks of racks. Aisles are free along their centre lines, cross
    aisles over their whole width. A pallet stands beside a rack and takes 0.8 m of its aisle.

    Examples
    --------
    >>> hall = Warehouse(racks=3, blocks=2, rack_length=8, aisle_width=2, cross_aisle=3)
    >>> hall.aisles().tolist(), hall.cross_aisles().tolist()
    ([1.0, 4.0, 7.0, 10.0], [1.5, 12.5, 23.5])
    """

    racks: int = Field(4, ge=1, le=100, description="number of racks along y [racks]")
    blocks: int = Field(2, ge=1, le=100, description="number of blocks of racks along x [blocks]")
    rack_length: float = Field(10.0, gt=0, description="length of a rack along x [m]")
    rack_depth: float = Field(1.0, gt=0, description="depth of a rack along y [m]")
    rack_height: float = Field(2.2, gt=0, description="height of a rack [m]")
    bay: float = Field(
        1.25, ge=0, description="distance of the uprights of racks; 0 for no pattern [m]"
    )
    aisle_width: float = Field(2.5, gt=0, description="width of the aisles between racks [m]")
    cross_aisle: float = Field(3.0, gt=0, description="width of the cross aisles [m]")
    pallets: int = Field(
        6, ge=0, le=10_000, description="number of pallets in the aisles [pallets]"
    )
    wall_thickness: float = Field(0.2, gt=0, description="thickness of the hall's walls [m]")
    height: float = Field(4.0, gt=0, description="height of the hall's walls [m]")

    def check(self) -> None:
        """Refuse aisles that two pallets would close, and racks shorter than a pallet."""
        require("aisle_width", self.aisle_width, 2 * PALLET[1], "two pallets")
        require("rack_length", self.rack_length, PALLET[0], "a pallet")

    def aisles(self) -> Floats:
        """Return y of the centre lines of the aisles [m, map]."""
        return self.aisle_width / 2 + self._row * np.arange(self.racks + 1.0)

    def cross_aisles(self) -> Floats:
        """Return x of the centre lines of the cross aisles [m, map]."""
        return self.cross_aisle / 2 + self._block * np.arange(self.blocks + 1.0)

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: the hall, the racks, and pallets beside some of them."""
        hall = shapely.box(
            0.0,
            0.0,
            self.blocks * self._block + self.cross_aisle,
            self.racks * self._row + self.aisle_width,
        )
        outer = hall.buffer(self.wall_thickness, join_style="mitre")
        racks = [
            self._rack(rack, block) for rack in range(self.racks) for block in range(self.blocks)
        ]
        solids = self.solids(outer - hall, top=self.height)
        solids += self.solids(racks, top=self.rack_height, repeat=self.bay)
        for _ in range(self.pallets):
            solids += self._pallet(rng, racks[rng.integers(len(racks))])
        return self.world(solids, outer.bounds)

    @property
    def _row(self) -> float:
        return self.aisle_width + self.rack_depth

    @property
    def _block(self) -> float:
        return self.cross_aisle + self.rack_length

    def _rack(self, rack: int, block: int) -> shapely.Polygon:
        x = self.cross_aisle + block * self._block
        y = self.aisle_width + rack * self._row
        return shapely.box(x, y, x + self.rack_length, y + self.rack_depth)

    def _pallet(self, rng: np.random.Generator, rack: shapely.Polygon) -> list[Solid]:
        xmin, ymin, xmax, ymax = rack.bounds
        length, depth = PALLET
        x = rng.uniform(xmin, xmax - length)
        y = ymax if rng.uniform() < 0.5 else ymin - depth
        return self.solids(
            shapely.box(x, y, x + length, y + depth), top=rng.uniform(*PALLET_HEIGHT)
        )
