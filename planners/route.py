"""A collision-free path, with what it costs and how sure it is."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from os import PathLike
from typing import IO, Any

import numpy as np
import shapely

from groundmap.archive import write_atomically
from groundmap.arrays import Floats
from planners.costmap import Costmap
from planners.polyline import Crossed, crossed


@dataclass(frozen=True, eq=False)
class Route:
    """A route that a planner found and the audit passed.

    Attributes
    ----------
    waypoints : ndarray, shape (n, 2), n >= 2 [m, map]
        Start, turning points, goal; exactly collinear points are merged.
    length : float [m]
    min_clearance : float [m]
        Distance of the line to the nearest cell it must not touch (its square), exact; infinite
        on a map without such cells.
    mean_clearance : float [m]
        Mean along the line of the clearance at the centres of the cells it crosses.
    min_confidence, mean_confidence : float
        Confidence of being free, which is minus the grid's confidence: 1 is surely free, 0 is
        unknown. Of the least sure cell that the line crosses; mean along the line.
    unknown_length : float [m]
        Length of the line in cells of which nothing is known.
    start_unknown_area : float [m²]
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
        "clean": a route that the audit refuses is never handed out.
    """

    waypoints: Floats
    length: float
    min_clearance: float
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

    @classmethod
    def along(
        cls, costmap: Costmap, waypoints: Floats, *, planner: str, expanded: int, seconds: float
    ) -> Route:
        """Return the route along `waypoints`, measured on the costmap.

        Parameters
        ----------
        costmap : Costmap
        waypoints : ndarray, shape (n, 2), n >= 2 [m, map]
        planner, expanded, seconds
            As in the attributes.
        """
        line = crossed(costmap.to_cells(waypoints))
        rows, cols = line.cells.T
        sureness = -costmap.window.confidence[rows, cols].astype(np.float64)
        unknown = costmap.window.count[rows, cols] == 0
        return cls(
            waypoints=waypoints,
            length=float(np.hypot(*np.diff(waypoints, axis=0).T).sum()),
            min_clearance=costmap.clearance_of(waypoints),
            mean_clearance=_mean(costmap.clearance[rows, cols], line.lengths),
            min_confidence=float(sureness.min()) + 0.0,  # + 0.0: an unknown cell's -0.0 is 0.0
            mean_confidence=_mean(sureness, line.lengths) + 0.0,
            unknown_length=float(line.lengths[unknown].sum()) * costmap.window.resolution,
            start_unknown_area=_start_unknown_area(costmap, waypoints, line),
            planner=planner,
            expanded=expanded,
            seconds=seconds,
            frame=costmap.problem.grid.frame,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return all fields as plain Python values; an infinite clearance as None, as in JSON."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        values["waypoints"] = self.waypoints.tolist()
        for name in ("min_clearance", "mean_clearance"):
            values[name] = values[name] if math.isfinite(values[name]) else None
        return values

    def to_geojson(self) -> dict[str, Any]:
        """Return a GeoJSON Feature: a LineString [m, map], the other fields as properties."""
        properties = self.to_dict()
        coordinates = properties.pop("waypoints")
        geometry = {"type": "LineString", "coordinates": coordinates}
        return {"type": "Feature", "geometry": geometry, "properties": properties}

    def save_geojson(self, path: str | PathLike[str]) -> None:
        """Write the GeoJSON Feature to a file, all or nothing.

        Raises
        ------
        OSError
            The folder does not exist or can't be written to.
        """
        text = json.dumps(self.to_geojson(), indent=2) + "\n"

        def write(stream: IO[bytes]) -> None:
            stream.write(text.encode())

        write_atomically(path, write)


def _mean(values: Floats, weights: Floats) -> float:
    """Return the weighted mean; of a single point, its value."""
    if weights.sum() == 0:
        return float(values[0])
    return float(np.average(values, weights=weights))


def _start_unknown_area(costmap: Costmap, waypoints: Floats, line: Crossed) -> float:
    centres = costmap.window.cell_to_world(np.argwhere(costmap.cleared))
    distances = shapely.distance(shapely.linestrings(waypoints), shapely.points(centres))
    used = np.zeros_like(costmap.cleared)
    used[costmap.cleared] = distances <= costmap.problem.footprint
    used[tuple(line.cells.T)] = True
    return float((used & costmap.cleared).sum()) * costmap.window.resolution**2
