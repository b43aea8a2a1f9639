"""A strip of ground along a track: a plane at each of its places, blended in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import InputError
from groundmap.view.kernels.strip import locate_points, mark_bends

STRAIGHT = 0.01  # [m], deviation of the places that are left out
EVEN = 0.003  # [rad], deviation of their normals
SHORTEST = 1e-3  # [m], between two places; nearer ones have no direction


class Located(NamedTuple):
    """Points relative to a strip, each field with the shape of the points but for the last axis."""

    station: Floats  #: [m] along the strip, from its first place
    offset: Floats  #: [m] to the left of it
    height: Floats  #: [m] above it


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundStrip:
    """Ground that is driven over: at each place of a track, the plane that contains the place.

    A point belongs to the nearest place of the track. Between two places, planes are interpolated;
    the first and the last piece of the track continue without end.

    Parameters
    ----------
    places : array_like, shape (k, 3) [m]
        At least two places on the ground, in the order in which they are driven over.
    normals : array_like, shape (k, 3)
        Upward unit vectors of the planes.

    Raises
    ------
    InputError
        The shapes differ, a number is not finite, a normal does not have length 1, or two
        consecutive places are nearer than 1 mm.

    Examples
    --------
    >>> level, uphill = (0.0, 0.0, 1.0), (-0.6, 0.0, 0.8)
    >>> places = [(0, 0, 0), (4, 0, 0), (8, 0, 3)]
    >>> strip = GroundStrip(places=places, normals=[level, level, uphill])
    >>> strip.height([(2.0, 1.0, 0.5), (8.0, -1.0, 3.0)])
    array([0.5, 0. ])
    """

    places: Floats
    normals: Floats

    def __post_init__(self) -> None:
        """Check both arrays."""
        places = as_floats("places", self.places, (None, 3))
        normals = as_floats("normals", self.normals, (len(places), 3))
        check_finite("places", places)
        check_finite("normals", normals)
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        if len(places) < 2 or not (lengths >= SHORTEST).all():
            got = f"{len(places)} places" if len(places) < 2 else f"{lengths.min():.3g} m"
            raise InputError("places", f"at least two, {SHORTEST:g} m apart", got)
        off = np.abs(np.linalg.norm(normals, axis=1) - 1.0)
        if not (off <= 1e-6).all():
            row = int(np.argmax(off > 1e-6))
            raise InputError(
                "normals", "vectors of length 1", f"off by {off[row]:.3g}", where=f"index {row}"
            )
        object.__setattr__(self, "places", np.ascontiguousarray(places))
        object.__setattr__(self, "normals", np.ascontiguousarray(normals))

    def height(self, points: Floats) -> Floats:
        """Return the heights [m] above the strip of points, shape (..., 3) [m]."""
        return self.locate(points).height

    def locate(self, points: Floats) -> Located:
        """Return where points are relative to the strip.

        Parameters
        ----------
        points : ndarray, shape (..., 3) [m]
        """
        given = np.asarray(points, dtype=np.float64)
        located = self._locate(given)[:, :3].T
        return Located(*(field.reshape(given.shape[:-1]) for field in located))

    def normal_at(self, point: Floats) -> Floats:
        """Return the unit normal of the ground at the place of a point, shape (3,) [m]."""
        normal = self._locate(np.asarray(point, dtype=np.float64))[0, 3:]
        unit: Floats = normal / np.linalg.norm(normal)
        return unit

    def _locate(self, points: Floats) -> Floats:
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        located = np.empty((len(flat), 6))
        locate_points(flat, self.places, self.normals, located)
        return located

    def simplified(self) -> GroundStrip:
        """Return the strip without the places that interpolation reproduces within 1 cm."""
        keep = np.zeros(len(self.places), dtype=np.bool_)
        mark_bends(np.hstack([self.places, self.normals * (STRAIGHT / EVEN)]), STRAIGHT, keep)
        return GroundStrip(places=self.places[keep], normals=self.normals[keep])

    def transformed(self, rotation: Floats, shift: Floats) -> GroundStrip:
        """Return the strip in another frame, p' = rotation @ p + shift.

        Parameters
        ----------
        rotation : ndarray, shape (3, 3)
        shift : ndarray, shape (3,) [m]
        """
        return GroundStrip(
            places=self.places @ rotation.T + shift, normals=self.normals @ rotation.T
        )
