"""Files of keep-out areas: GeoJSON."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
import shapely
import shapely.geometry

from groundmap.arrays import is_number
from groundmap.errors import FileFormatError
from groundmap.files.documents import read_json

EXPECTED = "a GeoJSON file with polygons"
MOST_AREAS = 100_000


def read_keep_out(path: str | PathLike[str]) -> list[shapely.Polygon]:
    """Return the polygons of a GeoJSON file, in the map's coordinates [m, map].

    Parameters
    ----------
    path : str or PathLike
        A FeatureCollection, a Feature, or a geometry: Polygon, MultiPolygon or a
        GeometryCollection of these. Coordinates are x, y [m, map]; a third one is ignored.

    Returns
    -------
    list of shapely.Polygon
        For `planners.PlanningProblem`, which checks that they are valid.

    Raises
    ------
    FileFormatError
        Not such a file, or one with other geometries.
    """
    document = read_json(path, EXPECTED)
    polygons: list[shapely.Polygon] = []
    for geometry in _geometries(path, document):
        polygons += _read(path, geometry)
    if not polygons:
        raise FileFormatError(path, EXPECTED, "none")
    return polygons


def _geometries(path: str | PathLike[str], document: Any) -> list[Any]:
    """Return the geometries in a document, and in its features."""
    kind = document.get("type") if isinstance(document, dict) else None
    if kind == "FeatureCollection":
        features = document.get("features")
        if not isinstance(features, list) or len(features) > MOST_AREAS:
            raise FileFormatError(path, f"a list of up to {MOST_AREAS} features", "something else")
        return [part for feature in features for part in _geometries(path, feature)]
    if kind == "Feature":
        return _geometries(path, document.get("geometry"))
    if kind == "GeometryCollection":
        parts = document.get("geometries")
        if not isinstance(parts, list) or len(parts) > MOST_AREAS:
            raise FileFormatError(path, "a list of geometries", "something else")
        return [each for part in parts for each in _geometries(path, part)]
    if kind not in ("Polygon", "MultiPolygon"):
        raise FileFormatError(path, EXPECTED, f"one of type {kind!r}")
    return [document]


def _read(path: str | PathLike[str], document: dict[str, Any]) -> list[shapely.Polygon]:
    coordinates = document.get("coordinates")
    parts = [coordinates] if document["type"] == "Polygon" else coordinates
    try:
        return [_polygon(rings) for rings in parts or ()]
    except (TypeError, ValueError, IndexError, KeyError, shapely.errors.ShapelyError) as error:
        expected = "rings of four or more points x, y [m]"
        raise FileFormatError(path, expected, str(error)) from error


def _polygon(rings: Any) -> shapely.Polygon:
    outer, *inner = [_ring(ring) for ring in rings]
    return shapely.Polygon(outer, inner)


def _ring(points: Any) -> Any:
    if not all(is_number(number) for point in points for number in point):
        raise ValueError("something else")
    ring = np.array([point[:2] for point in points], dtype=np.float64)
    if len(ring) < 4:
        raise ValueError(f"{len(ring)} points")
    return ring
