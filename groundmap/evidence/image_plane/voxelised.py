"""Patches of one view, drawn into voxels: non-free wins over free."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Floats, Floats32, Ints
from groundmap.evidence.evidence import Evidence, block_around
from groundmap.evidence.image_plane.depth_buffer import SQUARE, depth_buffer_of
from groundmap.evidence.image_plane.kernels.rays import draw_rays
from groundmap.evidence.image_plane.kernels.visit import visit_voxels
from groundmap.evidence.image_plane.lone_surfaces import LoneSurfaces, lone_surfaces_of
from groundmap.evidence.image_plane.patches import ImageMesh, Patches, PatchKind
from groundmap.evidence.image_plane.standing_room import standing_room
from groundmap.evidence.uncertainty import MODELS
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.view.view import View

MOST_CELLS = 2**28  # a block of 1 GiB, of which only what is seen takes memory
LEAST_COSINE = 0.05  # of the angle between two corners of a triangle, from the camera
FREE = np.float32(-1.0)


def evidence_of(
    image: ImageMesh,
    patches: Patches,
    view: View,
    grid: ConfidenceGrid,
    settings: MapperSettings,
) -> Evidence:
    """Draw the patches of a view into voxels.

    Voxels whose centres lie in front of a patch are free, -1, as are those that the robot stands
    in. Voxels that a surface passes through are above 0, spread by the uncertainty model. Lone
    vertices, segments and links beside which no patch is a surface are drawn along their rays, one
    voxel wide. Where both fall into a voxel the surface wins.

    Parameters
    ----------
    image : ImageMesh
    patches : Patches
    view : View
    grid : ConfidenceGrid
        Resolution and origin of the voxels.
    settings : MapperSettings

    Raises
    ------
    InputError
        The view reaches over more than 2**28 voxels.
    """
    camera = view.T_map_camera[:3, 3]
    outer = _outer(patches, settings)
    reached = np.concatenate([np.zeros((1, 3)), _reached(image, patches, outer, settings)])
    cells = (reached + camera - grid.origin) / grid.resolution
    block_around(cells, grid.resolution, most_cells=MOST_CELLS)  # before lines are cut into voxels
    lone = lone_surfaces_of(image, patches, settings)
    room = standing_room(view, grid, settings)
    on_lines = (_extent(lone.places.reshape(-1, 3)) + camera - grid.origin) / grid.resolution
    places = np.concatenate([cells, on_lines, _extent(room), _extent(room + 1)])
    lower, shape = block_around(places, grid.resolution, most_cells=MOST_CELLS)
    z = np.zeros(shape[::-1], dtype=np.float32)
    falloff = MODELS[settings.uncertainty].falloff.astype(np.float32)
    if len(patches.kind):
        buffer = depth_buffer_of(patches, image.mesh, outer, settings)
        visit_voxels(
            z,
            grid.origin + (lower + 0.5) * grid.resolution - camera,
            grid.resolution,
            settings.max_range,
            image.rotation,
            buffer.numbers,
            buffer.limits,
            np.array([*buffer.origin, buffer.cell]),
            SQUARE,
            np.column_stack([image.mesh.neighbors, patches.kind]).astype(np.int32),
            patches.rows(),
            np.inf if settings.discontinuities == "cautious" else settings.depth_halo,
            falloff,
        )
    col, row, layer = (room - lower.astype(np.int64)).T
    z[layer, row, col] = np.where(z[layer, row, col] > 0, z[layer, row, col], FREE)
    _draw_lone(z, lone, (camera - grid.origin) / grid.resolution - lower, falloff, settings)
    return Evidence(lower[::-1].astype(np.int64), z)


def _draw_lone(
    z: Floats32, lone: LoneSurfaces, camera: Floats, falloff: Floats32, settings: MapperSettings
) -> None:
    """Draw surfaces without a patch; `camera` is its position in the block [voxels]."""
    model = MODELS[settings.uncertainty]
    on_surface, around = model.evidence(lone.reach[:, None], settings.resolution)
    places = camera + lone.places / settings.resolution
    draw_rays(z, places, on_surface.astype(np.float32), around.astype(np.float32), falloff)


def _outer(patches: Patches, settings: MapperSettings) -> Floats:
    """Return the depth beyond which a patch says nothing, shape (t,) [m]."""
    farthest = (1.0 + patches.thickness[:, 2]) / patches.inverse[:, 2].min(axis=1)
    before = np.minimum(1.0 / patches.inverse[:, 0].min(axis=1), patches.depth)
    is_surface = patches.kind == PatchKind.SURFACE
    outer: Floats = np.minimum(np.where(is_surface, farthest, before), settings.max_range)
    return outer


def _reached(image: ImageMesh, patches: Patches, outer: Floats, settings: MapperSettings) -> Floats:
    """Return the box of all that the patches may say something about, shape (2, 3) [m, camera]."""
    some = patches.kind != PatchKind.NOTHING
    vertex_rays = image.rays(image.vertices.px)
    vertex_length = np.sqrt((vertex_rays**2).sum(axis=1))
    corners = image.mesh.simplices[some]
    rays, length = vertex_rays[corners], vertex_length[corners]
    a, b, c = np.moveaxis(rays / length[..., None], 1, 0)
    cosines = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
    cosine = np.minimum.reduce(cosines)
    # Between its corners, a triangle's part within max_range bulges by at most this.
    bulge = settings.max_range / np.sqrt(np.maximum(cosine, LEAST_COSINE))
    depth = np.minimum(bulge[:, None] / length, outer[some][:, None])
    reached = (rays * depth[..., None]).reshape(-1, 3)
    clipped: Floats = np.clip(reached, -settings.max_range, settings.max_range)
    return _extent(clipped)


def _extent(places: Floats | Ints) -> Floats:
    """Return the lower and upper corner of the box around places, shape (2, 3); (0, 3) of none."""
    if len(places) == 0:
        return np.empty((0, 3))
    x, y, z = places.T
    return np.array([(x.min(), y.min(), z.min()), (x.max(), y.max(), z.max())], dtype=np.float64)
