"""The ground under each view: a plane per view, fitted over a window of views."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.camera import StereoRig
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.features import View
from groundmap.frames import invert
from groundmap.settings import GroundSettings

STEEPEST_SIGHT = np.radians(60.0)  # beyond this a camera looks at the ground or the sky
MOST_LEAN = np.radians(45.0)  # between "up" of the base and z of the map
NOISE_FLOOR = 0.03  # [m], what even near features are off a real road's plane
TILT_FLOOR = 0.005  # [rad], a real road is no plane: more features don't make it one
TILTS = np.stack(
    np.meshgrid(np.tan(np.radians(np.arange(-10.0, 11.0, 2.0))), np.tan(np.radians((-6, -3, 0, 3, 6)))),
    axis=-1,
).reshape(-1, 2)
BIN = 0.1  # [m], height bins of the search


@dataclass(frozen=True, kw_only=True)
class GroundPlane:
    """The ground under one view, in its ``base_link`` frame, so that it moves with the pose.

    Parameters
    ----------
    normal : array_like, shape (3,) [base_link]
        Unit vector, upwards.
    offset : float [m]
        Height of the frame's origin above the plane.
    sigma_tilt : float, default 0.005 [rad]
        Standard deviation of the tilt.
    support : int, default 0
        Ground features it was fitted to; 0: given by hand, or carried over.

    Raises
    ------
    InputError
        The normal is not of length 1, or a number is not finite.

    Examples
    --------
    >>> plane = GroundPlane(normal=(0.0, 0.0, 1.0), offset=0.0)
    >>> plane.height([(5.0, 0.0, 0.4)])
    array([0.4])
    """

    normal: Floats
    offset: float
    sigma_tilt: float = TILT_FLOOR
    support: int = 0

    def __post_init__(self) -> None:
        normal = as_floats("normal", self.normal, (3,))
        check_finite("normal", normal)
        length = float(np.linalg.norm(normal))
        if abs(length - 1.0) > 1e-6:
            raise InputError("normal", "a vector of length 1", f"length {length:.6g}")
        if not (np.isfinite(self.offset) and np.isfinite(self.sigma_tilt) and self.sigma_tilt >= 0):
            raise InputError(
                "plane",
                "a finite offset [m] and a sigma_tilt of 0 or more [rad]",
                f"{self.offset}, {self.sigma_tilt}",
            )
        object.__setattr__(self, "normal", normal)

    @classmethod
    def below_camera(cls, rig: StereoRig, camera_height: float) -> GroundPlane:
        """Return the level ground that lies `camera_height` [m] below the left camera."""
        if not (np.isfinite(camera_height) and camera_height > 0):
            raise InputError("camera_height", "a number above 0 [m]", str(camera_height))
        offset = camera_height - float(rig.up @ rig.T_base_camera[:3, 3])
        return cls(normal=rig.up, offset=offset)

    def height(self, points: Floats) -> Floats:
        """Return the heights [m] above the plane of points, shape (..., 3) [m, base_link]."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
        return self.normal[0] * x + self.normal[1] * y + self.normal[2] * z + self.offset


def check_camera(view: View) -> None:
    """Refuse a camera that looks at the ground or the sky.

    Raises
    ------
    NoGroundPlaneError
        Its axis is more than 60 degrees off the horizontal, or up is not up in the map.
    """
    axis_up = float(view.T_map_camera[2, 2])
    if abs(axis_up) > np.sin(STEEPEST_SIGHT):
        looks = "sky" if axis_up > 0 else "ground"
        raise NoGroundPlaneError(
            f"the camera looks at the {looks} ({np.degrees(np.arcsin(axis_up)):+.0f} degrees): "
            "expected an optical axis within 60 degrees of the horizontal. Check the poses and "
            "whether the data's world is 'optical' or 'rep103'."
        )
    lean = float(np.arccos(np.clip(view.T_map_base[2, :3] @ view.rig.up, -1.0, 1.0)))
    if lean > MOST_LEAN:
        raise NoGroundPlaneError(
            f"up of the base is {np.degrees(lean):.0f} degrees off z of the map: expected at most "
            "45. Check T_base_camera and whether the data's world is 'optical' or 'rep103'."
        )


def fit_ground(
    views: Iterable[View],
    *,
    plane: GroundPlane | None = None,
    camera_height: float | None = None,
    **settings: object,
) -> Iterator[View]:
    """Yield the views, each with the ground plane under it.

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

    Yields
    ------
    View

    Raises
    ------
    NoGroundPlaneError
        A camera that looks at the ground or the sky; too few features on any plane below the
        camera. Where the window of a view has too few but an earlier one had enough, the plane
        is carried along with the base, with ``support=0``; where the rig is mounted
        (`T_base_camera` is given), ``base_link`` itself tells where the ground is.
    """
    options = GroundSettings(**settings)
    if plane is not None and camera_height is not None:
        raise InputError("fit_ground", "plane or camera_height", "both")
    if plane is not None or camera_height is not None:
        yield from _with_given_plane(views, plane, camera_height)
        return
    last: GroundPlane | None = None
    for view, window in _windows(views, options):
        last = _fit(view, window, options) or last
        if last is None:
            last = _ground_of_base(view, window)
        yield view.with_plane(last)
        last = GroundPlane(normal=last.normal, offset=last.offset, sigma_tilt=last.sigma_tilt)


def _with_given_plane(
    views: Iterable[View], plane: GroundPlane | None, camera_height: float | None
) -> Iterator[View]:
    for view in views:
        check_camera(view)
        yield view.with_plane(plane or GroundPlane.below_camera(view.rig, camera_height or 0.0))


class _Seen(NamedTuple):
    """A view and its features as the fit reads them."""

    view: View
    points: Floats  # (n, 3) [m, map]
    sigmas: Floats  # (n,) [m], standard deviation of the height


def _seen(view: View, options: GroundSettings) -> _Seen:
    check_camera(view)
    segments = view.segments
    xyz = np.concatenate([view.points.xyz, segments.xyz.reshape(-1, 3)])
    covariance = np.concatenate([view.points.covariance, segments.covariance.reshape(-1, 3, 3)])
    near = np.hypot(xyz[:, 0], xyz[:, 2]) <= options.max_range
    T_map_camera = view.T_map_camera
    points = xyz[near] @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
    up = T_map_camera[2, :3]
    return _Seen(view, points, np.sqrt(np.einsum("i,nij,j->n", up, covariance[near], up)))


def _windows(
    views: Iterable[View], options: GroundSettings
) -> Iterator[tuple[View, list[_Seen]]]:
    """Yield each view with the views around it (or before it), holding one window at a time."""
    ahead = 0 if options.causal else options.window // 2
    behind = options.window - 1 if options.causal else options.window // 2
    held: deque[_Seen] = deque()
    here = 0  # index in `held` of the next view to hand out
    for view in views:
        held.append(_seen(view, options))
        if len(held) - here > ahead:
            yield held[here].view, list(held)
            here += 1
            while here > behind:
                held.popleft()
                here -= 1
    while here < len(held):
        yield held[here].view, list(held)
        here += 1
        while here > behind:
            held.popleft()
            here -= 1


def _fit(view: View, window: list[_Seen], options: GroundSettings) -> GroundPlane | None:
    """Return the plane under `view`, or None where too few features lie on one."""
    T_base_map = invert(view.T_map_base)
    points = np.concatenate([seen.points for seen in window]) @ T_base_map[:3, :3].T
    points += T_base_map[:3, 3]
    sigmas = np.concatenate([seen.sigmas for seen in window])
    axes = _level_axes(view.rig)
    local = (points - view.rig.T_base_camera[:3, 3]) @ axes.T  # forward, left, up of the camera
    low = (local[:, 2] < -options.lowest_camera) & (local[:, 2] > -options.highest_camera)
    local, sigmas = local[low], sigmas[low]
    if len(local) < options.min_support:
        return None
    weights = 1.0 / (sigmas**2 + NOISE_FLOOR**2)
    a, b, c = _search(local, np.sqrt(weights))
    for tolerance in (0.4, 0.3, 0.2, 0.15, 0.15, 0.15):
        residual = local[:, 2] - (a * local[:, 0] + b * local[:, 1] + c)
        scale = np.sqrt(tolerance**2 + (2 * sigmas) ** 2)
        inside = weights * np.maximum(0.0, 1.0 - (residual / scale) ** 2) ** 2  # Tukey's biweight
        on_plane = inside > 0
        if on_plane.sum() < options.min_support:
            return None
        design = np.column_stack([local[:, :2], np.ones(len(local))])
        information = (design * inside[:, None]).T @ design
        if np.linalg.cond(information) > 1e12:
            return None  # all on one line: no plane
        a, b, c = np.linalg.solve(information, design.T @ (inside * local[:, 2]))
    tilt = np.hypot(*np.sqrt(np.diag(np.linalg.inv(information))[:2]))
    normal = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    normal_base = axes.T @ normal
    camera_height = -c * normal[2]
    return GroundPlane(
        normal=normal_base / np.linalg.norm(normal_base),
        offset=float(camera_height - normal_base @ view.rig.T_base_camera[:3, 3]),
        sigma_tilt=float(np.hypot(tilt, TILT_FLOOR)),
        support=int(on_plane.sum()),
    )


def _search(local: Floats, weights: Floats) -> tuple[float, float, float]:
    """Find the plane below the camera that holds most features and has few below it.

    A Hough transform over pitch, roll and height: deterministic, and it takes the whole window
    at once.
    """
    heights = local[:, 2] - TILTS @ local[:, :2].T
    bins = np.floor(heights / BIN).astype(np.int64)
    bins -= bins.min()
    columns = int(bins.max()) + 1
    rows = np.arange(len(TILTS))[:, None] * columns
    votes = np.bincount(
        (bins + rows).reshape(-1),
        weights=np.broadcast_to(weights, bins.shape).reshape(-1),
        minlength=len(TILTS) * columns,
    ).reshape(len(TILTS), columns)
    padded = np.pad(votes, ((0, 0), (2, 1)))
    held = votes + padded[:, 1:-2] + padded[:, 3:]
    below = np.cumsum(padded, axis=1)[:, : columns]
    tilt, column = np.unravel_index(int(np.argmax(held - 0.5 * below)), votes.shape)
    a, b = TILTS[tilt]
    lowest = np.floor(heights.min() / BIN)
    return float(a), float(b), float((lowest + column + 0.5) * BIN)


def _level_axes(rig: StereoRig) -> Floats:
    """Rows are forward, left and up of the camera, level in the base."""
    up = rig.up
    axis = rig.T_base_camera[:3, 2]
    forward = axis - (axis @ up) * up
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(up, forward), up])


def _ground_of_base(view: View, window: list[_Seen]) -> GroundPlane:
    if not np.array_equal(view.T_map_camera, view.T_map_base):
        return GroundPlane(normal=np.array([0.0, 0.0, 1.0]), offset=0.0, sigma_tilt=0.02)
    seen = sum(len(seen.points) for seen in window)
    raise NoGroundPlaneError(
        f"no plane below the camera holds enough of the {seen} features of {len(window)} views: "
        "give the camera's height above the ground (camera_height=..., --camera-height), or "
        "T_base_camera in the rig, so that base_link tells where the ground is."
    )
