"""Scale and level of a log whose world has no metre, or is tilted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from groundmap.arrays import Floats
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

    Examples
    --------
    >>> Similarity(scale=2.0).tilt
    0.0
    """

    scale: float = 1.0
    rotation: Floats = field(default_factory=lambda: np.eye(3))

    @property
    def tilt(self) -> float:
        """Angle between z before and after [rad]."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0)))

    def apply(self, view: View) -> View:
        """Return a view of the scaled and turned log."""
        T_map_base = np.eye(4)
        T_map_base[:3, :3] = self.rotation @ view.T_map_base[:3, :3]
        T_map_base[:3, 3] = self.scale * (self.rotation @ view.T_map_base[:3, 3])
        return replace(
            view,
            T_map_base=T_map_base,
            rig=self._rig(view.rig),
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
