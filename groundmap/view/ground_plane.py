"""The ground under one view: a plane, given or fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from groundmap.arrays import Floats, as_floats, as_number, check_finite, is_number
from groundmap.errors import InputError
from groundmap.view.stereo_rig import StereoRig

TILT_FLOOR = 0.005  # [rad], a real road is no plane: more features don't make it one


@dataclass(frozen=True, kw_only=True, eq=False)
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
        """Return the level ground that lies `camera_height` [m] below the left camera."""
        expected = "a number above 0 [m]"
        camera_height = as_number("camera_height", camera_height, expected, above=0.0)
        offset = camera_height - float(rig.up @ rig.T_base_camera[:3, 3])
        return cls(normal=rig.up, offset=offset)

    def height(self, points: Floats) -> Floats:
        """Return the heights [m] above the plane of points, shape (..., 3) [m, base_link]."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=np.float64), -1, 0)
        normal = self.normal
        heights: Floats = normal[0] * x + normal[1] * y + normal[2] * z + self.offset
        return heights
