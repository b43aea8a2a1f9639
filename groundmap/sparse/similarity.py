"""Scale and level of a log whose world has no metre, or is tilted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from groundmap.arrays import Floats
from groundmap.view.frames import invert
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features, View


@dataclass(frozen=True, kw_only=True, eq=False)
class Similarity:
    """A rotation and a scale of a whole log, about the origin of its world.

    Parameters
    ----------
    scale : float, default 1
        Metres per unit of the log.
    rotation : ndarray, shape (3, 3), default the identity
        From the axes of the log's map to level axes.
    camera_height : float, optional [m]
        Gives a view without a mounted rig a level ``base_link`` this far below its camera. The
        ground is then known where features do not show it, however the camera is held.

    Examples
    --------
    >>> Similarity(scale=2.0).tilt
    0.0
    """

    scale: float = 1.0
    rotation: Floats = field(default_factory=lambda: np.eye(3))
    camera_height: float | None = None

    @property
    def tilt(self) -> float:
        """Angle between z before and after [rad]."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0)))

    def apply(self, view: View) -> View:
        """Return a view of the scaled and turned log."""
        T_map_base = np.eye(4)
        T_map_base[:3, :3] = self.rotation @ view.T_map_base[:3, :3]
        T_map_base[:3, 3] = self.scale * (self.rotation @ view.T_map_base[:3, 3])
        rig = self._rig(view.rig)
        if self.camera_height is not None and not rig.is_mounted:
            T_map_camera = T_map_base
            T_map_base = _level_base(T_map_camera, self.camera_height)
            rig = replace(rig, T_base_camera=invert(T_map_base) @ T_map_camera)
        return replace(
            view,
            T_map_base=T_map_base,
            rig=rig,
            points=self._features(view.points),
            segments=self._features(view.segments),
        )

    def _rig(self, rig: StereoRig) -> StereoRig:
        if self.scale == 1.0:
            return rig
        T_base_camera = rig.T_base_camera.copy()
        T_base_camera[:3, 3] *= self.scale
        return replace(rig, baseline=self.scale * rig.baseline, T_base_camera=T_base_camera)

    def _features(self, features: Features) -> Features:
        if self.scale == 1.0 or not len(features):
            return features
        covariance = self.scale**2 * features.covariance
        return Features(self.scale * features.xyz, covariance, features.ids)


def _level_base(T_map_camera: Floats, camera_height: float) -> Floats:
    """Return the pose of a level base below a camera, x along its optical axis."""
    # The longer of two axes, if the camera looks up or down.
    ahead = max((T_map_camera[:2, 2], -T_map_camera[:2, 1]), key=lambda axis: float(axis @ axis))
    heading = np.arctan2(ahead[1], ahead[0])
    base = np.eye(4)
    base[:2, :2] = [(np.cos(heading), -np.sin(heading)), (np.sin(heading), np.cos(heading))]
    base[:3, 3] = T_map_camera[:3, 3] - (0.0, 0.0, camera_height)
    return base
