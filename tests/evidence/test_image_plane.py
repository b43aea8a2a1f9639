from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from groundmap import ConfidenceGrid, Features, GroundMapper, StereoRig, View
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.evidence.image_plane.kernels.rays import draw_rays
from groundmap.evidence.image_plane.kernels.spikes import repair_spikes
from groundmap.evidence.image_plane.lone_surfaces import lone_surfaces_of
from groundmap.evidence.image_plane.patches import PatchKind
from groundmap.evidence.image_plane.standing_room import standing_room
from groundmap.evidence.image_plane.view_parts import ImageParts
from groundmap.evidence.uncertainty import MODELS
from oracles_image import (
    block_centres,
    hovering,
    image_rig,
    image_view,
    in_front,
    random_image,
    triangles_at,
    twin,
)

VIEWS = 8  # of each kind; 1,000 were tried
RESOLUTION = 0.1524


def mapper(**settings: Any) -> GroundMapper:
    return GroundMapper(mode="3d", max_range=6.0, **{"resolution": RESOLUTION, **settings})


def explained(view: View, **settings: Any) -> ImageParts:
    parts = mapper(**settings).explain(view)
    assert isinstance(parts, ImageParts)
    return parts


def said_at(parts: ImageParts, place: Floats, grid: ConfidenceGrid) -> float:
    cell = np.floor((place - grid.origin) / grid.resolution).astype(np.int64)[::-1]
    index = cell - parts.evidence.lower
    inside = ((index >= 0) & (index < parts.evidence.z.shape)).all()
    return float(parts.evidence.z[tuple(index)]) if inside else 0.0


def wall(depth: float = 3.0, *, spacing: float = 30.0) -> View:
    """A wall across the optical axis, seen from 1.2 m above the ground."""
    x, y = np.meshgrid(np.arange(20.0, 640.0, spacing), np.arange(20.0, 480.0, spacing))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    return image_view(pixels, np.full(len(pixels), depth))


# Oracles


def test_free_voxels_are_those_in_the_tetrahedra_before_the_patches() -> None:
    rng = np.random.default_rng(1)
    compared = 0
    for _ in range(VIEWS):
        view = hovering(random_image(rng))
        used = mapper(uncertainty="none", narrowest_footprint=12.0, discontinuities="strict")
        parts = used.explain(view)
        centres = block_centres(parts.evidence, used.grid)
        number, _, unsure = triangles_at(parts, view, centres)
        inside = in_front(parts, view, centres, number)
        inside &= np.linalg.norm(centres - view.T_map_camera[:3, 3], axis=1) <= 6.0
        z = parts.evidence.z.reshape(-1)
        judged = ~unsure & (z <= 0)
        assert np.array_equal((z < 0)[judged], inside[judged])
        compared += int(inside.sum())
    assert compared > 1000


@pytest.mark.parametrize("discontinuities", ["halo", "cautious", "strict"])
@pytest.mark.parametrize("uncertainty", sorted(MODELS))
def test_kernels_agree_with_numpy_voxel_by_voxel(uncertainty: str, discontinuities: str) -> None:
    rng = np.random.default_rng(2)
    settings = {"uncertainty": uncertainty, "discontinuities": discontinuities}
    falloff = MODELS[uncertainty].falloff.astype(np.float32)
    for _ in range(VIEWS // 3):
        view = random_image(rng)
        used = mapper(**settings)
        parts = used.explain(view)
        expected, unsure = twin(parts, view, used.grid, used.settings, falloff)
        block = expected.reshape(parts.evidence.z.shape)
        room = standing_room(view, used.grid, used.settings)[:, ::-1] - parts.evidence.lower
        standing = np.zeros(block.shape, dtype=np.bool_)
        standing[tuple(room.T)] = True
        block[standing & (block <= 0)] = -1.0
        lone = lone_surfaces_of(parts.image, parts.patches, used.settings)
        on, around = MODELS[uncertainty].evidence(lone.reach[:, None], RESOLUTION)
        places = (lone.places + view.T_map_camera[:3, 3]) / RESOLUTION - parts.evidence.lower[::-1]
        for place, middle, beside in zip(places, on, around, strict=True):
            for cell, value in ray_cells(place, middle, beside, falloff):
                block[cell] = max(block[cell], value)
        sure = ~unsure.reshape(block.shape)
        np.testing.assert_allclose(parts.evidence.z[sure], block[sure], atol=1e-6)


def ray_cells(
    place: Floats, middle: float, beside: float, falloff: Any
) -> list[tuple[tuple[int, ...], float]]:
    found = [(tuple(np.floor(place[1]).astype(int)[::-1].tolist()), middle)]
    for end in (0, 2):
        steps = int(np.ceil(np.linalg.norm(place[end] - place[1]) / 0.5))
        for share in np.arange(1, steps + 1) / max(steps, 1):
            cell = np.floor(place[1] + share * (place[end] - place[1])).astype(int)[::-1]
            shell = min(int(share * len(falloff)), len(falloff) - 1)
            found.append((tuple(cell.tolist()), float(beside * falloff[shell])))
    return found


def test_tetrahedra_partition_the_viewing_volume() -> None:
    rng = np.random.default_rng(3)
    for _ in range(VIEWS // 4):
        view = random_image(rng)
        parts = explained(view)
        px, corners = parts.image.mesh.points / view.rig.fx, parts.image.mesh.simplices
        depth = 1.0 / parts.image.vertices.inverse
        places = np.column_stack([px, np.ones(len(px))]) * depth[:, None]
        volume = np.abs(np.linalg.det(places[corners])).sum() / 6.0
        # Independently: the inverse depth of a patch is linear in the image, and a cone with a
        # solid angle du dv holds depth^3 / 3 of it.
        step = 0.004
        u, v = np.meshgrid(
            *(np.arange(*bounds, step) for bounds in zip(px.min(0), px.max(0), strict=True))
        )
        rays = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
        centres = rays @ view.T_map_camera[:3, :3].T + view.T_map_camera[:3, 3]
        number, weights, _ = triangles_at(parts, view, centres)
        inside = number >= 0
        inverse = (parts.image.vertices.inverse[corners[number[inside]]] * weights[inside]).sum(1)
        assert volume == pytest.approx((inverse**-3 / 3.0).sum() * step**2, rel=0.03)


def test_views_in_any_order_and_merged_maps_give_the_same_map() -> None:
    rng = np.random.default_rng(4)
    views = [random_image(rng) for _ in range(6)]
    views = [
        View(T_map_base=np.eye(4), rig=v.rig, points=v.points, segments=v.segments) for v in views
    ]
    maps = [mapper(), mapper(), mapper(), mapper()]
    for view in views:
        maps[0].integrate(view)
    for view in reversed(views):
        maps[1].integrate(view)
    for number, view in enumerate(views):
        maps[2 + number % 2].integrate(view)
    one, back = (m.grid.window() for m in maps[:2])
    both = maps[2].grid.merge(maps[3].grid).window()
    for other in (back, both):
        assert np.array_equal(one.count, other.count)
        np.testing.assert_allclose(one.confidence, other.confidence, atol=2e-6)


def test_confidence_is_the_mean_of_what_the_views_say() -> None:
    rng = np.random.default_rng(5)
    total: dict[tuple[int, ...], list[float]] = {}
    used = mapper()
    for _ in range(5):
        view = random_image(rng)
        view = View(T_map_base=np.eye(4), rig=view.rig, points=view.points)
        evidence = used.explain(view).evidence
        used.integrate(view)
        for cell in np.argwhere(evidence.z != 0):
            key = tuple((cell + evidence.lower).tolist())
            total.setdefault(key, []).append(float(evidence.z[tuple(cell)]))
    cells = np.array(list(total))
    places = (cells[:, ::-1] + 0.5) * RESOLUTION
    assert np.array_equal(used.grid.count_at(places), [len(each) for each in total.values()])
    mean = [float(np.mean(each)) for each in total.values()]
    np.testing.assert_allclose(used.grid.confidence_at(places), mean, atol=1e-6)


# Rules


def test_space_before_a_wall_is_free_and_the_wall_is_not() -> None:
    used, view = mapper(uncertainty="none"), wall(3.0)
    used.integrate(view)
    assert used.grid.confidence_at((1.5, 0.3, 1.2)) == -1.0
    assert used.grid.confidence_at((3.0, 0.3, 1.2)) == 1.0
    assert used.grid.count_at((3.5, 0.3, 1.2)) == 0


def test_long_patches_grant_but_are_no_surfaces() -> None:
    parts = explained(wall(3.0, spacing=90.0), uncertainty="none")
    assert (parts.patches.kind == PatchKind.SIGHT).all()
    grid = mapper().grid
    assert said_at(parts, np.array([1.5, 0.02, 1.2]), grid) == -1.0
    # Only the vertices themselves are drawn, one voxel each.
    assert (parts.evidence.z > 0).sum() <= len(parts.features.px)


def test_sight_where_the_robot_would_fit_in_unseen_grants_nothing() -> None:
    parts = explained(wall(5.0, spacing=90.0), uncertainty="none", narrowest_footprint=0.6)
    grid = mapper().grid
    assert said_at(parts, np.array([1.5, 0.02, 1.2]), grid) == -1.0
    assert said_at(parts, np.array([4.5, 0.02, 1.2]), grid) == 0.0


@pytest.mark.parametrize(
    ("discontinuities", "beside", "apart"), [("halo", 0.0, -1.0), ("cautious", 0.0, 0.0)]
)
def test_near_a_corner_before_a_gap_sight_ends_at_its_depth(
    discontinuities: str, beside: float, apart: float
) -> None:
    # A post 1.5 m ahead, and a wall 5 m ahead that begins to the right of it.
    rows = np.arange(40.0, 460.0, 30.0)
    post = np.column_stack([np.full(len(rows), 200.0), rows])
    x, y = np.meshgrid(np.arange(500.0, 640.0, 30.0), rows)
    pixels = np.concatenate([post, np.column_stack([x.ravel(), y.ravel()])])
    depths = np.where(pixels[:, 0] < 300.0, 1.5, 5.0)
    view = hovering(image_view(pixels, depths))
    parts = explained(
        view, discontinuities=discontinuities, uncertainty="none", narrowest_footprint=12.0
    )
    grid = mapper().grid

    def at(column: float, depth: float) -> float:
        ahead, left = depth, -(column - 320.0) / 300.0 * depth
        return said_at(parts, np.array([ahead, left, 1.2]), grid)

    assert at(330.0, 1.2) == -1.0
    assert at(300.0, 3.0) == beside  # 0.5 m from the post at its depth
    assert at(450.0, 3.0) == apart  # 1.25 m


def test_a_gap_is_a_surface_like_any_other_in_strict_mode() -> None:
    rng = np.random.default_rng(6)
    view = random_image(rng)
    kinds = explained(view, discontinuities="strict").patches.kind
    assert PatchKind.GAP not in kinds
    assert PatchKind.GAP in explained(view).patches.kind


def test_a_vertex_far_behind_the_plane_of_its_neighbours_is_moved_onto_it() -> None:
    view = wall(3.0)
    at = len(view.points) // 2 + 8
    xyz = view.points.xyz.copy()
    xyz[at] *= 2.0
    spiked = View(
        T_map_base=view.T_map_base,
        rig=view.rig,
        points=Features(xyz, view.points.covariance, view.points.ids),
    )
    parts = explained(spiked)
    assert parts.image.vertices.spikes == 1
    np.testing.assert_allclose(parts.image.vertices.inverse, 1.0 / 3.0, rtol=1e-6)
    near = View(
        T_map_base=view.T_map_base,
        rig=view.rig,
        points=Features(
            np.where(np.arange(len(xyz))[:, None] == at, 0.25 * xyz, view.points.xyz),
            view.points.covariance,
            view.points.ids,
        ),
    )
    assert explained(near).image.vertices.spikes == 0  # a pole


def test_planes_of_neighbours_are_least_squares() -> None:
    rng = np.random.default_rng(7)
    points = rng.uniform(-50.0, 50.0, size=(9, 2))
    points[0] = (3.0, -4.0)
    sigma = rng.uniform(0.01, 0.02, size=9)
    inverse = 0.3 + points @ (0.001, -0.002) + rng.normal(size=9) * 0.3 * sigma
    inverse[0] -= 0.2
    edges = np.column_stack([np.zeros(8, dtype=np.int64), np.arange(1, 9)])
    repaired = inverse.copy()
    assert repair_spikes(points, inverse, sigma, edges, 4.0, 3.0, repaired) == 1
    columns = np.column_stack([points[1:] - points[0], np.ones(8)]) / sigma[1:, None]
    solution, *_ = np.linalg.lstsq(columns, inverse[1:] / sigma[1:], rcond=None)
    assert repaired[0] == pytest.approx(solution[2], rel=1e-9)
    np.testing.assert_array_equal(repaired[1:], inverse[1:])


def test_rays_raise_and_never_lower() -> None:
    z = np.full((4, 4, 12), 0.5, dtype=np.float32)
    z[1, 1, 5] = -1.0
    places = np.array([[(2.5, 1.5, 1.5), (5.5, 1.5, 1.5), (9.5, 1.5, 1.5)]])
    shells = np.array([1.0, 0.5], dtype=np.float32)
    draw_rays(z, places, np.ones(1, np.float32), np.full(1, 0.8, np.float32), shells)
    row = z[1, 1].tolist()
    assert row == pytest.approx([0.5, 0.5, 0.5, 0.5, 0.8, 1.0, 0.8, 0.8, 0.5, 0.5, 0.5, 0.5])


def test_the_nearest_of_features_in_one_pixel_counts() -> None:
    view = wall(3.0)
    behind = image_view(np.array([[320.0, 240.0], [320.2, 240.0]]), np.array([2.0, 4.0]))
    both = View(
        T_map_base=view.T_map_base,
        rig=view.rig,
        points=Features(
            np.concatenate([view.points.xyz, behind.points.xyz]),
            np.concatenate([view.points.covariance, behind.points.covariance]),
            np.concatenate([view.points.ids, behind.points.ids]),
        ),
    )
    vertices = explained(both).image.vertices
    at = np.hypot(*vertices.px.T).argmin()
    assert 1.0 / vertices.inverse[at] == pytest.approx(2.0)


def test_the_nearer_of_two_crossing_segments_counts_at_the_crossing() -> None:
    pixels = np.array([[200.0, 200.0], [400.0, 300.0], [200.0, 300.0], [400.0, 200.0]])
    depths = np.array([2.0, 2.0, 4.0, 4.0])
    parts = explained(image_view(pixels, depths, segments=np.array([[0, 1], [2, 3]])))
    inverse = np.sort(parts.image.vertices.inverse)
    np.testing.assert_allclose(inverse, [0.25, 0.25, 0.5, 0.5, 0.5])


def test_segments_are_drawn_although_no_patch_beside_them_is_a_surface() -> None:
    pixels = np.array([[100.0, 240.0], [540.0, 240.0], [320.0, 20.0], [320.0, 460.0]])
    view = image_view(pixels, np.full(4, 3.0), segments=np.array([[0, 1]]))
    parts = explained(view, uncertainty="none")
    grid = mapper().grid
    for left in np.linspace(-2.0, 2.0, 41):
        assert said_at(parts, np.array([3.0, left, 1.2]), grid) == 1.0


def test_the_robot_stands_in_free_space() -> None:
    used, view = mapper(), wall(3.0)
    used.integrate(view)
    assert used.grid.confidence_at((0.0, -0.3, 0.4)) == -1.0
    flying = view.rig.T_base_camera.copy()
    flying[2, 3] = 5.0
    high = View(
        T_map_base=np.eye(4),
        rig=StereoRig(fx=300.0, fy=300.0, cx=320.0, cy=240.0, baseline=0.3, T_base_camera=flying),
        points=view.points,
        plane=view.plane,
    )
    assert len(standing_room(high, used.grid, used.settings)) == 0


# Bad input


def test_views_without_a_ground_plane_are_mapped() -> None:
    view = wall(3.0)
    used = mapper()
    used.integrate(hovering(view))
    assert used.grid.confidence_at((1.5, 0.3, 1.2)) == -1.0
    assert len(used.grid.planes) == 0


def test_cameras_that_look_up_or_down_are_mapped() -> None:
    for angle in (-np.pi / 2, np.pi / 2):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix()
        used = mapper()
        view = wall(3.0)
        used.integrate(View(T_map_base=pose, rig=view.rig, points=view.points))
        eye = (pose @ view.rig.T_base_camera)[:3]
        assert used.grid.confidence_at(eye[:, 3] + 1.5 * eye[:, 2]) == -1.0


def test_features_outside_every_image_are_dropped_and_counted() -> None:
    view = wall(3.0)
    aside = Features.points([(30.0, 0.0, 0.5), (0.5, 9.0, 0.1)], [1e-4 * np.eye(3)] * 2)
    parts = explained(View(T_map_base=np.eye(4), rig=view.rig, points=aside))
    assert parts.features.dropped["outside_image"] == 2
    assert not parts.evidence.z.any()


def test_a_rig_that_sees_almost_a_half_space_is_mapped() -> None:
    rng = np.random.default_rng(8)
    directions = rng.normal(size=(400, 3)) * (1.0, 1.0, 0.3)
    directions[:, 2] = np.abs(directions[:, 2])
    xyz = 4.0 * directions / np.linalg.norm(directions, axis=1)[:, None]
    features = Features.points(xyz, np.tile(1e-4 * np.eye(3), (len(xyz), 1, 1)))
    used = mapper(narrowest_footprint=3.0, resolution=0.3)
    used.integrate(View(T_map_base=np.eye(4), rig=image_rig(), points=features))
    assert used.stats.features_dropped["outside_image"] > 0
    assert used.grid.confidence_at((2.0, 0.0, 1.2)) == -1.0


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_few_features_or_features_on_a_line_are_surfaces_but_grant_nothing(count: int) -> None:
    pixels = np.column_stack([np.linspace(100.0, 500.0, count), np.full(count, 240.0)])
    view = image_view(pixels.reshape(-1, 2), np.full(count, 3.0))
    bare = hovering(view)
    evidence = explained(bare).evidence
    assert (evidence.z > 0).any() == (count > 0)
    assert not (evidence.z < 0).any()


def test_a_frustum_larger_than_memory_names_the_settings() -> None:
    with pytest.raises(InputError, match=r"resolution: expected one that cuts a view .* max_range"):
        GroundMapper(mode="3d", resolution=0.01).explain(wall(18.0, spacing=100.0))


def test_a_pose_too_far_away_is_refused() -> None:
    view = wall(3.0)
    pose = np.eye(4)
    pose[0, 3] = 1e9
    with pytest.raises(InputError, match="T_map_base: expected a position within"):
        explained(View(T_map_base=pose, rig=view.rig, points=view.points))
