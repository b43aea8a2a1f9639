"""Files of the MovingAI benchmark: maps, voxels, queries."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.errors import FileFormatError, InputError
from groundmap.io.map_images import BlockedMap
from groundmap.io.movingai import read_movingai_map, read_movingai_voxels
from groundmap.io.movingai_scen import MovingAIQuery, read_movingai_scen
from strategies import rngs

DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the real maps are not part of the project"
)


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_bytes(text.encode())
    return folder / name


def movingai_map(folder: Path, text: str) -> Path:
    return written(folder, "some.map", text)


def drawn(found: BlockedMap) -> list[str]:
    """Draw # where blocked, row 0 first."""
    assert not found.unknown.any()
    return ["".join(row) for row in np.where(found.blocked, "#", ".").tolist()]


# Maps

HEADER = "type octile\nheight 2\nwidth 3\nmap\n"


def test_a_movingai_map_keeps_its_rows_in_the_order_of_the_file(tmp_path: Path) -> None:
    found = read_movingai_map(movingai_map(tmp_path, HEADER + "@..\n..T\n"), resolution=0.25)
    assert drawn(found) == ["#..", "..#"]
    assert (found.resolution, found.origin) == (0.25, (0.0, 0.0))


def test_every_kind_of_cell_is_free_or_blocked(tmp_path: Path) -> None:
    found = read_movingai_map(movingai_map(tmp_path, HEADER + ".GS\n@OT\n"))
    assert drawn(found) == ["...", "###"]
    assert drawn(read_movingai_map(movingai_map(tmp_path, HEADER + "W..\n...\n")))[0] == "#.."


@pytest.mark.parametrize(
    "text",
    [
        (HEADER + "@..\n..T\n").replace("\n", "\r\n"),
        HEADER + "@..\n..T",
        HEADER + "@..\n..T\n\n\n",
        "version 1.0\n" + HEADER + "@..\n..T\n",
        "type octile\nwidth 3\nheight 2 \nmap\n@..\n..T\n",
    ],
)
def test_line_ends_and_headers_do_not_change_the_map(tmp_path: Path, text: str) -> None:
    assert drawn(read_movingai_map(movingai_map(tmp_path, text))) == ["#..", "..#"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEADER + "...\n", "expected 2 rows, got 1. Was the file cut short"),
        (HEADER, "expected 2 rows, got 0. Was the file cut short"),
        (HEADER + "...\n...\n...\n", "expected 2 rows, got 3"),
        (HEADER + "...\n..\n", "expected 3 cells, got 2 at line 6"),
        (HEADER + "....\n...\n", "expected 3 cells, got 4 at line 5"),
        (HEADER + "...\n.x.\n", "expected cells of .*, got 'x' at line 6"),
        (HEADER + "...\n.é.\n", "expected cells of .*, got 'é' at line 6"),
        ("", "expected a line 'map', got none"),
        ("type octile\nheight 2\n", "expected a line 'map', got none"),
        ("type octile\nheight 2\nmap\n", "expected width before the map, got none at line 3"),
        ("type octile\nheight -2\n", "expected height and a number above 0, .* at line 2"),
        ("height 0\n", "expected height and a number above 0, got 'height 0' at line 1"),
        ("width\n", "expected width and a number above 0, got 'width' at line 1"),
        ("image: map.pgm\n", "expected type, height, width or map, got 'image: map.pgm' at line 1"),
    ],
)
def test_an_invalid_map_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileFormatError, match=f"some.map: {message}"):
        read_movingai_map(movingai_map(tmp_path, text))


def test_a_missing_map_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        FileFormatError, match=r"gone.map: expected a readable file, got no file of that name"
    ):
        read_movingai_map(tmp_path / "gone.map")


@pytest.mark.parametrize("resolution", [0.0, -1.0, float("nan")])
def test_the_resolution_sets_the_size_of_cells(tmp_path: Path, resolution: float) -> None:
    path = movingai_map(tmp_path, HEADER + "...\n...\n")
    with pytest.raises(InputError, match=r"resolution: expected a number above 0 \[m\]"):
        read_movingai_map(path, resolution=resolution)


# Voxels


@given(rngs(), st.sampled_from(["\n", "\r\n"]))
@settings(max_examples=30)
def test_voxels_are_where_their_lines_say(rng: np.random.Generator, end: str) -> None:
    size = rng.integers(1, 8, 3)
    voxels = rng.integers(0, size, (rng.integers(0, 30), 3))
    lines = ["voxel " + " ".join(map(str, size)), *(" ".join(map(str, row)) for row in voxels)]
    with TemporaryDirectory() as folder:
        path = written(Path(folder), "some.3dmap", end.join(lines))
        found = read_movingai_voxels(path, resolution=0.25)
    expected = np.zeros(size[::-1], dtype=bool)
    for x, y, z in voxels:
        expected[z, y, x] = True
    npt.assert_array_equal(found.blocked, expected)
    assert (found.resolution, found.origin) == (0.25, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected 'voxel X Y Z', got '' at line 1"),
        ("voxel 2 3\n", "expected 'voxel X Y Z', got 'voxel 2 3' at line 1"),
        ("voxels 2 3 4\n", "expected 'voxel X Y Z', got 'voxels 2 3 4' at line 1"),
        ("voxel 2 -3 4\n", "expected 'voxel X Y Z', got 'voxel 2 -3 4' at line 1"),
        ("voxel 2 0 4\n", "expected 1 to 134217728 voxels, got 2 x 0 x 4 at line 1"),
        ("voxel 9999 9999 9999\n", "expected 1 to 134217728 voxels, got 9999 x .* at line 1"),
        ("voxel 2 3 4\n0 0\n", "expected 3 columns, got 2 at line 2. Was the file cut short"),
        ("voxel 2 3 4\n0 0 0 0\n", "expected 3 columns, got 4 at line 2"),
        ("voxel 2 3 4\n\n0 0 0.5\n", "expected 3 numbers, the first 3 integers, .* at line 3"),
        ("voxel 2 3 4\n1 2 3\n1 2 4\n", "a voxel from 0 0 0 to 1 2 3, got '1 2 4' at line 3"),
        ("voxel 2 3 4\n-1 2 3\n", "a voxel from 0 0 0 to 1 2 3, got '-1 2 3' at line 2"),
    ],
)
def test_invalid_voxels_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, "some.3dmap", text)
    with pytest.raises(FileFormatError, match=f"some.3dmap: .*{message}"):
        read_movingai_voxels(path)


def test_the_resolution_sets_the_size_of_voxels(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"resolution: expected a number above 0 \[m\], got -1"):
        read_movingai_voxels(tmp_path / "some.3dmap", resolution=-1.0)


# Queries

ROW = "0\tmaps/dao/arena.map\t49\t48\t1\t11\t3\t12\t2.41421\n"
VOXEL_ROW = "1 2 3 1 2 9 6 1.0\n"


@pytest.mark.parametrize(
    "text",
    [
        "version 1\n" + ROW,
        "version 1.0\n" + ROW.replace("\t", " "),
        ("version 1\n" + ROW).replace("\n", "\r\n"),
        ("version 1\n" + ROW).rstrip(),
        "version\t1 \n\n" + ROW + "\n\n",
        "version 1\n" + ROW.replace("maps/dao/", "maps\\dao\\"),
        "\ufeffversion 1\n" + ROW,
    ],
)
def test_queries_of_different_form_are_read_alike(tmp_path: Path, text: str) -> None:
    [query] = read_movingai_scen(written(tmp_path, "arena.map.scen", text))
    assert query._replace(line=0) == MovingAIQuery(
        tmp_path / "arena.map", (48, 49), (11, 1), (12, 3), 2.41421, 0
    )
    assert query.solvable


def test_the_name_of_a_map_may_contain_spaces(tmp_path: Path) -> None:
    text = "version 1\n" + ROW.replace("arena", "the old arena")
    [query] = read_movingai_scen(written(tmp_path, "old.scen", text))
    assert query.map_file == tmp_path / "the old arena.map"


def test_a_pair_of_length_0_is_solvable_only_in_place(tmp_path: Path) -> None:
    apart, same = "0 a.map 9 9 1 1 3 3 0\n", "0 a.map 9 9 3 3 3 3 0.0\n"
    queries = read_movingai_scen(written(tmp_path, "a.scen", "version 1\n" + apart + same))
    assert [query.solvable for query in queries] == [False, True]


def test_queries_in_voxels_have_layers_first(tmp_path: Path) -> None:
    text = "version 1\nmaps/Simple.3dmap\n" + VOXEL_ROW
    [query] = read_movingai_scen(written(tmp_path, "Simple.3dmap.3dscen", text))
    assert query == MovingAIQuery(tmp_path / "Simple.3dmap", (), (3, 2, 1), (9, 2, 1), 6.0, 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected 'version 1', got '' at line 1"),
        (ROW, "expected 'version 1', got '0.* at line 1"),
        ("version 2\n", "expected 'version 1', got 'version 2' at line 1"),
        ("version one\n", "expected 'version 1', got 'version one' at line 1"),
        ("version 1\n0 a.map 9 9 1 1 3 3\n", "expected bucket, map, width, .* at line 2"),
        ("version 1\n\n0 a.map 9 9 1 1 3 x 2\n", "expected bucket, map, .* at line 3"),
        ("version 1\n0 a.map 9 9 1 1 3.5 3 2\n", "expected bucket, map, .* at line 2"),
        ("version 1\nnone a.map 9 9 1 1 3 3 2\n", "expected bucket, map, .* at line 2"),
        ("version 1\n0 a.map 9 9 1 1 3 3 -2\n", "a length of 0 or more, got -2 at line 2"),
        ("version 1\n0 a.map 9 9 1 1 3 3 nan\n", "a length of 0 or more, got nan at line 2"),
        ("version 1\n0 a.map 9 8 1 8 3 3 2\n", "a start on the map of 9 x 8 cells, got 1, 8 at"),
        ("version 1\n0 a.map 9 8 1 1 -3 3 2\n", "a goal on the map of 9 x 8 cells, got -3, 3"),
    ],
)
def test_invalid_queries_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, "a.map.scen", text)
    with pytest.raises(FileFormatError, match=f"a.map.scen: .*{message}"):
        read_movingai_scen(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version 1\n", "expected the name of a map, got none at line 2"),
        ("version 1\na.3dmap\n1 2 3 1 2 9 6\n", "expected start x, y, z, .* at line 3"),
        ("version 1\na.3dmap\n1 2 3 1 2 9 6 1 1\n", "expected start x, y, z, .* at line 3"),
        ("version 1\na.3dmap\n1 2 3 1 2\n", "expected start x, y, z, .* at line 3"),
        ("version 1\na.3dmap\n1 2 3.5 1 2 9 6 1\n", "expected start x, y, z, .* at line 3"),
        ("version 1\na.3dmap\n1 2 -3 1 2 9 6 1\n", "expected voxels from 0 0 0 on, .* at line 3"),
        ("version 1\na.3dmap\n1 2 3 1 2 9 inf 1\n", "a length of 0 or more, got inf at line 3"),
    ],
)
def test_invalid_queries_in_voxels_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, "a.3dmap.3dscen", text)
    with pytest.raises(FileFormatError, match=f"a.3dmap.3dscen: .*{message}"):
        read_movingai_scen(path)


def test_missing_queries_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        FileFormatError, match=r"gone.scen: expected a readable file, got no file of that name"
    ):
        read_movingai_scen(tmp_path / "gone.scen")


# Published files


@needs_data
@pytest.mark.parametrize(
    "path", sorted((DATA / "movingai").glob("*/*.map")), ids=lambda path: path.stem
)
def test_published_queries_start_and_end_in_free_cells(path: Path) -> None:
    found = read_movingai_map(path)
    queries = read_movingai_scen(path.with_name(path.name + ".scen"))
    assert {(query.map_file, query.shape) for query in queries} == {(path, found.blocked.shape)}
    ends = np.array([[query.start, query.goal] for query in queries])
    assert not found.blocked[ends[..., 0], ends[..., 1]].any()
    lengths = np.array([query.length for query in queries])
    assert (lengths > np.hypot(*(ends[:, 1] - ends[:, 0]).T) - 0.01).all()


@needs_data
@pytest.mark.parametrize("name", ["Simple", "Complex"])
def test_published_queries_in_voxels_start_and_end_in_free_ones(name: str) -> None:
    found = read_movingai_voxels(DATA / "warframe3d" / f"{name}.3dmap")
    queries = read_movingai_scen(DATA / "warframe3d" / f"{name}.3dmap.3dscen")
    assert len(queries) == 10_000
    ends = np.array([[query.start, query.goal] for query in queries])
    assert not found.blocked[tuple(np.moveaxis(ends, -1, 0))].any()
    assert found.blocked.any()
