"""What every generator of worlds shares."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import shapely
from pydantic import Field

from groundmap.errors import SettingsError
from groundmap.settings import Settings
from groundmap.simulate.world import Solid, World

Box: TypeAlias = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m, map]


class WorldGenerator(Settings, ABC):
    """Settings of one kind of world, which make as many such worlds as there are seeds.

    Raises
    ------
    SettingsError
        Besides unknown keys and values out of range: sizes that do not fit one another.
    """

    ground_texture: float = Field(6.0, ge=0, description="point features on the ground [1/m²]")
    ground_lines: float = Field(0.0, ge=0, description="segment features on the ground [1/m²]")

    @abstractmethod
    def make(self, rng: np.random.Generator) -> World:
        """Return a world; the same state of the generator gives the same one."""

    def world(self, solids: list[Solid], bounds: Box) -> World:
        """Return the world with the ground that was asked for."""
        return World(
            solids=tuple(solids),
            bounds=bounds,
            ground_texture=self.ground_texture,
            ground_lines=self.ground_lines,
        )


class BuiltWorld(WorldGenerator):
    """A world in which something stands."""

    texture: float = Field(6.0, ge=0, description="point features on what stands there [1/m²]")
    lines: float = Field(
        0.4, ge=0, description="segment features on its sides, in each direction [1/m²]"
    )

    def solids(
        self,
        geometry: shapely.Geometry | Sequence[shapely.Geometry],
        *,
        top: float,
        **options: Any,
    ) -> list[Solid]:
        """Return a prism for each polygon of a geometry, or of several.

        Parameters
        ----------
        geometry : shapely.Geometry or sequence of them [m, map]
        top : float [m]
        **options
            Other parameters of the solids, such as ``repeat``.
        """
        return [
            Solid(polygon, top=top, texture=self.texture, lines=self.lines, **options)
            for polygon in shapely.get_parts(geometry)
        ]


def require(name: str, value: float, least: float, what: str) -> None:
    """Raise `SettingsError` unless a setting is above what the others leave room for.

    Examples
    --------
    >>> require("aisle_width", 1.5, 1.6, "two pallets")
    Traceback (most recent call last):
        ...
    groundmap.errors.SettingsError: aisle_width: expected more than 1.6, to hold two pallets, \
got 1.5.
    """
    if not value > least:
        raise SettingsError(name, f"more than {least:g}, to hold {what}", f"{value:g}")


def check_bounds(bounds: Box, *, name: str = "bounds") -> None:
    """Raise `SettingsError` unless xmin, ymin, xmax, ymax [m] hold something."""
    xmin, ymin, xmax, ymax = bounds
    if not (xmin < xmax and ymin < ymax):
        raise SettingsError(name, "XMIN < XMAX and YMIN < YMAX [m]", str(bounds))
