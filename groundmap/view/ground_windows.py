"""Windows of views: those that the ground under a view is fitted to, and the drive around it."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from groundmap.arrays import Floats
from groundmap.settings import GroundSettings
from groundmap.view.diagnosis import upright_views
from groundmap.view.driven_track import Pose, Track, driven_track
from groundmap.view.view import View, sigma_along

MOST_POSES = 200  # before and after a view, that its track is made of


class NearFeatures(NamedTuple):
    """Features of a view within range."""

    points: Floats  # (n, 3) [m, map]
    sigmas: Floats  # (n,) [m], standard deviation of the height


@dataclass(eq=False)
class HeldView:
    """A view that is held in memory."""

    view: View
    max_range: float

    @property
    def pose(self) -> Pose:
        """Its pose."""
        return Pose(self.view.T_map_base, self.view.rig)

    @cached_property
    def near(self) -> NearFeatures:
        """Its features within range."""
        view = self.view
        segments = view.segments
        xyz = np.concatenate([view.points.xyz, segments.xyz.reshape(-1, 3)])
        covariance = np.concatenate([view.points.covariance, segments.covariance.reshape(-1, 3, 3)])
        near = np.hypot(xyz[:, 0], xyz[:, 2]) <= self.max_range
        T_map_camera = view.T_map_camera
        points = xyz[near] @ T_map_camera[:3, :3].T + T_map_camera[:3, 3]
        return NearFeatures(points, sigma_along(T_map_camera[2, :3], covariance[near]))


class Window(NamedTuple):
    """A view with those around it, or before it."""

    view: View
    held: list[HeldView]  # the window of views that its plane is fitted to
    poses: list[Pose]  # of the drive around the view
    number: int  # of the view among the poses

    def track(self, options: GroundSettings, *, below_camera: float) -> Track:
        """Return the driven track around the view.

        Parameters
        ----------
        options : GroundSettings
        below_camera : float [m]
            The track runs this far below the cameras.
        """
        return driven_track(
            self.poses, self.number, reach=options.max_range, below_camera=below_camera
        )


def windows(views: Iterable[View], options: GroundSettings) -> Iterator[Window]:
    """Yield each view with its window and the poses of the drive around it.

    Views are read ahead for half a window, and for the poses of the next `max_range` metres.

    Parameters
    ----------
    views : iterable of View
    options : GroundSettings
    """
    ahead = 0 if options.causal else options.window // 2
    behind = options.window - 1 - ahead
    held: deque[HeldView] = deque()
    driven: deque[Pose] = deque(maxlen=MOST_POSES)
    current = 0  # index in `held` of the next view to yield
    source = upright_views(views, causal=options.causal)
    while True:
        while not _reaches(held, current, ahead, options):
            number_and_view = next(source, None)
            if number_and_view is None:
                break
            held.append(HeldView(number_and_view[1], options.max_range))
        if current == len(held):
            return
        window = list(held)[max(0, current - behind) : current + ahead + 1]
        poses = [*driven, *(held_view.pose for held_view in list(held)[current:])]
        yield Window(held[current].view, window, poses, len(driven))
        driven.append(held[current].pose)
        current += 1
        if current > behind:
            held.popleft()
            current -= 1


def _reaches(held: deque[HeldView], current: int, ahead: int, options: GroundSettings) -> bool:
    """Return whether enough views after the current one are held."""
    after = len(held) - current - 1
    if options.causal or after < ahead:
        return after >= ahead
    last, here = (held_view.view.T_map_base[:2, 3] for held_view in (held[-1], held[current]))
    return after >= MOST_POSES or bool(np.hypot(*(last - here)) >= options.max_range)
