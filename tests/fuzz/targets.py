"""All targets by name."""

from __future__ import annotations

from fuzz.calls_draw import DRAW_CALLS
from fuzz.calls_map import MAP_CALLS
from fuzz.calls_plan import PLAN_CALLS
from fuzz.case import Target
from fuzz.commands import COMMANDS
from fuzz.readers import READERS

FILES: dict[str, Target] = {target.name: target for target in (*READERS, *COMMANDS)}
CALLS: dict[str, Target] = {
    target.name: target for target in (*MAP_CALLS, *PLAN_CALLS, *DRAW_CALLS)
}
TARGETS = FILES | CALLS
