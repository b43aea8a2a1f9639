"""The shape of a robot on the ground: a disc, or a polygon that turns with the robot."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Floats, as_floats, is_number
from groundmap.errors import InputError
from planners.errors import ProblemError

EXPECTED = "a radius of 0 or more [m], or 3 or more points x, y [m, base_link] of a simple polygon"
MOST_DISCS = 16  # that cover a polygon
LARGEST = 1e6  # [m]
FLAT = 1e-12  # area, as a share of the squared extent, below which a polygon is a line


@dataclass(frozen=True, eq=False)
class Footprint:
    """The area of the ground that a robot covers.

    Attributes
    ----------
    polygon : ndarray, shape (n, 2) [m, base_link], or None
        Corners, counter-clockwise, the first not repeated at the end; None for a disc.
    radius : float [m]
        Of the smallest disc about base_link's origin that contains the footprint.
    inscribed_radius : float [m]
        Of the largest disc about base_link's origin within the footprint; 0 if the origin is
        outside.

    Examples
    --------
    >>> car = Footprint.of([(-0.5, -0.4), (1.5, -0.4), (1.5, 0.4), (-0.5, 0.4)])
    >>> round(car.radius, 3), car.inscribed_radius, car.width, car.is_disc
    (1.552, 0.4, 0.8, False)
    >>> Footprint.of(0.9).width
    1.8
    >>> Footprint.of([(0, 0), (1, 1), (1, 0), (0, 1)])
    Traceback (most recent call last):
        ...
    planners.errors.ProblemError: footprint: expected a radius of 0 or more [m], or 3 or more \
points x, y [m, base_link] of a simple polygon, got a self-intersection at (0.5, 0.5).
    """

    polygon: Floats | None
    radius: float
    inscribed_radius: float

    @classmethod
    def of(cls, value: float | npt.ArrayLike) -> Footprint:
        """Return the footprint of a radius [m] or of a polygon's corners [m, base_link].

        A repeated first corner at the end is dropped, and a clockwise polygon is reversed.

        Raises
        ------
        ProblemError
            Not numbers, not finite, a negative radius, fewer than 3 points, no area, or a
            self-intersecting outline.
        """
        if is_number(value):
            return cls._of_radius(float(value))
        if isinstance(value, np.ndarray) and value.shape == ():
            return cls.of(value.item())
        if np.isscalar(value):
            raise _refusal(repr(value)[:60])
        try:
            corners = as_floats("footprint", value, (None, 2))
        except InputError as error:
            raise _refusal(error.got) from error
        if not np.isfinite(corners).all():
            raise _refusal("a number that is not finite")
        farthest = float(np.abs(corners).max(initial=0.0))
        if farthest > LARGEST:
            raise _refusal(f"a corner {farthest:g} m away")
        return cls._of_polygon(corners)

    @classmethod
    def _of_radius(cls, radius: float) -> Footprint:
        if not 0 <= radius <= LARGEST:
            raise _refusal(repr(radius))
        return cls(None, radius, radius)

    @classmethod
    def _of_polygon(cls, points: Floats) -> Footprint:
        corners = _corners(points)
        ring = shapely.LinearRing(corners)
        within = shapely.Polygon(ring).contains(shapely.Point(0.0, 0.0))
        inscribed = float(ring.distance(shapely.Point(0.0, 0.0))) if within else 0.0
        corners.flags.writeable = False
        return cls(corners, float(np.hypot(*corners.T).max()), inscribed)

    @property
    def is_disc(self) -> bool:
        """Whether it is a disc about base_link's origin, which does not depend on the yaw."""
        return self.polygon is None

    @property
    def width(self) -> float:
        """Width of the narrowest straight passage that it can move along [m].

        The diameter of a disc, or the smallest extent of a polygon over all directions. A convex
        shape passes no narrower gap.
        """
        if self.polygon is None:
            return 2.0 * self.radius
        hull = shapely.get_coordinates(shapely.MultiPoint(self.polygon).convex_hull)
        sides = np.diff(hull, axis=0)  # the narrowest extent is across one of the hull's sides
        normals = np.column_stack([-sides[:, 1], sides[:, 0]]) / np.hypot(*sides.T)[:, None]
        return float(np.ptp(normals @ hull.T, axis=1).min())

    def convex_parts(self) -> list[Floats]:
        """Return convex polygons whose union is `polygon`; none for a disc.

        A convex polygon is returned as it is, others as the triangles of their constrained
        Delaunay triangulation.
        """
        if self.polygon is None:
            return []
        whole = shapely.Polygon(self.polygon)
        if whole.convex_hull.area - whole.area <= FLAT * whole.area:
            return [self.polygon]
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(whole))
        return [shapely.get_coordinates(shapely.orient_polygons(t))[:-1] for t in triangles]

    def covering_discs(self) -> Floats:
        """Return discs whose union covers the footprint: shape (k, 3), x, y, radius [m, base_link].

        The polygon is cut across its longer side into slabs half as long as it is wide.
        """
        if self.polygon is None:
            return np.array([[0.0, 0.0, self.radius]])
        box = shapely.get_coordinates(shapely.Polygon(self.polygon).minimum_rotated_rectangle)
        sides = np.diff(box[:3], axis=0)
        along, across = sides[np.argsort(-np.hypot(*sides.T))]
        slabs = int(np.clip(np.ceil(2.0 * np.hypot(*along) / np.hypot(*across)), 1, MOST_DISCS))
        discs = []
        for i in range(slabs):
            begin, end = box[0] + along * i / slabs, box[0] + along * (i + 1) / slabs
            slab = shapely.Polygon([begin, end, end + across, begin + across])
            part = shapely.get_coordinates(slab.intersection(shapely.Polygon(self.polygon)))
            if len(part):
                centre = (part.min(axis=0) + part.max(axis=0)) / 2.0
                discs.append([*centre, float(np.hypot(*(part - centre).T).max())])
        return np.array(discs)

    def to_value(self) -> float | list[list[float]]:
        """Return the argument of `of` as plain numbers, for files."""
        if self.polygon is None:
            return self.radius
        corners: list[list[float]] = self.polygon.tolist()
        return corners


def _corners(points: Floats) -> Floats:
    """Return the corners of a simple polygon, counter-clockwise, without repetitions."""
    if points.ndim != 2 or points.shape[1] != 2:
        raise _refusal(f"shape {points.shape}")
    corners = points[(points != np.roll(points, -1, axis=0)).any(axis=1)]
    if len(corners) < 3:
        raise _refusal(f"{len(corners)} different points")
    extent = float(np.ptp(corners, axis=0).max())
    if shapely.MultiPoint(corners).convex_hull.area <= FLAT * extent * extent:
        raise _refusal("points on one line")
    polygon = shapely.Polygon(corners)
    if not shapely.is_valid(polygon):
        where = re.search(r"\[(\S+) (\S+)\]", str(shapely.is_valid_reason(polygon)))
        at = f" at ({float(where[1]):g}, {float(where[2]):g})" if where else ""
        raise _refusal(f"a self-intersection{at}")
    turned: Floats = corners if shapely.is_ccw(polygon.exterior) else corners[::-1]
    return turned.copy()


def _refusal(got: str) -> ProblemError:
    return ProblemError("footprint", EXPECTED, got)
