"""Patches: the planes that interpolate depth between features, and what they may say.

A patch is a plane n . P = 1 in space, so that n . P < 1 is in front of it. Over a triangle of the
image n . P is a sum of the corners' inverse depths, weighted by three linear functions of P, which
are all above 0 in the cone of the triangle: one product serves for both tests.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Bools, Bytes, Floats, Ints
from groundmap.evidence.image_plane.vertices import Vertices
from groundmap.evidence.triangulation import Mesh
from groundmap.evidence.uncertainty import MODELS
from groundmap.settings import MapperSettings

SHARE_OF_FOOTPRINT = 0.8  # a link shorter than this share of the narrowest robot stops that robot
THINNEST = 1e-9  # tangent of the angle that a triangle is wide
THINNEST_PX2 = 1e-6  # [px²], twice the area of a triangle; less is a line


class ImageMesh(NamedTuple):
    """The triangulation of a view's image, and how it lies in the map."""

    mesh: Mesh  #: in pixels from the principal point
    vertices: Vertices
    rotation: Floats  #: shape (3, 3), from the camera to the map
    focal: float  #: [px]

    def rays(self, px: Floats) -> Floats:
        """Return the rays of pixels, at depth 1, shape (..., 3) [m, axes of the map]."""
        ahead = np.ones((*px.shape[:-1], 1))
        rays: Floats = np.concatenate([px / self.focal, ahead], axis=-1) @ self.rotation.T
        return rays


class PatchKind(IntEnum):
    """What a patch says."""

    NOTHING = 0  #: it has no area in the image
    SIGHT = 1  #: the space before it is free
    SURFACE = 2  #: also that the voxels it passes through are non-free
    GAP = 3  #: its corners lie at different depths: how far the space before it is free


class Patches(NamedTuple):
    """Triangles of the image as patches in space; shape (t, ...).

    Positions are relative to the camera, with the axes of the map.
    """

    kind: Bytes  #: shape (t,), `PatchKind`
    basis: Floats  #: shape (t, 3, 3), basis[i, k] . P is the weight of corner k times the depth
    inverse: Floats  #: shape (t, 3, 3) [1/m], of near limit, surface and far limit, at each corner
    thickness: Floats  #: shape (t, 3), half of a voxel's, in terms of n . P
    depth: Floats  #: shape (t,) [m], beyond which the patch says nothing
    values: Floats  #: shape (t, 2), z on the surface and around it
    corners: Floats  #: shape (t, 3, 2), tangents of the corners, right and down
    near: Bools  #: shape (t, 3), corners before a gap
    believed: Bools  #: shape (e,), edges of the mesh that are surfaces
    edges: Ints  #: shape (t, 3), rows of the mesh's edges

    def rows(self) -> Floats:
        """Return the patches as rows of numbers, shape (t, 33), each in few lines of the cache."""
        fields = (
            self.basis,
            self.inverse,
            self.thickness,
            self.depth,
            self.values,
            self.corners,
            self.near,
        )
        columns = [field.reshape(len(self.kind), math.prod(field.shape[1:])) for field in fields]
        return np.concatenate(columns, axis=1, dtype=np.float64)


def patches_of(image: ImageMesh, settings: MapperSettings) -> Patches:
    """Return the patches of a triangulation of the image.

    A patch is a surface if its edges are segments or links not longer than min(max(link_length,
    link_angle r), 0.8 narrowest_footprint); longer ones grant freespace only. Where the depths of
    the corners differ by more than `depth_ratio`, `discontinuities` decides. No patch grants
    freespace where it is wider than the narrowest footprint: the robot would fit in unseen.

    Parameters
    ----------
    image : ImageMesh
    settings : MapperSettings
    """
    mesh, vertices = image.mesh, image.vertices
    corners = mesh.simplices
    rays = image.rays(vertices.px)
    distance = np.sqrt((rays**2).sum(axis=1)) / vertices.inverse
    believed = _believed(rays / vertices.inverse[:, None], distance, mesh, settings)
    basis, thin = _basis(rays[corners], THINNEST_PX2 / image.focal**2)
    reach = (vertices.reach * distance)[corners]
    scale = 1.0 + vertices.reach
    limits = np.stack([vertices.inverse * scale, vertices.inverse, vertices.inverse / scale])
    inverse = np.swapaxes(limits[:, corners], 0, 1)
    if settings.uncertainty == "radius":
        inverse = _across(inverse, basis, reach)
    normals = np.abs(inverse @ basis)
    thickness = 0.5 * settings.resolution * (normals[..., 0] + normals[..., 1] + normals[..., 2])
    edges = _edge_numbers(mesh)
    near = _before_gap(inverse, settings.depth_ratio)
    kind = np.full(len(corners), PatchKind.SIGHT, dtype=np.uint8)
    kind[believed[edges].all(axis=1)] = PatchKind.SURFACE
    strict = settings.discontinuities == "strict"
    kind[near.any(axis=1)] = PatchKind.SURFACE if strict else PatchKind.GAP
    kind[thin] = PatchKind.NOTHING
    tangents = vertices.px[corners] / image.focal
    width = np.minimum(_across_sight(rays[corners]), _beside_segment(tangents, mesh, edges))
    values = np.stack(MODELS[settings.uncertainty].evidence(reach, settings.resolution), axis=1)
    return Patches(
        kind=kind,
        basis=basis,
        inverse=inverse,
        thickness=thickness,
        depth=settings.narrowest_footprint / np.maximum(width, THINNEST),
        values=values,
        corners=tangents,
        near=near,
        believed=believed,
        edges=edges,
    )


def _believed(xyz: Floats, distance: Floats, mesh: Mesh, settings: MapperSettings) -> Bools:
    """Return which edges are segments or links that are short enough."""
    a, b = mesh.edges.T
    length = np.sqrt(((xyz[a] - xyz[b]) ** 2).sum(axis=1))
    nearer = np.minimum(distance[a], distance[b])
    longest = np.minimum(
        np.maximum(settings.link_length, settings.link_angle * nearer),
        SHARE_OF_FOOTPRINT * settings.narrowest_footprint,
    )
    believed: Bools = mesh.constrained | (length <= longest)
    return believed


def _edge_numbers(mesh: Mesh) -> Ints:
    """Return the row of `Mesh.edges` of each triangle's edges, shape (t, 3)."""
    count = len(mesh.points)
    keys = mesh.edges[:, 0] * count + mesh.edges[:, 1]  # ascending, as the edges are
    ends, others = mesh.simplices, mesh.simplices[:, [1, 2, 0]]
    sides = np.minimum(ends, others) * count + np.maximum(ends, others)
    numbers: Ints = np.searchsorted(keys, sides)
    return numbers


def _basis(corners: Floats, thinnest: float) -> tuple[Floats, Bools]:
    """Return the linear functions of the corners, shape (t, 3, 3), and which are thin, (t,).

    Function k is 1 at corner k and 0 at the two others, at depth 1.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    rows = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
    area = (rows[:, 0] * a).sum(axis=1)
    thin = ~(np.abs(area) > thinnest)
    basis: Floats = rows / np.where(thin, 1.0, area)[:, None, None]
    return basis, thin


def _cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors, shape (t, 3); several times as fast as NumPy's."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _across(inverse: Floats, basis: Floats, reach: Floats) -> Floats:
    """Move the limits along the patches' normals instead of the rays, shape (t, 3, 3)."""
    middle = inverse[:, 1]
    normal = np.einsum("ti,tij->tj", middle, basis)
    shift = reach.mean(axis=1) * np.sqrt((normal**2).sum(axis=1))
    moved = inverse.copy()
    # A plane nearer than the radius spreads up to the camera.
    moved[:, 0] = middle / np.maximum(1.0 - shift, 1e-3)[:, None]
    moved[:, 2] = middle / (1.0 + shift)[:, None]
    return moved


def _before_gap(inverse: Floats, ratio: float) -> Bools:
    """Return which corners lie before a gap in depth, shape (t, 3).

    There is one if the farthest corner is `ratio` times as far as the nearest, as sure as the
    spread of both. The near corners are those from which it is.
    """
    near, far = inverse[:, 0], inverse[:, 2]
    farthest = near.min(axis=1)
    nearest = far.max(axis=1)
    broken = nearest > ratio * farthest
    # Split at the geometric mean, so that each corner is on the side that it is closer to.
    middle = inverse[:, 1]
    split = np.sqrt(middle.min(axis=1) * middle.max(axis=1))
    before: Bools = broken[:, None] & (middle > split[:, None])
    return before


def _beside_segment(corners: Floats, mesh: Mesh, edges: Ints) -> Floats:
    """Return how far triangles reach from a side that is a segment, at depth 1; shape (t,) [m].

    What stands before a segment hides it, however long the segment is. Infinite without one.
    """
    on_segment = mesh.constrained[edges]
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.sqrt((sides**2).sum(axis=2))
    area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    heights = area[:, None] / np.maximum(length, np.finfo(np.float64).tiny)
    beside: Floats = np.where(on_segment, heights, np.inf).min(axis=1, initial=np.inf)
    return beside


def _across_sight(corners: Floats) -> Floats:
    """Return how wide triangles are, horizontally and across sight, at depth 1; shape (t,) [m].

    Parameters
    ----------
    corners : ndarray, shape (t, 3, 3) [m]
        Corners at depth 1, relative to the camera, with the axes of the map.
    """
    middle = corners.mean(axis=1)
    level = np.hypot(middle[:, 0], middle[:, 1])
    # Straight up or down, no direction is more horizontal than others: the longest side counts.
    upright = level < 1e-6 * np.sqrt((middle**2).sum(axis=1))
    safe = np.where(upright, 1.0, level)
    across = corners[..., 0] * (-middle[:, 1] / safe)[:, None]
    across += corners[..., 1] * (middle[:, 0] / safe)[:, None]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((sides**2).sum(axis=2)).max(axis=1)
    width: Floats = np.where(upright, longest, np.ptp(across, axis=1))
    return width
