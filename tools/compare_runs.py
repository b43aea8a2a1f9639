"""Compare two results of ``--json``: every number, text and list but for times must be equal.

``python tools/compare_runs.py BEFORE.json AFTER.json`` exits with 1 if anything differs.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: Keys whose values depend on the machine.
TIMES = {"median_ms", "p95_ms", "ratio", "seconds", "stages_s", "views_per_s", "wall_s"}


def main(before: Path, after: Path) -> None:
    """Print each difference of two files, and exit with 1 if there is any.

    Parameters
    ----------
    before, after : Path
    """
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    found = list(differences(old, new))
    print(*found, sep="\n", end="\n" if found else "")
    print(f"{len(found)} differences in {count(old)} values")
    sys.exit(bool(found))


def differences(old: Any, new: Any, path: str = "") -> Iterator[str]:
    """Yield a line for each value that differs.

    Parameters
    ----------
    old, new : JSON value
    path : str, default ""
        Keys and indices that lead to the values.
    """
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted({*old, *new} - TIMES):
            if key in old and key in new:
                yield from differences(old[key], new[key], f"{path}.{key}")
            else:
                yield f"{path}.{key}: only {'before' if key in old else 'after'}"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, f"{path}[{index}]")
    elif old != new:
        yield f"{path}: {old!r} before, {new!r} after"


def count(value: Any) -> int:
    """Return how many values other than times a JSON value holds."""
    if isinstance(value, dict):
        return sum(count(part) for key, part in value.items() if key not in TIMES)
    return sum(map(count, value)) if isinstance(value, list) else 1


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
