"""Ground fitting: one plane per view, fitted to a window of views."""

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

REACH = 3.0  # [max_range], horizontal distance from the camera within which features are used
NOISE_FLOOR = 0.03  # [m], deviation of a real road from a plane
TILTS = np.stack(
    np.meshgrid(
        np.tan(np.radians(np.arange(-10.0, 11.0, 2.0))), np.tan(np.radians((-6, -3, 0, 3, 6)))
    ),
    axis=-1,
).reshape(-1, 2)
SIGMA_TILT_OF_BASE = 0.02  # [rad], tilt of base_link against the ground
BIN = 0.1  # [m], height bins of the Hough transform
TOLERANCES = (0.4, 0.3, 0.2, 0.15, 0.15, 0.15)  # [m], one per refinement step
GROUND_HINT = (
    "give the height of the camera above the ground (camera_height=..., --camera-height), or "
    "T_base_camera in the rig, so that the ground is known from base_link."
)
WORST_CONDITION = 1e12  # of the information matrix; above it, all features are on one line


def fit_ground(
    views: Iterable[View],
    *,
    plane: GroundPlane | None = None,
    camera_height: float | None = None,
    **settings: Any,
) -> Iterator[View]:
    """Return views with a ground plane each, lazily and in their order.

    The plane of a view is fitted to the features of a window of views, because planes fitted to
    single views vary by degrees. The window is centred on the view; with ``causal=True`` it ends
    with the view. At most one window of views is held in memory.

    Where a window has too few features on a plane, its view gets the plane of the view before,
    with ``support=0``. Before the first fitted plane, a mounted rig (`T_base_camera` is given)
    gets level ground through the origin of ``base_link``.

    Parameters
    ----------
    views : iterable of View
        Consecutive views of a drive.
    plane : GroundPlane, optional
        Use this plane for all views instead of fitting planes.
    camera_height : float, optional [m]
        Use level ground this far below the left camera instead of fitting planes.
    **settings
        Fields of `groundmap.GroundSettings`: ``window`` [views], ``causal``, ``max_range`` [m], ...

    Returns
    -------
    iterator of View

    Raises
    ------
    SettingsError
        A setting is unknown (the nearest one is named) or out of range.
    InputError
        Both `plane` and `camera_height` are given, or `camera_height` is not above 0.
    NoGroundPlaneError
        While iterating: a camera looks at the ground or the sky, a plane is not below its camera,
        or too few features lie on a plane and no other plane is known.

    Examples
    --------
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> T_map_camera = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    >>> view = View.from_pixels(T_map_camera, rig, points_px=[(320.0, 250.0, 450.0)])
    >>> [view] = fit_ground([view], camera_height=1.5)
    >>> view.plane.offset
    1.5
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
        yield _attach_plane(view, last, number)
        last = GroundPlane(normal=last.normal, offset=last.offset, sigma_tilt=last.sigma_tilt)


def _with_given_plane(
    views: Iterable[View],
    plane: GroundPlane | None,
    camera_height: float | None,
    options: GroundSettings,
) -> Iterator[View]:
    for number, view in upright_views(views, causal=options.causal):
        below = plane or GroundPlane.below_camera(view.rig, camera_height or 0.0)
        yield _attach_plane(view, below, number)


def _attach_plane(view: View, plane: GroundPlane, number: int) -> View:
    """Return the view with a plane, after the check that the plane is below the camera."""
    with_plane = view.with_plane(plane)
    check_plane(with_plane, number=number)
    return with_plane


class _NearFeatures(NamedTuple):
    """A view and its features within range."""

    view: View
    points: Floats  # (n, 3) [m, map]
    sigmas: Floats  # (n,) [m], standard deviation of the height


def _select_near(view: View, options: GroundSettings) -> _NearFeatures:
    segments = view.segments
    xyz = np.concatenate([view.points.xyz, segments.xyz.reshape(-1, 3)])
    covariance = np.concatenate([view.points.covariance, segments.covariance.reshape(-1, 3, 3)])
    near = np.hypot(xyz[:, 0], xyz[:, 2]) <= options.max_range
    T_map_camera = view.T_map_camera
    points = xyz[near] @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    up = T_map_camera[2, :3]
    return _NearFeatures(view, points, sigma_along(up, covariance[near]))


def _windows(
    views: Iterable[View], options: GroundSettings
) -> Iterator[tuple[View, list[_NearFeatures]]]:
    """Yield each view with the views around it (or before it), holding one window at a time."""
    ahead = 0 if options.causal else options.window // 2
    behind = options.window - 1 - ahead
    window: deque[_NearFeatures] = deque()
    current = 0  # index in `window` of the next view to yield
    source = upright_views(views, causal=options.causal)
    for latest in _pad_with_none((_select_near(view, options) for _, view in source), times=ahead):
        if latest is not None:
            window.append(latest)
        if current < len(window) and (latest is None or len(window) - current > ahead):
            yield window[current].view, list(window)
            current += 1
            if current > behind:
                window.popleft()
                current -= 1


def _pad_with_none(items: Iterable[_NearFeatures], *, times: int) -> Iterator[_NearFeatures | None]:
    """Yield the items, then None: the windows of the last views are shorter."""
    yield from items
    for _ in range(times):
        yield None


class _Cloud(NamedTuple):
    """Features of a window that may be ground, relative to the camera, level with the base."""

    points: Floats  # (n, 3) [m], forward, left and up of the camera
    sigmas: Floats  # (n,) [m]
    weights: Floats  # (n,) [1/m²]


def _fit(view: View, window: list[_NearFeatures], options: GroundSettings) -> GroundPlane | None:
    """Return the plane under a view, or None if too few features lie on one.

    The camera is between ``lowest_camera`` and ``highest_camera`` above it.
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
    # The features are below the camera, but their plane, extended to the camera, may be above it.
    if not options.lowest_camera <= camera_height <= options.highest_camera:
        return None
    return GroundPlane(
        normal=normal,
        offset=float(camera_height - normal @ view.rig.T_base_camera[:3, 3]),
        sigma_tilt=float(np.hypot(tilt, TILT_FLOOR)),
        support=support,
    )


def _cloud(view: View, window: list[_NearFeatures], options: GroundSettings) -> _Cloud:
    T_base_map = invert(view.T_map_base)
    points = np.concatenate([features.points for features in window]) @ T_base_map[:3, :3].T
    points += T_base_map[:3, 3] - view.rig.T_base_camera[:3, 3]
    level = points @ _level_axes(view.rig).T
    low = (-options.highest_camera < level[:, 2]) & (level[:, 2] < -options.lowest_camera)
    # After a jump of the poses, the views before it are of another place.
    low &= np.hypot(level[:, 0], level[:, 1]) <= REACH * options.max_range
    sigmas = np.concatenate([features.sigmas for features in window])[low]
    return _Cloud(level[low], sigmas, 1.0 / (sigmas**2 + NOISE_FLOOR**2))


def _refine(
    cloud: _Cloud, plane: Floats, tolerance: float, min_support: int
) -> tuple[Floats, Floats, int] | None:
    """Return a refined plane (a, b, c: up = a forward + b left + c), its information and support.

    One step of iteratively reweighted least squares with Tukey's biweight. None if fewer than
    `min_support` features lie on the plane, or all of them lie on one line.
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
    """Return the plane (a, b, c) that has most features on it and few below it.

    A deterministic Hough transform over pitch, roll and height. None if no candidate is between
    ``lowest_camera`` and ``highest_camera`` below the camera.
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
    # Votes of a bin and both neighbours count for a plane, those below it against it, by half.
    padded = np.pad(votes, ((0, 0), (2, 1)))
    near = votes + padded[:, 1:-2] + padded[:, 3:]
    below = np.cumsum(padded, axis=1)[:, :columns]
    intercepts = (lowest + np.arange(columns) + 0.5) * BIN
    camera_heights = -intercepts / np.sqrt(1.0 + (TILTS**2).sum(axis=1))[:, None]
    allowed = (camera_heights >= options.lowest_camera) & (camera_heights <= options.highest_camera)
    if not allowed.any():
        return None
    score = np.where(allowed, near - 0.5 * below, -np.inf)
    tilt, column = np.unravel_index(int(np.argmax(score)), votes.shape)
    return np.array([*TILTS[tilt], intercepts[column]])


def _level_axes(rig: StereoRig) -> Floats:
    """Return axes with up of the base and forward of the camera, rows forward, left and up."""
    up = rig.up
    axis = rig.T_base_camera[:3, 2]
    forward = axis - (axis @ up) * up
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _ground_of_base(
    view: View, window: list[_NearFeatures], options: GroundSettings
) -> GroundPlane:
    """Return level ground through the origin of ``base_link``, for a mounted rig."""
    if view.rig.is_mounted:
        return GroundPlane(normal=view.rig.up, offset=0.0, sigma_tilt=SIGMA_TILT_OF_BASE)
    views = [features.view for features in window]
    count = sum(len(features.points) for features in window)
    dropped = sum((view.dropped for view in views), Counter[str]())
    dropped["out_of_range"] = sum(_count_positions(view) for view in views) - count
    raise NoGroundPlaneError(
        f"no plane between {options.lowest_camera:g} and {options.highest_camera:g} m below the "
        f"camera contains enough of the {count} features of {len(window)} views"
        f"{f' (dropped: {describe_dropped(+dropped)})' if dropped.total() else ''}: "
        + (" ".join(likely_mistakes(views)) or GROUND_HINT)
    )


def _count_positions(view: View) -> int:
    """Return the number of points and ends of segments of a view."""
    return len(view.points) + 2 * len(view.segments)
