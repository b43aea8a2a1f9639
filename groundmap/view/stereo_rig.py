"""The stereo rig: 3-D points with covariance from matched pixels."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, as_floats, as_number, as_numbers, is_number
from groundmap.errors import CameraError
from groundmap.printable import format_value
from groundmap.view.frames import check_transform

MOST = 1e9  # bound of all numbers of a rig; their squares and products stay finite


class Triangulated(NamedTuple):
    """Result of `StereoRig.triangulate`: n of the m given rows have a 3-D position."""

    xyz: Floats  #: shape (n, 3) or (n, 2, 3) [m, camera]
    covariance: Floats  #: shape (n, 3, 3) or (n, 2, 3, 3) [m², camera]
    kept: Bools  #: shape (m,), true for these n rows
    dropped: Counter[str]  #: number of dropped rows by reason


@dataclass(frozen=True, kw_only=True, eq=False)
class StereoRig:
    """A rectified stereo pair and its mounting on the robot.

    Parameters
    ----------
    fx, fy : float
        Focal lengths [px].
    cx, cy : float
        Principal point of the left image [px].
    baseline : float
        Distance between the two cameras [m].
    pixel_noise_px : float, default 0.5
        Standard deviation of a matched pixel coordinate [px].
    T_base_camera : array_like, shape (4, 4), default the identity
        Pose of the left camera in ``base_link``. With the identity, the poses of views are those
        of the camera itself, with optical axes (x right, y down, z forward).

    Raises
    ------
    CameraError
        A focal length, the baseline or the noise is not above 0, a number is not finite or is
        above 1e9, or `T_base_camera` is not a rigid transform.

    Examples
    --------
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> rig.triangulate([(355.0, 320.0, 275.0)]).xyz
    array([[ 0.5,  0.5, 10. ]])
    """

    fx: float
    fy: float
    cx: float
    cy: float
    baseline: float
    pixel_noise_px: float = 0.5
    T_base_camera: Floats = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        units = {"fx": "px", "fy": "px", "baseline": "m", "pixel_noise_px": "px"}
        for name, unit in units.items():
            given, expected = getattr(self, name), f"a number above 0 [{unit}]"
            value = as_number(name, given, expected, above=0.0, error=CameraError)
            if value > MOST:
                raise CameraError(name, f"a number up to {MOST:g} [{unit}]", format_value(value))
            object.__setattr__(self, name, value)
        for value in (self.cx, self.cy):
            if not (is_number(value) and abs(value) < MOST):
                expected = f"finite numbers [px], below {MOST:g}"
                raise CameraError(
                    "cx, cy", expected, f"{format_value(self.cx)}, {format_value(self.cy)}"
                )
        object.__setattr__(self, "cx", float(self.cx))
        object.__setattr__(self, "cy", float(self.cy))
        object.__setattr__(
            self, "T_base_camera", check_transform("T_base_camera", self.T_base_camera)
        )

    @property
    def is_mounted(self) -> bool:
        """Whether poses are those of a base that carries the camera, not of the camera itself."""
        return not np.array_equal(self.T_base_camera, np.eye(4))

    @property
    def up(self) -> Floats:
        """Unit vector that points up, shape (3,) [base_link].

        It is z for a mounted camera, and -y where the poses are those of the camera itself.
        """
        return np.array([0.0, 0.0, 1.0]) if self.is_mounted else np.array([0.0, -1.0, 0.0])

    @property
    def forward(self) -> Floats:
        """Unit vector that points forward, shape (3,) [base_link].

        It is x for a mounted camera, and z where the poses are those of the camera itself.
        """
        return np.array([1.0, 0.0, 0.0]) if self.is_mounted else np.array([0.0, 0.0, 1.0])

    def triangulate(self, pixels: npt.ArrayLike) -> Triangulated:
        """Return the 3-D positions of matched pixels; rows without one are dropped and counted.

        Parameters
        ----------
        pixels : array_like, shape (m, 3) or (m, 2, 3) [px]
            (uL, uR, v) of points, or of both ends of segments. A segment is dropped if one of its
            ends is.

        Returns
        -------
        Triangulated
            Reasons for dropped rows are ``not_finite`` and ``no_disparity`` (uL - uR is not above
            0).

        Raises
        ------
        InputError
            `pixels` are not numbers of one of these shapes.

        Notes
        -----
        The depth is fx * baseline / disparity. The covariance propagates independent noise of uL,
        uR and v through the Jacobian (Matthies and Shafer 1987).
        """
        array = as_numbers("pixels", pixels, "numbers of shape (n, 3) or (n, 2, 3)")
        ends = array.ndim == 3
        array = as_floats("pixels", array, (None, 2, 3) if ends else (None, 3))
        rows = array.reshape(len(array), 2 if ends else 1, 3)
        finite: Bools = np.logical_and.reduce(np.isfinite(rows), axis=(1, 2))
        with np.errstate(over="ignore", invalid="ignore"):
            disparity_px = rows[:, :, 0] - rows[:, :, 1]
            visible: Bools = np.logical_and.reduce(disparity_px > 0, axis=1)
        kept: Bools = finite & visible
        dropped = Counter(
            {
                "not_finite": int((~finite).sum()),
                "no_disparity": int((finite & ~visible).sum()),
            }
        )
        # Positions that overflow are dropped by the view.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            xyz = self._points(rows[kept], disparity_px[kept])
            covariance = self._covariance(xyz, disparity_px[kept])
        shape = (len(xyz), 2) if ends else (len(xyz),)
        return Triangulated(
            xyz.reshape(*shape, 3), covariance.reshape(*shape, 3, 3), kept, +dropped
        )

    def covariance_at(self, xyz: Floats) -> Floats:
        """Return the covariance that positions would have if they were matched pixels.

        Parameters
        ----------
        xyz : ndarray, shape (..., 3) [m, camera]

        Returns
        -------
        ndarray, shape (..., 3, 3) [m², camera]
        """
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return self._covariance(xyz, self.fx * self.baseline / xyz[..., 2])

    def _points(self, rows: Floats, disparity_px: Floats) -> Floats:
        scale = self.baseline / disparity_px
        x = (rows[..., 0] - self.cx) * scale
        y = (rows[..., 2] - self.cy) * scale * (self.fx / self.fy)
        return np.stack([x, y, self.fx * scale], axis=-1)

    def _covariance(self, xyz: Floats, disparity_px: Floats) -> Floats:
        scale = self.baseline / disparity_px
        jacobian = np.zeros((*disparity_px.shape, 3, 3))
        by_disparity = -xyz / disparity_px[..., None]
        jacobian[..., :, 0] = by_disparity
        jacobian[..., :, 1] = -by_disparity
        jacobian[..., 0, 0] += scale
        jacobian[..., 1, 2] = scale * (self.fx / self.fy)
        variance = self.pixel_noise_px**2
        covariance: Floats = variance * (jacobian @ np.swapaxes(jacobian, -1, -2))
        return covariance
