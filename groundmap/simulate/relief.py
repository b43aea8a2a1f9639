"""The relief of a world's ground: slopes along a road, banks and verges beside it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from groundmap.arrays import Bools, Floats, as_floats, check_finite
from groundmap.errors import InputError

WHEELBASE = 0.6  # [m], between the places that a base stands on
SAMPLES = 40  # places on a line of sight that are compared with the ground
SUNK = 0.02  # [m], a line of sight this far below the ground is hidden
FLAT = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """Heights of the ground: a profile along a road plus one across it, both piecewise linear.

    Beyond their ends, profiles are level.

    Parameters
    ----------
    road : array_like, shape (k, 2) [m, map]
        Its centre line.
    along : array_like, shape (n, 2) [m], default level
        Distance along the road and height, by increasing distance.
    across : array_like, shape (n, 2) [m], default level
        Distance from the road, above 0 to its left, and height above that of the road.

    Raises
    ------
    InputError
        A number is not finite, the road has fewer than two places or no length, or the distances
        of a profile do not increase.

    Examples
    --------
    >>> ramp = Relief(road=[(0, 0), (30, 0)], along=[(10, 0), (20, 1)], across=[(3, 0), (5, -0.4)])
    >>> ramp.height([(5.0, 0.0), (15.0, -2.0), (25.0, 4.0)])
    array([0. , 0.5, 0.8])
    """

    road: npt.ArrayLike
    along: npt.ArrayLike = (FLAT,)
    across: npt.ArrayLike = (FLAT,)

    def __post_init__(self) -> None:
        """Check road and profiles."""
        for name in ("road", "along", "across"):
            rows = as_floats(name, getattr(self, name), (None, 2))
            check_finite(name, rows)
            object.__setattr__(self, name, rows)
        if len(self._road) < 2 or not shapely.LineString(self._road).length > 0:
            raise InputError("road", "at least two places [m]", str(self._road.tolist())[:60])
        for name in ("along", "across"):
            rows = getattr(self, name)
            if not len(rows) or not (np.diff(rows[:, 0]) > 0).all():
                raise InputError(name, "rows by increasing distance [m]", str(rows.tolist())[:60])

    @property
    def _road(self) -> Floats:
        return np.asarray(self.road, dtype=np.float64)

    def height(self, places: npt.ArrayLike) -> Floats:
        """Return the heights of the ground at places, shape (..., 2) [m, map]."""
        given = np.asarray(places, dtype=np.float64)
        station, offset = self._locate(given.reshape(-1, 2))
        along, across = np.asarray(self.along), np.asarray(self.across)
        height: Floats = np.interp(station, *along.T) + np.interp(offset, *across.T)
        return height.reshape(given.shape[:-1])

    def _locate(self, places: Floats) -> tuple[Floats, Floats]:
        """Return distances along the road and to the left of it, from its nearest place."""
        road = self._road
        best = np.full(len(places), np.inf)
        station, offset = np.zeros(len(places)), np.zeros(len(places))
        begin = 0.0
        for start, end in pairwise(road):
            length = float(np.hypot(*(end - start)))
            if length == 0:
                continue
            ahead = (end - start) / length
            away = places - start
            at = np.clip(away @ ahead, 0.0, length)
            distance = np.hypot(*(away - at[:, None] * ahead).T)
            side = np.sign(ahead[0] * away[:, 1] - ahead[1] * away[:, 0])
            nearer = distance < best
            best[nearer] = distance[nearer]
            station[nearer] = begin + at[nearer]
            offset[nearer] = (side * distance)[nearer]
            begin += length
        return station, offset

    def lift(self, points: Floats) -> Floats:
        """Return points, shape (..., 3) [m, map], raised by the ground below them."""
        lifted = np.array(points, dtype=np.float64)
        lifted[..., 2] += self.height(lifted[..., :2])
        return lifted

    def lift_poses(self, poses: Floats) -> Floats:
        """Return poses on the flat ground, shape (n, 4, 4), as they stand on the relief.

        The base stands on four places, 0.6 m apart.
        """
        lifted = poses.copy()
        half = 0.5 * WHEELBASE
        middle = poses[:, :2, 3]
        ahead, left = half * poses[:, :2, 0], half * poses[:, :2, 1]
        rise = self.height(middle + ahead) - self.height(middle - ahead)
        bank = self.height(middle + left) - self.height(middle - left)
        x = np.column_stack([2 * ahead, rise])
        y = np.column_stack([2 * left, bank])
        up = np.cross(x, y)
        x /= np.linalg.norm(x, axis=1)[:, None]
        up /= np.linalg.norm(up, axis=1)[:, None]
        lifted[:, :3, :3] = np.stack([x, np.cross(up, x), up], axis=-1)
        lifted[:, 2, 3] += 0.5 * (self.height(middle + ahead) + self.height(middle - ahead))
        return lifted

    def in_sight(self, eye: Floats, targets: Floats) -> Bools:
        """Return which lines of sight do not pass through the ground, shape (n,).

        Parameters
        ----------
        eye : ndarray, shape (3,) [m, map]
        targets : ndarray, shape (n, 3) [m, map]
        """
        share = (np.arange(1, SAMPLES) / SAMPLES)[:, None, None]
        lines = eye + share * (targets - eye)
        over: Bools = np.logical_and.reduce(lines[..., 2] > self.height(lines[..., :2]) - SUNK)
        return over
