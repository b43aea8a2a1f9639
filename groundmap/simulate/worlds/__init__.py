"""Generators of worlds, by their names in scenario files; each world is made from a seed."""

from __future__ import annotations

from groundmap.simulate.worlds.base import WorldGenerator
from groundmap.simulate.worlds.corridor import Corridor
from groundmap.simulate.worlds.empty import Empty
from groundmap.simulate.worlds.forest import Forest
from groundmap.simulate.worlds.image import MapImage
from groundmap.simulate.worlds.parking import Parking
from groundmap.simulate.worlds.rooms import Rooms
from groundmap.simulate.worlds.spiral import Spiral
from groundmap.simulate.worlds.warehouse import Warehouse

GENERATORS: dict[str, type[WorldGenerator]] = {
    "empty": Empty,
    "rooms": Rooms,
    "corridor": Corridor,
    "warehouse": Warehouse,
    "parking": Parking,
    "forest": Forest,
    "spiral": Spiral,
    "image": MapImage,
}

__all__ = [
    "GENERATORS",
    "Corridor",
    "Empty",
    "Forest",
    "MapImage",
    "Parking",
    "Rooms",
    "Spiral",
    "Warehouse",
    "WorldGenerator",
]
