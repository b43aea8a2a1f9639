"""The settings file of the commands that map: TOML tables [mapper] and [ground]."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap.errors import FileFormatError, SettingsError
from groundmap.settings import GroundSettings, MapperSettings

TABLES = {"mapper": MapperSettings, "ground": GroundSettings}

ConfigOption = Annotated[
    Path | None,
    typer.Option(help="TOML file with tables [mapper] and [ground]: all other settings."),
]


def read_settings(path: Path | None) -> dict[str, dict[str, Any]]:
    """Return the tables of a settings file, validated; empty ones without a file.

    Raises
    ------
    FileFormatError
        No such file, or not TOML.
    SettingsError
        Another table, an unknown key (the nearest one is named), a value out of range.
    """
    tables: dict[str, dict[str, Any]] = {name: {} for name in TABLES}
    if path is None:
        return tables
    try:
        content = tomllib.loads(path.read_text())
    except FileNotFoundError as error:
        raise FileFormatError(path, "a settings file", "no file of that name") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, IsADirectoryError) as error:
        raise FileFormatError(path, "a TOML file", str(error)) from error
    for name, table in content.items():
        if name not in TABLES or not isinstance(table, dict):
            raise SettingsError(name, "a table, [mapper] or [ground]", "another key")
        TABLES[name](**table)
        tables[name] = table
    return tables
