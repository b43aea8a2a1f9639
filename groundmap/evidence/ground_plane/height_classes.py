"""Features of one view by height class, projected to the ground frame of the view.

The frame ``view`` has its origin below the left camera, x along the optical axis, y left. All steps
for one view (triangulation, visibility) use this frame, and only the last one transforms to the
map. The evidence of a view is thus independent of its pose.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.ground_plane.intervals import inside_circle, where_positive
from groundmap.settings import MapperSettings
from groundmap.view.camera_check import check_camera, check_plane
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.view import Features, View, sigma_along

UNSURE = 2.0  # standard deviations that must not reach from a feature to the camera
HOLLOW = 0.02  # [m per m of range], added to the depth that is traversable


class GroundView(NamedTuple):
    """The features of one view in its ground frame, by height class."""

    viewpoint: Floats  #: shape (2,) [m, map]
    base: Floats  #: shape (k, 2) [m, view], place of the base; none without features
    forward: Floats  #: shape (2,), unit vector [map]: x of the frame ``view``
    camera_height: float  #: [m] above the ground plane
    border: float  #: tangent of the bearing of the left image's borders
    baseline: float  #: [m]
    points: Floats  #: shape (n, 2) [m, view], obstacle points and ends of obstacle segments
    covariance: Floats  #: shape (n, 2, 2) [m², view]
    heights: Floats  #: shape (n,) [m] above the ground plane
    segments: Ints  #: shape (m, 2), rows of `points`
    supports: Floats  #: shape (k, 2) [m, view], ground features
    support_heights: Floats  #: shape (k,) [m]
    feature: Ints  #: shape (n + k,), number in the view of each point's and support's feature
    drop_offs: Floats  #: shape (b, 2) [m, view], features below the ground
    drop_off_heights: Floats  #: shape (b,) [m], below 0
    drop_off_sureness: Floats  #: shape (b,), confidence from 0 to 1, increasing with depth
    used: int  #: number of features in any of the above
    dropped: Counter[str]  #: number of other features, by reason

    def to_map(self, xy: Floats) -> Floats:
        """Return places, shape (..., 2) [m, view], in the map [m, map]."""
        x, y = xy[..., 0], xy[..., 1]
        cos, sin = self.forward
        turned: Floats = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return self.viewpoint + turned


class _Heights(NamedTuple):
    """Measured features, shapes (n, ...) for points or (m, 2, ...) for segments."""

    xy: Floats
    covariance: Floats
    height: Floats
    tolerance: Floats
    radius: Floats  # horizontal distance from the camera [m]
    sigma: Floats  # standard deviation of the position in its least certain direction [m]
    feature: Ints  # number in the view, points first

    def at(self, t: Floats) -> _Heights:
        """Interpolate along segments at `t`, shape (m, j): 0 at the first end, 1 at the second."""

        def blend(ends: Floats) -> Floats:
            weight = t.reshape(*t.shape, *(1,) * (ends.ndim - 2))
            blended: Floats = ends[:, :1] * (1.0 - weight) + ends[:, 1:] * weight
            return blended

        xy = blend(self.xy)
        return _Heights(
            xy,
            blend(self.covariance),
            blend(self.height),
            blend(self.tolerance),
            np.hypot(xy[..., 0], xy[..., 1]),
            blend(self.sigma),
            np.broadcast_to(self.feature[:, :1], t.shape),
        )


def flatten(view: View, settings: MapperSettings, *, number: int | None = None) -> GroundView:
    """Return the features of a view, projected to its ground plane and classified by height.

    Ground features lie within max(step_height, 2 sigma_h + r sigma_tilt) of the plane. Obstacle
    features lie above, up to the height of the robot. Higher features are overhead, lower ones
    below ground. Segments are clipped to the obstacle band. Features of unknown
    depth are dropped: those within two standard deviations of the camera.

    Parameters
    ----------
    view : View
    settings : MapperSettings
    number : int, optional
        Index of the view in its log, for error messages.

    Raises
    ------
    NoGroundPlaneError
        The view has no plane, the plane is not below the camera, or the camera points at the
        ground or the sky.
    """
    check_plane(view, number=number)
    check_camera(view, number=number)
    assert view.plane is not None
    plane = view.plane
    T_map_camera = view.T_map_camera
    forward = T_map_camera[:2, 2] / np.hypot(T_map_camera[0, 2], T_map_camera[1, 2])
    dropped = Counter(view.dropped)
    points = _measure(view.points, view, plane, forward, settings)
    parts = [_point_classes(points, settings, dropped)]
    if len(view.segments):  # most logs have none
        lasting = (view.segments.xyz[:, 0] != view.segments.xyz[:, 1]).any(axis=1)
        dropped["zero_length"] += int((~lasting).sum())
        segments = _measure(view.segments.select(lasting), view, plane, forward, settings)
        segments.feature[...] += len(view.points)
        parts.append(_segment_classes(segments, settings, dropped))
    obstacles, grounds = [part.obstacles for part in parts], [part.ground for part in parts]
    n_points = len(obstacles[0].xy)
    ends = np.arange(n_points, sum(len(part.xy) for part in obstacles), dtype=np.int64)
    used = sum(part.used for part in parts)
    return GroundView(
        viewpoint=T_map_camera[:2, 3],
        base=_in_view(view.T_map_base[:2, 3] - T_map_camera[:2, 3], forward)[None][: min(used, 1)],
        forward=forward,
        camera_height=float(plane.height(view.rig.T_base_camera[:3, 3])),
        border=view.rig.cx / view.rig.fx if view.rig.cx > 0 else np.inf,
        baseline=view.rig.baseline,
        points=np.concatenate([part.xy for part in obstacles]),
        covariance=np.concatenate([part.covariance for part in obstacles]),
        heights=np.concatenate([part.height for part in obstacles]),
        segments=ends.reshape(-1, 2),
        supports=np.concatenate([part.xy for part in grounds]),
        support_heights=np.concatenate([part.height for part in grounds]),
        feature=np.concatenate([part.feature for part in (*obstacles, *grounds)]),
        drop_offs=np.concatenate([part.below[:, :2] for part in parts]),
        drop_off_heights=np.concatenate([part.below[:, 2] for part in parts]),
        drop_off_sureness=np.concatenate([part.below[:, 3] for part in parts]),
        used=used,
        dropped=+dropped,
    )


def _in_view(offset: Floats, forward: Floats) -> Floats:
    """Rotate a vector of the map, shape (2,) [m], into the frame ``view``."""
    ahead = forward[0] * offset[0] + forward[1] * offset[1]
    left = forward[0] * offset[1] - forward[1] * offset[0]
    return np.array([ahead, left])


def _measure(
    features: Features, view: View, plane: GroundPlane, forward: Floats, settings: MapperSettings
) -> _Heights:
    rotation = view.T_map_camera[:2, :3]
    # The order of the terms keeps results equal under quarter turns of the map.
    axes = np.stack(
        [
            forward[0] * rotation[0] + forward[1] * rotation[1],
            forward[0] * rotation[1] - forward[1] * rotation[0],
        ]
    )
    x, y, z = np.moveaxis(features.xyz, -1, 0)
    xy = np.stack([row[0] * x + row[1] * y + row[2] * z for row in axes], axis=-1)
    radius = np.hypot(xy[..., 0], xy[..., 1])
    up = view.rig.T_base_camera[:3, :3].T @ plane.normal
    if plane.strip is None:
        height = up[0] * x + up[1] * y + up[2] * z
        height += float(plane.height(view.rig.T_base_camera[:3, 3]))
    else:
        T_base_camera = view.rig.T_base_camera
        height = plane.height(features.xyz @ T_base_camera[:3, :3].T + T_base_camera[:3, 3])
    sigma = sigma_along(up, features.covariance)
    tolerance = np.maximum(settings.step_height, 2.0 * sigma + radius * plane.sigma_tilt)
    # Both ends of a segment get its number.
    number = np.arange(len(features)).reshape(-1, *(1,) * (radius.ndim - 1)) + np.zeros_like(
        radius, dtype=np.int64
    )
    # The trace of a covariance lies between its largest variance and three times that.
    with np.errstate(over="ignore"):
        trace = np.trace(features.covariance, axis1=-2, axis2=-1)
    spread = np.sqrt(np.maximum(trace, 0.0))
    return _Heights(
        xy, axes @ features.covariance @ axes.T, height, tolerance, radius, spread, number
    )


class _Classes(NamedTuple):
    obstacles: _Heights
    ground: _Heights
    below: Floats  # shape (b, 4): position, height and confidence
    used: int


def _point_classes(points: _Heights, settings: MapperSettings, dropped: Counter[str]) -> _Classes:
    near = points.radius < settings.min_range
    far = points.radius > settings.max_range
    unsure = ~near & ~far & _is_unsure(points)
    inside = ~near & ~far & ~unsure
    overhead = inside & (points.height > settings.robot_height)
    below = inside & (points.height < -points.tolerance)
    ground = inside & ~overhead & (np.abs(points.height) <= points.tolerance)
    obstacle = inside & ~overhead & ~below & ~ground
    dropped.update(
        too_near=int(near.sum()),
        out_of_range=int(far.sum()),
        too_uncertain=int(unsure.sum()),
        overhead=int(overhead.sum()),
    )
    dropped["below_ground"] += int(below.sum())
    return _Classes(
        _pick(points, obstacle),
        _pick(points, ground),
        _drop_offs(_pick(points, below), settings),
        int(obstacle.sum() + ground.sum()),
    )


def _is_unsure(features: _Heights) -> Bools:
    """Return which features may as well be at the camera: nothing is known of their depth."""
    unsure: Bools = UNSURE * features.sigma > features.radius
    return unsure


def _segment_classes(
    segments: _Heights, settings: MapperSettings, dropped: Counter[str]
) -> _Classes:
    """Split segments into an obstacle piece and a ground piece, each of which may be empty."""
    unsure: Bools = np.logical_or.reduce(_is_unsure(segments), axis=1)
    dropped["too_uncertain"] += int(unsure.sum())
    segments = _pick(segments, ~unsure)
    reached = inside_circle(segments.xy[:, 0], segments.xy[:, 1], settings.max_range)
    over_step = segments.height - segments.tolerance
    over_hole = segments.height + segments.tolerance
    below_top = settings.robot_height - segments.height
    # All of these are linear along the segment.
    obstacle = reached.cut(where_positive(*over_step.T)).cut(where_positive(*below_top.T))
    ground = reached.cut(where_positive(*over_hole.T)).cut(where_positive(*-over_step.T))
    used = obstacle.any | ground.any
    below = reached.any & ~used & (over_hole.min(axis=1) < 0)
    dropped["out_of_range"] += int((~reached.any).sum())
    dropped["below_ground"] += int(below.sum())
    dropped["overhead"] += int((reached.any & ~used & ~below).sum())
    pieces = _pick(segments, obstacle.any).at(np.stack(obstacle, axis=1)[obstacle.any])
    return _Classes(
        _each(pieces, lambda field: field.reshape(-1, *field.shape[2:])),
        _sample_segments(
            _pick(segments, ground.any), np.stack(ground, axis=1)[ground.any], settings
        ),
        _drop_offs(_each(_pick(segments, below), lambda ends: ends.mean(axis=1)), settings),
        int(used.sum()),
    )


def _drop_offs(below: _Heights, settings: MapperSettings) -> Floats:
    """Return position, height and confidence of features below the ground, shape (b, 4).

    The error of the plane increases with the range, and hollows of the depth of a step are
    traversable. The confidence is 0 up to these depths, and reaches 1 a step height deeper.
    """
    allowed = np.maximum(below.tolerance, settings.step_height + HOLLOW * below.radius)
    sureness = np.clip((-below.height - allowed) / settings.step_height, 0.0, 1.0)
    return np.column_stack([below.xy, below.height, sureness])


def _sample_segments(segments: _Heights, spans: Floats, settings: MapperSettings) -> _Heights:
    """Return points along ground segments, at most `support_width` apart."""
    ends = segments.at(spans)
    length = np.hypot(*(ends.xy[:, 1] - ends.xy[:, 0]).T)
    counts = np.ceil(length / settings.support_width).astype(np.int64) + 1
    rows = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    fraction = step / np.maximum(counts[rows] - 1, 1)
    t = spans[rows, 0] + fraction * (spans[rows, 1] - spans[rows, 0])
    samples = _each(_pick(segments, rows).at(t[:, None]), lambda field: field[:, 0])
    return _pick(samples, samples.radius >= settings.min_range)


def _pick(heights: _Heights, rows: Bools | Ints) -> _Heights:
    return _each(heights, lambda field: field[rows])


def _each(heights: _Heights, change: Callable[[Any], Any]) -> _Heights:
    return _Heights(*map(change, heights))
