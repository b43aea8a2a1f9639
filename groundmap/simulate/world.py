"""Simulated worlds: prisms on a flat ground, each present for some time."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, replace

import numpy as np
import shapely
from shapely.affinity import translate

from groundmap.arrays import Floats, as_floats, as_number, check_finite
from groundmap.errors import InputError

FARTHEST = 1e8  # [m] from the origin to an outline; beyond, edges of centimetres are rounded away
THINNEST = 1e-9  # [m] between two sides; less is rounding, and faces would have no direction
ALWAYS = (-math.inf, math.inf)


@dataclass(frozen=True, eq=False)
class Solid:
    """A prism: a footprint between two heights.

    Parameters
    ----------
    outline : shapely.Polygon [m, map]
        Its footprint, which may have holes.
    top, bottom : float [m]
        Heights above the ground; the bottom of a table top is above 0.
    slope : (float, float), default (0, 0) [m/m]
        Rise of its upper side along x and y, as of a ramp; `top` is then its highest point.
    texture : float, default 6 [1/m²]
        Point features on its sides and its top; 0 for a bare wall.
    underside : float, default 0 [1/m²]
        Point features on its underside, such as a ceiling's. With `edges`, its lower edges are then
        matched as segments, too.
    lines : float, default 0.4 [1/m²]
        Segment features on its sides, in each direction.
    edges : bool, default True
        Whether its upper and upright edges are matched as segments.
    transparent : bool, default False
        Whether it is glass, which does not end sight.
    repeat : float, default 0 [m]
        Period of a repeated pattern, such as a fence, which a matcher may match one period off; 0
        for no pattern.
    present : (float, float) [s]
        Start and end of its presence; the end is excluded.
    velocity : (float, float) [m/s]
        Its velocity along x and y; `outline` is its footprint at time 0.

    Raises
    ------
    InputError
        An outline that is not a valid polygon or has no area, a top that is not above the bottom, a
        slope down to below the bottom, a density below 0.

    Examples
    --------
    >>> car = Solid(shapely.box(0, 0, 4, 2), top=1.5, velocity=(1.0, 0.0))
    >>> car.at(3.0).outline.bounds
    (3.0, 0.0, 7.0, 2.0)
    """

    outline: shapely.Polygon
    _: KW_ONLY
    top: float
    bottom: float = 0.0
    slope: tuple[float, float] = (0.0, 0.0)
    texture: float = 6.0
    underside: float = 0.0
    lines: float = 0.4
    edges: bool = True
    transparent: bool = False
    repeat: float = 0.0
    present: tuple[float, float] = ALWAYS
    velocity: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the values, and orient the exterior of the outline counter-clockwise."""
        object.__setattr__(self, "outline", _polygon("outline", self.outline))
        bottom = as_number("bottom", self.bottom, "a height below the top [m]")
        top = as_number("top", self.top, "a height above the bottom [m]")
        if top - bottom < THINNEST:
            raise InputError("top", "a height above the bottom [m]", f"{bottom} to {top}")
        object.__setattr__(self, "bottom", bottom)
        object.__setattr__(self, "top", top)
        slope = as_floats("slope", self.slope, (2,))
        check_finite("slope", slope)
        object.__setattr__(self, "slope", tuple(slope.tolist()))
        lowest = self.top_at(shapely.get_coordinates(self.outline)).min()
        if lowest < bottom - THINNEST:
            expected = "a slope whose lowest point is not below the bottom"
            raise InputError("slope", expected, f"{lowest:g}, with a bottom of {bottom:g} [m]")
        for name in ("texture", "underside", "lines", "repeat"):
            value = as_number(name, getattr(self, name), "a number of 0 or more", least=0.0)
            object.__setattr__(self, name, value)
        velocity = as_floats("velocity", self.velocity, (2,))
        check_finite("velocity", velocity)
        object.__setattr__(self, "velocity", tuple(velocity.tolist()))
        since, until = as_floats("present", self.present, (2,)).tolist()
        if not since < until:
            raise InputError("present", "(from, until) [s]", f"{since} to {until}")
        object.__setattr__(self, "present", (since, until))

    @property
    def upper_plane(self) -> tuple[float, float, float]:
        """Height of its upper side at x = y = 0 [m], and its rise along x and y [m/m]."""
        if self.slope == (0.0, 0.0):
            return self.top, 0.0, 0.0
        rise = float((shapely.get_coordinates(self.outline) @ self.slope).max())
        return self.top - rise, *self.slope

    def top_at(self, places: Floats) -> Floats:
        """Return the heights of its upper side at places, shape (n, 2) [m]."""
        level, along_x, along_y = self.upper_plane
        heights: Floats = level + along_x * places[:, 0] + along_y * places[:, 1]
        return heights

    def is_there(self, time: float) -> bool:
        """Return whether it is present at a time [s]."""
        return self.present[0] <= time < self.present[1]

    def shift(self, time: float) -> tuple[float, float]:
        """Return its displacement at a time [s], x and y [m]."""
        if self.velocity == (0.0, 0.0):
            return 0.0, 0.0
        return self.velocity[0] * time, self.velocity[1] * time

    def at(self, time: float) -> Solid:
        """Return the solid at its place at a time [s], at rest."""
        x, y = self.shift(time)
        return replace(self, outline=translate(self.outline, x, y), velocity=(0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Hole:
    """A lower part of the ground: a pit, a stair downwards.

    Parameters
    ----------
    outline : shapely.Polygon [m, map]
    depth : float [m]
        Depth of its floor below the ground.

    Raises
    ------
    InputError
        An outline that is not a valid polygon or has no area, a depth that is not positive.
    """

    outline: shapely.Polygon
    _: KW_ONLY
    depth: float

    def __post_init__(self) -> None:
        """Check the outline and the depth."""
        object.__setattr__(self, "outline", _polygon("outline", self.outline))
        depth = as_number("depth", self.depth, "a number above 0 [m]", above=0.0)
        object.__setattr__(self, "depth", depth)


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Solids and holes on a flat ground at height 0.

    Parameters
    ----------
    solids : tuple of Solid
    holes : tuple of Hole
    bounds : (float, float, float, float) [m, map]
        xmin, ymin, xmax, ymax of the ground that has texture.
    ground_texture : float, default 6 [1/m²]
        Point features on the ground.
    ground_lines : float, default 0 [1/m²]
        Segment features on the ground, such as paint.

    Raises
    ------
    InputError
        Empty bounds, or a negative density.

    Examples
    --------
    >>> pillar = Solid(shapely.box(4, 4, 5, 5), top=2.0)
    >>> table = Solid(shapely.box(6, 4, 8, 5), bottom=0.7, top=0.75)
    >>> lamp = Solid(shapely.box(1, 1, 2, 2), bottom=2.2, top=2.5)
    >>> world = World(solids=(pillar, table, lamp), bounds=(0, 0, 10, 10))
    >>> world.obstacles(0.15, 2.0).area
    3.0
    """

    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...] = ()
    holes: tuple[Hole, ...] = ()
    ground_texture: float = 6.0
    ground_lines: float = 0.0

    def __post_init__(self) -> None:
        """Check the bounds and the densities."""
        bounds = as_floats("bounds", self.bounds, (4,))
        xmin, ymin, xmax, ymax = bounds.tolist()
        if not (np.isfinite(bounds).all() and xmin < xmax and ymin < ymax):
            raise InputError("bounds", "XMIN < XMAX and YMIN < YMAX [m]", str(bounds.tolist()))
        object.__setattr__(self, "bounds", (xmin, ymin, xmax, ymax))
        for name in ("ground_texture", "ground_lines"):
            value = as_number(name, getattr(self, name), "a number of 0 or more [1/m²]", least=0.0)
            object.__setattr__(self, name, value)

    def at(self, time: float) -> World:
        """Return the world at a time [s]: the solids present, at their places, at rest."""
        return replace(
            self, solids=tuple(solid.at(time) for solid in self.solids if solid.is_there(time))
        )

    def obstacles(
        self, step_height: float, robot_height: float, *, opaque: bool = False
    ) -> shapely.Geometry:
        """Return the obstacles to a robot: solids that it would hit, and holes.

        Parameters
        ----------
        step_height, robot_height : float [m]
            Solids between these heights are obstacles, and so are holes deeper than the step.
        opaque : bool, default False
            Whether to return only obstacles that end sight along the ground: no glass, no holes.
        """
        outlines = [
            solid.outline
            for solid in self.solids
            if solid.top > step_height
            and solid.bottom < robot_height
            and not (opaque and solid.transparent)
        ]
        if not opaque:
            outlines += [hole.outline for hole in self.holes if hole.depth > step_height]
        return shapely.union_all(np.array(outlines, dtype=object))


def _polygon(name: str, outline: shapely.Polygon) -> shapely.Polygon:
    if not isinstance(outline, shapely.Polygon):
        raise InputError(name, "a shapely.Polygon", repr(outline)[:60])
    farthest = np.abs(outline.bounds).max()
    if farthest > FARTHEST:
        raise InputError(name, f"a polygon within {FARTHEST:g} m of the origin", f"{farthest:g} m")
    if not outline.is_valid or outline.area <= THINNEST**2:
        fault = "one without" if outline.is_valid else shapely.is_valid_reason(outline)
        raise InputError(name, "a polygon with an area [m, map]", fault)
    return shapely.orient_polygons(outline)
