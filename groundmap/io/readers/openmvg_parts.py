"""The content of OpenMVG's ``sfm_data``."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from groundmap.arrays import Floats, Ints
from groundmap.sparse.cameras import Camera, Projection, equirectangular

View = tuple[int, str, int, int]  # key, name, and the ids of its pose and its intrinsics


@dataclass
class SfmData:
    """Views, cameras, poses and landmarks, as the file lists them."""

    views: list[View] = field(default_factory=list)
    intrinsics: dict[int, Camera] = field(default_factory=dict)
    poses: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)  #: rotation and centre
    landmark_ids: list[int] = field(default_factory=list)
    landmarks: list[Floats] = field(default_factory=list)
    _keys: list[Ints] = field(default_factory=list)
    _pixels: list[Floats] = field(default_factory=list)

    def add_landmark(self, number: int, place: Floats, keys: Ints, pixels: Floats) -> None:
        """Add a landmark with its sightings.

        Parameters
        ----------
        number : int
            Its id.
        place : ndarray, shape (3,) [world]
        keys : ndarray of int, shape (k,)
            Keys of the views that saw it.
        pixels : ndarray, shape (k, 2) [px]
        """
        self.landmark_ids.append(number)
        self.landmarks.append(place)
        self._keys.append(keys)
        self._pixels.append(pixels)

    def sightings(self) -> tuple[Ints, Ints, Floats]:
        """Return the keys of the views, the rows of the landmarks, and the pixels."""
        keys = np.concatenate([np.empty(0, dtype=np.int64), *self._keys])
        rows = np.repeat(np.arange(len(self._keys)), [len(seen) for seen in self._keys])
        return keys, rows, np.concatenate([np.empty((0, 2)), *self._pixels])


def camera_of(
    model: str, width: int, height: int, focal_px: float, cx: float | None = None
) -> Camera:
    """Return a camera of OpenMVG.

    Parameters
    ----------
    model : str
        Such as ``"pinhole_radial_k3"``, ``"fisheye"`` or ``"spherical"``.
    width, height : int [px]
    focal_px : float [px]
    cx : float, optional [px]
    """
    if "spherical" in model:
        return equirectangular(model, width, height)
    projection: Projection = "fisheye" if "fisheye" in model else "perspective"
    return Camera(
        model=model, projection=projection, focal_px=focal_px, width=width, height=height, cx=cx
    )
