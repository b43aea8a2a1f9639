"""Grey values of images: the pixel format decides how they are read, or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
from PIL import Image, TiffImagePlugin

from groundmap.errors import FileFormatError
from groundmap.io.greys import BITS, PHOTOMETRIC, SAMPLE_FORMAT, Greys, read_greys
from groundmap.io.map_images import read_ros_map

RAMP = [[0, 1, 128, 254, 255]]
YAML = """\
image: {image}
resolution: 0.5
origin: [1.0, 2.0, {yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
mode: {mode}
"""


def read(
    folder: Path, pixels: Any, suffix: str = ".tif", tags: dict[str, int] | None = None
) -> Greys:
    """Write an array as an image, with tags of a TIFF by name, and read it."""
    path = folder / f"image{suffix}"
    numbers = {"photometric": PHOTOMETRIC, "samples": SAMPLE_FORMAT, "bits": BITS}
    if tags:
        info = TiffImagePlugin.ImageFileDirectory_v2()
        for name, value in tags.items():
            if name != "photometric":  # Pillow would invert the pixels, too
                info[numbers[name]] = value
        Image.fromarray(pixels).save(path, tiffinfo=info)
        _set_tags(path, {numbers[name]: value for name, value in tags.items()})
    else:
        Image.fromarray(pixels).save(path)
    return read_greys(path, "an image")


def _set_tags(path: Path, tags: dict[int, int]) -> None:
    """Write tags of one short number into a little-endian TIFF: Pillow sets some of its own."""
    content = bytearray(path.read_bytes())
    assert content[:4] == b"II*\0"
    start = int.from_bytes(content[4:8], "little")
    for at in range(start + 2, start + 2 + 12 * content[start], 12):
        number = int.from_bytes(content[at : at + 2], "little")
        if number in tags:
            content[at + 8 : at + 10] = tags[number].to_bytes(2, "little")
    path.write_bytes(content)


@pytest.mark.parametrize("suffix", [".tif", ".png", ".bmp", ".pgm", ".gif"])
def test_greys_of_8_bits_are_read_unchanged(tmp_path: Path, suffix: str) -> None:
    grey, white = read(tmp_path, np.array(RAMP, dtype=np.uint8), suffix)
    npt.assert_array_equal(grey.astype(float) / white, np.array(RAMP) / 255)


@pytest.mark.parametrize("suffix", [".tif", ".png", ".pgm"])
def test_greys_of_16_bits_are_read_unchanged(tmp_path: Path, suffix: str) -> None:
    pixels = np.array([[0, 1, 30_000, 65_535]], dtype=np.uint16)
    grey, white = read(tmp_path, pixels, suffix)
    npt.assert_array_equal(grey, pixels)
    assert white == 65_535


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_tiff_with_white_as_zero_is_inverted(tmp_path: Path, kind: Any) -> None:
    pixels = np.array(RAMP, dtype=kind)
    grey, white = read(tmp_path, pixels, tags={"photometric": 0})
    npt.assert_array_equal(grey, np.iinfo(kind).max - pixels)
    assert white == np.iinfo(kind).max


@pytest.mark.parametrize(
    ("pixels", "tags", "got"),
    [
        (np.array([[-(2**31), 0, 2**31 - 1]], dtype=np.int32), {}, "signed whole numbers of 32"),
        (np.array([[0.0, 0.5, 1.0]], dtype=np.float32), {}, "real numbers of 32 bits"),
        (np.array([RAMP[0]], dtype=np.int32), {"samples": 1}, "whole numbers of 32 bits"),
        (np.array([RAMP[0]], dtype=np.uint16), {"samples": 2}, "signed whole numbers of 16 bits"),
        (np.array([RAMP[0]], dtype=np.uint8), {"samples": 2}, "signed whole numbers of 8 bits"),
    ],
)
def test_a_tiff_of_other_numbers_is_refused(
    tmp_path: Path, pixels: Any, tags: dict[str, int], got: str
) -> None:
    expected = f"whole numbers of up to 16 bits, got {got}.* Save it as a PNG"
    with pytest.raises(FileFormatError, match=expected):
        read(tmp_path, pixels, tags=tags)


def test_the_content_decides_the_image_format_and_documents_are_refused(tmp_path: Path) -> None:
    Image.fromarray(np.array(RAMP, dtype=np.uint8)).save(tmp_path / "image.eps")
    with pytest.raises(FileFormatError, match=r"image.eps: expected an image, got cannot identify"):
        read_greys(tmp_path / "image.eps", "an image")


@pytest.mark.parametrize(
    ("mode", "yaw"),
    [("Trinary", "0"), ("TRINARY", "1e-17"), ("trinary", "6.283185307179586"), ("trinary", "-0.0")],
)
def test_an_origin_with_any_form_of_zero_yaw_is_read(tmp_path: Path, mode: str, yaw: str) -> None:
    Image.fromarray(np.array([[0, 254, 205]], dtype=np.uint8)).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text(YAML.format(image="map.png", mode=mode, yaw=yaw))
    found = read_ros_map(tmp_path / "map.yaml")
    assert found.blocked.tolist() == [[True, False, False]]
    assert found.unknown.tolist() == [[False, False, True]]


def test_an_origin_with_a_yaw_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(YAML.format(image="map.png", mode="trinary", yaw=1e-6))
    with pytest.raises(FileFormatError, match="expected an origin of yaw 0, got 1e-06"):
        read_ros_map(tmp_path / "map.yaml")


def test_an_image_whose_map_needs_gigabytes_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "map.png"
    Image.new("1", (12, 2_000_000), 1).save(path)  # a few kilobytes, but 31,250 rows of tiles
    with pytest.raises(FileFormatError, match=r"map.png: expected an image of at most \d+ pixels"):
        read_greys(path, "an image")
