"""The stereo rig of a simulated robot: a rectified pair of pinhole cameras, and its matcher."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from pydantic import Field

from groundmap.arrays import Bools, Floats
from groundmap.simulate.matching import MatchingSettings
from groundmap.view.frames import T_REP103_OPTICAL, invert
from groundmap.view.stereo_rig import StereoRig

NEAREST = 0.2  # [m], least depth of features


class SensorSettings(MatchingSettings):
    """The rig, its mount and the matcher."""

    fx: float = Field(700.0, gt=0, description="focal length [px]")
    width_px: int = Field(1280, gt=0, description="width of the images [px]")
    height_px: int = Field(720, gt=0, description="height of the images [px]")
    baseline: float = Field(0.54, gt=0, description="distance between the cameras [m]")
    camera_height: float = Field(1.0, gt=0, description="height of the camera above the ground [m]")
    camera_forward: float = Field(
        0.0, description="position of the camera ahead of the robot's centre [m]"
    )
    pitch: float = Field(0.1, gt=-1.5, lt=1.5, description="downward pitch of the camera [rad]")
    max_range: float = Field(25.0, gt=0, description="largest range of features [m]")
    max_points: int = Field(2000, ge=0, description="most points in a view [features]")
    max_segments: int = Field(500, ge=0, description="most segments in a view [features]")
    assumed_noise_px: float | None = Field(
        None, gt=0, description="pixel noise stated by the rig; default: the true one [px]"
    )

    @cached_property
    def rig(self) -> StereoRig:
        """The rig, as written to the log."""
        mount = np.eye(4)
        cos, sin = np.cos(self.pitch), np.sin(self.pitch)
        mount[:3, :3] = [(cos, 0.0, sin), (0.0, 1.0, 0.0), (-sin, 0.0, cos)]
        mount[:3, 3] = self.camera_forward, 0.0, self.camera_height
        return StereoRig(
            fx=self.fx, fy=self.fx, cx=self.width_px / 2, cy=self.height_px / 2,
            baseline=self.baseline, T_base_camera=mount @ T_REP103_OPTICAL,
            pixel_noise_px=self.assumed_noise_px or max(self.pixel_noise_px, 1e-3),
        )  # fmt: skip

    def project(self, T_map_base: Floats, places: Floats) -> tuple[Floats, Bools]:
        """Return (uL, uR, v) of places, shape (n, 3) [px], and which of them are in both images.

        Parameters
        ----------
        T_map_base : ndarray, shape (4, 4) [m]
        places : ndarray, shape (n, 3) [m, map]
        """
        rig = self.rig
        T_camera_map = invert(T_map_base @ rig.T_base_camera)
        x, y, depth = (places @ T_camera_map[:3, :3].T + T_camera_map[:3, 3]).T
        ahead = (depth > NEAREST) & (np.hypot(x, depth) < self.max_range)
        depth = np.where(ahead, depth, 1.0)
        left = rig.cx + rig.fx * x / depth
        right = left - rig.fx * rig.baseline / depth
        down = rig.cy + rig.fy * y / depth
        inside = (right >= 0) & (left <= self.width_px) & (down >= 0) & (down <= self.height_px)
        in_images: Bools = ahead & inside
        return np.stack([left, right, down], axis=1), in_images
