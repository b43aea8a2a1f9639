"""Cameras of a sparse map: what their model says about noise and the borders of the image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from groundmap.arrays import is_number
from groundmap.errors import InputError
from groundmap.printable import format_value

Projection = Literal["perspective", "fisheye", "equirectangular"]
USUAL_FOCAL_PX = 500.0  # of a camera about which the file says nothing
LEAST_FOCAL_PX, MOST_PX = 1e-3, 1e9


@dataclass(frozen=True, kw_only=True)
class Camera:
    """The camera of a view, as far as its file describes it.

    Positions of landmarks come from the file; pixels are not projected again. The camera therefore
    only gives the noise of a bearing, 1 px / focal length, and the borders of the image.

    Parameters
    ----------
    model : str
        Name of the model in the file.
    projection : {"perspective", "fisheye", "equirectangular"}
    focal_px : float, default 500 [px]
        Pixels per radian at the image centre.
    width, height : int, optional [px]
        Size of the image; 0 if the file does not contain it.
    cx : float, optional [px]
        Column of the principal point; default: the centre.

    Raises
    ------
    InputError
        The focal length is not above 0, or a number is not finite.

    Examples
    --------
    >>> Camera(model="PINHOLE", focal_px=700.0, width=1400, height=800).border
    1.0
    """

    model: str
    projection: Projection = "perspective"
    focal_px: float = USUAL_FOCAL_PX
    width: int = 0
    height: int = 0
    cx: float | None = None

    def __post_init__(self) -> None:
        if not (is_number(self.focal_px) and LEAST_FOCAL_PX <= self.focal_px <= MOST_PX):
            expected = f"a focal length above 0 [px], from {LEAST_FOCAL_PX:g} to {MOST_PX:g}"
            raise InputError(f"camera {self.model}", expected, format_value(self.focal_px))
        sizes = (self.width, self.height, 0 if self.cx is None else self.cx)
        if not all(is_number(size) and abs(size) <= MOST_PX for size in sizes):
            expected = f"an image size and centre of at most {MOST_PX:g} px"
            raise InputError(f"camera {self.model}", expected, format_value(sizes))

    @property
    def border(self) -> float | None:
        """Tangent of the angle between the optical axis and the nearer border of the image.

        None if the file does not contain the size of the image.
        """
        if self.projection != "perspective" or self.width <= 0:
            return None
        centre = self.width / 2 if self.cx is None else self.cx
        nearer = min(centre, self.width - centre)
        return nearer / self.focal_px if nearer > 0 else None

    @property
    def bearing_noise(self) -> float:
        """Angle of one pixel at the image centre [rad]."""
        return 1.0 / self.focal_px


def equirectangular(model: str, width: int, height: int) -> Camera:
    """Return a camera that sees all directions.

    Parameters
    ----------
    model : str
        Name of the model in the file.
    width, height : int [px]
    """
    if width <= 0:
        raise InputError(f"camera {model}", "a width above 0 [px]", format_value(width))
    focal = width / math.tau
    return Camera(
        model=model, projection="equirectangular", focal_px=focal, width=width, height=height
    )
