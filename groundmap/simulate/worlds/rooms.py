"""Rooms joined by doorways."""

from __future__ import annotations

import numpy as np
import shapely
from pydantic import Field
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import SettingsError
from groundmap.simulate.world import Solid, World
from groundmap.simulate.worlds.base import BuiltWorld, require

JAMB = 0.2  # [m] of wall between a door and the corner of the room
FURNITURE_SIDE = (0.4, 1.4)  # [m]
FURNITURE_HEIGHT = (0.4, 1.5)  # [m]
TRIES = 30  # attempts to place a piece of furniture before it is omitted


class Rooms(BuiltWorld):
    """Rooms on a grid, furnished with boxes, each reachable from every other through doorways.

    The origin is the corner of the outer wall. Doors are at random places along their walls. The
    centre of every room is free, and so is a passage of width `passage` from there to each of its
    doors.

    Examples
    --------
    >>> rooms = Rooms(columns=3, rows=1, room_width=4, room_depth=5)
    >>> rooms.centres().round(3).tolist()
    [[2.2, 2.7], [6.4, 2.7], [10.6, 2.7]]
    >>> rooms.make(np.random.default_rng(0)).obstacles(0.15, 2.0).bounds
    (0.0, 0.0, 12.8, 5.4)
    """

    columns: int = Field(3, ge=1, le=100, description="number of rooms along x [rooms]")
    rows: int = Field(2, ge=1, le=100, description="number of rooms along y [rooms]")
    room_width: float = Field(5.0, gt=0, description="clear size of a room along x [m]")
    room_depth: float = Field(4.0, gt=0, description="clear size of a room along y [m]")
    wall_thickness: float = Field(0.2, gt=0, description="thickness of the walls [m]")
    height: float = Field(2.5, gt=0, description="height of the walls [m]")
    door_width: float = Field(1.0, gt=0, description="clear width of a doorway [m]")
    passage: float = Field(1.0, gt=0, description="width of the passages without furniture [m]")
    loops: float = Field(0.2, ge=0, le=1, description="share of doors in walls that need none")
    boxes: int = Field(4, ge=0, le=1000, description="most boxes in a room [boxes]")

    def check(self) -> None:
        """Refuse walls shorter than their doors, and passages wider than doors."""
        for name in ("room_width", "room_depth"):
            least = self.door_width + 2 * JAMB
            require(name, getattr(self, name), least, "a door between its jambs")
        if self.passage > self.door_width:
            raise SettingsError("passage", "at most the door_width", f"{self.passage:g}")

    def centres(self) -> Floats:
        """Return the centres of the rooms, row by row, shape (n, 2) [m, map]."""
        t = self.wall_thickness
        x = t + self.room_width / 2 + np.arange(self.columns) * (self.room_width + t)
        y = t + self.room_depth / 2 + np.arange(self.rows) * (self.room_depth + t)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def make(self, rng: np.random.Generator) -> World:
        """Return the world: walls with doors, and furniture that keeps the passages free."""
        t, centres = self.wall_thickness, self.centres()
        size = (self.columns * (self.room_width + t) + t, self.rows * (self.room_depth + t) + t)
        pairs = _pairs_with_door(rng, self._neighbours(), len(centres), self.loops)
        doors = [self._door(rng, *centres[pair]) for pair in pairs]
        rooms = [_around(centre, self.room_width, self.room_depth) for centre in centres]
        ends = centres[pairs]
        gaps = [self._gap(door, *pair) for door, pair in zip(doors, ends, strict=True)]
        outer = shapely.box(0.0, 0.0, *size)
        solids = self.solids(outer - shapely.union_all([*rooms, *gaps]), top=self.height)
        for index, room in enumerate(rooms):
            own = [door for door, pair in zip(doors, pairs, strict=True) if index in pair]
            solids += self._furniture(rng, room, self._ways(centres[index], own))
        return self.world(solids, (0.0, 0.0, *size))

    def _neighbours(self) -> Ints:
        """Return all pairs of rooms that share a wall, shape (n, 2)."""
        room = np.arange(self.rows * self.columns).reshape(self.rows, self.columns)
        beside = np.stack([room[:, :-1].ravel(), room[:, 1:].ravel()], axis=1)
        above = np.stack([room[:-1].ravel(), room[1:].ravel()], axis=1)
        return np.concatenate([beside, above])

    def _door(self, rng: np.random.Generator, a: Floats, b: Floats) -> Floats:
        """Return the centre of a door at a random place along the wall between two rooms."""
        middle: Floats = (a + b) / 2
        along, side = (1, self.room_depth) if a[1] == b[1] else (0, self.room_width)
        reach = (side - self.door_width) / 2 - JAMB
        middle[along] += rng.uniform(-reach, reach)
        return middle

    def _gap(self, door: Floats, a: Floats, b: Floats) -> shapely.Polygon:
        """Return the doorway, slightly deeper than the wall, so that no sliver of it remains."""
        depth = 1.5 * self.wall_thickness
        beside = a[1] == b[1]
        return _around(door, *((depth, self.door_width) if beside else (self.door_width, depth)))

    def _ways(self, centre: Floats, doors: list[Floats]) -> shapely.Geometry:
        """Return the passages from the centre of a room to its doors, perpendicular to these."""
        lines = [shapely.LineString([centre, centre])]
        for door in doors:
            beside = abs(door[0] - centre[0]) > self.room_width / 2
            axis = 0 if beside else 1
            before = door.copy()
            before[axis] += np.sign(centre[axis] - door[axis]) * (
                (self.wall_thickness + self.passage) / 2
            )
            lines.append(shapely.LineString([centre, before, door]))
        return shapely.union_all(shapely.buffer(lines, self.passage / 2))

    def _furniture(
        self, rng: np.random.Generator, room: shapely.Polygon, ways: shapely.Geometry
    ) -> list[Solid]:
        placed: list[Solid] = []
        xmin, ymin, xmax, ymax = room.bounds
        for _ in range(self.boxes * TRIES):
            if len(placed) == self.boxes:
                break
            width, depth = rng.uniform(*FURNITURE_SIDE, size=2)
            piece = _around(rng.uniform((xmin, ymin), (xmax, ymax)), width, depth)
            taken = [ways, *(solid.outline for solid in placed)]
            if room.contains(piece) and not shapely.intersects(taken, piece).any():
                placed += self.solids(piece, top=rng.uniform(*FURNITURE_HEIGHT))
        return placed


def _pairs_with_door(rng: np.random.Generator, pairs: Ints, rooms: int, loops: float) -> Ints:
    """Return the pairs of a random spanning tree, and a share `loops` of the others."""
    length = rng.uniform(1.0, 2.0, size=len(pairs))
    tree = minimum_spanning_tree(coo_array((length, pairs.T), shape=(rooms, rooms)))
    needed: Bools = tree.toarray()[tuple(pairs.T)] > 0
    return pairs[needed | (rng.uniform(size=len(pairs)) < loops)]


def _around(centre: Floats, width: float, depth: float) -> shapely.Polygon:
    x, y = centre
    return shapely.box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)
