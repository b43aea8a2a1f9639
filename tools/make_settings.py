"""Write docs/settings.md: the settings of maps, ground planes and planners, from their classes.

Run it from the root of the tree when a setting has changed.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from groundmap import GroundSettings, MapperSettings, RegistrationSettings
from planners import OWN_PLANNERS, SamplingSettings
from planners.sampling.ompl_module import has_parameter, samplers
from planners.sampling.ompl_parameters import PARAMETERS
from planners.sampling.settings import refusal
from planners.search.base import SearchSettings

FILE = Path(__file__).parents[1] / "docs" / "settings.md"
MAPS = """# Settings

A number out of its range is an error, and so is an unknown setting.

## Maps

`groundmap.GroundMapper(setting=value)`, or the table `[mapper]` of the TOML file of `groundmap map
--config`.
"""
GROUND = """
## Ground planes

`groundmap.fit_ground(views, setting=value)`, or the table `[ground]` of the same file.
"""
REGISTRATION = """
## Registration

`groundmap.register(a, b, setting=value)` and `groundmap.estimate_poses(views, setting=value)`.
"""
PLANNERS = """
## Planners

`planners.plan(problem, "NAME", setting=value)`, or `groundmap plan --planner NAME --set
setting=value`. Every planner has the setting `time_limit`: the time from the call to the answer
[s]; default: 30 s, `none` for no limit.
"""
SAMPLING = """
### Sampling planners

All sampling planners have these settings:
"""
OWN = """
These are OMPL's parameters of single planners, with OMPL's names. The default is OMPL's own value,
except for `range`, whose default depends on the map.
"""


def document() -> str:
    """Return the text of the file."""
    parts = [MAPS, table(MapperSettings.model_fields), GROUND]
    parts += [table(GroundSettings.model_fields), REGISTRATION]
    parts += [table(RegistrationSettings.model_fields), PLANNERS]
    for name, entry in sorted(OWN_PLANNERS.items()):
        if fields := own_fields(entry.settings):
            parts += [f"\n### {name}\n", table(fields)]
    fields = own_fields(SamplingSettings)
    parts += [SAMPLING, table({k: v for k, v in fields.items() if k not in PARAMETERS})]
    parts += [OWN, table({k: fields[k] for k in PARAMETERS}, takers)]
    return "".join(parts)


def own_fields(settings: type[SearchSettings]) -> dict[str, FieldInfo]:
    """Return the settings of a planner without those that all planners have."""
    common = SearchSettings.model_fields
    return {key: field for key, field in settings.model_fields.items() if key not in common}


def takers(name: str) -> str:
    """Return the names of the planners that have a parameter."""
    planners = [planner for planner in sorted(samplers()) if refusal(planner, "r2") is None]
    return ", ".join(f"`{planner}`" for planner in planners if has_parameter(planner, name))


def table(fields: dict[str, FieldInfo], planners_of: Any = None) -> str:
    """Return a table of settings."""
    heads = ["setting", "default", "range", "meaning", *(["planners"] if planners_of else [])]
    lines = ["", "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name, field in fields.items():
        default, limits = format_default(field.default), format_range(field)
        cells = [f"`{name}`", default, limits, field.description or ""]
        cells += [planners_of(name)] if planners_of else []
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def format_default(value: Any) -> str:
    """Return a default as code; empty for None."""
    return "" if value is None or value == () else f"`{value}`"


def format_range(field: FieldInfo) -> str:
    """Return the range of a number."""
    limits = {"ge": "≥ {:.10g}", "gt": "> {:.10g}", "le": "≤ {:.10g}", "lt": "< {:.10g}"}
    texts = [
        text.format(getattr(rule, kind))
        for rule in field.metadata
        for kind, text in limits.items()
        if getattr(rule, kind, None) is not None
    ]
    return ", ".join(texts)


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
    print(FILE, file=sys.stderr)
