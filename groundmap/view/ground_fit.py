"""Fitting the ground: a plane per view, over a window of views, as a pass of its own."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_number
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.settings import GroundSettings
from groundmap.view.camera_check import check_plane
from groundmap.view.diagnosis import describe_dropped, likely_mistakes, upright_views
from groundmap.view.frames import invert
from groundmap.view.ground_plane import TILT_FLOOR, GroundPlane
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import View, sigma_along

REACH = 3.0  # [max_range], features farther from the camera are of another place
NOISE_FLOOR = 0.03  # [m], what even near features are off a real road's plane
TILTS = np.stack(
    np.meshgrid(
        np.tan(np.radians(np.arange(-10.0, 11.0, 2.0))), np.tan(np.radians((-6, -3, 0, 3, 6)))
    ),
    axis=-1,
).reshape(-1, 2)
SIGMA_TILT_OF_BASE = 0.02  # [rad], of base_link against the ground it stands on
BIN = 0.1  # [m], height bins of the search
TOLERANCES = (0.4, 0.3, 0.2, 0.15, 0.15, 0.15)  # [m], of the refinement's steps
GIVE_THE_GROUND = (
    "give the camera's height above the ground (camera_height=..., --camera-height), or "
    "T_base_camera in the rig, so that base_link tells where the ground is."
)
WORST_CONDITION = 1e12  # of the information matrix: beyond this, all features are on one line


def fit_ground(
    views: Iterable[View],
    *,
    plane: GroundPlane | None = None,
    camera_height: float | None = None,
    **settings: Any,
) -> Iterator[View]:
    """Return the views, each with the ground plane under it, as they are asked for.

    A plane is fitted to the features of a window of views around each view (behind it, with
    ``causal=True``), since planes of single views swing by degrees. Views are read as they are
    needed: no more than a window is held.

    Parameters
    ----------
    views : iterable of View
    plane : GroundPlane, optional
        Give every view this plane instead of fitting one.
    camera_height : float, optional [m]
        The same, as level ground that far below the camera.
    **settings
        `groundmap.settings.GroundSettings`: ``window`` [views], ``causal``, ``max_range`` [m], ...

    Returns
    -------
    iterator of View

    Raises
    ------
    NoGroundPlaneError
        A camera that looks at the ground or the sky; too few features on any plane below the
        camera. Where the window of a view has too few but an earlier one had enough, the plane
        is carried along with the base, with ``support=0``; where the rig is mounted
        (`T_base_camera` is given), ``base_link`` itself tells where the ground is.
    """
    options = GroundSettings(**settings)
    if camera_height is not None:
        expected = "a number above 0 [m]"
        camera_height = as_number("camera_height", camera_height, expected, above=0.0)
    if plane is not None and camera_height is not None:
        raise InputError("fit_ground", "plane or camera_height", "both")
    if plane is not None or camera_height is not None:
        return _with_given_plane(views, plane, camera_height, options)
    return _with_fitted_plane(views, options)


def _with_fitted_plane(views: Iterable[View], options: GroundSettings) -> Iterator[View]:
    last: GroundPlane | None = None
    for number, (view, window) in enumerate(_windows(views, options)):
        last = _fit(view, window, options) or last
        if last is None:
            last = _ground_of_base(view, window, options)
        yield _standing(view, last, number)
        last = GroundPlane(normal=last.normal, offset=last.offset, sigma_tilt=last.sigma_tilt)


def _with_given_plane(
    views: Iterable[View],
    plane: GroundPlane | None,
    camera_height: float | None,
    options: GroundSettings,
) -> Iterator[View]:
    for number, view in upright_views(views, causal=options.causal):
        below = plane or GroundPlane.below_camera(view.rig, camera_height or 0.0)
        yield _standing(view, below, number)


def _standing(view: View, plane: GroundPlane, number: int) -> View:
    """Return the view on a plane, however it was found: none is at or above the camera."""
    standing = view.with_plane(plane)
    check_plane(standing, number=number)
    return standing


class _Seen(NamedTuple):
    """A view and its features as the fit reads them."""

    view: View
    points: Floats  # (n, 3) [m, map]
    sigmas: Floats  # (n,) [m], standard deviation of the height


def _see_ground(view: View, options: GroundSettings) -> _Seen:
    segments = view.segments
    xyz = np.concatenate([view.points.xyz, segments.xyz.reshape(-1, 3)])
    covariance = np.concatenate([view.points.covariance, segments.covariance.reshape(-1, 3, 3)])
    near = np.hypot(xyz[:, 0], xyz[:, 2]) <= options.max_range
    T_map_camera = view.T_map_camera
    points = xyz[near] @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    up = T_map_camera[2, :3]
    return _Seen(view, points, sigma_along(up, covariance[near]))


def _windows(views: Iterable[View], options: GroundSettings) -> Iterator[tuple[View, list[_Seen]]]:
    """Yield each view with the views around it (or before it), holding one window at a time."""
    ahead = 0 if options.causal else options.window // 2
    behind = options.window - 1 - ahead
    held: deque[_Seen] = deque()
    here = 0  # index in `held` of the next view to hand out
    read = (_see_ground(view, options) for _, view in upright_views(views, causal=options.causal))
    for seen in _then_nothing(read, times=ahead):
        if seen is not None:
            held.append(seen)
        if here < len(held) and (seen is None or len(held) - here > ahead):
            yield held[here].view, list(held)
            here += 1
            if here > behind:
                held.popleft()
                here -= 1


def _then_nothing(items: Iterable[_Seen], *, times: int) -> Iterator[_Seen | None]:
    """Yield the items, then None: the last views have fewer ahead of them."""
    yield from items
    for _ in range(times):
        yield None


class _Cloud(NamedTuple):
    """The features of a window that may be ground, in axes level with the base."""

    points: Floats  # (n, 3) [m], forward, left and up of the camera
    sigmas: Floats  # (n,) [m]
    weights: Floats  # (n,) [1/m²]


def _fit(view: View, window: list[_Seen], options: GroundSettings) -> GroundPlane | None:
    """Return the plane under `view`, or None where too few features lie on one.

    Its distance from the camera is within ``lowest_camera`` and ``highest_camera``.
    """
    cloud = _cloud(view, window, options)
    if len(cloud.points) < options.min_support:
        return None
    plane = _search(cloud.points, np.sqrt(cloud.weights), options)
    if plane is None:
        return None
    for tolerance in TOLERANCES:
        refined = _refine(cloud, plane, tolerance, options.min_support)
        if refined is None:
            return None
        plane, information, support = refined
    a, b, c = plane
    up = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    normal = _level_axes(view.rig).T @ up
    normal /= np.linalg.norm(normal)
    tilt = np.sqrt(np.diag(np.linalg.inv(information))[:2].sum())
    camera_height = -c * up[2]
    # The features are below the camera, but a plane through them may rise above it on the way here.
    if not options.lowest_camera <= camera_height <= options.highest_camera:
        return None
    return GroundPlane(
        normal=normal,
        offset=float(camera_height - normal @ view.rig.T_base_camera[:3, 3]),
        sigma_tilt=float(np.hypot(tilt, TILT_FLOOR)),
        support=support,
    )


def _cloud(view: View, window: list[_Seen], options: GroundSettings) -> _Cloud:
    T_base_map = invert(view.T_map_base)
    points = np.concatenate([seen.points for seen in window]) @ T_base_map[:3, :3].T
    points += T_base_map[:3, 3] - view.rig.T_base_camera[:3, 3]
    level = points @ _level_axes(view.rig).T
    low = (-options.highest_camera < level[:, 2]) & (level[:, 2] < -options.lowest_camera)
    # Views that a jump of the poses carried far off say nothing about this place.
    low &= np.hypot(level[:, 0], level[:, 1]) <= REACH * options.max_range
    sigmas = np.concatenate([seen.sigmas for seen in window])[low]
    return _Cloud(level[low], sigmas, 1.0 / (sigmas**2 + NOISE_FLOOR**2))


def _refine(
    cloud: _Cloud, plane: Floats, tolerance: float, min_support: int
) -> tuple[Floats, Floats, int] | None:
    """Return a better plane (a, b, c: up = a forward + b left + c), its information and support.

    One step of iteratively reweighted least squares with Tukey's biweight; None where fewer than
    `min_support` features lie on the plane, or all of them on one line.
    """
    x, y, z = cloud.points.T
    design = np.column_stack([x, y, np.ones(len(x))])
    residual = z - design @ plane
    scale = np.sqrt(tolerance**2 + (2 * cloud.sigmas) ** 2)
    weights = cloud.weights * np.maximum(0.0, 1.0 - (residual / scale) ** 2) ** 2
    support = int((weights > 0).sum())
    information = (design * weights[:, None]).T @ design
    if support < min_support or np.linalg.cond(information) > WORST_CONDITION:
        return None
    return np.linalg.solve(information, design.T @ (weights * z)), information, support


def _search(points: Floats, weights: Floats, options: GroundSettings) -> Floats | None:
    """Find the plane (a, b, c) below the camera that holds most features and has few below it.

    A Hough transform over pitch, roll and height: deterministic, and it takes the whole window
    at once. None where every candidate is too near below the camera, too far below or above it.
    """
    bins = np.floor((points[:, 2] - TILTS @ points[:, :2].T) / BIN).astype(np.int64)
    lowest = int(bins.min())
    columns = int(bins.max()) - lowest + 1
    rows = np.arange(len(TILTS))[:, None] * columns
    votes = np.bincount(
        (bins - lowest + rows).ravel(),
        weights=np.broadcast_to(weights, bins.shape).ravel(),
        minlength=len(TILTS) * columns,
    ).reshape(len(TILTS), columns)
    # A plane holds its bin and both neighbours; what lies lower speaks against it, half as loud.
    padded = np.pad(votes, ((0, 0), (2, 1)))
    held = votes + padded[:, 1:-2] + padded[:, 3:]
    below = np.cumsum(padded, axis=1)[:, :columns]
    intercepts = (lowest + np.arange(columns) + 0.5) * BIN
    camera_heights = -intercepts / np.sqrt(1.0 + (TILTS**2).sum(axis=1))[:, None]
    allowed = (camera_heights >= options.lowest_camera) & (camera_heights <= options.highest_camera)
    if not allowed.any():
        return None
    score = np.where(allowed, held - 0.5 * below, -np.inf)
    tilt, column = np.unravel_index(int(np.argmax(score)), votes.shape)
    return np.array([*TILTS[tilt], intercepts[column]])


def _level_axes(rig: StereoRig) -> Floats:
    """Rows are forward, left and up of the camera, level in the base."""
    up = rig.up
    axis = rig.T_base_camera[:3, 2]
    forward = axis - (axis @ up) * up
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _ground_of_base(view: View, window: list[_Seen], options: GroundSettings) -> GroundPlane:
    if view.rig.is_mounted:
        return GroundPlane(normal=view.rig.up, offset=0.0, sigma_tilt=SIGMA_TILT_OF_BASE)
    views = [seen.view for seen in window]
    seen = sum(len(seen.points) for seen in window)
    dropped = sum((view.dropped for view in views), Counter[str]())
    dropped["out_of_range"] = sum(_size(view) for view in views) - seen
    raise NoGroundPlaneError(
        f"no plane between {options.lowest_camera:g} and {options.highest_camera:g} m below the "
        f"camera holds enough of the {seen} features of {len(window)} views"
        f"{f' (dropped: {describe_dropped(+dropped)})' if dropped.total() else ''}: "
        + (" ".join(likely_mistakes(views)) or GIVE_THE_GROUND)
    )


def _size(view: View) -> int:
    """Return how many features the fit gets from a view: points, and both ends of segments."""
    return len(view.points) + 2 * len(view.segments)
