"""The eight moves between cells and their integer costs.

A cell's side costs `ONE`, its diagonal `DIAGONAL`. Moves are bits: bit k of ``moves[node]`` tells
whether the step (ROWS[k], COLS[k]) is allowed, counter-clockwise from east (+x): E, NE, N, NW, W,
SW, S, SE.
"""

from __future__ import annotations

import numpy as np

ONE = 2**32
DIAGONAL = 6074001000  # round(sqrt(2) * ONE)
ROWS = np.array([0, 1, 1, 1, 0, -1, -1, -1], dtype=np.int64)
COLS = np.array([1, 1, 0, -1, -1, -1, 0, 1], dtype=np.int64)
