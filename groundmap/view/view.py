"""Views: what one stereo observation gives, in the form that everything after it reads."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, Ints, as_floats, as_number
from groundmap.errors import InputError
from groundmap.view.frames import check_transform
from groundmap.view.ground_plane import GroundPlane
from groundmap.view.stereo_rig import StereoRig

COVARIANCE_TOLERANCE = 1e-5  # of the largest entry: what text with five digits is off
FARTHEST = 1e8  # [m] from the camera


@dataclass(frozen=True, eq=False)
class Features:
    """Point or segment features of one view, in the camera frame.

    Parameters
    ----------
    xyz : array_like, shape (n, 3) or (n, 2, 3) [m, camera]
        Points, or both ends of segments.
    covariance : array_like, shape (n, 3, 3) or (n, 2, 3, 3) [m², camera]
    ids : array_like, shape (n,), optional
        Landmark ids; -1 where a feature has none.

    Raises
    ------
    InputError
        Shapes that do not belong together; from `points` and `segments`, a covariance that is not
        symmetric and positive semi-definite, too.
    """

    xyz: Floats
    covariance: Floats
    ids: Ints

    def __post_init__(self) -> None:
        if len(self.covariance) != len(self.xyz) or len(self.ids) != len(self.xyz):
            raise InputError(
                "features",
                f"covariance and ids of the {len(self.xyz)} features",
                f"{len(self.covariance)} and {len(self.ids)}",
            )

    def __len__(self) -> int:
        return len(self.xyz)

    @classmethod
    def points(
        cls, xyz: npt.ArrayLike, covariance: npt.ArrayLike, ids: npt.ArrayLike | None = None
    ) -> Features:
        """Return point features from XYZ and covariance."""
        return cls._check(xyz, covariance, ids, ())

    @classmethod
    def segments(
        cls, xyz: npt.ArrayLike, covariance: npt.ArrayLike, ids: npt.ArrayLike | None = None
    ) -> Features:
        """Return segment features from the XYZ and covariance of both ends."""
        return cls._check(xyz, covariance, ids, (2,))

    @classmethod
    def _check(
        cls,
        xyz: npt.ArrayLike,
        covariance: npt.ArrayLike,
        ids: npt.ArrayLike | None,
        ends: tuple[int, ...],
    ) -> Features:
        positions = as_floats("xyz", xyz, (None, *ends, 3))
        spread = as_floats("covariance", covariance, (None, *ends, 3, 3))
        wrong = wrong_covariance(spread)
        if wrong is not None:
            where = f"index {wrong.row}"
            raise InputError("covariance", wrong.expected, wrong.got, where=where)
        if ids is None:
            return cls(positions, spread, np.full(len(positions), -1, dtype=np.int64))
        return cls(positions, spread, _as_ids("ids", ids))

    def select(self, keep: npt.NDArray[np.generic]) -> Features:
        """Return the features that a mask or an index array picks."""
        return Features(self.xyz[keep], self.covariance[keep], self.ids[keep])


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One stereo observation.

    Parameters
    ----------
    T_map_base : array_like, shape (4, 4)
        Pose of ``base_link`` in the map.
    rig : StereoRig
    points, segments : Features
        Features in the camera frame. Rows that are not finite, lie behind the camera or beyond
        1e8 m are dropped and counted; `from_pixels` counts those without disparity, too.
    timestamp : float, optional [s]
    plane : GroundPlane, optional
        The ground under this view; `groundmap.fit_ground` puts it there.
    dropped : Counter
        Features given but not kept, by reason.

    Raises
    ------
    CameraError
        The pose is not a rigid transform.
    """

    T_map_base: Floats
    rig: StereoRig
    points: Features = field(default_factory=lambda: _no_features(()))
    segments: Features = field(default_factory=lambda: _no_features((2,)))
    timestamp: float | None = None
    plane: GroundPlane | None = None
    dropped: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_map_base", check_transform("T_map_base", self.T_map_base))
        if self.timestamp is not None:
            object.__setattr__(self, "timestamp", _as_time(self.timestamp))
        dropped = Counter(self.dropped)
        for name in ("points", "segments"):
            features: Features = getattr(self, name)
            axes = tuple(range(1, features.xyz.ndim))
            finite: Bools = np.logical_and.reduce(np.isfinite(features.xyz), axis=axes)
            finite &= np.isfinite(features.covariance).all(axis=(*axes, axes[-1] + 1))
            with np.errstate(invalid="ignore"):
                ahead: Bools = np.logical_and.reduce(features.xyz[..., 2] > 0, axis=axes[:-1])
            near: Bools = np.logical_and.reduce(np.abs(features.xyz) <= FARTHEST, axis=axes)
            if not (finite & ahead & near).all():
                dropped["not_finite"] += int((~finite).sum())
                dropped["behind_camera"] += int((finite & ~ahead).sum())
                dropped["out_of_range"] += int((finite & ahead & ~near).sum())
                object.__setattr__(self, name, features.select(finite & ahead & near))
        object.__setattr__(self, "dropped", +dropped)

    @classmethod
    def from_pixels(
        cls,
        T_map_base: npt.ArrayLike,
        rig: StereoRig,
        *,
        points_px: npt.ArrayLike = (),
        segments_px: npt.ArrayLike = (),
        point_ids: npt.ArrayLike | None = None,
        segment_ids: npt.ArrayLike | None = None,
        timestamp: float | None = None,
    ) -> View:
        """Return the view of matched pixels: (uL, uR, v), or both ends of segments [px].

        Examples
        --------
        >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
        >>> view = View.from_pixels(np.eye(4), rig, points_px=[(355, 320, 275), (320, 320, 240)])
        >>> len(view.points), dict(view.dropped)
        (1, {'no_disparity': 1})
        """
        points = rig.triangulate(as_floats("points_px", points_px, (None, 3)))
        segments = rig.triangulate(as_floats("segments_px", segments_px, (None, 2, 3)))
        return cls(
            T_map_base=as_floats("T_map_base", T_map_base, (4, 4)),
            rig=rig,
            points=Features(
                points.xyz, points.covariance, _select_rows(point_ids, points.kept, "point_ids")
            ),
            segments=Features(
                segments.xyz,
                segments.covariance,
                _select_rows(segment_ids, segments.kept, "segment_ids"),
            ),
            timestamp=timestamp,
            dropped=points.dropped + segments.dropped,
        )

    @property
    def T_map_camera(self) -> Floats:
        """Pose of the left camera in the map, shape (4, 4)."""
        return self.T_map_base @ self.rig.T_base_camera

    def with_plane(self, plane: GroundPlane) -> View:
        """Return this view standing on `plane`, given in its ``base_link`` frame."""
        return replace(self, plane=plane)


class WrongCovariance(NamedTuple):
    """The first covariance that none can be."""

    row: int  #: index of the feature
    expected: str
    got: str


def wrong_covariance(covariance: Floats) -> WrongCovariance | None:
    """Return the first feature whose covariance is not symmetric or has a negative eigenvalue.

    Rounding is allowed for, to `COVARIANCE_TOLERANCE` of the largest entry; what is not finite is
    passed over, since views drop and count it.

    Parameters
    ----------
    covariance : ndarray, shape (n, 3, 3) or (n, 2, 3, 3) [m²]

    Examples
    --------
    >>> wrong_covariance(np.array([np.eye(3), np.diag([1.0, 1.0, -0.5])]))
    WrongCovariance(row=1, expected='a positive semi-definite matrix', got='the eigenvalue -0.5')
    """
    matrices = covariance.reshape(-1, 3, 3)
    finite = np.flatnonzero(np.isfinite(matrices).all(axis=(1, 2)))
    matrices = matrices[finite]
    largest = np.abs(matrices).max(axis=(1, 2), initial=0.0)
    scaled = matrices / np.where(largest > 0, largest, 1.0)[:, None, None]
    skew = np.abs(scaled - np.swapaxes(scaled, 1, 2)).max(axis=(1, 2), initial=0.0)
    lowest = np.linalg.eigvalsh(scaled)[:, 0]
    wrong = np.flatnonzero((skew > COVARIANCE_TOLERANCE) | (lowest < -COVARIANCE_TOLERANCE))
    if not len(wrong):
        return None
    first = wrong[0]
    row = int(finite[first]) // (len(covariance.reshape(-1, 3, 3)) // len(covariance))
    if skew[first] > COVARIANCE_TOLERANCE:
        off = skew[first] * largest[first]
        return WrongCovariance(row, "a symmetric matrix", f"entries that differ by {off:.3g}")
    eigenvalue = lowest[first] * largest[first]
    return WrongCovariance(
        row, "a positive semi-definite matrix", f"the eigenvalue {eigenvalue:.3g}"
    )


def sigma_along(direction: Floats, covariance: Floats) -> Floats:
    """Return the standard deviation along a unit vector, shape (...), of (..., 3, 3) [m]."""
    variance = np.einsum("i,...ij,j->...", direction, covariance, direction)
    # What was rounded may be a little below 0 in a direction that is known exactly.
    sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
    return sigma


def _select_rows(ids: npt.ArrayLike | None, kept: npt.NDArray[np.bool_], name: str) -> Ints:
    if ids is None:
        return np.full(int(kept.sum()), -1, dtype=np.int64)
    array = _as_ids(name, ids)
    if array.shape != kept.shape:
        raise InputError(name, f"shape {kept.shape}", f"shape {array.shape}")
    picked: Ints = array[kept]
    return picked


def _as_ids(name: str, ids: npt.ArrayLike) -> Ints:
    try:
        array = np.asarray(ids)
    except ValueError as error:
        raise InputError(name, "whole numbers of shape (n,)", repr(ids)[:60]) from error
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InputError(
            name, "whole numbers of shape (n,)", f"{array.dtype} of shape {array.shape}"
        )
    if array.dtype.kind == "u" and (array > np.iinfo(np.int64).max).any():
        raise InputError(name, "whole numbers within 64 bits", str(array.max()))
    return array.astype(np.int64)


def _as_time(timestamp: object) -> float:
    """Return a time stamp as a float: finite or not, as `groundmap.write_views` tells."""
    if isinstance(timestamp, (float, np.floating)):
        return float(timestamp)
    return as_number("timestamp", timestamp, "a number [s], or none")


def _no_features(ends: tuple[int, ...]) -> Features:
    return Features(
        np.empty((0, *ends, 3)), np.empty((0, *ends, 3, 3)), np.empty(0, dtype=np.int64)
    )
