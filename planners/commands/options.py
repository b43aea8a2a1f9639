"""What options of the command line say, as values: outlines, settings."""

from __future__ import annotations

from typing import Any

import typer

from planners.console import numbers


def outline(text: str) -> float | list[tuple[float, ...]]:
    """Return a footprint: ``R`` is a radius [m], ``X,Y X,Y X,Y ...`` corners [m, base_link].

    Raises
    ------
    typer.BadParameter
        Neither.

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
        No equals sign, or a name that comes twice.

    Examples
    --------
    >>> assignments(["weight=2.5", "motion=dubins", "time_limit=none"])
    {'weight': 2.5, 'motion': 'dubins', 'time_limit': None}
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


def _value(text: str) -> Any:
    if text.lower() == "none":
        return None
    try:
        return float(text)
    except ValueError:
        return text
