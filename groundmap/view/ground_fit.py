"""Ground fitting: the ground under each view, fitted to a window of views along the track."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from groundmap.arrays import Floats, as_number
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.settings import GroundSettings
from groundmap.view.camera_check import check_plane
from groundmap.view.diagnosis import describe_dropped, likely_mistakes, upright_views
from groundmap.view.driven_track import Track, level_axes
from groundmap.view.frames import invert
from groundmap.view.ground_plane import TILT_FLOOR, GroundPlane
from groundmap.view.ground_strip import EVEN, STRAIGHT, GroundStrip
from groundmap.view.ground_windows import Window, windows
from groundmap.view.plane_fit import Cloud, fit_plane
from groundmap.view.slopes_ahead import continue_strip, slopes_ahead
from groundmap.view.view import View

REACH = 3.0  # [max_range], horizontal distance from the camera within which features are used
NOISE_FLOOR = 0.03  # [m], deviation of a real road from a plane
SIDE = 0.05  # [m/m], how much the ground may be off per distance from the driven track
SIGMA_SLOPE = 0.003  # of a long track against the ground under the wheels
SIGMA_RISE = 0.05  # [m], the same over the length of a short one
LONG = 3.0  # [m], track from which on it says more about the ground than its continuation
SHORTEST = 1e-3  # [m], length of a track
BENT = np.radians(4.0)  # change of slope; below it, a track above the ground is as good
SIGMA_TILT_OF_BASE = 0.02  # [rad], tilt of base_link against the ground
GROUND_HINT = (
    "give the height of the camera above the ground (camera_height=..., --camera-height), or "
    "T_base_camera in the rig, so that the ground is known from base_link."
)


def fit_ground(
    views: Iterable[View],
    *,
    plane: GroundPlane | None = None,
    camera_height: float | None = None,
    **settings: Any,
) -> Iterator[View]:
    """Return views with the ground under each, lazily and in their order.

    The ground of a view is fitted to the features of a window of views, because planes fitted to
    single views vary by degrees. The window is centred on the view; with ``causal=True`` it ends
    with the view. The poses of the drive show where the ground rises and falls along the driven
    track; the features show how far it is below the cameras, and where its slope changes ahead of
    the track. Features near the track count most. Views are read ahead for half a window and for
    the next `max_range` metres of the track, at most 200.

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
        Use ground this far below the left camera along the driven track, instead of fitting it to
        features. Where the robot has not moved, the ground is level with its base.
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
    >>> from groundmap import StereoRig, View, fit_ground
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
    if plane is not None:
        return _with_given_plane(views, plane, options)
    if camera_height is not None:
        return _with_given_height(views, camera_height, options)
    return _with_fitted_plane(views, options)


def _with_fitted_plane(views: Iterable[View], options: GroundSettings) -> Iterator[View]:
    last: GroundPlane | None = None
    for number, window in enumerate(windows(views, options)):
        last = _fit(window, options) or last
        if last is None:
            last = _ground_of_base(window, options)
        yield _attach_plane(window.view, last, number)
        last = replace(last, support=0, strip=None)


def _with_given_plane(
    views: Iterable[View], plane: GroundPlane, options: GroundSettings
) -> Iterator[View]:
    for number, view in upright_views(views, causal=options.causal):
        yield _attach_plane(view, plane, number)


def _with_given_height(
    views: Iterable[View], camera_height: float, options: GroundSettings
) -> Iterator[View]:
    for number, window in enumerate(windows(views, options)):
        level = GroundPlane.below_camera(window.view.rig, camera_height)
        track = window.track(options, below_camera=camera_height)
        yield _attach_plane(window.view, _along(track.strip, window.view, level), number)


def _attach_plane(view: View, plane: GroundPlane, number: int) -> View:
    """Return the view with a plane, after the check that the plane is below the camera."""
    with_plane = view.with_plane(plane)
    check_plane(with_plane, number=number)
    return with_plane


def _fit(window: Window, options: GroundSettings) -> GroundPlane | None:
    """Return the ground under a view, or None if too few features lie on it.

    The camera is between ``lowest_camera`` and ``highest_camera`` above it. A bare camera hangs at
    an unknown height over the track, which the first fit determines.
    """
    rig = window.view.rig
    below = float(rig.up @ rig.T_base_camera[:3, 3]) if rig.is_mounted else 0.0
    plane = _fit_along(window, below, options)
    if plane is None or rig.is_mounted or not _is_bent(plane):
        return plane
    height = float(plane.height(rig.T_base_camera[:3, 3]))
    return _fit_along(window, height, options)


def _is_bent(plane: GroundPlane) -> bool:
    """Return whether slopes change so much that the height of the track above the ground counts."""
    return plane.strip is not None and bool(
        (plane.strip.normals @ plane.normal).min() < np.cos(BENT)
    )


def _fit_along(window: Window, below: float, options: GroundSettings) -> GroundPlane | None:
    """Return the ground along the track that runs `below` [m] under the cameras."""
    view = window.view
    track = window.track(options, below_camera=below)
    sigma_slope = float(np.hypot(SIGMA_SLOPE, SIGMA_RISE / max(track.length, SHORTEST)))
    if view.rig.is_mounted:
        sigma_slope = min(sigma_slope, SIGMA_TILT_OF_BASE)
    points, sigmas = _along_track(window, track, below, options)
    trust = 1.0 if view.rig.is_mounted else track.length / (track.length + LONG)
    fitted = fit_plane(_cloud(points, sigmas, track, trust, options), sigma_slope, options)
    if fitted is None:
        return None
    a, b, c = fitted.plane
    camera_height = -c / np.sqrt(a * a + b * b + 1.0)
    # The features are below the camera, but their plane, extended to the camera, may be above it.
    if not options.lowest_camera <= camera_height <= options.highest_camera:
        return None
    normal = level_axes(view.rig).T @ (np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0))
    normal /= np.linalg.norm(normal)
    level = GroundPlane(
        normal=normal,
        offset=float(camera_height - normal @ view.rig.T_base_camera[:3, 3]),
        sigma_tilt=float(np.hypot(fitted.sigma_tilt, TILT_FLOOR)),
        support=fitted.support,
    )
    if track.beyond >= options.max_range:
        return _along(track.raised(a, b, c + below), view, level)
    above = points - np.outer(a * points[:, 0] + b * points[:, 1] + c, (0.0, 0.0, 1.0))
    changes = slopes_ahead(above - (track.beyond, 0.0, 0.0), options.max_range)
    strip = continue_strip(track.raised(a, b, c + below), track.undriven, changes)
    return _along(strip, view, level)


def _along(strip: GroundStrip, view: View, level: GroundPlane) -> GroundPlane:
    """Return the ground of a strip [level]: `level`, if the strip is nowhere off this plane."""
    rig = view.rig
    in_base = strip.transformed(level_axes(rig).T, rig.T_base_camera[:3, 3]).simplified()
    sunk = np.abs(level.height(in_base.places)).max()
    turned = np.abs(in_base.normals - level.normal).max()
    if sunk < STRAIGHT and turned < EVEN:
        return level
    camera = rig.T_base_camera[:3, 3]
    normal = in_base.normal_at(camera)
    return replace(
        level,
        normal=normal,
        offset=float(in_base.height(camera) - normal @ camera),
        strip=in_base if len(in_base.places) > 2 else None,
    )


def _along_track(
    window: Window, track: Track, below: float, options: GroundSettings
) -> tuple[Floats, Floats]:
    """Return features of a window relative to its view and the track, and their deviations.

    Shape (n, 3) [m], along the track, to its left, and above the camera, which the track runs
    `below`; and the standard deviations of the heights, shape (n,) [m].
    """
    view = window.view
    T_base_map = invert(view.T_map_base)
    points = np.concatenate([held.near.points for held in window.held]) @ T_base_map[:3, :3].T
    points += T_base_map[:3, 3] - view.rig.T_base_camera[:3, 3]
    level = points @ level_axes(view.rig).T
    sigmas = np.concatenate([held.near.sigmas for held in window.held])
    # After a jump of the poses, the views before it are of another place.
    around = np.hypot(level[:, 0], level[:, 1]) <= REACH * options.max_range
    station, offset, height = track.strip.locate(level[around])
    return np.stack([station - track.station, offset, height - below], axis=1), sigmas[around]


def _cloud(
    points: Floats, sigmas: Floats, track: Track, trust: float, options: GroundSettings
) -> Cloud:
    """Return the features that may be ground, the surer the nearer to the driven track.

    Parameters
    ----------
    points : ndarray, shape (n, 3) [m]
    sigmas : ndarray, shape (n,) [m]
    track : Track
    trust : float
        From 0 to 1, how much better the slope of the track is known than that ahead of it.
    options : GroundSettings
    """
    low = (-options.highest_camera < points[:, 2]) & (points[:, 2] < -options.lowest_camera)
    points, sigmas = points[low], sigmas[low]
    undriven = np.maximum(points[:, 0] - track.beyond, -track.before - points[:, 0])
    undriven = trust * np.maximum(undriven, 0.0)
    variance = sigmas**2 + NOISE_FLOOR**2 + (SIDE * points[:, 1]) ** 2
    far = (SIDE * undriven) ** 2
    votes = 1.0 / np.sqrt(variance) / (1.0 + far / NOISE_FLOOR**2)
    return Cloud(points, sigmas, 1.0 / (variance + far), votes)


def _ground_of_base(window: Window, options: GroundSettings) -> GroundPlane:
    """Return level ground through the origin of ``base_link``, for a mounted rig."""
    view = window.view
    if view.rig.is_mounted:
        return GroundPlane(normal=view.rig.up, offset=0.0, sigma_tilt=SIGMA_TILT_OF_BASE)
    views = [held.view for held in window.held]
    count = sum(len(held.near.points) for held in window.held)
    dropped = sum((view.dropped for view in views), Counter[str]())
    dropped["out_of_range"] = sum(_count_positions(view) for view in views) - count
    raise NoGroundPlaneError(
        f"no plane between {options.lowest_camera:g} and {options.highest_camera:g} m below the "
        f"camera contains enough of the {count} features of {len(views)} views"
        f"{f' (dropped: {describe_dropped(+dropped)})' if dropped.total() else ''}: "
        + (" ".join(likely_mistakes(views)) or GROUND_HINT)
    )


def _count_positions(view: View) -> int:
    """Return the number of points and ends of segments of a view."""
    return len(view.points) + 2 * len(view.segments)
