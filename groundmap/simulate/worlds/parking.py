"""A street with parked cars."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field

from groundmap.simulate.shapes import pole
from groundmap.simulate.world import Solid, World
from groundmap.simulate.worlds.base import BuiltWorld

KERB_HEIGHT = 0.12  # [m]
CAR = (4.2, 1.8, 1.5)  # length, width, height [m]
LANE = 2.2  # [m], width of the strip that cars are parked on
LANE_JITTER = 0.15  # [m], largest distance of a car from the middle of its strip
CAR_GAP = (0.6, 1.6)  # [m], between two parking places
HOUSE_WIDTH = (6.0, 12.0)  # [m], along the street
SETBACK = 0.5  # [m], largest distance of a house from the pavement
HOUSE_DEPTH = 1.0  # [m], least depth of a house
KERB_TO_POLE = 0.3  # [m]


class Parking(BuiltWorld):
    """A street along x with cars parked on both sides, kerbs, lamp posts and fronts of houses.

    The street starts at x = 0, and y = 0 is its middle. The road between the parked cars,
    `road_width` wide, is free from end to end. The pavements are 0.12 m high, which is ground to a
    robot with a larger step height.

    Examples
    --------
    >>> street = Parking(length=40, road_width=5).make(np.random.default_rng(0))
    >>> street.obstacles(0.15, 2.0).intersects(shapely.box(0, -2.5, 40, 2.5))
    False
    """

    length: float = Field(60.0, gt=0, le=10_000, description="length of the street [m]")
    road_width: float = Field(
        5.0, gt=0, description="width of the road between the parked cars [m]"
    )
    pavement: float = Field(2.0, gt=0, description="width of the pavement on each side [m]")
    occupancy: float = Field(
        0.75, ge=0, le=1, description="share of the parking places that are occupied"
    )
    pole_spacing: float = Field(12.0, ge=0.1, description="mean distance between lamp posts [m]")
    pole_radius: float = Field(0.08, gt=0, description="radius of a lamp post [m]")
    pole_height: float = Field(4.0, gt=0, description="height of a lamp post [m]")
    height: float = Field(6.0, gt=0, description="height of the houses [m]")

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: both sides of the street, independent of each other."""
        solids = [solid for side in (-1, 1) for solid in self._side(rng, side)]
        y = self._fronts + SETBACK + HOUSE_DEPTH
        return self.world(solids, (0.0, -y, self.length, y))

    @property
    def _kerb(self) -> float:
        return self.road_width / 2 + LANE

    @property
    def _fronts(self) -> float:
        return self._kerb + self.pavement

    def _side(self, rng: np.random.Generator, side: int) -> list[Solid]:
        back = self._fronts + SETBACK + HOUSE_DEPTH
        houses = self._houses(rng, side, back)
        pavement = _strip(0.0, self.length, side * self._kerb, side * back)
        return [
            *self._cars(rng, side),
            *self.solids(pavement - shapely.union_all(houses), top=KERB_HEIGHT),
            *self.solids(houses, top=self.height),
            *self._poles(rng, side),
        ]

    def _cars(self, rng: np.random.Generator, side: int) -> list[Solid]:
        cars = []
        length, width, height = CAR
        x = rng.uniform(*CAR_GAP)
        while x + length <= self.length:
            middle = self._kerb - LANE / 2 + rng.uniform(-LANE_JITTER, LANE_JITTER)
            if rng.uniform() < self.occupancy:
                cars.append(
                    _strip(x, x + length, side * (middle - width / 2), side * (middle + width / 2))
                )
            x += length + rng.uniform(*CAR_GAP)
        return self.solids(cars, top=height)

    def _houses(self, rng: np.random.Generator, side: int, back: float) -> list[shapely.Polygon]:
        houses = []
        x = 0.0
        while x < self.length:
            end = min(x + rng.uniform(*HOUSE_WIDTH), self.length)
            front = self._fronts + rng.uniform(0.0, SETBACK)
            houses.append(_strip(x, end, side * front, side * back))
            x = end
        return houses

    def _poles(self, rng: np.random.Generator, side: int) -> list[Solid]:
        y = side * (self._kerb + KERB_TO_POLE)
        poles = []
        x = self.pole_spacing * rng.uniform(0.2, 1.0)
        while x < self.length:
            poles.append(pole(x, y, radius=self.pole_radius))
            x += self.pole_spacing * rng.uniform(0.7, 1.3)
        return self.solids(poles, top=self.pole_height)


def _strip(x0: float, x1: float, y0: float, y1: float) -> shapely.Polygon:
    return shapely.box(x0, min(y0, y1), x1, max(y0, y1))
