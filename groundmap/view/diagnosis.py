"""Diagnosis of common mistakes in logs, from implausible features and poses.

A likely mistake is reported only if the data are implausible as given. For poses, another
interpretation of them must also fit the landmarks far better.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.errors import GroundmapError, NoGroundPlaneError
from groundmap.view.camera_check import camera_fault, check_camera
from groundmap.view.frames import T_REP103_OPTICAL, from_quaternion, invert, to_quaternion
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View

SAMPLE = 20  # views of a log that are examined
FEWEST = 50  # features that a statement about features needs
FARTHEST_MEDIAN = 200.0  # [m], median depth; features of a ground robot are nearer
LARGEST_BASELINE = 5.0  # [m]
WIDEST_MEDIAN = 4.0  # median tangent of the angle off the optical axis: 76 degrees
NORMALISED_SPAN_PX = 2.0  # of coordinates divided by the focal length or the image size
CLEARLY_BETTER = 4.0  # ratio of the disagreements of two clearly different interpretations
LAG = 3  # views between the two observations of a landmark that are compared
FEWEST_SHARED = 5  # landmarks that two views share
SIMILAR = 1.05  # ratio of two disagreements that count as equal
AHEAD_TIE = 0.1  # difference of two cosines that count as equal

# Returns T_map_base and T_base_camera as they would be in another interpretation of a log.
Interpretation = Callable[[Floats, Floats], tuple[Floats, Floats]]


def likely_mistakes(views: Sequence[View]) -> list[str]:
    """Return a sentence for each likely mistake in a log, with the expected input.

    Parameters
    ----------
    views : sequence of View
        The first views of a log; `SAMPLE` are enough.
    """
    sentences = [*_feature_mistakes(views), *_pose_mistakes(views)] if views else []
    return [f"Likely cause: {sentence}" for sentence in sentences]


def upright_views(views: Iterable[View], *, causal: bool = False) -> Iterator[tuple[int, View]]:
    """Yield views with their index, after a check of the camera's attitude.

    Parameters
    ----------
    views : iterable of View
    causal : bool, default False
        Whether to diagnose a refused view without reading the views after it.

    Raises
    ------
    NoGroundPlaneError
        A camera looks at the ground or the sky; the message gives the likely cause.
    """
    source = iter(views)
    for number, view in enumerate(source):
        try:
            check_camera(view, number=number)
        except NoGroundPlaneError as error:
            causes = likely_mistakes([view] if causal else [view, *_readable(source)])
            raise NoGroundPlaneError(" ".join([str(error), *causes])) from None
        yield number, view


def _readable(source: Iterator[View]) -> list[View]:
    """Return the next views for a diagnosis, up to the first that cannot be read."""
    views: list[View] = []
    with suppress(GroundmapError):
        views.extend(islice(source, SAMPLE - 1))
    return views


def describe_dropped(dropped: Counter[str]) -> str:
    """Return the numbers of dropped features by reason as text, largest first.

    Examples
    --------
    >>> describe_dropped(Counter(overhead=3, no_disparity=5200))
    '5,200 no_disparity, 3 overhead'
    """
    return ", ".join(f"{count:,} {reason}" for reason, count in dropped.most_common() if count)


def _feature_mistakes(views: Sequence[View]) -> list[str]:
    dropped = sum((view.dropped for view in views), Counter[str]())
    total = sum(len(view.points) + len(view.segments) for view in views) + dropped.total()
    if total < FEWEST:
        return []
    if dropped["no_disparity"] > total / 2:
        return [
            f"uL - uR is not above 0 in {dropped['no_disparity']:,} of {total:,} features. uL and "
            "uR may be swapped, or columns (u) and rows (v)."
        ]
    if dropped["behind_camera"] > total / 2:
        return [
            f"z is not above 0 in {dropped['behind_camera']:,} of {total:,} features. XYZ may have "
            "other axes: expected x right, y down, z forward from the left camera."
        ]
    both = [part.xyz for view in views for part in (view.points, view.segments)]
    xyz = np.concatenate([part.reshape(-1, 3) for part in both])
    return _position_mistakes(xyz, views[0].rig) if len(xyz) >= FEWEST else []


def _position_mistakes(xyz: Floats, rig: StereoRig) -> list[str]:
    depth = float(np.median(xyz[:, 2]))
    x, y = (xyz[:, :2] / xyz[:, 2:]).T
    u, v = rig.fx * x + rig.cx, rig.fy * y + rig.cy
    if max(np.ptp(u), np.ptp(v)) < NORMALISED_SPAN_PX:
        return [
            f"the image coordinates of the features span {np.ptp(u):.2g} by {np.ptp(v):.2g} px. "
            "They may be normalised: expected pixels."
        ]
    off_axis = float(np.median(np.hypot(x, y)))
    if off_axis > WIDEST_MEDIAN:
        return [
            f"half of the features are {np.degrees(np.arctan(off_axis)):.0f} degrees or more off "
            f"the optical axis with fx = {rig.fx:g}, cx = {rig.cx:g}. The focal length may be in "
            "millimetres: expected pixels."
        ]
    if depth > FARTHEST_MEDIAN:
        return [f"half of the features are farther than {depth:,.0f} m. {_unit_advice(rig)}"]
    right, bottom = np.quantile(u, 0.95), np.quantile(v, 0.95)
    if 2 * rig.cx < right < 2 * rig.cy and bottom < min(rig.cy, 2 * rig.cx):
        return [
            f"nearly all features are above row cy = {rig.cy:g}, and many are beyond column 2 cx = "
            f"{2 * rig.cx:g}. cx and cy may be swapped."
        ]
    return []


def _unit_advice(rig: StereoRig) -> str:
    if rig.baseline <= LARGEST_BASELINE:
        return "XYZ or the baseline may be in another unit: expected metres."
    return (
        f"The baseline of {rig.baseline:g} m may be fx times the baseline (which would be "
        f"{rig.baseline / rig.fx:.4g} m) or in millimetres ({rig.baseline / 1000:.4g} m): expected "
        "the distance between the two cameras in metres."
    )


def _as_given(T_map_base: Floats, T_base_camera: Floats) -> tuple[Floats, Floats]:
    return T_map_base, T_base_camera


def _reorder_quaternion(T_world_base: Floats) -> Floats:
    """Return the pose from a quaternion w x y z that was read as x y z w."""
    x, y, z, w = to_quaternion(T_world_base)
    return from_quaternion(T_world_base[:3, 3], np.array([y, z, w, x]))


def _scale_millimetres(T_world_base: Floats) -> Floats:
    scaled = T_world_base.copy()
    scaled[:3, 3] /= 1000.0
    return scaled


def _in_world(change: Callable[[Floats], Floats], T_map_world: Floats) -> Interpretation:
    """Return the interpretation that changes poses in their world frame, before the map frame."""
    T_world_map = invert(T_map_world)
    return lambda T_map_base, T_base_camera: (
        T_map_world @ change(T_world_map @ T_map_base),
        T_base_camera,
    )


IN_WORLD: dict[str, Callable[[Floats], Floats]] = {
    "the quaternions of the poses may be in the order w x y z: expected rows of "
    "'timestamp tx ty tz qx qy qz qw'.": _reorder_quaternion,
    "the poses may transform world to camera coordinates: expected the pose of the body in the "
    "world, p_world = T_world_body @ p_body. Invert them.": invert,
    "the translations of the poses may be in millimetres: expected metres.": _scale_millimetres,
}
INTERPRETATIONS: list[tuple[str, Interpretation]] = [
    *(
        (sentence, _in_world(change, T_map_world))
        for sentence, change in IN_WORLD.items()
        for T_map_world in (np.eye(4), T_REP103_OPTICAL)
    ),
    (
        "the world frame of the poses may be 'rep103' (x forward, y left, z up), not 'optical'.",
        lambda T_map_base, T_base_camera: (invert(T_REP103_OPTICAL) @ T_map_base, T_base_camera),
    ),
    (
        "the world frame of the poses may be 'optical' (x right, y down, z forward), not 'rep103'.",
        lambda T_map_base, T_base_camera: (T_REP103_OPTICAL @ T_map_base, T_base_camera),
    ),
    (
        "T_base_camera may be inverted: expected the pose of the camera in base_link.",
        lambda T_map_base, T_base_camera: (T_map_base, invert(T_base_camera)),
    ),
    (
        "the poses may be those of the camera, not of base_link: then remove T_base_camera from "
        "the rig.",
        lambda T_map_base, T_base_camera: (T_map_base, np.eye(4)),
    ),
]


class _Plausibility(NamedTuple):
    """Measures of how plausible the poses are in one interpretation."""

    upright: bool  # whether the ground can be below every camera
    disagreement: float | None  # [m], median distance between two observations of a landmark
    ahead: float  # median cosine of the angle between optical axis and motion


class _SharedLandmarks(NamedTuple):
    """The nearer half of the landmarks that two views share."""

    first: int
    second: int
    xyz: tuple[Floats, Floats]  # [m, camera]


def _pose_mistakes(views: Sequence[View]) -> list[str]:
    shared = _shared_landmarks(views)
    given = _assess(views, shared, _as_given)
    if given.upright and given.disagreement is None:
        return []
    others = [(sentence, _assess(views, shared, other)) for sentence, other in INTERPRETATIONS]
    better = [(sentence, other) for sentence, other in others if _is_better(other, given)]
    if not better:
        return []
    best = min((other for _, other in better), key=_rank)
    tied = [sentence for sentence, other in better if _is_tied(other, best)]
    return [" Or ".join(dict.fromkeys(tied))]


def _is_better(other: _Plausibility, given: _Plausibility) -> bool:
    if not other.upright:
        return False
    if given.disagreement is None or other.disagreement is None:
        return not given.upright
    ratio = SIMILAR if not given.upright else 1.0 / CLEARLY_BETTER
    return other.disagreement < ratio * given.disagreement


def _rank(plausibility: _Plausibility) -> tuple[float, float]:
    return (plausibility.disagreement or 0.0, -plausibility.ahead)


def _is_tied(other: _Plausibility, best: _Plausibility) -> bool:
    if other.disagreement is None or best.disagreement is None:
        return other.ahead >= best.ahead - AHEAD_TIE
    return other.disagreement <= SIMILAR * best.disagreement


def _assess(
    views: Sequence[View], shared: Iterable[_SharedLandmarks], interpretation: Interpretation
) -> _Plausibility:
    cameras, upright = [], True
    for view in views:
        T_map_base, T_base_camera = interpretation(view.T_map_base, view.rig.T_base_camera)
        rig = replace(view.rig, T_base_camera=T_base_camera)
        upright = upright and not camera_fault(T_map_base, rig)
        cameras.append(T_map_base @ T_base_camera)
    distances = [_distance(cameras[pair.first], cameras[pair.second], pair.xyz) for pair in shared]
    moves = np.diff([camera[:3, 3] for camera in cameras], axis=0)
    axes = np.reshape([camera[:3, 2] for camera in cameras[:-1]], (-1, 3))
    with np.errstate(over="ignore"):  # poses of 1e200 m are longer than a float holds
        lengths = np.linalg.norm(moves, axis=1)
    cosines = (moves * axes).sum(axis=1)[lengths > 0] / lengths[lengths > 0]
    return _Plausibility(
        upright,
        float(np.median(distances)) if distances else None,
        float(np.median(cosines)) if len(cosines) else 0.0,
    )


def _distance(first: Floats, second: Floats, xyz: tuple[Floats, Floats]) -> float:
    """Return the median distance between positions seen from two camera poses [m]."""
    positions = [p @ T[:3, :3].T + T[:3, 3] for T, p in zip((first, second), xyz, strict=True)]
    return float(np.median(np.linalg.norm(positions[0] - positions[1], axis=1)))


def _shared_landmarks(views: Sequence[View]) -> list[_SharedLandmarks]:
    shared = []
    for first in range(len(views) - LAG):
        one, other = views[first].points, views[first + LAG].points
        ids, rows, others = np.intersect1d(one.ids, other.ids, return_indices=True)
        rows, others = rows[ids >= 0], others[ids >= 0]
        if len(rows) < FEWEST_SHARED:
            continue
        near = one.xyz[rows, 2] <= np.median(one.xyz[rows, 2])
        positions = (one.xyz[rows[near]], other.xyz[others[near]])
        shared.append(_SharedLandmarks(first, first + LAG, positions))
    return shared
