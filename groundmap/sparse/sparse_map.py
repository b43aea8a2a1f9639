"""The container of a sparse map, which every reader of a SLAM or SfM system fills."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Bools, Floats, Ints, as_floats
from groundmap.errors import InputError
from groundmap.sparse.cameras import Camera

ORTHONORMAL_TOLERANCE = 1e-3  # of rotations in a file; some print only four decimals
FARTHEST = 1e8  # [unit of the file]


@dataclass(frozen=True, kw_only=True, eq=False)
class SparseMap:
    """Poses, landmarks, and which view saw which landmark, in the world of a file.

    Positions are in the unit of the file, which is the metre if `metric`. Landmarks that are not
    finite, and sightings of them, are dropped and counted, and so are repeated sightings: a view
    sees a landmark once.

    Parameters
    ----------
    system : str
        The program that wrote the file, for messages: ``"COLMAP"``.
    T_world_camera : ndarray, shape (n, 4, 4)
        Poses of the cameras: x right, y down, z forward.
    landmarks : ndarray, shape (m, 3) [world]
    view_of, landmark_of : ndarray of int, shape (k,)
        View and row of `landmarks` of each sighting.
    ids : ndarray of int, shape (m,), optional
        Ids of the landmarks in the file; rows with the same id are measurements of one landmark.
        Default: the row.
    names : sequence of str, optional
        Names of the views; default: their number.
    timestamps : ndarray, shape (n,), optional [s]
    cameras : sequence of Camera, optional
    camera_of : ndarray of int, shape (n,), optional
        Camera of each view; default: the first.
    pixels : ndarray, shape (k, 2), optional [px]
        Column and row of each sighting, as the file states them.
    covariance : ndarray, shape (m, 3, 3), optional [world]
        Of the landmarks; default: from the bearings of the views.
    metric : bool, default False
        Whether the unit is known to be the metre.
    up : ndarray, shape (3,), optional [world]
        Direction against gravity, if the file states it.
    T_base_camera : ndarray, shape (n, 4, 4), optional
        Pose of the cameras in ``base_link``, if the file states it.
    dropped : Counter, optional
        What the reader left out, by reason.
    notes : tuple of str, optional
        Sentences for the user about what the reader found.

    Raises
    ------
    InputError
        A pose is not a rigid transform, an index leads nowhere, or arrays differ in length.

    Examples
    --------
    >>> found = SparseMap(
    ...     system="example", T_world_camera=np.eye(4)[None], landmarks=np.array([[0, 1.0, 5]]),
    ...     view_of=np.array([0, 0]), landmark_of=np.array([0, 0]),
    ... )
    >>> len(found), found.sightings, dict(found.dropped)
    (1, 1, {'repeated_sightings': 1})
    """

    system: str
    T_world_camera: Floats
    landmarks: Floats
    view_of: Ints
    landmark_of: Ints
    ids: Ints | None = None
    names: tuple[str, ...] = ()
    timestamps: Floats | None = None
    cameras: tuple[Camera, ...] = (Camera(model="unknown"),)
    camera_of: Ints | None = None
    pixels: Floats | None = None
    covariance: Floats | None = None
    metric: bool = False
    up: Floats | None = None
    T_base_camera: Floats | None = None
    dropped: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        poses = as_floats("poses", self.T_world_camera, (None, 4, 4))
        landmarks = as_floats("landmarks", self.landmarks, (None, 3))
        views, count = len(poses), len(landmarks)
        _set(self, T_world_camera=_rigid(poses), landmarks=landmarks)
        _set(self, ids=_defaulted(self.ids, np.arange(count), "ids"))
        _set(self, camera_of=_defaulted(self.camera_of, np.zeros(views, np.int64), "camera_of"))
        _set(self, names=self.names or tuple(map(str, range(views))), dropped=Counter(self.dropped))
        if len(self.names) != views:
            raise InputError("names", f"{views}, one per view", str(len(self.names)))
        _check_indices("camera of a view", self.camera_of, len(self.cameras))
        _check_indices("view of a sighting", self.view_of, views)
        _check_indices("landmark of a sighting", self.landmark_of, count)
        if len(self.view_of) != len(self.landmark_of):
            got = f"{len(self.view_of)} and {len(self.landmark_of)}"
            raise InputError("sightings", "as many views as landmarks", got)
        self._keep_sightings()

    def _keep_sightings(self) -> None:
        """Sort the sightings by view, each pair once, and drop those of invalid landmarks."""
        with np.errstate(invalid="ignore"):
            near: Bools = np.logical_and.reduce(np.abs(self.landmarks) <= FARTHEST, axis=1)
        valid = near[self.landmark_of]
        keys = self.view_of * max(len(self.landmarks), 1) + self.landmark_of
        _, first = np.unique(keys, return_index=True)
        kept = first[valid[first]]
        self.dropped["invalid_landmarks"] += int((~near).sum())
        self.dropped["sightings_of_invalid_landmarks"] += int((~valid).sum())
        self.dropped["repeated_sightings"] += (
            len(keys) - len(first) - int((~valid).sum() - (~valid[first]).sum())
        )
        pixels = None if self.pixels is None else self.pixels[kept]
        _set(self, view_of=self.view_of[kept], landmark_of=self.landmark_of[kept], pixels=pixels)
        _set(self, dropped=+self.dropped)

    def __len__(self) -> int:
        """Return the number of views."""
        return len(self.T_world_camera)

    @property
    def sightings(self) -> int:
        """Number of distinct pairs of a view and a landmark that it saw."""
        return len(self.view_of)

    @cached_property
    def landmark_count(self) -> int:
        """Number of landmarks: rows that share an id count once."""
        ids = np.asarray(self.ids)
        return len(np.unique(ids[ids >= 0])) + int((ids < 0).sum())

    @cached_property
    def offsets(self) -> Ints:
        """Where the sightings of each view begin, shape (n + 1,)."""
        return np.searchsorted(self.view_of, np.arange(len(self) + 1))

    def of_view(self, view: int) -> slice:
        """Return the sightings of one view."""
        return slice(int(self.offsets[view]), int(self.offsets[view + 1]))

    @property
    def centres(self) -> Floats:
        """Centres of the cameras, shape (n, 3) [world]."""
        return self.T_world_camera[:, :3, 3]

    def camera(self, view: int) -> Camera:
        """Return the camera of one view."""
        assert self.camera_of is not None
        return self.cameras[int(self.camera_of[view])]

    def offsets_from_cameras(self) -> Floats:
        """Return the vectors from the camera to the landmark of each sighting, (k, 3) [world]."""
        return self.landmarks[self.landmark_of] - self.centres[self.view_of]


def _set(target: SparseMap, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(target, name, value)


def _defaulted(given: npt.ArrayLike | None, default: Ints, name: str) -> Ints:
    if given is None:
        return default.astype(np.int64)
    array = np.asarray(given, dtype=np.int64)
    if array.shape != default.shape:
        raise InputError(name, f"shape {default.shape}", f"shape {array.shape}")
    return array


def _check_indices(name: str, indices: Ints | None, count: int) -> None:
    assert indices is not None
    wrong = np.flatnonzero((indices < 0) | (indices >= count))
    if len(wrong):
        expected = f"an index below {count}" if count else "none, as there is nothing to refer to"
        raise InputError(name, expected, str(indices[wrong[0]]), where=f"row {wrong[0]}")


def _rigid(poses: Floats) -> Floats:
    """Return the poses with rotations that are orthonormal to the last digit."""
    if len(poses) == 0:
        return poses
    near = np.isfinite(poses).all(axis=(1, 2)) & (np.abs(poses[:, :3, 3]) <= FARTHEST).all(axis=1)
    wrong = np.flatnonzero(~near)
    if len(wrong):
        expected = f"a finite pose within {FARTHEST:g} of the origin"
        got = str(poses[wrong[0], :3, 3].tolist())
        raise InputError("pose", expected, got, where=f"view {wrong[0]}")
    rotations = poses[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        products = rotations @ np.swapaxes(rotations, 1, 2)
        deviation = np.abs(products - np.eye(3)).max(axis=(1, 2))
        wrong = np.flatnonzero(~(deviation <= ORTHONORMAL_TOLERANCE))
    if len(wrong):
        got = f"rows off by {deviation[wrong[0]]:.3g}"
        expected = "a rotation with orthonormal rows"
        raise InputError("pose", expected, got, where=f"view {wrong[0]}")
    wrong = np.flatnonzero(np.linalg.det(rotations) < 0)
    if len(wrong):
        raise InputError("pose", "a rotation", "a reflection", where=f"view {wrong[0]}")
    left, _, right = np.linalg.svd(rotations)
    exact = poses.copy()
    exact[:, :3, :3] = left @ right
    exact[:, 3] = (0.0, 0.0, 0.0, 1.0)
    return exact
