"""Uncertainty models, by name: the spread of surfaces over cells (paper, section 6.2)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from groundmap.arrays import Floats

PEAK = 4.0  # ratio of z on a surface to z around it
SHELLS = 4  # steps in which a Gaussian decreases
SPREAD = 2.0  # standard deviations of a Gaussian to its end


class Ellipsoid:
    """The third solution of the paper: a constant-density ellipse along the feature's covariance.

    Around the surface, z along a ray through the spread sums to one cell of surface. On the
    surface, z is four times as high, but at most 1: with a spread of two standard deviations, it
    is 1 up to a standard deviation of one cell, and decreases with larger ones.
    """

    name: ClassVar[str] = "ellipsoid"

    def sigma(self, xy: Floats, covariance: Floats) -> Floats:
        """Return the standard deviation of each feature along the line of sight, shape (n,) [m].

        Parameters
        ----------
        xy : ndarray, shape (n, d) [m]
            From the viewpoint.
        covariance : ndarray, shape (n, d, d) [m²]
        """
        ray = _unit(xy)
        variance = np.einsum("ni,nij,nj->n", ray, covariance, ray)
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))  # rounding may give values below 0
        return sigma

    @property
    def falloff(self) -> Floats:
        """z in equal shells of the spread, from the surface outwards, as a share of `evidence`."""
        return np.ones(1)

    def core_radius(self, resolution: float) -> float:
        """Return the half-width of the core of a lone point, half a cell [m]."""
        return 0.5 * resolution

    def outline(self, ends: Floats, reach: Floats) -> Floats:
        """Return the quadrangle over which a surface spreads, shape (s, 4, 2) [m, view].

        Parameters
        ----------
        ends : ndarray, shape (s, 2, 2) [m, view]
        reach : ndarray, shape (s, 2) [m]
        """
        radius = np.hypot(ends[..., 0], ends[..., 1])
        ray = _unit(ends)
        # An uncertain feature, too, is in front of the viewpoint.
        near = ends - ray * np.minimum(reach, radius)[..., None]
        return _quadrangle(near, ends + ray * reach[..., None])

    def caps(self, reach: Floats) -> Floats:
        """Return the radius of the disc at each end, shape (s, 2) [m]; 0 for none."""
        return np.zeros_like(reach)

    def evidence(self, reach: Floats, resolution: float) -> tuple[Floats, Floats]:
        """Return z on the surface and in the spread around it, shape (s,) each.

        Parameters
        ----------
        reach : ndarray, shape (s, 2) [m]
        resolution : float [m]
        """
        density = _constant_density(reach, resolution)
        return np.minimum(PEAK * density, 1.0), density


class Radius(Ellipsoid):
    """The second solution: a radius of certainty, the same in all directions."""

    name: ClassVar[str] = "radius"

    def sigma(self, xy: Floats, covariance: Floats) -> Floats:
        """Return the standard deviation in each feature's least certain direction [m].

        Parameters
        ----------
        xy : ndarray, shape (n, 2) [m, view]
        covariance : ndarray, shape (n, 2, 2) [m², view]
        """
        sigma: Floats = np.sqrt(np.linalg.eigvalsh(covariance)[:, -1])
        return sigma

    def core_radius(self, resolution: float) -> float:
        """Return 0 [m], as the caps spread a lone point equally in all directions."""
        return 0.0

    def outline(self, ends: Floats, reach: Floats) -> Floats:
        """Return the quadrangle across the surface, shape (s, 4, 2) [m, view].

        Parameters
        ----------
        ends : ndarray, shape (s, 2, 2) [m, view]
        reach : ndarray, shape (s, 2) [m]
        """
        along = _unit(ends[:, 1] - ends[:, 0])
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        offset = across[:, None, :] * reach[..., None]
        return _quadrangle(ends - offset, ends + offset)

    def caps(self, reach: Floats) -> Floats:
        """Return the radius of the disc at each end, shape (s, 2) [m]."""
        return reach

    def evidence(self, reach: Floats, resolution: float) -> tuple[Floats, Floats]:
        """Return z on the surface and around it, which are equal in this model, shape (s,) each.

        Parameters
        ----------
        reach : ndarray, shape (s, 2) [m]
        resolution : float [m]
        """
        density = _constant_density(reach, resolution)
        return density, density


class Exact(Ellipsoid):
    """The first solution: no spread; errors average out over many views."""

    name: ClassVar[str] = "none"

    def sigma(self, xy: Floats, covariance: Floats) -> Floats:
        """Return zeros, shape (n,) [m], as this model ignores the uncertainty of features.

        Parameters
        ----------
        xy : ndarray, shape (n, 2) [m, view]
        covariance : ndarray, shape (n, 2, 2) [m², view]
        """
        return np.zeros(len(xy))


class Gaussian(Ellipsoid):
    """A Gaussian along the line of sight, which is truncated where the ellipsoid ends.

    Around the surface, z decreases from it in steps; along a ray it sums to one cell of surface.
    """

    name: ClassVar[str] = "gaussian"

    @property
    def falloff(self) -> Floats:
        """z in equal shells of the spread, from the surface outwards, as a share of `evidence`."""
        middles = (np.arange(SHELLS) + 0.5) * (SPREAD / SHELLS)
        heights = np.exp(-0.5 * middles**2)
        falloff: Floats = heights / heights[0]
        return falloff

    def evidence(self, reach: Floats, resolution: float) -> tuple[Floats, Floats]:
        """Return z on the surface and in the innermost shell around it, shape (s,) each.

        Parameters
        ----------
        reach : ndarray, shape (s, k) [m]
        resolution : float [m]
        """
        density = _constant_density(reach, resolution)
        return np.minimum(PEAK * density, 1.0), np.minimum(density / self.falloff.mean(), 1.0)


MODELS: dict[str, Ellipsoid] = {
    model.name: model for model in (Ellipsoid(), Radius(), Exact(), Gaussian())
}


def _constant_density(reach: Floats, resolution: float) -> Floats:
    spread = 2.0 * reach.mean(axis=1)
    density: Floats = resolution / np.maximum(spread, resolution)
    return density


def _quadrangle(near: Floats, far: Floats) -> Floats:
    return np.stack([near[:, 0], near[:, 1], far[:, 1], far[:, 0]], axis=1)


def _unit(vectors: Floats) -> Floats:
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    unit: Floats = vectors / np.where(length > 0, length, 1.0)
    return unit
