"""The world of a map: walls where its cells are blocked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from pydantic import Field
from scipy.ndimage import label

from groundmap.arrays import Bools
from groundmap.errors import InputError
from groundmap.io.map_images import BlockedMap, read_ros_map
from groundmap.io.movingai import read_movingai_map
from groundmap.simulate.world import World
from groundmap.simulate.worlds.base import Box, BuiltWorld, check_bounds


class MapImage(BuiltWorld):
    r"""Walls where a map's cells are blocked; nothing about them is random.

    Every other cell, unknown ones among them, is free. Cells lie where the map says, or where
    `read_movingai_map` puts them.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "hook.map"
    ...     _ = path.write_text("type octile\nheight 2\nwidth 3\nmap\n@@.\n@..\n")
    ...     [wall] = MapImage(path=path, resolution=0.5).make(np.random.default_rng(0)).solids
    >>> wall.outline.area
    0.75
    """

    path: Path = Field(description="a map of Nav2 (.yaml), or of MovingAI (.map)")
    height: float = Field(2.5, gt=0, description="of the walls [m]")
    resolution: float = Field(
        1.0, gt=0, description="size of a cell of a .map; a .yaml says its own [m/cell]"
    )
    crop: Box | None = Field(
        None, description="xmin, ymin, xmax, ymax: cells centred outside are left out [m]"
    )

    def check(self) -> None:
        """Refuse a crop that holds nothing."""
        if self.crop is not None:
            check_bounds(self.crop, name="crop")

    def make(self, rng: np.random.Generator) -> World:
        """Read the map, and return a prism for each piece of blocked cells that hang together.

        Raises
        ------
        FileFormatError
            The file is neither kind of map, or breaks its format.
        InputError
            A crop beside the map.
        """
        found = self._read()
        if self.crop is not None:
            found = _crop(found, self.crop)
        corner = np.array(found.origin)
        rows, cols = found.blocked.shape
        walls = shapely.transform(
            outlines(found.blocked), lambda cells: corner + cells * found.resolution
        )
        xmax, ymax = corner + np.array([cols, rows]) * found.resolution
        bounds = (*found.origin, float(xmax), float(ymax))
        return self.world(self.solids(walls, top=self.height), bounds)

    def _read(self) -> BlockedMap:
        if self.path.suffix.lower() == ".map":
            return read_movingai_map(self.path, resolution=self.resolution)
        return read_ros_map(self.path)


def outlines(blocked: Bools) -> list[shapely.Polygon]:
    """Return the pieces of true cells that hang together by their sides, in (col, row).

    Examples
    --------
    >>> [piece.area for piece in outlines(np.array([[True, True, False], [False, True, False]]))]
    [3.0]
    """
    pieces, count = label(blocked)
    # Runs of cells, because they are fewer; a piece at a time, because the union of a great many
    # takes time out of proportion (3.3 s instead of 0.5 s on 400 x 400 cells at random). In whole
    # cells neighbours meet exactly.
    steps = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, start = np.nonzero(steps == 1)
    _, stop = np.nonzero(steps == -1)
    runs, piece = shapely.box(start, row, stop, row + 1), pieces[row, start]
    order = np.argsort(piece, kind="stable")
    first = np.searchsorted(piece[order], np.arange(1, count + 1))
    return [shapely.union_all(group) for group in np.split(runs[order], first)[1:]]


def _crop(found: BlockedMap, crop: Box) -> BlockedMap:
    rows, cols = found.blocked.shape
    x = _within(found.origin[0], found.resolution, cols, crop[0], crop[2])
    y = _within(found.origin[1], found.resolution, rows, crop[1], crop[3])
    if x is None or y is None:
        raise InputError("crop", "a piece of the map [m]", str(crop), hint=_extent(found))
    origin = np.array(found.origin) + found.resolution * np.array([x.start, y.start])
    return found._replace(
        blocked=found.blocked[y, x],
        unknown=found.unknown[y, x],
        origin=(float(origin[0]), float(origin[1])),
    )


def _within(first: float, side: float, count: int, low: float, high: float) -> slice | None:
    centres = first + (np.arange(count) + 0.5) * side
    inside = np.flatnonzero((low <= centres) & (centres <= high))
    return slice(int(inside[0]), int(inside[-1]) + 1) if len(inside) else None


def _extent(found: BlockedMap) -> str:
    x, y = found.origin
    rows, cols = found.blocked.shape
    return (
        f"The map reaches from ({x:g}, {y:g}) to "
        f"({x + cols * found.resolution:g}, {y + rows * found.resolution:g})."
    )
