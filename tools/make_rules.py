"""Write docs/rules.md: how fast each update rule changes the state of a cell.

Run it from the root of the tree when a rule has changed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundmap import CellState, ConfidenceGrid
from groundmap.grid.fusion import (
    Absolute,
    Average,
    Capped,
    Exponential,
    LogOdds,
    UpdateRule,
)

FILE = Path(__file__).parents[1] / "docs" / "rules.md"
RULES: tuple[UpdateRule, ...] = (
    Average(),
    Capped(50),
    Capped(2),
    Exponential(0.2),
    Exponential(0.5),
    LogOdds(),
    Absolute(),
)
HEAD = """# Update rules

`groundmap map --fusion RULE`, or `groundmap.GroundMapper(fusion=RULE)`. An update rule adds the
evidence z of a view, from -1 (certainly free) to 1 (certainly non-free), to the confidence x of a
cell that k views observed before. A cell without evidence changes neither confidence nor count.

| rule | update | parameters | `merge` |
|---|---|---|---|
| `average` | x += (z - x) / (k + 1): the mean of all views | | exact |
| `capped` | the same, with k at most `cap` | `cap` | refused |
| `exponential` | x += `alpha` (z - x), and x = z at first | `alpha` | refused |
| `log_odds` | the log-odds of the view's sensor model are added, and clamped | \
`nonfree_probability`, `free_probability`, `most_probable` | refused |
| `absolute` | x = z: perfect data, the newest view decides | | refused |

`merge` is refused if the rule depends on the order of the views, or, for `log_odds`, because the
clamp does. With `absolute`, a new surface in freespace also makes the free cells behind it
non-free, as far as the older boundary of freespace. Every rule works on the height layers, too: a
line of sight above an obstacle does not make it free.

The table counts the views that observe a cell, with z = 1 or z = -1. *False wall*: 3 views of a
wall that does not exist, then free views until the cell is free. *New wall*: 200 free views, then
views of a new wall until the cell is non-free.

| rule | false wall, 2-D | new wall, 2-D | false wall, 3-D | new wall, 3-D |
|---|---|---|---|---|
"""


def views_until(rule: UpdateRule, ndim: int, before: int, z: float) -> int:
    """Return how many views with evidence z change a cell that `before` views saw otherwise.

    Parameters
    ----------
    rule : UpdateRule
    ndim : int
    before : int
    z : float
    """
    grid = ConfidenceGrid(resolution=1.0, origin=(0.0,) * ndim, rule=rule)
    lower, cell = np.zeros(ndim, dtype=np.int64), np.full((1,) * ndim, z, dtype=np.float32)
    for _ in range(before):
        grid.fuse(lower, -cell)
    views, wanted = 0, CellState.NONFREE if z > 0 else CellState.FREE
    while grid.window([0.0] * ndim + [1.0] * ndim).states().item() != wanted:
        grid.fuse(lower, cell)
        views += 1
    return views


def document() -> str:
    """Return the text of the file."""
    rows = []
    for rule in RULES:
        parameters = list(rule.to_dict().values())[1:]
        values = " ".join(f"{value:g}" for value in parameters)
        views = [
            str(views_until(rule, ndim, before, z))
            for ndim in (2, 3)
            for before, z in ((3, -1.0), (200, 1.0))
        ]
        rows.append(f"| {' | '.join([f'`{rule.name}` {values}'.strip(), *views])} |\n")
    return HEAD + "".join(rows)


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
