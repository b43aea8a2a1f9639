"""Export of maps for Nav2's map_server: a ``.yaml`` file and a ``.pgm`` image."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt
import yaml

from groundmap.arrays import Bytes
from groundmap.errors import InputError
from groundmap.files.archive import write_atomically
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState
from groundmap.io.dense import dense_window
from groundmap.printable import is_plain

# Contested cells are exported as unknown: planners treat both alike.
GREYS = {
    CellState.UNKNOWN: 205,
    CellState.FREE: 254,
    CellState.NONFREE: 0,
    CellState.CONTESTED: 205,
}
OCCUPIED_THRESH = 0.65
# map_server reads grey g as an occupancy probability of (255 - g) / 255, and as free below this
# threshold: 205 is 0.19608, so all unknown space would be free at the customary 0.25.
FREE_THRESH = 0.196


def write_ros_map(
    grid: ConfidenceGrid, path: str | PathLike[str], *, bounds: npt.ArrayLike | None = None
) -> None:
    """Write a 2-D map as ``NAME.yaml`` and ``NAME.pgm``, which map_server loads.

    Occupied is 0, free 254, unknown and contested 205. Resolution and origin are written with all
    digits: rounded to three decimals, they would shift a cell at 100 m by a third of a metre.

    Parameters
    ----------
    grid : ConfidenceGrid
    path : path
        The ``.yaml`` file; the image is written beside it.
    bounds : array_like, shape (4,), optional
        Part to write, xmin, ymin, xmax, ymax [m, map]; default: all observed cells.

    Raises
    ------
    InputError
        An empty or 3-D map, invalid bounds, a box with too many cells, or a file name that is not
        UTF-8.
    OSError
        The folder does not exist or is not writable.
    """
    if grid.ndim != 2:
        raise InputError("grid", "a 2-D map", f"a {grid.ndim}-D one", hint="Export it as .npz.")
    window = dense_window(grid, bounds)
    target = Path(path)
    image = target.with_suffix(".pgm")
    if not is_plain(image.name):  # YAML could not name the image
        raise InputError("path", "a file name in UTF-8", repr(image.name))
    pgm = _pgm(window.states())
    text = _yaml(image.name, window.resolution, window.origin.tolist())
    # The image first, so that the yaml file never names a missing image.
    write_atomically(image, lambda stream: stream.write(pgm))
    write_atomically(target, lambda stream: stream.write(text.encode()))


def _pgm(states: Bytes) -> bytes:
    greys = np.array([GREYS[state] for state in CellState], dtype=np.uint8)
    pixels = greys[states[::-1]]  # row 0 of an image is its top, the largest y
    rows, cols = pixels.shape
    return f"P5\n{cols} {rows}\n255\n".encode() + pixels.tobytes()


def _yaml(image: str, resolution: float, origin: list[float]) -> str:
    content = {
        "image": image,
        "mode": "trinary",
        "resolution": float(resolution),
        "origin": [*origin, 0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESH,
        "free_thresh": FREE_THRESH,
    }
    return yaml.safe_dump(
        content,
        sort_keys=False,
        allow_unicode=True,
        default_flow_style=None,  # the origin on one line
        width=math.inf,
    )
