"""Roadmap files: arrays, JSON, and a digest of the map that the roadmap was grown on."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from groundmap.errors import FileFormatError
from groundmap.files.archive import read_archive, write_archive
from planners.costmap.costmap import Costmap
from planners.costmap.endpoint_check import check_on_map
from planners.errors import OutsideMapError
from planners.problem.problem import PlanningProblem
from planners.sampling.settings import SamplingSettings, StateSpace
from planners.search.graph import Graph

FORMAT, VERSION = "groundmap roadmap", 1
SPACES: tuple[StateSpace, ...] = (
    "r2",
    "se2",
    "reeds_shepp",
)  # spaces whose edges can be driven both ways


def write_roadmap(
    path: str | PathLike[str], graph: Graph, costmap: Costmap, settings: Mapping[str, Any]
) -> None:
    """Write a roadmap file atomically.

    Parameters
    ----------
    path : path-like
    graph : Graph
    costmap : Costmap
        Of the map that the roadmap was grown on.
    settings : mapping
        Settings that were given, and the space.
    """
    header = {
        "format": FORMAT,
        "version": VERSION,
        "settings": dict(settings),
        "cleared_at": list(costmap.problem.clear_place),
        "ground": _digest(costmap),
    }
    arrays = {"vertices": graph.vertices, "edges": graph.edges, "weights": graph.weights}
    write_archive(path, header, arrays)


def read_roadmap(
    path: str | PathLike[str], problem: PlanningProblem
) -> tuple[Graph, Costmap, SamplingSettings]:
    """Return a roadmap, the costmap that it was grown on, and its settings.

    Parameters
    ----------
    path : path-like
    problem : PlanningProblem
        Its start and goal are ignored.

    Raises
    ------
    FileFormatError
        Not a roadmap file, or one of another map or footprint.
    """
    header, arrays = read_archive(path, FORMAT, VERSION)
    try:
        graph = Graph(arrays["vertices"], arrays["edges"], arrays["weights"])
        settings = SamplingSettings(**header["settings"])
        space, ground = header["settings"]["space"], header["ground"]
        place = tuple(map(float, header["cleared_at"]))
        cleared = place if problem.cleared_at is None else problem.cleared_at
        problem = replace(problem, start=place, goal=place, cleared_at=cleared)
    except (KeyError, TypeError, ValueError) as error:
        expected = "a complete roadmap"
        raise FileFormatError(path, expected, "one with missing or invalid parts") from error
    if settings.space not in SPACES:
        raise FileFormatError(path, f"a roadmap in one of {', '.join(SPACES)}", repr(space))
    if not _fits(graph, width=2 if space == "r2" else 3):
        raise FileFormatError(path, "a complete roadmap", "arrays that are not consistent")
    costmap = _costmap_of(problem)
    if costmap is None or _digest(costmap) != ground:
        raise FileFormatError(
            path,
            "a roadmap of this map and footprint",
            "one that was grown on other free cells or for another footprint",
            hint="Grow another roadmap.",
        )
    if not _is_on_map(graph, costmap):
        raise FileFormatError(path, "a complete roadmap", "places that are not on the map")
    return graph, costmap, settings


def _is_on_map(graph: Graph, costmap: Costmap) -> bool:
    """Whether all places of a roadmap lie within the costmap, or on its border."""
    window = costmap.window
    lower = window.origin
    upper = lower + np.array(costmap.blocked.shape[::-1]) * window.resolution
    places = graph.vertices[:, :2]
    return bool(((places >= lower) & (places <= upper)).all())


def _costmap_of(problem: PlanningProblem) -> Costmap | None:
    """Return the costmap of a problem, or None if its start is outside the map."""
    try:
        check_on_map(problem)
    except OutsideMapError:
        return None
    return Costmap.of(problem)


def _fits(graph: Graph, *, width: int) -> bool:
    """Whether the arrays of a file form a graph."""
    vertices, edges, weights = graph.vertices, graph.edges, graph.weights
    return (
        vertices.shape == (len(vertices), width)
        and edges.shape == (len(edges), 2)
        and weights.shape == (len(edges),)
        and vertices.dtype == weights.dtype == np.float64
        and edges.dtype == np.int64
        and bool(np.isfinite(vertices).all())
        and bool((np.isfinite(weights) & (weights >= 0.0)).all())
        and bool(((edges >= 0) & (edges < len(vertices))).all())
    )


def _digest(costmap: Costmap) -> str:
    """Return a digest of the free cells and the footprint, which a roadmap depends on.

    Blocked cells are not included, so the digest does not depend on the extent of the window.
    """
    grid, shape = costmap.problem.grid, costmap.problem.shape
    cells = np.argwhere(~costmap.blocked) + costmap.lower_cell
    polygon = np.empty((0, 2)) if shape.polygon is None else shape.polygon
    numbers = np.array([grid.resolution, *grid.origin, shape.radius, len(polygon)])
    digest = hashlib.sha256()
    for values in (numbers, polygon, cells):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()
