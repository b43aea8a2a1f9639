"""Surfaces without a patch: lone vertices, segments and links, as places along them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.evidence.image_plane.patches import ImageMesh, Patches, PatchKind
from groundmap.settings import MapperSettings

STEP = 0.5  # [voxels] between places along an edge


class LoneSurfaces(NamedTuple):
    """Places on surfaces that no patch covers, each to be drawn along its ray."""

    places: Floats  #: shape (n, 3, 3) [m], near limit, surface and far limit, from the camera
    reach: Floats  #: shape (n,) [m], extent of the spread to each side


def lone_surfaces_of(image: ImageMesh, patches: Patches, settings: MapperSettings) -> LoneSurfaces:
    """Return places on vertices and believed edges beside which no patch is a surface.

    Parameters
    ----------
    image : ImageMesh
    patches : Patches
    settings : MapperSettings
    """
    vertices = image.vertices
    edges = _edges(image, patches)
    rows, share = _along(image, edges, settings)

    def blend(values: Floats) -> Floats:
        weight = share.reshape(-1, *(1,) * (values.ndim - 1))
        blended: Floats = values[edges[rows, 0]] * (1 - weight) + values[edges[rows, 1]] * weight
        return blended

    rays = image.rays(blend(vertices.px))
    inverse, reach = blend(vertices.inverse), blend(vertices.reach)
    distance = np.sqrt((rays**2).sum(axis=1)) / inverse
    limits = np.stack([inverse * (1.0 + reach), inverse, inverse / (1.0 + reach)], axis=1)
    inside = distance <= settings.max_range
    places = rays[:, None] / limits[..., None]
    return LoneSurfaces(places[inside], (reach * distance)[inside])


def _edges(image: ImageMesh, patches: Patches) -> Ints:
    """Return the believed edges without a surface, and lone vertices as edges of no length."""
    edges = image.mesh.edges
    covered = np.zeros(len(edges), dtype=np.bool_)
    covered[patches.edges[patches.kind == PatchKind.SURFACE].reshape(-1)] = True
    lone = np.ones(len(image.mesh.points), dtype=np.bool_)
    lone[edges[patches.believed]] = False
    single = np.flatnonzero(lone)
    return np.concatenate([edges[patches.believed & ~covered], np.stack([single, single], axis=1)])


def _along(image: ImageMesh, edges: Ints, settings: MapperSettings) -> tuple[Ints, Floats]:
    """Return places evenly spaced on edges: the edge of each, and its share of it in the image."""
    inverse = image.vertices.inverse[edges]
    ends = image.rays(image.vertices.px[edges]) / inverse[..., None]
    length = np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1))
    length = np.minimum(length, 2.0 * settings.max_range)
    counts = np.ceil(length / (STEP * settings.resolution)).astype(np.int64) + 1
    rows = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = step / np.maximum(counts[rows] - 1, 1)
    # What is even in space is not even in the image: depths weigh the shares.
    nearer = share * inverse[rows, 0]
    return rows, nearer / (nearer + (1.0 - share) * inverse[rows, 1])
