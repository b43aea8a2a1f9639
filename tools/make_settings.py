"""Write docs/settings.md: what every planner can be told, as its settings class has it.

Run it when a setting changes, from the root of the tree.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from planners import OWN_PLANNERS, SamplingSettings
from planners.sampling.ompl_module import has_parameter, samplers
from planners.sampling.ompl_parameters import PARAMETERS
from planners.sampling.settings import refusal
from planners.search.base import SearchSettings

FILE = Path(__file__).parents[1] / "docs" / "settings.md"
HEAD = """# Settings of planners

`planners.plan(problem, "NAME", setting=value)`, or `groundmap plan --planner NAME --set
setting=value`. Every planner takes `time_limit`, the time [s] from the call to the answer, 30
unless told, none for no limit; a number beyond its range is refused.
"""
SAMPLING = """
## Sampling planners

All of them take these:
"""
OWN = """
These are parameters of single planners, under the names that OMPL has; where none is given, OMPL's
own value counts, but for `range`, which is then fitted to the map.
"""


def document() -> str:
    """Return what the file is to hold."""
    parts = [HEAD]
    for name, entry in sorted(OWN_PLANNERS.items()):
        if fields := own_fields(entry.settings):
            parts += [f"\n## {name}\n", table(fields)]
    fields = own_fields(SamplingSettings)
    parts += [SAMPLING, table({k: v for k, v in fields.items() if k not in PARAMETERS})]
    parts += [OWN, table({k: fields[k] for k in PARAMETERS}, takers)]
    return "".join(parts)


def own_fields(settings: type[SearchSettings]) -> dict[str, FieldInfo]:
    """Return the settings of a planner beside those that all of them have."""
    common = SearchSettings.model_fields
    return {key: field for key, field in settings.model_fields.items() if key not in common}


def takers(name: str) -> str:
    """Return the planners that have a parameter."""
    names = [one for one in sorted(samplers()) if refusal(one, "r2") is None]
    return ", ".join(f"`{one}`" for one in names if has_parameter(one, name))


def table(fields: dict[str, FieldInfo], planners_of: Any = None) -> str:
    """Return a table of settings."""
    heads = ["setting", "default", "range", "what it is", *(["planners"] if planners_of else [])]
    lines = ["", "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name, field in fields.items():
        cells = [f"`{name}`", shown(field.default), span(field), field.description or ""]
        cells += [planners_of(name)] if planners_of else []
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def shown(value: Any) -> str:
    """Return a default as one would write it."""
    return "" if value is None or value == () else f"`{value}`"


def span(field: FieldInfo) -> str:
    """Return the range of a number, or the values there are."""
    limits = {"ge": "≥ {:g}", "gt": "> {:g}", "le": "≤ {:g}", "lt": "< {:g}"}
    found = [
        text.format(getattr(rule, kind))
        for rule in field.metadata
        for kind, text in limits.items()
        if getattr(rule, kind, None) is not None
    ]
    return ", ".join(found)


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
    print(FILE, file=sys.stderr)
