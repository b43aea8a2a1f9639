"""The settings file of ``map``, ``evaluate`` and ``plot``: TOML tables [mapper] and [ground]."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap.errors import SettingsError
from groundmap.files.documents import read_toml
from groundmap.settings import GroundSettings, MapperSettings

TABLES = {"mapper": MapperSettings, "ground": GroundSettings}

ConfigOption = Annotated[
    Path | None,
    typer.Option(help="TOML file with all other settings, in tables [mapper] and [ground]."),
]

ModeOption = Annotated[
    str | None,
    typer.Option(help="Kind of map: 2d (cells of the ground) or 3d (voxels); default: 2d."),
]


def read_settings(path: Path | None) -> dict[str, dict[str, Any]]:
    """Return the validated tables of a settings file; without a file, empty tables.

    Raises
    ------
    FileFormatError
        The file does not exist or is not TOML.
    SettingsError
        An unknown table, an unknown key (the nearest one is named), a value out of range.

    """
    tables: dict[str, dict[str, Any]] = {name: {} for name in TABLES}
    if path is None:
        return tables
    content = read_toml(path, "a settings file")
    for name, table in content.items():
        if name not in TABLES or not isinstance(table, dict):
            raise SettingsError(name, "a table, [mapper] or [ground]", "another key")
        TABLES[name](**table)
        tables[name] = table
    return tables
