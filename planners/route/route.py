"""A collision-free path, with what it costs and how sure it is."""

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


@dataclass(frozen=True, eq=False)
class Route:
    """A route that a planner found and the audit passed.

    Attributes
    ----------
    waypoints : ndarray, shape (n, 2), n >= 2 [m, map]
        Start, turning points, goal; exactly collinear points are merged. On a 3-D map of shape
        (n, 3).
    headings : ndarray, shape (n,) [rad, map]
        Where the robot looks at each waypoint: as the planner decided, else along the next piece
        (at the goal: the yaw asked for, or along the last piece).
    length : float [m]
    cost : float [m]
        What the planner minimised: the length, where the problem says so with dear metres counted
        more, cell by cell; of sampling planners, what their weights say, along the line.
    bound : float or None
        The cost is at most this many times the least that the planner could have found; None if
        it knows no bound.
    min_clearance : float [m]
        Distance of the line to the nearest cell it must not touch (its square), exact; infinite
        on a map without such cells.
    known_clearance : float [m]
        As `min_clearance`, but to the unknown cells near the start as well that count as free:
        what is kept for sure. It is smaller where the line comes near to such cells, and 0 where
        it crosses one.
    mean_clearance : float [m]
        Mean along the line of the clearance at the centres of the cells it crosses.
    min_confidence, mean_confidence : float
        Confidence of being free, which is minus the grid's confidence: 1 is surely free, 0 is
        unknown. Of the least sure cell that the line crosses; mean along the line.
    unknown_length : float [m]
        Length of the line in cells of which nothing is known.
    start_unknown_area : float [m²; on a 3-D map m³]
        Area of the unknown cells that counted as free because they are near the start and that
        the route really uses: their centre comes under the footprint, or the line crosses them.
    planner : str
    expanded : int
        Nodes that the search expanded.
    seconds : float [s]
        Wall time of the checks, the costmap and the search.
    frame : str
        Frame of the waypoints.
    audit : str
        "clean": a route that the audit refuses is never handed out; "skipped" where
        `planners.plan_many` was told to do without.
    graph : planners.search.graph.Graph or None
        The tree or roadmap that it was found in, if a sampling planner was told to keep it; files
        leave it out.
    """

    waypoints: Floats
    headings: Floats
    length: float
    cost: float
    bound: float | None
    min_clearance: float
    known_clearance: float
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
        """Return the route that a planner found, measured on the map.

        Parameters
        ----------
        space : Costmap or Voxels
        result : SearchResult
        planner, seconds
            As in the attributes.
        """
        waypoints = result.waypoints
        line = cross_cells(space.to_cells(waypoints))
        at = tuple(line.cells.T)
        sureness = -space.window.confidence[at].astype(np.float64)
        unknown = space.window.count[at] == 0
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
        for name in ("min_clearance", "known_clearance", "mean_clearance"):
            values[name] = values[name] if math.isfinite(values[name]) else None
        return values

    def to_geojson(self) -> dict[str, Any]:
        """Return a GeoJSON Feature: a LineString [m, map], the other fields as properties."""
        properties = self.to_dict()
        coordinates = properties.pop("waypoints")
        geometry = {"type": "LineString", "coordinates": coordinates}
        return {"type": "Feature", "geometry": geometry, "properties": properties}

    def to_path(self) -> dict[str, Any]:
        """Return a dict that looks like ROS's nav_msgs/Path: poses with quaternions [map].

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
        """Write the route to a file, all or nothing; the name's ending says how.

        ``.geojson`` or ``.json``: a GeoJSON Feature; ``.csv``: see `to_csv`; ``.yaml``: see
        `to_path`, as ``ros2 topic pub`` takes it.

        Raises
        ------
        InputError
            Another ending.
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
    """Return where a robot looks that drives along a line; standing, as it was asked to."""
    dx, dy = np.diff(waypoints, axis=0).T[:2]
    headings = np.arctan2(dy, dx)
    if not (dx.any() or dy.any()) and problem.start_yaw is not None:
        headings[:] = problem.start_yaw
    return np.append(headings, headings[-1] if problem.goal_yaw is None else problem.goal_yaw)


def _mean(values: Floats, weights: Floats) -> float:
    """Return the weighted mean; of a single point, its value."""
    if weights.sum() == 0:
        return float(values[0])
    return float(np.average(values, weights=weights))


def _known_clearance(space: MapSpace, waypoints: Floats, clearance: float) -> float:
    """Return the distance to what is blocked or unknown but cleared, given that to the former."""
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
    """Return which places come under the footprint: the outline as it is turned, or the disc."""
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
