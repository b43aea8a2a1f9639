"""``groundmap plot``: draw a map, a route on it, or a single view of a log."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer

from groundmap import ConfidenceGrid, GroundMapper, draw, fit_ground
from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import FileFormatError, InputError
from groundmap.files.documents import read_json
from groundmap.io import files_of, load_map
from planners.commands.console import JsonOption, emit, numbers
from planners.commands.imposed import Imposed, KeepOutOption, RecentOption, imposed
from planners.commands.settings_file import ConfigOption, read_settings
from planners.commands.sources import (
    CameraHeightOption,
    FormatOption,
    LevelOption,
    ScaleOption,
    Source,
    open_source,
)
from planners.search.graph import Graph


def plot_command(
    map_file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP", help="A map, as for `plan`; with --explain, a source, as for `map`."
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Picture: .png, .pdf or .svg; default: beside MAP.")
    ] = None,
    explain: Annotated[
        int | None,
        typer.Option(
            metavar="VIEW", help="Draw the evidence of view number VIEW of a log, from 0."
        ),
    ] = None,
    format: FormatOption = None,
    scale: ScaleOption = None,
    camera_height: CameraHeightOption = None,
    level: LevelOption = None,
    config: ConfigOption = None,
    bounds: Annotated[
        str | None,
        typer.Option(
            metavar="XMIN,YMIN,XMAX,YMAX",
            help="Part to draw [m]; default: all. On a 3-D map XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX.",
        ),
    ] = None,
    route: Annotated[Path | None, typer.Option(help="Route to draw: GeoJSON of `plan`.")] = None,
    recent: RecentOption = False,
    keep_out: KeepOutOption = None,
    footprint: Annotated[float, typer.Option(help="Radius to draw along the route [m].")] = 0.0,
    height: Annotated[
        float | None,
        typer.Option(help="On a 3-D map: z of the layer to draw [m]; default: from the route."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Draw a map (free, non-free, contested, unknown), its trajectory, and a route on it.

    Of a 3-D map, draw its non-free surfaces, a layer, and a section along the route.
    """
    picture = out or _beside(map_file)
    draw.check_picture(picture, sources=files_of(map_file))
    if explain is not None:
        source = open_source(
            map_file, format=format, scale=scale, camera_height=camera_height, level=level
        )
        _draw_view(source, explain, read_settings(config), picture)
        emit({"out": str(picture)}, as_json=as_json, title=f"view {explain} of {map_file}")
        return
    grid = load_map(map_file)
    if height is not None and grid.ndim != 3:
        raise InputError("height", "a 3-D map", f"one of {grid.ndim}-D")
    box = None if bounds is None else np.array(numbers("bounds", bounds, 2 * grid.ndim))
    waypoints = None if route is None else _read_route(route, grid.ndim)
    if grid.ndim == 3:
        routes = {} if waypoints is None else {"route": waypoints}
        draw_voxels(grid, picture, bounds=box, height=height, routes=routes, footprint=footprint)
    else:
        areas = imposed(recent=recent, keep_out=keep_out, grid=grid)
        draw_map(grid, picture, bounds=box, waypoints=waypoints, footprint=footprint, areas=areas)
    emit({"out": str(picture)}, as_json=as_json, title=f"picture of {map_file}")


def draw_voxels(
    grid: ConfidenceGrid,
    picture: Path,
    *,
    routes: Mapping[str, Floats],
    bounds: Floats | None = None,
    height: float | None = None,
    footprint: float = 0.0,
) -> None:
    """Draw a 3-D map and routes on it to a file; see `groundmap.draw.voxel_figure`."""
    figure = draw.voxel_figure(
        grid, bounds=bounds, height=height, routes=routes, footprint=footprint
    )
    draw.save_figure(figure, picture)


def draw_map(
    grid: ConfidenceGrid,
    picture: Path,
    *,
    bounds: Floats | None = None,
    waypoints: Floats | None = None,
    footprint: float | npt.ArrayLike = 0.0,
    headings: Floats | None = None,
    lines: Mapping[str, Floats] | None = None,
    graph: Graph | None = None,
    areas: Imposed | None = None,
) -> None:
    """Draw a map, its trajectory, and a route or several named lines, to a file.

    The graph is the tree or roadmap of a sampling planner; it is drawn below the route, as are
    the areas that are not to be entered.
    """
    box = draw.known_bounds(grid) if bounds is None else bounds
    figure, axes = draw.new_figure(box)
    draw.draw_grid(grid, bounds=box, ax=axes)
    draw.draw_trajectory(grid.trajectory, ax=axes)
    if areas is not None:
        if areas.recent is not None:
            draw.draw_cells(areas.recent, label="seen by the newest views", ax=axes)
        draw.draw_keep_out(areas.keep_out, ax=axes)
    if graph is not None:
        draw.draw_graph(graph.vertices[:, :2], graph.edges, ax=axes)
    if waypoints is not None:
        draw.draw_route(waypoints, footprint=footprint, headings=headings, ax=axes)
    if lines is not None:
        draw.draw_routes(lines, ax=axes)
    draw.save_figure(figure, picture)


def _beside(map_file: Path) -> Path:
    """Return the default name of a picture; it differs from the image of a map_server map."""
    if map_file.suffix.lower() in (".yaml", ".yml"):
        return map_file.with_name(f"{map_file.stem}-plot.png")
    return map_file.with_suffix(".png")


def _draw_view(source: Source, number: int, settings: dict[str, dict[str, Any]], out: Path) -> None:
    """Draw the evidence of one view of a log, to a file."""
    count = len(source.views)
    if not 0 <= number < count:
        raise InputError("explain", f"a view from 0 to {count - 1}", str(number))
    mapper = GroundMapper(**settings["mapper"])
    views = fit_ground(source.views, camera_height=source.camera_height, **settings["ground"])
    parts = mapper.explain(next(islice(views, number, None)))
    title = f"view {number} of {source.log.path}"
    draw.save_figure(draw.draw_view(parts, mapper.grid, title=title), out)


def _read_route(path: Path, ndim: int) -> Floats:
    """Return the line of a GeoJSON Feature, shape (n, ndim) [m, map]."""
    expected = "a GeoJSON Feature with a LineString"
    feature = read_json(path, "a GeoJSON file")
    try:
        line = as_floats("coordinates", feature["geometry"]["coordinates"], (None, ndim))
        check_finite("coordinates", line)
    except InputError as error:
        raise FileFormatError(path, f"{expected} of {error.expected}", error.got) from error
    except (KeyError, TypeError) as error:
        raise FileFormatError(path, expected, "something else") from error
    if not len(line):
        raise FileFormatError(path, expected, "one without coordinates")
    return line
