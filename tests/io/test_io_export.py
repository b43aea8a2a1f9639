"""Export of maps for other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest
import yaml

from groundmap.errors import InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState
from groundmap.io import EXPORTERS, export
from groundmap.io.ros_map import FREE_THRESH, OCCUPIED_THRESH

CELLS = {"free": (0, 0), "nonfree": (0, 1), "contested": (2, 0), "drop_off": (2, 2)}


@pytest.fixture
def grid() -> ConfidenceGrid:
    """Return a tile with a cell of every state; its corner is at (-6.1, 2.3)."""
    made = ConfidenceGrid(resolution=0.1524, origin=(-6.1, 2.3))
    tile = made.tile((0, 0))
    for cell, confidence in (("free", -0.5), ("nonfree", 0.5), ("contested", 0.001)):
        tile.confidence[CELLS[cell]] = confidence
        tile.count[CELLS[cell]] = 2
    # Sight over the drop-off was free more often than it was seen.
    where, size = np.array(CELLS["drop_off"]), (1, 1)
    for _ in range(2):
        made.fuse(where, np.ones(size, np.float32), np.full(size, -0.5, np.float32))
    for _ in range(3):
        made.fuse(where, -np.ones(size, np.float32), np.full(size, 0.3, np.float32))
    return made


def read_pgm(path: Path) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    magic, size, depth, pixels = path.read_bytes().split(b"\n", 3)
    assert (magic, depth) == (b"P5", b"255")
    cols, rows = map(int, size.split())
    return np.frombuffer(pixels, dtype=np.uint8).reshape(rows, cols)


def test_a_ros_map_shows_each_state_with_the_largest_y_on_top(
    grid: ConfidenceGrid, tmp_path: Path
) -> None:
    export(grid, tmp_path / "map.yaml")
    image = read_pgm(tmp_path / "map.pgm")[::-1]
    assert image.shape == (64, 64)
    assert {name: int(image[cell]) for name, cell in CELLS.items()} == {
        "free": 254,
        "nonfree": 0,
        "contested": 205,
        "drop_off": 0,
    }
    assert int((image == 205).sum()) == 64 * 64 - 3


def test_a_ros_map_gives_its_origin_with_all_digits(grid: ConfidenceGrid, tmp_path: Path) -> None:
    grid.tile((-1, -2))
    export(grid, tmp_path / "map.yaml")
    x, y = -6.1 - 128 * 0.1524, 2.3 - 64 * 0.1524
    assert (tmp_path / "map.yaml").read_text().splitlines() == [
        "image: map.pgm",
        "mode: trinary",
        "resolution: 0.1524",
        f"origin: [{x!r}, {y!r}, 0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    assert read_pgm(tmp_path / "map.pgm").shape == (128, 192)


def test_map_server_restores_the_state_of_each_grey(grid: ConfidenceGrid, tmp_path: Path) -> None:
    export(grid, tmp_path / "map.yaml")
    # map_server's trinary mode, with negate 0.
    occupancy = (255 - read_pgm(tmp_path / "map.pgm")[::-1].astype(float)) / 255
    read = np.full(occupancy.shape, CellState.UNKNOWN)
    read[occupancy < FREE_THRESH] = CellState.FREE
    read[occupancy > OCCUPIED_THRESH] = CellState.NONFREE
    states = grid.window().states()
    states[states == CellState.CONTESTED] = CellState.UNKNOWN
    npt.assert_array_equal(read, states)


@pytest.mark.parametrize(
    "name", ["a: b", "no", "it's", "Tür\t#1", "- x", "aaaaaa " * 30 + "x", "two\nlines"]
)
def test_numbers_and_names_round_trip_through_yaml(tmp_path: Path, name: str) -> None:
    grid = ConfidenceGrid(resolution=1e-05, origin=(1e22, -6.1 - 128 * 0.1524))
    grid.tile((0, 0))
    export(grid, tmp_path / f"{name}.yaml")
    text = (tmp_path / f"{name}.yaml").read_text(encoding="utf-8")
    assert "resolution: 1.0e-05\n" in text  # YAML 1.1 reads 1e-05 as text
    content = yaml.safe_load(text)
    assert content["image"] == f"{name}.pgm"
    assert content["resolution"] == grid.resolution
    assert content["origin"] == [*grid.origin, 0]


def test_a_name_that_yaml_cannot_hold_is_refused(grid: ConfidenceGrid, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^path: expected a file name in UTF-8, got 'a.udcff.pgm"):
        export(grid, tmp_path / "a\udcff.yaml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("origin", [(-6.1, 2.3), (-6.1, 2.3, 0.5)])
def test_dense_arrays_are_the_window(tmp_path: Path, origin: tuple[float, ...]) -> None:
    grid = ConfidenceGrid(resolution=0.1524, origin=origin)
    rng = np.random.default_rng(0)
    tile = grid.tile((0,) * len(origin))
    tile.confidence[...] = rng.uniform(-1, 1, tile.confidence.shape)
    tile.count[...] = rng.integers(0, 9, tile.count.shape)
    export(grid, tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz", allow_pickle=False) as arrays:
        assert set(arrays) == {"confidence", "count", "resolution", "origin"}
        npt.assert_array_equal(arrays["confidence"], tile.confidence)
        npt.assert_array_equal(arrays["count"], tile.count)
        assert arrays["resolution"] == 0.1524
        npt.assert_array_equal(arrays["origin"], origin)


@pytest.mark.parametrize("suffix", sorted(EXPORTERS))
def test_an_empty_map_is_refused_and_nothing_written(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(InputError, match="grid: expected a map with known cells, got an empty one"):
        export(ConfidenceGrid(), tmp_path / f"map{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_a_3d_map_is_not_exported_as_an_image(tmp_path: Path) -> None:
    grid = ConfidenceGrid(origin=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r"a 2-D map, got a 3-D one. Export it as .npz"):
        export(grid, tmp_path / "map.yaml")


@pytest.mark.parametrize("name", ["map.png", "map", "map.npz.bak"])
def test_the_error_for_another_suffix_lists_the_known_ones(
    grid: ConfidenceGrid, tmp_path: Path, name: str
) -> None:
    with pytest.raises(InputError, match=f"ends in .npz or .yaml, got '{name}'"):
        export(grid, tmp_path / name)


def test_a_suffix_in_capitals_is_the_same(grid: ConfidenceGrid, tmp_path: Path) -> None:
    export(grid, tmp_path / "MAP.NPZ")
    assert (tmp_path / "MAP.NPZ").is_file()


def test_a_folder_that_does_not_exist_is_an_os_error(grid: ConfidenceGrid, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file or directory"):
        export(grid, tmp_path / "gone" / "map.npz")
