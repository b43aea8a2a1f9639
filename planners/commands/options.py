"""Parsers of options that hold outlines and settings."""

from __future__ import annotations

from typing import Any

import typer

from groundmap.files.documents import WrongDocumentError, parse_json
from planners.commands.console import numbers


def outline(text: str) -> float | list[tuple[float, ...]]:
    """Return a footprint: a radius for ``R`` [m], corners for ``X,Y X,Y ...`` [m, base_link].

    Raises
    ------
    typer.BadParameter
        Neither a number nor corners.

    Examples
    --------
    >>> outline("0.9"), outline("-1,-0.5 1,-0.5 1,0.5")
    (0.9, [(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5)])
    """
    corners = text.split()
    if len(corners) > 1:
        return [numbers("footprint", corner, 2) for corner in corners]
    return numbers("footprint", text, 1)[0]


def assignments(texts: list[str]) -> dict[str, Any]:
    """Return settings given as ``NAME=VALUE``; the settings' class checks names and values.

    Raises
    ------
    typer.BadParameter
        No equals sign, a name given twice, or an invalid list.

    Examples
    --------
    >>> assignments(["weight=2.5", "motion=dubins", "time_limit=none", "goals=[[3, 4]]"])
    {'weight': 2.5, 'motion': 'dubins', 'time_limit': None, 'goals': [[3, 4]]}
    """
    settings: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals) or name in settings:
            raise typer.BadParameter(
                f"expected NAME=VALUE, each name once, got {text!r}", param_hint="--set"
            )
        settings[name] = _value(value)
    return settings


def _parse_list(text: str) -> Any:
    """Return a list in JSON."""
    try:
        return parse_json(text)
    except WrongDocumentError as error:
        raise typer.BadParameter(
            f"expected a list such as [[1, 2], [3, 4]], got {text!r}", param_hint="--set"
        ) from error


def _value(text: str) -> Any:
    if text.lower() == "none":
        return None
    if text.startswith("["):
        return _parse_list(text)
    try:
        return float(text)
    except ValueError:
        return text
