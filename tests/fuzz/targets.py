"""All targets by name."""

from __future__ import annotations

from fuzz.case import Target
from fuzz.commands import COMMANDS
from fuzz.readers import READERS

FILES: dict[str, Target] = {target.name: target for target in (*READERS, *COMMANDS)}
CALLS: dict[str, Target] = {}
TARGETS = FILES | CALLS
