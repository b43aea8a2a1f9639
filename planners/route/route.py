"""A collision-free path with its cost, clearance and confidence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from os import PathLike
from typing import Any

import numpy as np
import shapely

from groundmap.arrays import Bools, Floats
from planners.costmap.map_space import MapSpace
from planners.geometry.polyline import CrossedCells, cross_cells, distances_to, length_of
from planners.problem.problem import PlanningProblem
from planners.route.route_files import (
    Format,
    csv_table,
    dump_json,
    dump_yaml,
    format_of,
    path_message,
    write_text,
)
from planners.search.base import SearchResult
from planners.search.graph import Graph

CLEARANCES = (  # fields that may be infinite
    "min_clearance",
    "known_clearance",
    "keep_out_clearance",
    "recent_clearance",
    "mean_clearance",
)


@dataclass(frozen=True, eq=False)
class Route:
    """A route that a planner found and the audit passed.

    Attributes
    ----------
    waypoints : ndarray, shape (n, 2), n >= 2 [m, map]
        Start, turning points, goal; exactly collinear points are merged. Shape (n, 3) on a 3-D
        map.
    headings : ndarray, shape (n,) [rad, map]
        Heading at each waypoint: the planned one, or else along the next piece (at the goal: the
        requested yaw, or along the last piece).
    length : float [m]
    cost : float [m]
        The quantity that the planner minimised: the length, weighted by the cost of the cells if
        the problem has costs; the weighted objective along the line for sampling planners.
    bound : float or None
        Upper bound of the ratio of the cost to the optimal cost; None if there is no bound.
    min_clearance : float [m]
        Exact distance of the line to the square of the nearest cell that the footprint must not
        touch; infinite on a map without such cells.
    known_clearance : float [m]
        As `min_clearance`, but also to the unknown cells near the start that count as free: the
        clearance within known space. It is 0 if the line crosses such a cell.
    keep_out_clearance, recent_clearance : float [m]
        As `min_clearance`, but to the cells of keep-out areas alone, and to those that the newest
        views saw as non-free; infinite without any.
    mean_clearance : float [m]
        Mean along the line of the clearance at the centres of the crossed cells.
    min_confidence, mean_confidence : float
        Confidence that the crossed cells are free, which is minus the grid's confidence: 1 is
        certainly free, 0 is unknown. The smallest of a cell, and the mean along the line.
    unknown_length : float [m]
        Length of the line in cells without any observation.
    start_unknown_area : float [m²; on a 3-D map m³]
        Area of the unknown cells near the start that count as free and that the route uses: the
        footprint covers their centre, or the line crosses them.
    planner : str
        Name of the planner.
    expanded : int
        Nodes that the search expanded.
    seconds : float [s]
        Wall time of the checks, the costmap and the search.
    frame : str
        Frame of the waypoints.
    audit : str
        "clean": the route passed the audit; "skipped" for `planners.plan_many` without audit.
    graph : planners.search.graph.Graph or None
        The tree or roadmap of a sampling planner, if its settings keep it; not saved to files.
    """

    waypoints: Floats
    headings: Floats
    length: float
    cost: float
    bound: float | None
    min_clearance: float
    known_clearance: float
    keep_out_clearance: float
    recent_clearance: float
    mean_clearance: float
    min_confidence: float
    mean_confidence: float
    unknown_length: float
    start_unknown_area: float
    planner: str
    expanded: int
    seconds: float
    frame: str
    audit: str = "clean"
    graph: Graph | None = None

    @classmethod
    def along(cls, space: MapSpace, result: SearchResult, *, planner: str, seconds: float) -> Route:
        """Return a search result as a route, measured on the map.

        Parameters
        ----------
        space : Costmap or Voxels
        result : SearchResult
        planner : str
            Name of the planner.
        seconds : float [s]
            Time that planning took.
        """
        waypoints = result.waypoints
        line = cross_cells(space.to_cells(waypoints))
        confidence, count = space.evidence_at(line.cells)
        sureness, unknown = -confidence.astype(np.float64), count == 0
        length, clearance = length_of(waypoints), space.clearance_of(waypoints)
        headings = result.headings
        return cls(
            waypoints=waypoints,
            headings=_headings(waypoints, space.problem) if headings is None else headings,
            length=length,
            cost=length if result.cost is None else result.cost,
            bound=result.bound,
            min_clearance=clearance,
            known_clearance=_known_clearance(space, waypoints, clearance),
            keep_out_clearance=_clearance_to(space, waypoints, space.kept_out),
            recent_clearance=_clearance_to(space, waypoints, space.recent),
            mean_clearance=_mean(space.clearance_at(line.cells), line.lengths),
            min_confidence=float(sureness.min()) + 0.0,  # + 0.0: an unknown cell's -0.0 is 0.0
            mean_confidence=_mean(sureness, line.lengths) + 0.0,
            unknown_length=float(line.lengths[unknown].sum()) * space.window.resolution,
            start_unknown_area=_start_unknown_area(space, result, line),
            planner=planner,
            expanded=result.expanded,
            seconds=seconds,
            frame=space.problem.grid.frame,
            graph=result.graph,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return all fields but the graph as plain values; an infinite clearance as None."""
        names = [field.name for field in fields(self) if field.name != "graph"]
        values = {name: getattr(self, name) for name in names}
        values["waypoints"] = self.waypoints.tolist()
        values["headings"] = self.headings.tolist()
        for name in CLEARANCES:
            values[name] = values[name] if math.isfinite(values[name]) else None
        return values

    def to_geojson(self) -> dict[str, Any]:
        """Return a GeoJSON Feature: a LineString [m, map], the other fields as properties."""
        properties = self.to_dict()
        coordinates = properties.pop("waypoints")
        geometry = {"type": "LineString", "coordinates": coordinates}
        return {"type": "Feature", "geometry": geometry, "properties": properties}

    def to_path(self) -> dict[str, Any]:
        """Return a dict with the structure of ROS's nav_msgs/Path: poses with quaternions [map].

        Examples
        --------
        >>> from groundmap import ConfidenceGrid
        >>> from planners import PlanningProblem, plan
        >>> grid = ConfidenceGrid(resolution=0.5)
        >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
        >>> route = plan(PlanningProblem(grid, start=(2.25, 2.25), goal=(2.25, 6), footprint=0.9))
        >>> pose = route.to_path()["poses"][0]["pose"]
        >>> pose["position"], round(pose["orientation"]["z"], 3)
        ({'x': 2.25, 'y': 2.25, 'z': 0.0}, 0.707)
        """
        return path_message(self.frame, self.waypoints, self.headings)

    def to_csv(self) -> str:
        """Return a line per waypoint: x, y (and z) [m], yaw [rad], distance along the route [m]."""
        return csv_table(self.waypoints, self.headings)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the route to a file, all or nothing, in the format of the suffix.

        ``.geojson`` or ``.json``: a GeoJSON Feature; ``.csv``: see `to_csv`; ``.yaml``: see
        `to_path`, as input of ``ros2 topic pub``.

        Raises
        ------
        InputError
            Another suffix.
        OSError
            The folder does not exist or can't be written to.
        """
        texts: dict[Format, Callable[[], str]] = {
            "geojson": lambda: dump_json(self.to_geojson()),
            "csv": self.to_csv,
            "path": lambda: dump_yaml(self.to_path()),
        }
        write_text(path, texts[format_of(path)]())

    def save_geojson(self, path: str | PathLike[str]) -> None:
        """Write the GeoJSON Feature to a file, all or nothing.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        write_text(path, dump_json(self.to_geojson()))


def _headings(waypoints: Floats, problem: PlanningProblem) -> Floats:
    """Return the headings along a line; those of start and goal for a line of length 0."""
    dx, dy = np.diff(waypoints, axis=0).T[:2]
    headings = np.arctan2(dy, dx)
    if not (dx.any() or dy.any()) and problem.start_yaw is not None:
        headings[:] = problem.start_yaw
    return np.append(headings, headings[-1] if problem.goal_yaw is None else problem.goal_yaw)


def _mean(values: Floats, weights: Floats) -> float:
    """Return the weighted mean; the value if there is a single point."""
    if weights.sum() == 0:
        return float(values[0])
    return float(np.average(values, weights=weights))


def _clearance_to(space: MapSpace, waypoints: Floats, cells: Bools | None) -> float:
    """Return the distance to the cells of a mask; infinite without any."""
    return math.inf if cells is None else space.clearance_of(waypoints, to=cells)


def _known_clearance(space: MapSpace, waypoints: Floats, clearance: float) -> float:
    """Return the distance to blocked and cleared cells, given the distance to blocked ones."""
    if not space.problem.avoids_unknown or not space.cleared.any():
        return clearance
    return min(clearance, space.clearance_of(waypoints, to=space.cleared, limit=clearance))


def _start_unknown_area(space: MapSpace, result: SearchResult, line: CrossedCells) -> float:
    if not space.cleared.any():
        return 0.0
    centres = space.window.cell_to_world(np.argwhere(space.cleared))
    used = np.zeros_like(space.cleared)
    used[space.cleared] = _cover(space, result, centres)
    used[tuple(line.cells.T)] = True
    return space.area_of(used & space.cleared)


def _cover(space: MapSpace, result: SearchResult, places: Floats) -> Bools:
    """Return which places the footprint covers: the outline at its headings, or the disc."""
    polygon = space.problem.shape.polygon
    if result.headings is None or polygon is None:
        return distances_to(places, result.waypoints) <= space.radius
    covered = np.zeros(len(places), dtype=np.bool_)
    outline = shapely.Polygon(polygon)
    shapely.prepare(outline)
    low, high = places.min(axis=0) - space.radius, places.max(axis=0) + space.radius
    near = ((result.waypoints >= low) & (result.waypoints <= high)).all(axis=1)
    for xy, yaw in zip(result.waypoints[near], result.headings[near].tolist(), strict=True):
        x, y = (places - xy).T
        cos, sin = math.cos(yaw), math.sin(yaw)
        covered |= shapely.intersects_xy(outline, cos * x + sin * y, cos * y - sin * x)
    return covered
