"""Maps of map_server, and loading of maps by suffix."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from groundmap.errors import FileFormatError, InputError
from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState
from groundmap.io.load import load_map
from groundmap.io.map_images import BlockedMap, BlockedVoxels, grid_of, read_ros_map
from groundmap.io.ros_map import write_ros_map
from strategies import rngs

DATA = Path(__file__).parents[3] / "shared" / "data"
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the real maps are not part of the project"
)

KEYS = {
    "image": "map.png",
    "resolution": 0.5,
    "origin": [1.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def ros_map(folder: Path, pixels: Any = ((0, 254),), *, without: str = "", **keys: Any) -> Path:
    """Write a map of 8-bit pixels, the first row on top, and return its yaml file."""
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(folder / "map.png")
    kept = {key: value for key, value in (KEYS | keys).items() if key != without}
    (folder / "map.yaml").write_text(yaml.safe_dump(kept))
    return folder / "map.yaml"


def drawn(found: BlockedMap) -> list[str]:
    """Draw # where blocked, ? where unknown, row 0 first."""
    assert not (found.blocked & found.unknown).any()
    cells = np.where(found.blocked, "#", np.where(found.unknown, "?", "."))
    return ["".join(row) for row in cells.tolist()]


# Nav2


def test_row_0_of_a_ros_map_is_the_lowest_of_its_image(tmp_path: Path) -> None:
    found = read_ros_map(ros_map(tmp_path, [[0, 254, 205], [254, 254, 254], [254, 254, 0]]))
    assert drawn(found) == ["..#", "...", "#.?"]
    assert (found.resolution, found.origin) == (0.5, (1.0, 2.0))


@pytest.mark.parametrize(("free_thresh", "state"), [(0.196, "?"), (0.25, ".")])
def test_free_thresh_decides_whether_grey_205_is_free(
    tmp_path: Path, free_thresh: float, state: str
) -> None:
    assert drawn(read_ros_map(ros_map(tmp_path, [[205]], free_thresh=free_thresh))) == [state]


def test_a_darkness_at_a_threshold_is_unknown(tmp_path: Path) -> None:
    path = ros_map(tmp_path, [[54, 204, 53, 205]], free_thresh=51 / 255, occupied_thresh=201 / 255)
    assert drawn(read_ros_map(path)) == ["??#."]


@pytest.mark.parametrize("negate", [1, True])
def test_a_negated_map_is_blocked_where_it_is_white(tmp_path: Path, negate: int) -> None:
    assert drawn(read_ros_map(ros_map(tmp_path, [[0, 254, 100]], negate=negate))) == [".#?"]


def test_the_grey_of_a_colour_is_the_mean_of_its_channels(tmp_path: Path) -> None:
    red, orange, white = (255, 0, 0), (255, 190, 0), (255, 255, 255)
    assert drawn(read_ros_map(ros_map(tmp_path, [[red, orange, white]]))) == ["#?."]


def test_transparent_pixels_are_darker(tmp_path: Path) -> None:
    assert drawn(read_ros_map(ros_map(tmp_path, [[(255, 255, 255, 255), (255, 255, 255, 0)]]))) == [
        ".?"
    ]


def test_an_image_of_16_bits_is_read_to_its_own_white(tmp_path: Path) -> None:
    path = ros_map(tmp_path, image="deep.pgm")
    (tmp_path / "deep.pgm").write_bytes(b"P5\n3 1\n65535\n" + b"\x00\x00\xc0\x00\xff\xff")
    assert drawn(read_ros_map(path)) == ["#?."]


def test_an_image_may_lie_in_another_folder(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    path = ros_map(tmp_path, image="images/map.png")
    (tmp_path / "map.png").rename(tmp_path / "images" / "map.png")
    assert drawn(read_ros_map(path)) == ["#."]


def test_numbers_without_a_point_are_numbers(tmp_path: Path) -> None:
    path = ros_map(tmp_path)
    path.write_text(path.read_text().replace("resolution: 0.5", "resolution: 5e-1"))
    assert read_ros_map(path).resolution == 0.5


@given(rngs(), st.floats(1e-6, 1e3), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_written_map_is_read_unchanged(
    rng: np.random.Generator, resolution: float, x: float, y: float
) -> None:
    grid = ConfidenceGrid(resolution=resolution, origin=(x, y))
    for at in ((0, 0), (1, -1)):
        tile = grid.tile(at)
        tile.confidence[...] = rng.uniform(-1.0, 1.0, tile.confidence.shape).round(1)
        tile.count[...] = rng.integers(0, 3, tile.count.shape)
    window = grid.window()
    with TemporaryDirectory() as folder:
        write_ros_map(grid, Path(folder) / "map.yaml")
        found = read_ros_map(Path(folder) / "map.yaml")
    npt.assert_array_equal(found.blocked, window.states() == CellState.NONFREE)
    npt.assert_array_equal(~found.blocked & ~found.unknown, window.states() == CellState.FREE)
    assert (found.resolution, found.origin) == (resolution, tuple(window.origin.tolist()))


@pytest.mark.parametrize("key", sorted(KEYS))
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    with pytest.raises(FileFormatError, match=f"map.yaml: expected the key '{key}', got none"):
        read_ros_map(ros_map(tmp_path, without=key))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"resolution": "wide"}, "a number for 'resolution', got 'wide'"),
        ({"resolution": None}, "a number for 'resolution', got 'null'"),
        ({"resolution": float("nan")}, r"a number for 'resolution', got '\.nan'"),
        ({"resolution": 0}, r"resolution above 0 \[m\], got 0"),
        ({"origin": 3}, r"an origin of \[x, y, yaw\], got '3'"),
        ({"origin": [0, 0]}, r"an origin of \[x, y, yaw\], got \['0', '0'\]"),
        ({"origin": [0, "east", 0]}, "a number for 'origin', got 'east'"),
        ({"origin": [0, 0, 1.5]}, "an origin of yaw 0, got 1.5. Rotate the image"),
        ({"negate": 2}, "negate 0 or 1, got '2'"),
        ({"occupied_thresh": 0.1}, "free_thresh <= occupied_thresh <= 1, got 0.196 and 0.1"),
        ({"occupied_thresh": 65}, "free_thresh <= occupied_thresh <= 1, got 0.196 and 65"),
        ({"free_thresh": -0.1}, "0 <= free_thresh .*, got -0.1 and 0.65"),
        ({"mode": "raw"}, "mode trinary, got 'raw'"),
        ({"image": [7]}, r"the name of an image, got \['7'\]"),
        ({"image": ""}, "the name of an image, got ''"),
    ],
)
def test_an_invalid_value_is_refused(tmp_path: Path, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(FileFormatError, match=f"map.yaml: expected .*{message}"):
        read_ros_map(ros_map(tmp_path, **keys))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "image: [\n",
            r"expected YAML, got something else \(expected the node content, .*\) at line 2",
        ),
        ("image: a\x00b\n", "expected YAML, got something else"),
        ("", "expected keys and values, got an empty file"),
        ("- image\n", "expected keys and values, got a list"),
    ],
)
def test_a_yaml_file_of_something_else_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(FileFormatError, match=f"map.yaml: {message}"):
        read_ros_map(tmp_path / "map.yaml")


def test_a_missing_yaml_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"gone.yaml: expected a YAML file, got no file"):
        read_ros_map(tmp_path / "gone.yaml")


def test_a_missing_image_is_named_with_its_map(tmp_path: Path) -> None:
    path = ros_map(tmp_path, image="gone.pgm")
    with pytest.raises(FileFormatError, match=r"gone.pgm: expected the image of map.yaml, got no"):
        read_ros_map(path)


@pytest.mark.parametrize("content", [b"", b"no image", b"P5\n10 10\n255\nshort", b"P5\n-3 x\n"])
def test_an_invalid_or_truncated_image_is_refused(tmp_path: Path, content: bytes) -> None:
    path = ros_map(tmp_path, image="bad.pgm")
    (tmp_path / "bad.pgm").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"bad.pgm: expected an image, got"):
        read_ros_map(path)


# Maps to plan on


@given(rngs(), st.sampled_from([2, 3]))
def test_a_grid_of_blocked_cells_has_their_states(rng: np.random.Generator, ndim: int) -> None:
    shape, corner = tuple(rng.integers(1, 20, ndim)), tuple(rng.uniform(-9, 9, ndim).tolist())
    blocked = rng.random(shape) < 0.5
    unknown = ~blocked & (rng.random(shape) < 0.5)
    found: BlockedMap | BlockedVoxels = BlockedMap(blocked, unknown, 0.5, corner[:2])
    if len(corner) == 3:
        unknown[...] = False
        found = BlockedVoxels(blocked, 0.5, corner)
    grid = grid_of(found, frame="house")
    window = grid.window(np.concatenate([corner, np.array(corner) + np.array(shape[::-1]) * 0.5]))
    states = window.states()[tuple(map(slice, shape))]
    expected = np.where(blocked, CellState.NONFREE, CellState.FREE)
    npt.assert_array_equal(states, np.where(unknown, CellState.UNKNOWN, expected))
    assert grid.frame == "house"


def test_a_map_is_loaded_by_its_suffix(tmp_path: Path) -> None:
    grid = load_map(ros_map(tmp_path))
    assert grid.confidence_at([(1.2, 2.2), (1.7, 2.2)]) == pytest.approx([1.0, -1.0])
    grid.save(tmp_path / "own.npz")
    assert load_map(tmp_path / "own.npz").window().count.sum() == 2
    (tmp_path / "a.map").write_text("type octile\nheight 1\nwidth 2\nmap\n.@\n")
    assert load_map(tmp_path / "a.map").confidence_at((1.5, 0.5)) == 1.0
    (tmp_path / "a.3dmap").write_text("voxel 2 1 1\n1 0 0\n")
    assert load_map(tmp_path / "a.3dmap").confidence_at((1.5, 0.5, 0.5)) == 1.0


@pytest.mark.parametrize("name", ["map.pgm", "map.PNG"])
def test_an_image_without_a_yaml_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=rf"{name}: expected a map, got an image. Give the .yaml"):
        load_map(name)


def test_another_file_is_not_a_map(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(FileFormatError, match=r"notes.txt: expected"):
        load_map(tmp_path / "notes.txt")


# Published maps


@needs_data
@pytest.mark.parametrize(("name", "unknown"), [("depot", False), ("tb3_sandbox", True)])
def test_the_thresholds_of_published_maps_classify_grey_205(name: str, unknown: bool) -> None:
    found = read_ros_map(DATA / "ros_maps" / f"{name}.yaml")
    with Image.open(DATA / "ros_maps" / f"{name}.pgm") as image:
        grey = np.asarray(image)[::-1]
    npt.assert_array_equal(found.blocked, (255 - grey) / 255 > 0.65)
    assert (grey == 205).any()
    assert (found.unknown[grey == 205] == unknown).all()
