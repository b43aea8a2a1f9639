"""Maps with tiles far from the rest, and what a local question may cost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from command_line import run
from groundmap import ConfidenceGrid, draw
from groundmap.errors import InputError
from groundmap.grid.grid import MOST_CELLS
from groundmap.grid.tiles import Index, Tile, Tiles
from groundmap.io import export


def with_far_tile(cell: int = 10**6) -> ConfidenceGrid:
    """Return 2 x 3 tiles of free cells of 0.5 m, and one cell far along x."""
    grid = ConfidenceGrid(resolution=0.5)
    grid.fuse(np.array([0, 0]), np.full((128, 192), -1.0, dtype=np.float32))
    grid.fuse(np.array([5, cell]), np.ones((1, 1), dtype=np.float32))
    return grid


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    with_far_tile().save(tmp_path / "far.npz")
    return tmp_path / "far.npz"


NAMES_IT = (
    r"^map: expected a box of \d+ cells at most around the observed tiles, "
    r"got 1\.00006e\+06 x 128 cells \(500032 x 64 m, 1\.02 GB\)\. "
    r"1 of 7 tiles lies far from the rest, the one at "
    r"\(500016, 16\) m, 499904 m away: is a pose wrong there\? Give the bounds of a part "
    r"\(bounds=\.\.\., --bounds\), without them 0\.0,0\.0,96\.0,64\.0\.$"
)


def test_a_far_tile_is_named_with_bounds_that_leave_it_out() -> None:
    grid = with_far_tile()
    with pytest.raises(InputError, match=NAMES_IT):
        grid.check_extent(2**25)
    with pytest.raises(InputError, match=NAMES_IT):
        grid.window(most_cells=2**25)
    with pytest.raises(InputError, match=NAMES_IT):
        draw.known_bounds(grid)
    assert grid.window((0.0, 0.0, 96.0, 64.0)).count.all()


def test_far_tiles_on_several_sides_are_counted_together() -> None:
    grid = with_far_tile()
    grid.tile((0, -(10**5)))
    grid.tile((1, -(10**5)))
    with pytest.raises(InputError, match=r"3 of 9 tiles lie far .* the farthest at \(-3199984, "):
        grid.check_extent(2**25)


def test_a_large_map_without_gaps_blames_no_tile() -> None:
    grid = ConfidenceGrid(resolution=1.0)
    for number in range(40):
        grid.tile((number, number))
    with pytest.raises(InputError, match=r"got 2560 x 2560 cells .*GB\)\. Give the bounds of a pa"):
        grid.check_extent(2**20)


def test_bounds_of_too_many_cells_say_what_memory_they_would_take() -> None:
    expected = r"^bounds: expected a box of 268435456 cells .* got 200000 x 2000 .* 3\.2 GB\)"
    with pytest.raises(InputError, match=expected):
        with_far_tile().window((0, 0, 1e5, 1e3))
    with pytest.raises(InputError, match=r"^bounds: expected a box of 33554432 cells at most"):
        draw.draw_grid(with_far_tile(), bounds=(0, 0, 1e5, 1e3))


def test_a_map_as_far_as_cells_go_is_refused_alike() -> None:
    grid = with_far_tile(2**59)
    grid.tile((-(2**53), 0))
    with pytest.raises(InputError, match="2 of 8 tiles lie far from the rest"):
        grid.window()


@pytest.mark.parametrize("out", ["dense.npz", "nav2.yaml"])
def test_convert_refuses_a_box_beyond_memory_and_takes_bounds(map_file: Path, out: str) -> None:
    with_far_tile(MOST_CELLS).save(map_file)
    target = map_file.with_name(out)
    refused = run("convert", map_file, target)
    assert refused.code == 2
    assert "1 of 7 tiles lies far from the rest" in refused.err
    assert not target.exists()
    assert run("convert", map_file, target, "--bounds", "1,2,11,7").code == 0
    if out == "dense.npz":
        with np.load(target) as arrays:
            assert arrays["count"].shape == (10, 20)
            assert arrays["origin"].tolist() == [1.0, 2.0]
    else:
        assert target.with_suffix(".pgm").read_bytes().startswith(b"P5\n20 10\n255\n")
        assert "origin: [1.0, 2.0, 0]\n" in target.read_text()


def test_bounds_that_are_no_box_write_nothing(map_file: Path) -> None:
    target = map_file.with_name("part.npz")
    with pytest.raises(InputError, match="an upper corner above the lower one"):
        export(with_far_tile(), target, bounds=(1, 0, 0, 1))
    assert not target.exists()
    assert run("convert", map_file, target, "--bounds", "1,2,3").code == 2


def test_plot_refuses_a_far_tile_and_draws_bounds(map_file: Path) -> None:
    picture = map_file.with_name("far.png")
    refused = run("plot", map_file, "--out", picture)
    assert refused.code == 2
    assert "without them 0.0,0.0,96.0,64.0." in refused.err
    assert run("plot", map_file, "--out", picture, "--bounds", "0,0,96,64").code == 0
    assert picture.stat().st_size > 1000


def test_info_works_with_a_far_tile(map_file: Path) -> None:
    info = run("info", map_file, "--json")
    assert info.code == 0
    assert info.json["bounds"] == [0.0, 0.0, 500032.0, 64.0]
    assert info.json["area_free_m2"] == 128 * 192 * 0.25


class Watched(dict[Index, Tile]):
    """Tiles that count how many of them are looked at."""

    looked = 0

    def get(self, index: Index, default: Any = None) -> Any:
        self.looked += 1
        return super().get(index, default)

    def items(self) -> Any:
        def each() -> Iterator[tuple[Index, Tile]]:
            for item in super(Watched, self).items():
                self.looked += 1
                yield item

        return each()


@pytest.fixture
def watched() -> tuple[ConfidenceGrid, Watched]:
    """Return a grid of 32 x 32 tiles with cells of 1 m, and its tiles."""
    grid = ConfidenceGrid(resolution=1.0)
    for row in range(32):
        for col in range(32):
            grid.tile((row, col)).count[...] = 32 * row + col
    tiles = Watched(grid.tiles())
    grid._tiles._held = tiles
    return grid, tiles


def test_a_small_window_looks_at_the_tiles_it_touches(
    watched: tuple[ConfidenceGrid, Watched],
) -> None:
    grid, tiles = watched
    window = grid.window((62.0, 126.0, 66.0, 130.0))
    assert tiles.looked == 4
    assert np.unique(window.count).tolist() == [32, 33, 64, 65]


def test_positions_are_looked_up_tile_by_tile(watched: tuple[ConfidenceGrid, Watched]) -> None:
    grid, tiles = watched
    xy = np.random.default_rng(1).uniform(0.0, 128.0, (1000, 2))
    counts = grid.count_at(xy)
    assert tiles.looked == 4
    npt.assert_array_equal(counts, 32 * (xy[:, 1] // 64) + xy[:, 0] // 64)


def test_a_window_beyond_the_map_is_read_without_a_step_for_each_tile_of_its_box() -> None:
    tiles = Tiles(2)
    tiles.touch((5, -7)).count[...] = 1
    dense = tiles.read(np.array([0, -1000]), np.array([1000, 1000]))
    assert dense.count.sum() == 64 * 64


indices = st.tuples(st.integers(-60, 60), st.integers(-60, 60))


@given(st.lists(indices, min_size=1, max_size=12), st.integers(1, 400))
@settings(max_examples=60)
def test_what_stays_of_a_parted_map_fits_or_has_no_gap(held: list[Index], most: int) -> None:
    tiles = Tiles(2)
    for index in held:
        tiles.touch(index)
    kept, away = tiles.main_part(most * 64 * 64)
    together = sorted(map(tuple, np.concatenate([kept, away]).tolist()))
    assert together == sorted(set(held))
    fits = np.prod(np.ptp(kept, axis=0) + 1) <= most
    gaps = [np.diff(np.unique(along)).max(initial=1) for along in kept.T]
    assert fits or max(gaps) == 1
    if np.prod(np.ptp(np.array(held), axis=0) + 1) <= most:
        assert len(away) == 0
