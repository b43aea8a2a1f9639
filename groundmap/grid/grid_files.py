"""Map files: the content of a grid in one archive."""

from __future__ import annotations

from os import PathLike
from typing import Any, NamedTuple

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import FileFormatError
from groundmap.files.archive import read_archive, write_archive
from groundmap.grid.arguments import as_origin, as_resolution, check_frame
from groundmap.grid.collapse import as_planes
from groundmap.grid.fusion import rule_from
from groundmap.grid.height_layers import HeightLayers
from groundmap.grid.old_versions import upgrade
from groundmap.grid.tiles import Tiles

FORMAT, VERSION = "groundmap-grid", 2


class GridContent(NamedTuple):
    """The content of a grid."""

    settings: dict[str, Any]  #: arguments of `groundmap.ConfidenceGrid`
    tiles: Tiles
    layers: HeightLayers
    trajectory: Floats  #: shape (n, 3): x, y [m], yaw [rad], in the map frame
    planes: Floats  #: shape (k, 6), see `groundmap.ConfidenceGrid.planes`


def write_grid(path: str | PathLike[str], content: GridContent) -> None:
    """Write the content of a grid to a file; an existing file is replaced at the end.

    Parameters
    ----------
    path : path-like
    content : GridContent

    Raises
    ------
    OSError
        The folder does not exist or is not writable.
    """
    settings = content.settings
    header = {
        "format": FORMAT,
        "version": VERSION,
        **settings,
        "origin": settings["origin"].tolist(),
        "rule": settings["rule"].to_dict(),
    }
    arrays = {
        **content.tiles.to_arrays(),
        **content.layers.to_arrays(),
        "trajectory": content.trajectory,
        "planes": content.planes,
    }
    write_archive(path, header, arrays)


def read_grid(path: str | PathLike[str]) -> GridContent:
    """Return the content of a file that `write_grid` wrote, in this version or an older one.

    Raises
    ------
    FileFormatError
        The file is not a map file, of a newer version, truncated or altered.
    """
    header, arrays = read_archive(path, FORMAT, VERSION)
    try:
        header, arrays = upgrade(header, arrays)
        settings = {name: header[name] for name in ("resolution", "origin", "frame")}
        settings |= {"rule": rule_from(header["rule"]), "heights": tuple(header["heights"])}
        check_frame(settings["frame"])
        settings["resolution"] = as_resolution(settings["resolution"])
        settings["origin"] = as_origin(settings["origin"])
        ndim = len(settings["origin"])
        tiles = Tiles.from_arrays(ndim, arrays)
        layers = HeightLayers.from_arrays(ndim, settings["heights"], arrays)
        trajectory = as_floats("trajectory", arrays["trajectory"], (None, 3))
        check_finite("trajectory", trajectory)
        planes = as_planes(arrays.get("planes", ()))  # older files have none
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(path, "a complete map file", f"{error}") from error
    return GridContent(settings, tiles, layers, trajectory, planes)
