"""What hypothesis makes up: point clouds with segments, rooms seen from inside, whole views."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from groundmap import StereoRig, View
from groundmap.arrays import Floats, Ints
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.view.frames import T_REP103_OPTICAL
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.view import Features


def rngs() -> st.SearchStrategy[np.random.Generator]:
    """Generators for coordinates in general position, where special values would only mislead."""
    return st.integers(0, 2**32 - 1).map(np.random.default_rng)


# Points and segments in the plane


class Cloud(NamedTuple):
    points: Floats  #: shape (n, 2)
    segments: Ints  #: shape (m, 2), rows of `points`


@st.composite
def clouds(draw: st.DrawFn, kind: str | None = None) -> Cloud:
    """Points and segments that cross, overlap, touch or nearly coincide, by kind."""
    kind = kind or draw(st.sampled_from(sorted(_CLOUDS)))
    return draw(_CLOUDS[kind])


@st.composite
def _generic(draw: st.DrawFn) -> Cloud:
    rng = draw(rngs())
    points = rng.uniform(-10.0, 10.0, size=(rng.integers(2, 40), 2))
    return _with_segments(draw, points)


@st.composite
def _on_lattice(draw: st.DrawFn, pitch: float) -> Cloud:
    node = st.tuples(st.integers(0, 6), st.integers(0, 6))
    points = np.array(draw(st.lists(node, min_size=2, max_size=20)), dtype=np.float64)
    return _with_segments(draw, points * pitch)


@st.composite
def _near_duplicates(draw: st.DrawFn) -> Cloud:
    rng = draw(rngs())
    points = rng.uniform(-3.0, 3.0, size=(rng.integers(2, 10), 2))
    twins = points + rng.uniform(-7e-4, 7e-4, size=points.shape)
    strangers = points + rng.uniform(-3e-3, 3e-3, size=points.shape)
    return _with_segments(draw, np.concatenate([points, twins, strangers]))


@st.composite
def _collinear(draw: st.DrawFn) -> Cloud:
    rng = draw(rngs())
    along = rng.uniform(-8.0, 8.0, size=rng.integers(2, 15))
    angle = rng.uniform(-np.pi, np.pi)
    points = along[:, None] * (np.cos(angle), np.sin(angle)) + rng.uniform(-5.0, 5.0, size=2)
    return _with_segments(draw, points)


@st.composite
def _t_junctions(draw: st.DrawFn) -> Cloud:
    """Segments that end on others, as far as rounding lets them."""
    rng = draw(rngs())
    ends = rng.uniform(-5.0, 5.0, size=(rng.integers(1, 6), 2, 2))
    share = rng.uniform(size=(len(ends), 1))
    on = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    off = rng.uniform(-5.0, 5.0, size=on.shape)
    points = np.concatenate([ends.reshape(-1, 2), on, off])
    whole = np.arange(2 * len(ends)).reshape(-1, 2)
    stems = np.arange(2 * len(ends), 4 * len(ends)).reshape(2, -1).T
    return Cloud(points, np.concatenate([whole, stems]))


def _with_segments(draw: st.DrawFn, points: Floats) -> Cloud:
    row = st.integers(0, len(points) - 1)
    pairs = draw(st.lists(st.tuples(row, row), max_size=12))
    return Cloud(points, np.array(pairs, dtype=np.int64).reshape(-1, 2))


_CLOUDS = {
    "generic": _generic(),
    "lattice": _on_lattice(1.0),
    "tenths": _on_lattice(0.1),
    "thirds": _on_lattice(1.0 / 3.0),
    "near_duplicates": _near_duplicates(),
    "collinear": _collinear(),
    "t_junctions": _t_junctions(),
}


# Surfaces around a viewpoint at the origin


@st.composite
def rooms(draw: st.DrawFn) -> Cloud:
    """Points and segments around the origin: crossing, behind, radial, through the viewpoint."""
    rng = draw(rngs())
    count = int(rng.integers(0, 12))
    ends = rng.uniform(-10.0, 10.0, size=(count, 2, 2))
    short = rng.uniform(size=count) < 0.5
    ends[short, 1] = ends[short, 0] + rng.normal(size=(int(short.sum()), 2))
    extra = [np.empty((0, 2, 2))]
    if draw(st.booleans()):  # seen end-on
        ray = rng.normal(size=2)
        extra.append(np.array([[ray, 2.0 * ray]]))
    if draw(st.booleans()):  # through the viewpoint
        ray = rng.normal(size=2)
        extra.append(np.array([[-3.0 * ray, 2.0 * ray]]))
    if draw(st.booleans()):  # across the seam
        extra.append(np.array([[(-rng.uniform(1.0, 9.0), 2.0), (-rng.uniform(1.0, 9.0), -1.0)]]))
    if draw(st.booleans()):  # all around
        extra.append(_around(rng))
    ends = np.concatenate([ends, *extra])
    lone = rng.uniform(-10.0, 10.0, size=(int(rng.integers(0, 6)), 2))
    lone = lone[np.hypot(*lone.T) > 0.5]
    segments = np.arange(2 * len(ends)).reshape(-1, 2)
    return Cloud(np.concatenate([ends.reshape(-1, 2), lone]), segments)


def _around(rng: np.random.Generator) -> Floats:
    bearings = np.sort(rng.uniform(-np.pi, np.pi, size=8))
    bearings = np.concatenate([bearings, np.arange(-3, 4)])  # no gap of a half turn
    bearings.sort()
    radius = rng.uniform(4.0, 8.0, size=len(bearings))
    corners = radius[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def flat_view(
    points: npt.ArrayLike = (),
    segments: npt.ArrayLike = (),
    *,
    heights: npt.ArrayLike = 1.0,
    covariance: npt.ArrayLike = 0.0,
    supports: npt.ArrayLike = (),
    support_heights: npt.ArrayLike = 0.0,
    camera_height: float = 1.0,
    drop_offs: npt.ArrayLike = (),
    drop_off_heights: npt.ArrayLike = -1.0,
    drop_off_sureness: float = 1.0,
    border: float = np.inf,
    baseline: float = 0.0,
    viewpoint: tuple[float, float] = (0.0, 0.0),
    forward: tuple[float, float] = (1.0, 0.0),
) -> GroundView:
    """Build a view by hand; a covariance is a variance in all directions, or matrices.

    Its images have no borders unless they are given.
    """
    xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    ground = np.asarray(supports, dtype=np.float64).reshape(-1, 2)
    below = np.asarray(drop_offs, dtype=np.float64).reshape(-1, 2)
    spread = np.asarray(covariance, dtype=np.float64)
    if spread.ndim < 2:
        spread = spread[..., None, None] * np.eye(2)
    feature = np.arange(len(xy) + len(ground))
    for a, b in np.asarray(segments, dtype=np.int64).reshape(-1, 2).tolist():
        feature[b] = feature[a]  # both ends are of one feature
    return GroundView(
        viewpoint=np.array(viewpoint),
        base=np.empty((0, 2)),  # no wheels
        forward=np.array(forward),
        camera_height=camera_height,
        border=border,
        baseline=baseline,
        points=xy,
        covariance=np.broadcast_to(spread, (len(xy), 2, 2)).copy(),
        heights=np.broadcast_to(np.asarray(heights, dtype=np.float64), len(xy)).copy(),
        segments=np.asarray(segments, dtype=np.int64).reshape(-1, 2),
        supports=ground,
        support_heights=np.broadcast_to(
            np.asarray(support_heights, dtype=np.float64), len(ground)
        ).copy(),
        feature=feature,
        drop_offs=below,
        drop_off_heights=np.broadcast_to(
            np.asarray(drop_off_heights, dtype=np.float64), len(below)
        ).copy(),
        drop_off_sureness=np.full(len(below), drop_off_sureness),
        used=len(xy) + len(ground),
        dropped=Counter(),
    )


# Views

MOUNT_HEIGHT = 1.0


def rig(*, mounted: bool) -> StereoRig:
    """A stereo rig on its own, or on a base on the ground below it."""
    T_base_camera = np.eye(4)
    if mounted:
        T_base_camera = T_REP103_OPTICAL.copy()
        T_base_camera[:3, 3] = 0.2, 0.06, MOUNT_HEIGHT
    return StereoRig(
        fx=700.0, fy=700.0, cx=640.0, cy=360.0, baseline=0.12, T_base_camera=T_base_camera
    )


def pose(x: float, y: float, yaw: float, *, mounted: bool, height: float = 0.0) -> Floats:
    """T_map_base at a place in the map; the base is the camera itself unless it is mounted."""
    T_map_base = np.eye(4)
    T_map_base[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T_map_base[:3, 3] = x, y, height
    return T_map_base if mounted else T_map_base @ T_REP103_OPTICAL


def pixels_of(stereo: StereoRig, xyz: Floats) -> Floats:
    """Project points in the camera frame, shape (..., 3), to (uL, uR, v)."""
    x, y, z = np.moveaxis(xyz, -1, 0)
    left = stereo.fx * x / z + stereo.cx
    right = stereo.fx * (x - stereo.baseline) / z + stereo.cx
    return np.stack([left, right, stereo.fy * y / z + stereo.cy], axis=-1)


def level_view(
    *,
    points: npt.ArrayLike = (),
    segments: npt.ArrayLike = (),
    sigma: float = 0.0,
    camera_height: float = 1.0,
    sigma_tilt: float = 0.0,
) -> View:
    """View of features given by (forward, left, height above ground) from a level camera."""
    stereo = rig(mounted=False)
    level = GroundPlane.below_camera(stereo, camera_height)
    return View(
        T_map_base=pose(0.0, 0.0, 0.0, mounted=False),
        rig=stereo,
        points=_features(np.asarray(points, dtype=np.float64).reshape(-1, 3), sigma, level.offset),
        segments=_features(
            np.asarray(segments, dtype=np.float64).reshape(-1, 2, 3), sigma, level.offset
        ),
        plane=replace(level, sigma_tilt=sigma_tilt),
    )


def _features(places: Floats, sigma: float, camera_height: float) -> Features:
    forward, left, height = np.moveaxis(places, -1, 0)
    xyz = np.stack([-left, camera_height - height, forward], axis=-1)
    covariance = np.broadcast_to(sigma**2 * np.eye(3), (*xyz.shape, 3))
    return Features(xyz, covariance.copy(), np.full(len(xyz), -1, dtype=np.int64))


@st.composite
def views(draw: st.DrawFn) -> View:
    """A view of obstacles, ground and a few strays 1 m to 20 m ahead, in general position."""
    rng, mounted = draw(rngs()), draw(st.booleans())
    height = MOUNT_HEIGHT if mounted else float(rng.uniform(0.6, 1.6))
    return random_view(rng, mounted=mounted, camera_height=height)


def random_view(rng: np.random.Generator, *, mounted: bool, camera_height: float) -> View:
    """Build a view of a camera that leans a little from points and segments around it."""
    stereo = rig(mounted=mounted)
    points = _ahead(rng, int(rng.integers(0, 25)), camera_height, 0.2, 1.9)
    ground = _ahead(rng, int(rng.integers(0, 25)), camera_height, -0.05, 0.05)
    strays = _ahead(rng, int(rng.integers(0, 6)), camera_height, -2.0, 4.0)
    starts = _ahead(rng, int(rng.integers(0, 8)), camera_height, 0.0, 2.2)
    stops = starts + rng.normal(scale=(1.0, 0.3, 1.0), size=starts.shape)
    stops[:, 2] = np.maximum(stops[:, 2], 0.5)
    seen = stereo.triangulate(pixels_of(stereo, np.concatenate([points, ground, strays])))
    lines = stereo.triangulate(pixels_of(stereo, np.stack([starts, stops], axis=1)))
    x, y, yaw = rng.uniform((-30.0, -30.0, -np.pi), (30.0, 30.0, np.pi))
    return View(
        T_map_base=pose(x, y, yaw, mounted=mounted) @ _lean(rng),
        rig=stereo,
        points=Features.points(seen.xyz, seen.covariance),
        segments=Features.segments(lines.xyz, lines.covariance),
        plane=GroundPlane.below_camera(stereo, camera_height),
    )


def _lean(rng: np.random.Generator) -> Floats:
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_rotvec(rng.normal(scale=0.03, size=3)).as_matrix()
    return transform


def _ahead(
    rng: np.random.Generator, count: int, camera_height: float, low: float, high: float
) -> Floats:
    """Points within 45 degrees of the optical axis, heights above ground from low to high."""
    depth = rng.uniform(1.0, 16.0, size=count)
    side = depth * rng.uniform(-1.0, 1.0, size=count)
    return np.stack([side, camera_height - rng.uniform(low, high, size=count), depth], axis=1)
