"""Features given as positions alone: the borders of their images, and their covariance."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats, Ints
from groundmap.errors import FileFormatError
from groundmap.io.columns import KINDS, PIXEL_FIELDS, PLACE_FIELDS, Kind, Noise
from groundmap.io.feature_tables import FeatureTable
from groundmap.io.rig import IMAGE_KEYS, GivenRig
from groundmap.sparse.cameras import USUAL_FOCAL_PX
from groundmap.sparse.covariance import bearing_information, invert_information
from groundmap.view.stereo_rig import StereoRig

NO_BASELINE = 1e-6  # [m], of positions that no second image bounds
WIDEST_BORDER = 20.0  # tangent
# Of positions without a rig that no second view confirms: standard deviations along the ray, as a
# share of the depth squared [1/m], and across it [rad].
DEPTH_NOISE, BEARING_NOISE = 0.005, 1.0 / USUAL_FOCAL_PX


def rig_and_noise(
    path: Path, given: GivenRig, tables: dict[Kind, FeatureTable], T_map_camera: Floats
) -> tuple[StereoRig, Noise]:
    """Return the rig of a folder, and the covariance of positions that have none.

    Parameters
    ----------
    path : Path
        Of the rig, for error messages.
    given : GivenRig
    tables : dict of FeatureTable
    T_map_camera : ndarray, shape (n, 4, 4) [m, map]

    Raises
    ------
    FileFormatError
        Features in pixels, and no numbers of the images.
    """
    if given.rig is not None:
        rig = given.rig
        return rig, lambda rows, xyz: rig.covariance_at(xyz)
    for kind in KINDS:
        if tables[kind].layout.fields == PIXEL_FIELDS and not tables[kind].is_empty:
            expected = f"{', '.join(IMAGE_KEYS)}, as {kind} are in pixels"
            raise FileFormatError(path, expected, "none of them")
    border = max(_border(tables[kind], len(T_map_camera)) for kind in KINDS) or 1.0
    centre = border * USUAL_FOCAL_PX
    rig = StereoRig(
        fx=USUAL_FOCAL_PX,
        fy=USUAL_FOCAL_PX,
        cx=centre,
        cy=centre,
        baseline=NO_BASELINE,
        T_base_camera=given.T_base_camera,
    )
    return rig, TrackNoise(tables["points"], T_map_camera)


def _border(table: FeatureTable, views: int) -> float:
    """Return the largest tangent of the bearings of features; 0 if there are none."""
    widest = 0.0
    for rows in () if table.is_empty else table.chunks(views):
        x, _, z = np.moveaxis(table.layout.positions(rows), -1, 0)
        ahead = z > 0
        with np.errstate(over="ignore", invalid="ignore"):
            tangents = np.abs(x[ahead] / z[ahead])
        widest = max(widest, float(tangents[np.isfinite(tangents)].max(initial=0.0)))
    return min(widest, WIDEST_BORDER)


class TrackNoise:
    """The covariance of landmarks from the bearings of all views that saw them.

    Parameters
    ----------
    table : FeatureTable
        Points; only their ids tell which view saw which landmark. Others get the noise of a
        measured depth.
    T_map_camera : ndarray, shape (n, 4, 4) [m, map]
    """

    def __init__(self, table: FeatureTable, T_map_camera: Floats) -> None:
        self._rotations = T_map_camera[:, :3, :3]
        self._ids = np.empty(0, dtype=np.int64)
        information, views = np.empty((0, 6)), np.empty(0, dtype=np.int64)
        if table.layout.fields == PLACE_FIELDS:
            for rows in table.chunks(len(T_map_camera)):
                information, views = self._add(
                    rows, table.layout.positions(rows), information, views
                )
        shared = views > 1
        self._ids = self._ids[shared]
        self._covariance = invert_information(information[shared], np.full(shared.sum(), np.inf))

    def _add(
        self, rows: npt.NDArray[Any], xyz: Floats, information: Floats, views: Ints
    ) -> tuple[Floats, Ints]:
        """Add the bearings of rows to the sums of their landmarks, and to the counts of views."""
        kept = (rows["id"] >= 0) & np.isfinite(xyz).all(axis=1) & (np.abs(xyz) < 1e8).all(axis=1)
        offsets = np.einsum("kij,kj->ki", self._rotations[rows["view"][kept]], xyz[kept])
        ids = np.concatenate([self._ids, rows["id"][kept]])
        self._ids, place = np.unique(ids, return_inverse=True)
        values = np.concatenate([information, bearing_information(offsets, BEARING_NOISE)])
        counts = np.concatenate([views, np.ones(int(kept.sum()), dtype=np.int64)])
        sums = [np.bincount(place, column, minlength=len(self._ids)) for column in values.T]
        return np.stack(sums, axis=1), np.bincount(place, counts).astype(np.int64)

    def __call__(self, rows: npt.NDArray[Any], xyz: Floats) -> Floats:
        """Return covariances in the frame of the camera that saw the features.

        Parameters
        ----------
        rows : ndarray, shape (n,)
            Of one view.
        xyz : ndarray, shape (n, 3) or (n, 2, 3) [m, camera]
        """
        covariance = measured_covariance(xyz)
        if xyz.ndim == 2 and len(self._ids) and len(rows):
            place = np.searchsorted(self._ids, rows["id"]).clip(max=len(self._ids) - 1)
            known = self._ids[place] == rows["id"]
            rotation = self._rotations[rows["view"][0]]
            covariance[known] = rotation.T @ self._covariance[place[known]] @ rotation
        return covariance


def measured_covariance(xyz: Floats) -> Floats:
    """Return the covariance of measured positions, shape (..., 3, 3) [m², camera].

    Parameters
    ----------
    xyz : ndarray, shape (..., 3) [m, camera]
    """
    with np.errstate(over="ignore", invalid="ignore"):
        squared = np.maximum(np.einsum("...i,...i->...", xyz, xyz), 1e-12)
        rays = xyz[..., :, None] * xyz[..., None, :] / squared[..., None, None]
        across = BEARING_NOISE**2 * squared
        along = np.maximum(DEPTH_NOISE**2 * squared**2, across)
        covariance: Floats = across[..., None, None] * np.eye(3)
        covariance += (along - across)[..., None, None] * rays
    return covariance
