"""Grey values of images, for every pixel format that they may have."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, TiffImagePlugin

from groundmap.errors import FileFormatError
from groundmap.files.opening import open_file

TILE = 64  # [pixels] side of a map's tile
MOST_CELLS = 2**26  # 8,192 x 8,192: their map takes 0.8 GiB
FORMATS = ("BMP", "GIF", "JPEG", "PNG", "PPM", "TIFF", "WEBP")
SIXTEEN_BITS = ("I;16", "I;16L", "I;16B", "I;16N")
BITS, PHOTOMETRIC, SAMPLE_FORMAT = 258, 262, 339  # tags of a TIFF
WHITE_IS_ZERO, UNSIGNED = 0, 1  # values of the last two
READ_BY = "an image of whole numbers of up to 16 bits"
HINT = "Save it as a PNG of 8 bits."
# Exceptions that Pillow raises for damaged images, as the fuzzer found them.
DAMAGES = (OSError, EOFError, ValueError, SyntaxError, TypeError, LookupError, ArithmeticError,
           AttributeError, RuntimeError, MemoryError, Image.DecompressionBombError)  # fmt: skip


class Greys(NamedTuple):
    """The brightness of the pixels of an image."""

    grey: npt.NDArray[np.uint16]  #: shape (rows, cols): the sum of all channels
    white: int  #: the largest possible value of `grey`


def read_greys(path: Path, expected: str) -> Greys:
    """Read an image of whole numbers of up to 16 bits, with any number of channels.

    Parameters
    ----------
    path : Path
    expected : str
        Description of the file for the error message.

    Raises
    ------
    FileFormatError
        A file that is missing or not readable, or pixels of another type.
    """
    with open_file(path, expected) as stream, warnings.catch_warnings():
        # Pillow warns of large images, and of damaged metadata, which is not used here.
        warnings.simplefilter("ignore")
        try:
            with Image.open(stream, formats=FORMATS) as image:
                _check_size(path, image)
                return _greys(path, image)
        except FileFormatError:
            raise
        except DAMAGES as error:
            raise FileFormatError(path, "an image", str(error) or type(error).__name__) from error


def _greys(path: Path, image: Image.Image) -> Greys:
    white_is_zero = False
    if isinstance(image, TiffImagePlugin.TiffImageFile):
        _check_samples(path, image)
        white_is_zero = _tag(image, PHOTOMETRIC) == WHITE_IS_ZERO
    # Pillow stores 16-bit images of PGM, and in older releases of PNG, in 32 bits.
    if image.mode in SIXTEEN_BITS or (image.mode == "I" and image.format in ("PNG", "PPM")):
        pixels = np.asarray(image).astype(np.uint16)
        # Pillow has already inverted images of up to 8 bits.
        return Greys(65535 - pixels if white_is_zero else pixels, 65535)
    if image.mode.startswith(("I", "F")):
        raise FileFormatError(path, READ_BY, f"one of mode {image.mode}", hint=HINT)
    if image.mode in ("1", "L") and not image.has_transparency_data:
        return Greys(np.asarray(image.convert("L")).astype(np.uint16), 255)
    pixels = np.asarray(image.convert("RGBA" if image.has_transparency_data else "RGB"))
    return Greys(pixels.sum(axis=-1, dtype=np.uint16), 255 * pixels.shape[-1])


def _check_size(path: Path, image: Image.Image) -> None:
    """Refuse an image whose map needs gigabytes, before its pixels are read."""
    width, height = image.size
    cells = math.prod(-(-side // TILE) * TILE for side in image.size)
    if cells > MOST_CELLS:
        raise FileFormatError(
            path,
            f"an image of at most {MOST_CELLS} pixels, sides rounded up to {TILE}",
            f"{width} x {height} pixels",
            hint="Crop it, or scale it down and raise the resolution [m/px].",
        )


def _check_samples(path: Path, image: TiffImagePlugin.TiffImageFile) -> None:
    """Refuse samples that Pillow reads with a wrong range: signed, real, of 12 bits."""
    bits, kind = _tag(image, BITS, 1), _tag(image, SAMPLE_FORMAT, UNSIGNED)
    if kind != UNSIGNED or bits not in (1, 2, 4, 8, 16):
        name = {2: "signed whole", 3: "real"}.get(kind, "whole")
        raise FileFormatError(path, READ_BY, f"{name} numbers of {bits} bits", hint=HINT)


def _tag(image: TiffImagePlugin.TiffImageFile, number: int, default: int = -1) -> int:
    """Return a tag; if it has a value per channel, the first."""
    value = image.tag_v2.get(number, default)
    return int(value[0] if isinstance(value, tuple) else value)
