"""Files of older versions: their maps say what they said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap import CellState, ConfidenceGrid
from groundmap.errors import FileFormatError

HEADER = {
    "format": "groundmap-grid",
    "version": 1,
    "resolution": 0.5,
    "origin": [0.0, 0.0],
    "frame": "map",
    "rule": {"name": "average"},
}


def write_version_1(path: Path, drop_offs: object = np.uint32) -> None:
    """Write a map of two tiles as version 1 did, one of them with drop-offs."""
    shape = (2, 64, 64)
    confidence, count = np.zeros(shape, np.float32), np.zeros(shape, np.uint32)
    views = np.zeros(shape, drop_offs)  # type: ignore[call-overload]
    confidence[:, 0], count[:, 0] = -0.75, 9
    confidence[1, 1], count[1, 1] = 0.5, 2
    views[1, 0, :3] = 2, 3, 7
    views[1, 9, :3] = 2, 3, 7
    with path.open("wb") as stream:
        np.savez_compressed(
            stream,
            header=np.array(json.dumps(HEADER)),
            tiles=np.array([(0, 0), (0, 1)], dtype=np.int64),
            confidence=confidence,
            count=count,
            drop_offs=views,
            trajectory=np.ones((1, 3)),
        )


def test_a_map_of_version_1_has_the_states_that_it_had(tmp_path: Path) -> None:
    write_version_1(tmp_path / "map")
    grid = ConfidenceGrid.load(tmp_path / "map")
    states = grid.window().states()
    expected = np.full((64, 128), CellState.UNKNOWN)
    expected[0], expected[1, 64:] = CellState.FREE, CellState.NONFREE
    expected[0, 65:67] = expected[9, 65:67] = CellState.NONFREE  # seen by 3 views or more
    npt.assert_array_equal(states, expected)
    assert grid.count_at([(0.1, 0.1), (32.6, 4.6), (33.1, 4.6)]).tolist() == [9, 3, 7]  # type: ignore[union-attr]
    npt.assert_array_equal(grid.trajectory, np.ones((1, 3)))


def test_a_map_of_version_1_is_saved_as_the_newest(tmp_path: Path) -> None:
    write_version_1(tmp_path / "map")
    grid = ConfidenceGrid.load(tmp_path / "map")
    grid.save(tmp_path / "new")
    again = ConfidenceGrid.load(tmp_path / "new")
    npt.assert_array_equal(again.window().confidence, grid.window().confidence)
    npt.assert_array_equal(again.window().count, grid.window().count)


def test_drop_offs_of_another_type_are_refused(tmp_path: Path) -> None:
    write_version_1(tmp_path / "map", np.float64)
    with pytest.raises(FileFormatError, match="drop_offs: expected uint32 of shape"):
        ConfidenceGrid.load(tmp_path / "map")
