"""What one view says about voxels, by slow means that share no code with the kernels."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from groundmap import StereoRig, View
from groundmap.arrays import Bools, Floats, Floats32, Ints
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.image_plane.patches import PatchKind
from groundmap.evidence.image_plane.view_parts import ImageParts
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.view.frames import T_REP103_OPTICAL
from groundmap.view.ground_plane import GroundPlane


def image_rig(focal: float = 300.0) -> StereoRig:
    """A mounted rig, 1.2 m above the ground."""
    mount = np.eye(4)
    mount[2, 3] = 1.2
    return StereoRig(
        fx=focal, fy=focal, cx=320.0, cy=240.0, baseline=0.3, T_base_camera=mount @ T_REP103_OPTICAL
    )


def image_view(
    pixels: Floats, depths: Floats, *, segments: Ints | None = None, pose: Floats | None = None
) -> View:
    """A view with features at pixels, shape (n, 2), and depths, shape (n,) [m].

    Rows of `segments`, shape (m, 2), are segments; the other features are points.
    """
    rig = image_rig()
    disparity = rig.fx * rig.baseline / depths
    matched = np.column_stack([pixels[:, 0], pixels[:, 0] - disparity, pixels[:, 1]])
    pairs = np.empty((0, 2), dtype=np.int64) if segments is None else segments
    points = np.setdiff1d(np.arange(len(pixels)), pairs)
    view = View.from_pixels(
        np.eye(4) if pose is None else pose,
        rig,
        points_px=matched[points],
        segments_px=matched[pairs],
    )
    return view.with_plane(GroundPlane(normal=np.array([0.0, 0.0, 1.0]), offset=0.0))


def hovering(view: View) -> View:
    """The view without a ground plane: nothing stands below its camera."""
    return View(
        T_map_base=view.T_map_base, rig=view.rig, points=view.points, segments=view.segments
    )


def random_image(rng: np.random.Generator, *, most: int = 40) -> View:
    """A view from anywhere: patches of smooth depth, gaps in depth, segments that cross."""
    count = int(rng.integers(3, most))
    pixels = rng.uniform((0.0, 0.0), (640.0, 480.0), size=(count, 2))
    depths = rng.uniform(1.0, 3.0) + pixels @ rng.uniform(-0.002, 0.004, size=2)
    depths = np.clip(depths, 0.7, None) * np.where(rng.uniform(size=count) < 0.3, 2.5, 1.0)
    order = rng.permutation(count)
    segments = order[: 2 * int(rng.integers(0, count // 3 + 1))].reshape(-1, 2)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(rng.normal(0.0, 0.4, size=3)).as_matrix()
    pose[:3, 3] = rng.uniform(-20.0, 20.0, size=3)
    return image_view(pixels, depths, segments=segments, pose=pose)


def block_centres(evidence: Evidence, grid: ConfidenceGrid) -> Floats:
    """Centres of the voxels of a block, shape (n, 3) [m, map], in the order of `z.reshape(-1)`."""
    cells = evidence.lower + np.argwhere(np.ones(evidence.z.shape, dtype=np.bool_))
    return grid.origin + (cells[:, ::-1] + 0.5) * grid.resolution


def triangles_at(parts: ImageParts, view: View, centres: Floats) -> tuple[Ints, Floats, Bools]:
    """The triangle that each place is seen through (-1: none), its weights, and which are unsure.

    Weights, shape (n, 3), are barycentric in the image. Places on a side are unsure: rounding
    decides between the triangles.
    """
    T_map_camera = view.T_map_camera
    xyz = (centres - T_map_camera[:3, 3]) @ T_map_camera[:3, :3]
    ahead = xyz[:, 2] > 0
    px = np.full((len(xyz), 2), np.inf)
    px[ahead] = view.rig.fx * xyz[ahead, :2] / xyz[ahead, 2:]
    number = np.full(len(xyz), -1, dtype=np.int64)
    weights = np.zeros((len(xyz), 3))
    unsure = np.zeros(len(xyz), dtype=np.bool_)
    points, patches = parts.image.mesh.points, parts.patches
    for t, corners in enumerate(points[parts.image.mesh.simplices]):
        if patches.kind[t] == PatchKind.NOTHING:
            continue
        inside_box = ahead & (px >= corners.min(axis=0) - 1).all(axis=1)
        rows = np.flatnonzero(inside_box & (px <= corners.max(axis=0) + 1).all(axis=1))
        sides = np.column_stack([corners[1] - corners[0], corners[2] - corners[0]])
        share = np.linalg.solve(sides, (px[rows] - corners[0]).T).T
        bary = np.column_stack([1.0 - share.sum(axis=1), share])
        unsure[rows] |= np.abs(bary).min(axis=1) < 1e-7
        inside = (bary >= 0).all(axis=1)
        number[rows[inside]] = t
        weights[rows[inside]] = bary[inside]
    return number, weights, unsure


def in_front(parts: ImageParts, view: View, centres: Floats, number: Ints) -> Bools:
    """Which places lie in the tetrahedron of the camera and their triangle's near limits."""
    T_map_camera = view.T_map_camera
    rays = np.column_stack(
        [parts.image.mesh.points / view.rig.fx, np.ones(len(parts.image.mesh.points))]
    )
    inside = np.zeros(len(centres), dtype=np.bool_)
    for t in np.unique(number[number >= 0]):
        corners = rays[parts.image.mesh.simplices[t]] / parts.patches.inverse[t, 0][:, None]
        corners = corners @ T_map_camera[:3, :3].T
        rows = np.flatnonzero(number == t)
        share = np.linalg.solve(corners.T, (centres[rows] - T_map_camera[:3, 3]).T).T
        inside[rows] = (share > -1e-9).all(axis=1) & (share.sum(axis=1) < 1.0)
    return inside


def twin(
    parts: ImageParts, view: View, grid: ConfidenceGrid, settings: MapperSettings, falloff: Floats32
) -> tuple[Floats, Bools]:
    """What the patches alone say in every voxel of the block, by NumPy, and which are unsure."""
    centres = block_centres(parts.evidence, grid)
    number, weights, unsure = triangles_at(parts, view, centres)
    T_map_camera, patches = view.T_map_camera, parts.patches
    offset = centres - T_map_camera[:3, 3]
    depth = offset @ T_map_camera[:3, 2]
    distance = np.sqrt((offset**2).sum(axis=1))
    rows = np.flatnonzero((number >= 0) & (distance <= settings.max_range))
    t, w, z_depth = number[rows], weights[rows], depth[rows]
    inverse = (patches.inverse[t] * w[:, None]).sum(axis=2)  # near, surface, far along the ray
    s = inverse * z_depth[:, None]
    gap = patches.kind[t] == PatchKind.GAP
    tangents = (offset[rows] @ T_map_camera[:3, :3])[:, :2] / z_depth[:, None]
    apart = np.sqrt(((tangents[:, None] - patches.corners[t]) ** 2).sum(axis=2))
    halo = np.inf if settings.discontinuities == "cautious" else settings.depth_halo
    ends = ~patches.near[t] | (apart <= halo * patches.inverse[t, 1])
    limit = np.where(ends, patches.inverse[t, 0], 0.0).max(axis=1)
    before = np.where(gap, limit * z_depth, s[:, 0])
    z = np.where((before < 1.0) & (z_depth <= patches.depth[t]), -1.0, 0.0)
    thick = patches.thickness[t]
    is_surface = patches.kind[t] == PatchKind.SURFACE
    spread = is_surface & (s[:, 0] >= 1.0 - thick[:, 0]) & (s[:, 2] <= 1.0 + thick[:, 2])
    on = is_surface & (s[:, 0] >= 1.0 - thick[:, 0]) & (np.abs(s[:, 1] - 1.0) <= thick[:, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        front, behind = (1 - s[:, 1]) / (s[:, 0] - s[:, 1]), (s[:, 1] - 1) / (s[:, 1] - s[:, 2])
    share = np.clip(np.nan_to_num(np.where(s[:, 1] < 1.0, front, behind)), 0.0, 1.0)
    shell = np.clip((share * len(falloff)).astype(np.int64), 0, len(falloff) - 1)
    z[spread] = (patches.values[t, 1] * falloff[shell])[spread]
    z[on] = patches.values[t, 0][on]
    edges = np.abs(np.column_stack([before - 1, s[:, 1:] - 1])).min(axis=1) < 1e-7
    edges |= np.abs(np.abs(s - 1) - thick).min(axis=1) < 1e-7
    edges |= np.abs(z_depth - patches.depth[t]) < 1e-7
    edges |= np.abs(share * len(falloff) - np.rint(share * len(falloff))) < 1e-6
    edges |= np.abs(apart - halo * patches.inverse[t, 1]).min(axis=1) < 1e-9
    unsure[rows] |= edges
    block = np.zeros(len(centres))
    block[rows] = z
    return block, unsure
