"""``groundmap plot``: draw a map, a route on it, or a single view of a log."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import typer

from groundmap import ConfidenceGrid, GroundMapper, draw, fit_ground, read_views
from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import FileFormatError, InputError
from groundmap.files.documents import read_json
from groundmap.io import files_of, load_map
from planners.commands.console import JsonOption, emit, numbers
from planners.commands.imposed import Imposed, KeepOutOption, RecentOption, imposed
from planners.commands.settings_file import ConfigOption, read_settings
from planners.search.graph import Graph


def plot_command(
    map_file: Annotated[
        Path,
        typer.Argument(metavar="MAP", help="A map, as for `plan`; with --explain, a log."),
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
    camera_height: Annotated[
        float | None,
        typer.Option(
            help="With --explain: height of the camera above level ground [m]; default: fitted."
        ),
    ] = None,
    config: ConfigOption = None,
    bounds: Annotated[
        str | None,
        typer.Option(metavar="XMIN,YMIN,XMAX,YMAX", help="Part to draw [m]; default: all."),
    ] = None,
    route: Annotated[Path | None, typer.Option(help="Route to draw: GeoJSON of `plan`.")] = None,
    recent: RecentOption = False,
    keep_out: KeepOutOption = None,
    footprint: Annotated[float, typer.Option(help="Radius to draw along the route [m].")] = 0.0,
    as_json: JsonOption = False,
) -> None:
    """Draw a map (free, non-free, contested, unknown), its trajectory, and a route on it."""
    picture = out or _beside(map_file)
    draw.check_picture(picture, sources=files_of(map_file))
    if explain is not None:
        _draw_view(map_file, explain, camera_height, read_settings(config), picture)
        emit({"out": str(picture)}, as_json=as_json, title=f"view {explain} of {map_file}")
        return
    grid = load_map(map_file)
    check_flat(grid, map_file)
    box = None if bounds is None else np.array(numbers("bounds", bounds, 4))
    waypoints = None if route is None else _read_route(route)
    areas = imposed(recent=recent, keep_out=keep_out, grid=grid)
    draw_map(grid, picture, bounds=box, waypoints=waypoints, footprint=footprint, areas=areas)
    emit({"out": str(picture)}, as_json=as_json, title=f"picture of {map_file}")


def check_flat(grid: ConfidenceGrid, map_file: Path) -> None:
    """Check that a map can be drawn.

    Raises
    ------
    InputError
        A 3-D map.
    """
    if grid.ndim != 2:
        raise InputError(str(map_file), "a 2-D map, to draw it", f"one of {grid.ndim}-D")


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


def _draw_view(
    source: Path,
    number: int,
    camera_height: float | None,
    settings: dict[str, dict[str, Any]],
    out: Path,
) -> None:
    """Draw the evidence of one view of a log, to a file."""
    log = read_views(source)
    if not 0 <= number < len(log):
        raise InputError("explain", f"a view from 0 to {len(log) - 1}", str(number))
    mapper = GroundMapper(**settings["mapper"])
    views = fit_ground(log, camera_height=camera_height, **settings["ground"])
    parts = mapper.explain(next(islice(views, number, None)))
    figure = draw.draw_view(parts, mapper.grid, title=f"view {number} of {source}")
    draw.save_figure(figure, out)


def _read_route(path: Path) -> Floats:
    """Return the line of a GeoJSON Feature, shape (n, 2) [m, map]."""
    expected = "a GeoJSON Feature with a LineString"
    feature = read_json(path, "a GeoJSON file")
    try:
        line = as_floats("coordinates", feature["geometry"]["coordinates"], (None, 2))
        check_finite("coordinates", line)
    except InputError as error:
        raise FileFormatError(path, f"{expected} of {error.expected}", error.got) from error
    except (KeyError, TypeError) as error:
        raise FileFormatError(path, expected, "something else") from error
    if not len(line):
        raise FileFormatError(path, expected, "one without coordinates")
    return line
