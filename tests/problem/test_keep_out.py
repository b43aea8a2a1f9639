"""Keep-out areas: what they are given as, and files of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from groundmap import CellSet, ConfidenceGrid
from groundmap.errors import FileFormatError
from planners import KeepOut, PlanningProblem, ProblemError, read_keep_out

GRID = ConfidenceGrid(resolution=0.5)
SQUARE = shapely.box(0, 0, 2, 1)
RING = [[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]
HOLE = [[0.5, 0.25], [1, 0.25], [1, 0.5], [0.5, 0.25]]


@pytest.mark.parametrize(
    "value",
    [
        SQUARE,
        [SQUARE],
        shapely.MultiPolygon([SQUARE]),
        shapely.GeometryCollection([shapely.MultiPolygon([SQUARE])]),
        shapely.force_3d(SQUARE, z=4.0),
        KeepOut.of(SQUARE, GRID),
    ],
)
def test_polygons_come_alone_in_lists_and_in_collections(value: Any) -> None:
    [area] = KeepOut.of(value, GRID).areas
    assert area.equals(SQUARE)
    assert not area.has_z


@pytest.mark.parametrize("value", [None, [], (), np.empty((0, 2), dtype=np.int64)])
def test_no_areas_are_false(value: Any) -> None:
    assert not KeepOut.of(value, GRID)


def test_cells_are_held_once() -> None:
    areas = KeepOut.of([[3, 4], [3, 5], [3, 4]], GRID)
    assert areas.cells.cells.tolist() == [[3, 4], [3, 5]]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (shapely.LineString([(0, 0), (1, 1)]), r"keep_out\[0\]: expected a polygon .* buffer"),
        ([SQUARE, shapely.Point(0, 0)], r"keep_out\[1\]: expected a polygon"),
        (shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), "got Self-intersection"),
        (shapely.Polygon(), "expected a valid polygon with an area, got none"),
        (shapely.box(0, 0, 1e10, 1), "within 1e\\+09 m"),
        ([[0.5, 1.0]], "keep_out: expected whole numbers"),
        ("POLYGON", "expected polygons with an area .* or cells"),
        (3.0, "expected polygons with an area"),
        (CellSet(np.zeros((1, 2), dtype=np.int64), 0.25, np.zeros(2)), "got cells of 0.25 m"),
        (CellSet(np.zeros((1, 2), dtype=np.int64), 0.5, np.ones(2)), "expected cells of 0.5 m"),
    ],
)
def test_what_is_no_area_is_refused(value: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        PlanningProblem(GRID, start=(0, 0), goal=(1, 1), footprint=0.5, keep_out=value)


def written(path: Path, document: Any) -> Path:
    path.write_text(json.dumps(document))
    return path


def test_files_hold_features_collections_and_geometries(tmp_path: Path) -> None:
    polygon = {"type": "Polygon", "coordinates": [RING, HOLE]}
    several = {
        "type": "MultiPolygon",
        "coordinates": [[RING], [[[9, 9, 1], *RING[1:4], [9, 9, 1]]]],
    }
    feature = {"type": "Feature", "properties": None, "geometry": polygon}
    collection = {"type": "GeometryCollection", "geometries": [polygon, several]}
    features = {"type": "FeatureCollection", "features": [feature, feature]}
    counts = [(polygon, 1), (several, 2), (feature, 1), (collection, 3), (features, 2)]
    for document, count in counts:
        areas = read_keep_out(written(tmp_path / "areas.geojson", document))
        assert len(areas) == count
    assert read_keep_out(written(tmp_path / "one.json", polygon))[0].area == pytest.approx(1.9375)


@pytest.mark.parametrize(
    "document",
    [
        {},
        [],
        {"type": "LineString", "coordinates": RING},
        {"type": "Feature", "geometry": None},
        {"type": "FeatureCollection", "features": []},
        {"type": "FeatureCollection", "features": {}},
        {"type": "Polygon"},
        {"type": "Polygon", "coordinates": RING},
        {"type": "Polygon", "coordinates": [RING[:3]]},
        {"type": "Polygon", "coordinates": [[*RING[:3], ["0", 0]]]},
        {"type": "Polygon", "coordinates": 3},
        {"type": "MultiPolygon", "coordinates": [RING]},
    ],
)
def test_other_files_are_refused(document: Any, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"areas\.geojson: expected"):
        read_keep_out(written(tmp_path / "areas.geojson", document))
