"""``rig.toml``: the stereo rig of a folder of views, and the world its poses are given in."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import Any

from groundmap.errors import FileFormatError, InputError
from groundmap.files.documents import read_toml
from groundmap.view.frames import WorldConvention
from groundmap.view.stereo_rig import StereoRig

REQUIRED = ("world", "fx", "fy", "cx", "cy", "baseline")
OPTIONAL = ("pixel_noise_px", "T_base_camera")
WORLDS: tuple[WorldConvention, ...] = ("optical", "rep103")


def read_rig(path: Path) -> tuple[StereoRig, WorldConvention]:
    """Read a rig and its world.

    Raises
    ------
    FileFormatError
        No TOML; a key that is missing or unknown (the nearest one is named); a value that no rig
        can have.
    """
    values = read_toml(path)
    _check_keys(path, values)
    world = values.pop("world")
    if world not in WORLDS:
        raise FileFormatError(path, "world to be 'optical' or 'rep103'", repr(world))
    for key, value in values.items():
        if key != "T_base_camera" and (
            isinstance(value, bool) or not isinstance(value, int | float)
        ):
            raise FileFormatError(path, f"{key} to be a number", repr(value))
    try:
        return StereoRig(**values), world
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
    """Write a rig and its world; every number is read back as it was."""
    # Python writes floats, and lists of them, the way TOML does.
    lines = [f'world = "{world}"', *(f"{key} = {value}" for key, value in rig_values(rig).items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _check_keys(path: Path, values: dict[str, Any]) -> None:
    known = (*REQUIRED, *OPTIONAL)
    for key in values:
        if key not in known:
            close = get_close_matches(key, known, n=1)
            hint = f"Did you mean {close[0]!r}?" if close else f"There are: {', '.join(known)}."
            raise FileFormatError(path, "keys of a rig", f"the unknown key {key!r}", hint=hint)
    missing = [key for key in REQUIRED if key not in values]
    if missing:
        raise FileFormatError(path, f"the keys {', '.join(REQUIRED)}", f"no {missing[0]!r}")
