"""The world of a map: walls at its blocked cells."""

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
    r"""Walls at the blocked cells of a map; nothing is random.

    All other cells are free, including unknown ones. The places of cells are those of the map, for
    ``.map`` files as `read_movingai_map` defines them.

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
    height: float = Field(2.5, gt=0, description="height of the walls [m]")
    resolution: float = Field(
        1.0, gt=0, description="size of a cell of a .map; a .yaml states its own [m/cell]"
    )
    crop: Box | None = Field(
        None, description="xmin, ymin, xmax, ymax; cells centred outside are omitted [m]"
    )

    def check(self) -> None:
        """Refuse an empty crop."""
        if self.crop is not None:
            check_bounds(self.crop, name="crop")

    def make(self, rng: np.random.Generator) -> World:
        """Read the map, and return a prism for each connected component of blocked cells.

        Raises
        ------
        FileFormatError
            The file is not a map, or violates its format.
        InputError
            A crop outside the map.
        """
        source_map = self._read()
        if self.crop is not None:
            source_map = _crop(source_map, self.crop)
        corner = np.array(source_map.origin)
        rows, cols = source_map.blocked.shape
        walls = shapely.transform(
            outlines(source_map.blocked), lambda cells: corner + cells * source_map.resolution
        )
        xmax, ymax = corner + np.array([cols, rows]) * source_map.resolution
        bounds = (*source_map.origin, float(xmax), float(ymax))
        return self.world(self.solids(walls, top=self.height), bounds)

    def _read(self) -> BlockedMap:
        if self.path.suffix.lower() == ".map":
            return read_movingai_map(self.path, resolution=self.resolution)
        return read_ros_map(self.path)


def outlines(blocked: Bools) -> list[shapely.Polygon]:
    """Return the outlines of the 4-connected components of true cells, in (col, row).

    Examples
    --------
    >>> [piece.area for piece in outlines(np.array([[True, True, False], [False, True, False]]))]
    [3.0]
    """
    pieces, count = label(blocked)
    # Runs of cells, because they are fewer; one component at a time, because the time of a union
    # grows faster than its size (3.3 s instead of 0.5 s on 400 x 400 random cells). In units of
    # cells, neighbours share their edges exactly.
    steps = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, start = np.nonzero(steps == 1)
    _, stop = np.nonzero(steps == -1)
    runs, piece = shapely.box(start, row, stop, row + 1), pieces[row, start]
    order = np.argsort(piece, kind="stable")
    first = np.searchsorted(piece[order], np.arange(1, count + 1))
    return [shapely.union_all(group) for group in np.split(runs[order], first)[1:]]


def _crop(source_map: BlockedMap, crop: Box) -> BlockedMap:
    rows, cols = source_map.blocked.shape
    x = _within(source_map.origin[0], source_map.resolution, cols, crop[0], crop[2])
    y = _within(source_map.origin[1], source_map.resolution, rows, crop[1], crop[3])
    if x is None or y is None:
        raise InputError("crop", "a piece of the map [m]", str(crop), hint=_extent(source_map))
    origin = np.array(source_map.origin) + source_map.resolution * np.array([x.start, y.start])
    return source_map._replace(
        blocked=source_map.blocked[y, x],
        unknown=source_map.unknown[y, x],
        origin=(float(origin[0]), float(origin[1])),
    )


def _within(first: float, side: float, count: int, low: float, high: float) -> slice | None:
    centres = first + (np.arange(count) + 0.5) * side
    inside = np.flatnonzero((low <= centres) & (centres <= high))
    return slice(int(inside[0]), int(inside[-1]) + 1) if len(inside) else None


def _extent(source_map: BlockedMap) -> str:
    x, y = source_map.origin
    rows, cols = source_map.blocked.shape
    return (
        f"The map reaches from ({x:g}, {y:g}) to "
        f"({x + cols * source_map.resolution:g}, {y + rows * source_map.resolution:g})."
    )
