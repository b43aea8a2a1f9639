"""Builders by name: how the evidence of one view is built, which is all that 2-D and 3-D differ in.

Everything else takes the dimension from the grid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from groundmap.evidence.ground_plane import view_parts as ground_plane
from groundmap.evidence.image_plane import view_parts as image_plane
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings
from groundmap.stopwatch import Stopwatch
from groundmap.view.view import View

Parts = ground_plane.ViewParts | image_plane.ImageParts
Build = Callable[[View, ConfidenceGrid, MapperSettings, Stopwatch, int], Parts]


class Builder(NamedTuple):
    """A kind of map: the dimension of its grid, and what builds a view's evidence for it."""

    ndim: int
    build: Build


BUILDERS = {"2d": Builder(2, ground_plane.build), "3d": Builder(3, image_plane.build)}
