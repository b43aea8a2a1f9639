"""Views: one stereo observation each, the input of everything after it."""

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

COVARIANCE_TOLERANCE = 1e-5  # relative to the largest entry; the rounding of five digits
FARTHEST = 1e8  # [m] from the camera


@dataclass(frozen=True, eq=False)
class Features:
    """Point or segment features of one view, in the camera frame.

    Construct them with `Features.points` or `Features.segments`, which check their arguments.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3) or (n, 2, 3) [m, camera]
        Points, or both ends of segments.
    covariance : ndarray, shape (n, 3, 3) or (n, 2, 3, 3) [m², camera]
    ids : ndarray, shape (n,)
        Landmark ids; -1 for features without one.

    Raises
    ------
    InputError
        The arrays differ in length.

    Examples
    --------
    >>> landmarks = Features.points([(0.5, 1.5, 8.0)], [0.01 * np.eye(3)], ids=[7])
    >>> len(landmarks), landmarks.ids
    (1, array([7]))
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
        """Return point features from their positions and covariances.

        Parameters
        ----------
        xyz : array_like, shape (n, 3) [m, camera]
        covariance : array_like, shape (n, 3, 3) [m², camera]
        ids : array_like of int, shape (n,), optional
            Landmark ids; default: -1, no id.

        Raises
        ------
        InputError
            A shape is wrong, or a covariance is not symmetric and positive semi-definite.
        """
        return cls._check(xyz, covariance, ids, ())

    @classmethod
    def segments(
        cls, xyz: npt.ArrayLike, covariance: npt.ArrayLike, ids: npt.ArrayLike | None = None
    ) -> Features:
        """Return segment features from the positions and covariances of both ends.

        Parameters
        ----------
        xyz : array_like, shape (n, 2, 3) [m, camera]
        covariance : array_like, shape (n, 2, 3, 3) [m², camera]
        ids : array_like of int, shape (n,), optional
            Landmark ids; default: -1, no id.

        Raises
        ------
        InputError
            A shape is wrong, or a covariance is not symmetric and positive semi-definite.
        """
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
        covariances = as_floats("covariance", covariance, (None, *ends, 3, 3))
        wrong = wrong_covariance(covariances)
        if wrong is not None:
            where = f"index {wrong.row}"
            raise InputError("covariance", wrong.expected, wrong.got, where=where)
        if ids is None:
            return cls(positions, covariances, np.full(len(positions), -1, dtype=np.int64))
        return cls(positions, covariances, _as_ids("ids", ids))

    def select(self, keep: npt.NDArray[np.generic]) -> Features:
        """Return the features that a mask or an array of indices selects."""
        return Features(self.xyz[keep], self.covariance[keep], self.ids[keep])


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One stereo observation: a pose, and the features seen from it.

    Features that are not finite, lie behind the camera or are more than 1e8 m away are dropped and
    counted in `dropped`.

    Parameters
    ----------
    T_map_base : array_like, shape (4, 4) [m, map]
        Pose of ``base_link`` in the map.
    rig : StereoRig
    points, segments : Features, default none
        Features in the camera frame.
    timestamp : float, optional [s]
    plane : GroundPlane, optional
        The ground under this view, as `groundmap.fit_ground` determines it.
    dropped : Counter, default empty
        Number of features that were dropped before, by reason.

    Raises
    ------
    CameraError
        The pose is not a rigid transform.
    InputError
        The timestamp is not a number.

    Examples
    --------
    >>> rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    >>> landmarks = Features.points([(0.5, 1.5, 8.0), (0.0, 0.0, -1.0)], [0.01 * np.eye(3)] * 2)
    >>> view = View(T_map_base=np.eye(4), rig=rig, points=landmarks)
    >>> len(view.points), dict(view.dropped)
    (1, {'behind_camera': 1})
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
        """Return a view from matched pixels.

        Features without a positive disparity are dropped and counted as well.

        Parameters
        ----------
        T_map_base : array_like, shape (4, 4) [m, map]
        rig : StereoRig
        points_px : array_like, shape (n, 3), optional [px]
            (uL, uR, v): columns in the left and right image, and the common row.
        segments_px : array_like, shape (k, 2, 3), optional [px]
            (uL, uR, v) of both ends.
        point_ids : array_like of int, shape (n,), optional
            Landmark ids; default: -1, no id.
        segment_ids : array_like of int, shape (k,), optional
        timestamp : float, optional [s]

        Raises
        ------
        CameraError
            The pose is not a rigid transform.
        InputError
            An array has a wrong shape, or the timestamp is not a number.

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
        """Pose of the left camera in the map, shape (4, 4) [m, map]."""
        return self.T_map_base @ self.rig.T_base_camera

    def with_plane(self, plane: GroundPlane) -> View:
        """Return a copy of this view with another ground plane."""
        return replace(self, plane=plane)


class WrongCovariance(NamedTuple):
    """The first matrix of an array that is not a covariance."""

    row: int  #: index of the feature
    expected: str
    got: str


def wrong_covariance(covariance: Floats) -> WrongCovariance | None:
    """Return the first feature whose covariance is not symmetric or has a negative eigenvalue.

    Rounding errors of up to 1e-5 of the largest entry are accepted. Matrices that are not finite
    are skipped, since views drop and count their features.

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
    """Return standard deviations along a direction, shape (...) [m].

    Parameters
    ----------
    direction : ndarray, shape (3,)
        Unit vector, in the frame of the covariances.
    covariance : ndarray, shape (..., 3, 3) [m²]
    """
    variance = np.einsum("i,...ij,j->...", direction, covariance, direction)
    # Rounding can make a variance of 0 negative.
    sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
    return sigma


def _select_rows(ids: npt.ArrayLike | None, kept: npt.NDArray[np.bool_], name: str) -> Ints:
    if ids is None:
        return np.full(int(kept.sum()), -1, dtype=np.int64)
    array = _as_ids(name, ids)
    if array.shape != kept.shape:
        raise InputError(name, f"shape {kept.shape}", f"shape {array.shape}")
    selected: Ints = array[kept]
    return selected


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
    """Return a timestamp as a float; `groundmap.write_views` refuses one that is not finite."""
    if isinstance(timestamp, (float, np.floating)):
        return float(timestamp)
    return as_number("timestamp", timestamp, "a number [s] or None")


def _no_features(ends: tuple[int, ...]) -> Features:
    return Features(
        np.empty((0, *ends, 3)), np.empty((0, *ends, 3, 3)), np.empty(0, dtype=np.int64)
    )
