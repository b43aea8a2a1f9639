"""``rig.toml``: the stereo rig of a folder of views, and the world frame of its poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError, InputError
from groundmap.files.documents import read_toml
from groundmap.settings import Settings
from groundmap.view.frames import WorldConvention, check_transform
from groundmap.view.stereo_rig import StereoRig

IMAGE_KEYS = ("fx", "fy", "cx", "cy", "baseline")  # all of them, or none


class RigFile(Settings):
    """The keys of ``rig.toml``; `groundmap.StereoRig` checks the ranges of the numbers."""

    model_config = ConfigDict(strict=True)  # text and truth values are not numbers

    world: WorldConvention = Field(description="axes of the world frame of the poses")
    fx: float | None = Field(None, description="focal length [px]")
    fy: float | None = Field(None, description="focal length [px]")
    cx: float | None = Field(
        None, description="column of the principal point of the left image [px]"
    )
    cy: float | None = Field(None, description="row of the principal point [px]")
    baseline: float | None = Field(None, description="distance between the cameras [m]")
    pixel_noise_px: float = Field(
        0.5, description="standard deviation of a matched pixel coordinate [px]"
    )
    T_base_camera: list[list[float]] | None = Field(
        None, description="pose of the left camera in base_link, 4 x 4; default: the identity"
    )


class GivenRig(NamedTuple):
    """The content of a file."""

    rig: StereoRig | None  #: None if the file has no numbers of the images
    world: WorldConvention
    T_base_camera: Floats  #: shape (4, 4)


def read_rig(path: Path) -> GivenRig:
    """Return the rig and the world convention of a file.

    The numbers of the images (`IMAGE_KEYS`) are needed for features in pixels only.

    Raises
    ------
    FileFormatError
        The file is not TOML, a key is missing or unknown (the nearest valid key is named), or a
        value is out of range.
    """
    content = read_toml(path)
    try:
        values = RigFile(**content).model_dump(exclude_none=True)
        world = values.pop("world")
        given = [key for key in IMAGE_KEYS if key in values]
        missing = [key for key in IMAGE_KEYS if key not in values]
        if given and missing:
            hint = f"Give all of {', '.join(IMAGE_KEYS)}, or none."
            raise InputError(missing[0], "a value", "none", hint=hint)
        T_base_camera = check_transform("T_base_camera", values.get("T_base_camera", np.eye(4)))
        return GivenRig(StereoRig(**values) if given else None, world, T_base_camera)
    except InputError as error:
        raise FileFormatError(
            path, f"{error.name} to be {error.expected}", error.got, hint=error.hint
        ) from error


def rig_values(rig: StereoRig) -> dict[str, Any]:
    """Return the numbers of a rig by key, as plain floats and lists: comparable, and TOML."""
    numbers = ("fx", "fy", "cx", "cy", "baseline", "pixel_noise_px")
    return {
        **{name: float(getattr(rig, name)) for name in numbers},
        "T_base_camera": rig.T_base_camera.tolist(),
    }


def write_rig(path: Path, rig: StereoRig, world: WorldConvention) -> None:
    """Write a rig and the world convention of its poses; numbers keep all digits.

    Parameters
    ----------
    path : Path
    rig : StereoRig
    world : {"optical", "rep103"}
    """
    # Python writes floats, and lists of them, the way TOML does.
    lines = [f'world = "{world}"', *(f"{key} = {value}" for key, value in rig_values(rig).items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
