"""Views from a sparse map, one at a time."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from groundmap.arrays import Bools, Floats
from groundmap.sparse.cameras import Camera
from groundmap.sparse.covariance import landmark_covariance
from groundmap.sparse.sparse_map import SparseMap
from groundmap.view.frames import T_REP103_OPTICAL, invert
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features, View

NO_BASELINE = 1e-6  # [m], of a single camera: its left and right image see the same
WIDE = np.cos(np.radians(65.0))  # of the angle off the optical axis that a flat image reaches
WIDE_SHARE = 0.01  # of the sightings beyond it that make a camera wide
SECTORS = 4  # views that a wide view is split into
OVERLAP = np.radians(5.0)  # of neighbouring sectors on either side, so that links cross borders
USUAL_BORDER = 1.0  # tangent, of a camera that saw nothing
WIDEST_BORDER = 20.0
DIGITS = re.compile(r"([0-9]+)")


class SparseViews:
    """The views of a sparse map, in the ``map`` frame, which can be iterated over repeatedly.

    A camera with a wide or spherical image is split into four views with flat images, which look
    in horizontal directions and overlap by 10 degrees.

    Parameters
    ----------
    sparse : SparseMap
    point_noise : float, optional [unit of the file]
        Standard deviation of the positions of landmarks; default: `landmark_covariance`.
    """

    def __init__(self, sparse: SparseMap, *, point_noise: float | None = None) -> None:
        self.sparse = sparse
        self._covariance = landmark_covariance(sparse, point_noise=point_noise)
        self._T_map_world = np.eye(4) if _is_rep103(sparse) else T_REP103_OPTICAL
        self._wide = _wide_cameras(sparse)
        self._rigs = [_rig(camera, _border(sparse, n)) for n, camera in enumerate(sparse.cameras)]
        self._up = _up(sparse)
        self._order = _order(sparse)

    def __len__(self) -> int:
        """Return the number of views; a wide one counts as four."""
        assert self.sparse.camera_of is not None
        wide = self._wide[self.sparse.camera_of]
        return int(np.where(wide, SECTORS, 1).sum())

    @property
    def split(self) -> int:
        """Number of views of the sparse map that are split."""
        assert self.sparse.camera_of is not None
        return int(self._wide[self.sparse.camera_of].sum())

    def __iter__(self) -> Iterator[View]:
        """Iterate over the views in the order of their times, or of the numbers in their names."""
        assert self.sparse.camera_of is not None
        for view in self._order:
            camera = int(self.sparse.camera_of[view])
            if self._wide[camera]:
                yield from self._sectors(view)
            else:
                yield self._view(view, self.sparse.T_world_camera[view], self._rigs[camera])

    def _view(
        self, view: int, T_world_camera: Floats, rig: StereoRig, keep: Bools | None = None
    ) -> View:
        sparse = self.sparse
        rows = sparse.landmark_of[sparse.of_view(view)]
        if keep is not None:
            rows = rows[keep]
        rotation = T_world_camera[:3, :3]
        xyz = (sparse.landmarks[rows] - T_world_camera[:3, 3]) @ rotation
        covariance = rotation.T @ self._covariance[rows] @ rotation
        assert sparse.ids is not None
        T_map_base = self._T_map_world @ T_world_camera
        if sparse.T_base_camera is not None and keep is None:
            rig = StereoRig(**{**vars(rig), "T_base_camera": sparse.T_base_camera[view]})
            T_map_base = T_map_base @ invert(sparse.T_base_camera[view])
        return View(
            T_map_base=T_map_base,
            rig=rig,
            points=Features(xyz, covariance, sparse.ids[rows]),
            timestamp=None if sparse.timestamps is None else float(sparse.timestamps[view]),
        )

    def _sectors(self, view: int) -> Iterator[View]:
        """Yield views in four horizontal directions, the first near that of the camera."""
        sparse = self.sparse
        T_world_camera = sparse.T_world_camera[view]
        offsets = sparse.landmarks[sparse.landmark_of[sparse.of_view(view)]] - T_world_camera[:3, 3]
        border = np.tan(np.pi / SECTORS + OVERLAP)
        rig = _rig(sparse.camera(view), float(border))
        for rotation in _sector_axes(T_world_camera[:3, :3], self._up):
            x, _, z = (offsets @ rotation).T
            inside = (z > 0) & (np.abs(x) <= border * z)
            T_world_sector = T_world_camera.copy()
            T_world_sector[:3, :3] = rotation
            yield self._view(view, T_world_sector, rig, inside)


def _order(sparse: SparseMap) -> list[int]:
    """Return the views by time; without times, by the names of their files, then of the folders."""
    views = range(len(sparse))
    if sparse.timestamps is not None:
        times = sparse.timestamps
        return sorted(views, key=lambda view: float(times[view]))
    return sorted(views, key=lambda view: _name_key(sparse.names[view]))


def _name_key(name: str) -> tuple[list[tuple[int, str]], str]:
    """Return a key that sorts ``image2`` before ``image10``, and pairs of a rig side by side."""
    base = name.replace("\\", "/").rpartition("/")[2]
    parts = DIGITS.split(base)
    return [(int(part[-18:]), part) if part.isdigit() else (-1, part) for part in parts], name


def _is_rep103(sparse: SparseMap) -> bool:
    """Return whether z of the world points up."""
    return sparse.up is not None and float(sparse.up[2]) > 0.9


def _up(sparse: SparseMap) -> Floats:
    """Return the direction up, shape (3,) [world]: the file's, or the mean of the cameras' -y."""
    if sparse.up is not None:
        return sparse.up / np.linalg.norm(sparse.up)
    up = -sparse.T_world_camera[:, :3, 1].mean(axis=0) if len(sparse) else np.zeros(3)
    length = float(np.linalg.norm(up))
    return up / length if length > 0 else np.array([0.0, -1.0, 0.0])


def _sector_axes(rotation: Floats, up: Floats) -> Iterator[Floats]:
    """Yield rotations of horizontal cameras, columns right, down and forward [world]."""
    # The longer of two axes, if the camera looks up or down.
    forward = max((_horizontal(rotation[:, axis], up) for axis in (2, 1)), key=np.linalg.norm)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(-up, forward)
    for angle in np.arange(SECTORS) * (2.0 * np.pi / SECTORS):
        ahead = np.cos(angle) * forward + np.sin(angle) * right
        yield np.column_stack([np.cross(-up, ahead), -up, ahead])


def _horizontal(axis: Floats, up: Floats) -> Floats:
    flat: Floats = axis - (axis @ up) * up
    return flat


def _wide_cameras(sparse: SparseMap) -> Bools:
    """Return which cameras see too widely for a flat image, shape (cameras,)."""
    declared = np.array([camera.projection == "equirectangular" for camera in sparse.cameras])
    offsets = sparse.offsets_from_cameras()
    axes = sparse.T_world_camera[sparse.view_of, :3, 2]
    along = np.einsum("ki,ki->k", offsets, axes)
    off_axis = along < WIDE * np.linalg.norm(offsets, axis=1)
    assert sparse.camera_of is not None
    owner = sparse.camera_of[sparse.view_of]
    total = np.bincount(owner, minlength=len(sparse.cameras))
    beyond = np.bincount(owner, weights=off_axis, minlength=len(sparse.cameras))
    fisheye = np.array([camera.projection == "fisheye" for camera in sparse.cameras])
    wide: Bools = declared | (fisheye & (beyond > WIDE_SHARE * np.maximum(total, 1)))
    return wide


def _border(sparse: SparseMap, number: int) -> float:
    """Return the tangent of the borders of a camera's image: the file's, or of its sightings."""
    known = sparse.cameras[number].border
    if known is not None:
        return min(known, WIDEST_BORDER)
    assert sparse.camera_of is not None
    own = sparse.camera_of[sparse.view_of] == number
    rotations = sparse.T_world_camera[sparse.view_of[own], :3, :3]
    offsets = sparse.offsets_from_cameras()[own]
    x, _, z = np.einsum("ki,kij->jk", offsets, rotations)
    tangents = np.abs(x[z > 0] / z[z > 0])
    return float(min(tangents.max(initial=0.0), WIDEST_BORDER)) or USUAL_BORDER


def _rig(camera: Camera, border: float) -> StereoRig:
    """Return a rig whose image has the given borders."""
    centre = border * camera.focal_px
    return StereoRig(
        fx=camera.focal_px, fy=camera.focal_px, cx=centre, cy=centre, baseline=NO_BASELINE
    )
