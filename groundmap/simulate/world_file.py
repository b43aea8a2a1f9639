"""Settings of the solids and holes in scenario files, a table each."""

from __future__ import annotations

import math
from typing import Any

import shapely
from pydantic import Field

from groundmap.errors import InputError
from groundmap.settings import Settings
from groundmap.simulate.shapes import box, pole, polygon, table, wall
from groundmap.simulate.world import Hole, Solid

Point = tuple[float, float]
Box = tuple[float, float, float, float]
OF_SOLIDS = ("slope", "texture", "underside", "lines", "edges", "transparent", "repeat", "velocity")
TOP, TABLE_TOP = 2.5, 0.75  # [m], defaults


class _Shaped(Settings):
    """The outline of a solid or a hole, given in exactly one way."""

    box: Box | None = Field(None, description="x0, y0, x1, y1: two opposite corners [m]")
    polygon: tuple[Point, ...] | None = Field(None, description="corners x, y [m]")

    def _pick_given(self, *ways: str) -> str:
        """Return the name of the only one that is given."""
        given = [way for way in ways if getattr(self, way) is not None]
        if len(given) != 1:
            raise InputError("shape", f"one of {', '.join(ways)}", " and ".join(given) or "none")
        return given[0]


class SolidSettings(_Shaped):
    """A solid, or a piece of furniture of several; see `groundmap.simulate.Solid`."""

    wall: tuple[Point, ...] | None = Field(
        None, description="corners of the centre line of a wall [m]"
    )
    thickness: float = Field(0.2, gt=0, description="thickness of a wall [m]")
    pole: Point | None = Field(None, description="x, y of the centre of a pole [m]")
    radius: float = Field(0.06, gt=0, description="radius of a pole [m]")
    table: Box | None = Field(None, description="two opposite corners of the top of a table [m]")
    top: float | None = Field(
        None, description="height of its top; default: 2.5, for a table 0.75 [m]"
    )
    bottom: float = Field(0.0, description="height of its underside [m]")
    slope: tuple[float, float] = Field(
        (0.0, 0.0), description="rise of its upper side along x and y; top is its highest point"
    )
    texture: float = Field(6.0, ge=0, description="point features on it [1/m²]")
    underside: float = Field(0.0, ge=0, description="point features on its underside [1/m²]")
    lines: float = Field(0.4, ge=0, description="segments on it, in each direction [1/m²]")
    edges: bool = Field(True, description="whether its edges are matched as segments")
    transparent: bool = Field(False, description="whether it is glass")
    repeat: float = Field(0.0, ge=0, description="spacing of a repeated pattern; 0 for none [m]")
    appears: float | None = Field(None, description="time from which on it is present [s]")
    vanishes: float | None = Field(None, description="time until which it is present [s]")
    velocity: tuple[float, float] = Field((0.0, 0.0), description="velocity along x and y [m/s]")

    def solids(self) -> tuple[Solid, ...]:
        """Return the solids; a table consists of five.

        Examples
        --------
        >>> [solid] = SolidSettings(pole=(2.0, 1.0), radius=0.1, top=2.0).solids()
        >>> solid.top, round(solid.outline.area, 3)
        (2.0, 0.03)
        """
        options: dict[str, Any] = {name: getattr(self, name) for name in OF_SOLIDS}
        options["present"] = (
            -math.inf if self.appears is None else self.appears,
            math.inf if self.vanishes is None else self.vanishes,
        )
        way = self._pick_given("box", "polygon", "wall", "pole", "table")
        if way == "table":
            assert self.table is not None
            height = TABLE_TOP if self.top is None else self.top
            return table(*self.table, height=height, **options)
        top = TOP if self.top is None else self.top
        return (Solid(self._outline(way), bottom=self.bottom, top=top, **options),)

    def _outline(self, way: str) -> shapely.Polygon:
        given = getattr(self, way)
        if way == "wall":
            return wall(given, thickness=self.thickness)
        if way == "pole":
            return pole(*given, radius=self.radius)
        return box(*given) if way == "box" else polygon(given)


class HoleSettings(_Shaped):
    """A hole in the ground; see `groundmap.simulate.Hole`."""

    depth: float = Field(gt=0, description="depth of its floor below the ground [m]")

    def hole(self) -> Hole:
        """Return the hole."""
        given = getattr(self, way := self._pick_given("box", "polygon"))
        return Hole(box(*given) if way == "box" else polygon(given), depth=self.depth)
