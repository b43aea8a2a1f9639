"""The base classes of the generators of worlds."""

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
    """Settings of one kind of world, from which every seed makes a world.

    Raises
    ------
    SettingsError
        Unknown keys, values out of range, or sizes that do not fit each other.
    """

    ground_texture: float = Field(6.0, ge=0, description="point features on the ground [1/m²]")
    ground_lines: float = Field(0.0, ge=0, description="segment features on the ground [1/m²]")

    @abstractmethod
    def make(self, rng: np.random.Generator) -> World:
        """Return a world; the same state of the random generator gives the same world."""

    def world(self, solids: list[Solid], bounds: Box) -> World:
        """Return a world of solids, with the ground of the settings.

        Parameters
        ----------
        solids : list of Solid
        bounds : tuple of float [m, map]
            xmin, ymin, xmax, ymax.
        """
        return World(
            solids=tuple(solids),
            bounds=bounds,
            ground_texture=self.ground_texture,
            ground_lines=self.ground_lines,
        )


class BuiltWorld(WorldGenerator):
    """Settings of a world with solids."""

    texture: float = Field(6.0, ge=0, description="point features on the solids [1/m²]")
    lines: float = Field(
        0.4, ge=0, description="segment features on their sides, in each direction [1/m²]"
    )

    def solids(
        self,
        geometry: shapely.Geometry | Sequence[shapely.Geometry],
        *,
        top: float,
        **options: Any,
    ) -> list[Solid]:
        """Return a prism for each polygon of one or several geometries.

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
    """Raise `SettingsError` unless a setting is above a bound that results from others.

    Parameters
    ----------
    name : str
    value, least : float
        The setting, and its bound.
    what : str
        The things that need the room, for the error message.

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
    """Raise `SettingsError` if bounds are empty.

    Parameters
    ----------
    bounds : tuple of float [m]
        xmin, ymin, xmax, ymax.
    name : str, default "bounds"
        Name of the setting.
    """
    xmin, ymin, xmax, ymax = bounds
    if not (xmin < xmax and ymin < ymax):
        raise SettingsError(name, "XMIN < XMAX and YMIN < YMAX [m]", str(bounds))
