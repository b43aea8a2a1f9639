"""The ground of one view: a plane, or a strip of planes along the driven track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundmap.arrays import Floats, as_floats, as_number, check_finite, is_number
from groundmap.errors import InputError
from groundmap.view.ground_strip import GroundStrip
from groundmap.view.stereo_rig import StereoRig

TILT_FLOOR = 0.005  # [rad], a road is not a perfect plane, however many features it has


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPlane:
    """The ground under one view: a plane in the ``base_link`` frame, which moves with the pose.

    Where the driven track shows that the ground is not one plane, the plane is that at the camera,
    and `strip` has the others.

    Parameters
    ----------
    normal : array_like, shape (3,) [base_link]
        Unit vector that points upwards.
    offset : float [m]
        Height of the origin of ``base_link`` above the plane.
    sigma_tilt : float, default 0.005 [rad]
        Standard deviation of the tilt.
    support : int, default 0
        Number of ground features that the plane was fitted to; 0 for a plane that was given, or
        taken over from an earlier view.
    strip : GroundStrip, optional [base_link]
        The ground along the track; then, `normal` and `offset` are those at the camera.

    Raises
    ------
    InputError
        The normal does not have length 1, a number is not finite, or `sigma_tilt` is negative.

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
    strip: GroundStrip | None = None

    def __post_init__(self) -> None:
        normal = as_floats("normal", self.normal, (3,))
        check_finite("normal", normal)
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(normal))
        if not abs(length - 1.0) <= 1e-6:
            raise InputError("normal", "a vector of length 1", f"length {length:.6g}")
        if not (is_number(self.offset) and is_number(self.sigma_tilt) and self.sigma_tilt >= 0):
            raise InputError(
                "plane",
                "a finite offset [m] and a sigma_tilt of 0 or more [rad]",
                f"{self.offset!r:.60}, {self.sigma_tilt!r:.60}",
            )
        object.__setattr__(self, "offset", float(self.offset))
        object.__setattr__(self, "sigma_tilt", float(self.sigma_tilt))
        object.__setattr__(self, "normal", normal)

    @classmethod
    def below_camera(cls, rig: StereoRig, camera_height: float) -> GroundPlane:
        """Return level ground at a given depth below the left camera.

        Parameters
        ----------
        rig : StereoRig
        camera_height : float [m]
            Height of the left camera above the ground.

        Raises
        ------
        InputError
            `camera_height` is not above 0.
        """
        expected = "a number above 0 [m]"
        camera_height = as_number("camera_height", camera_height, expected, above=0.0)
        offset = camera_height - float(rig.up @ rig.T_base_camera[:3, 3])
        return cls(normal=rig.up, offset=offset)

    def height(self, points: Floats) -> Floats:
        """Return the heights [m] above the ground of points, shape (..., 3) [m, base_link]."""
        if self.strip is not None:
            return self.strip.height(points)
        x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
        normal = self.normal
        heights: Floats = normal[0] * x + normal[1] * y + normal[2] * z + self.offset
        return heights
