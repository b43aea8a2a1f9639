"""Exact distances from cell centres to the nearest blocked square.

In half cells, a centre is at (2 col + 1, 2 row + 1) and a square spans two units, so squared
distances are integers. The transform is separable. Down a column, a blocked square k rows away is
2 k - 1 half cells away (0 for k = 0). Along a row, the nearest point of a square to the left is on
its right border, and that of a square to the right on its left border. Each border between two
columns therefore carries the smaller squared distance of the two, and the remaining step is the
lower envelope of parabolas (Felzenszwalb and Huttenlocher 2012), over integers.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from groundmap.arrays import Bools, Ints, Ints32

NOWHERE = np.iinfo(np.int32).max  # squared distance to a blocked square if there is none


@njit(cache=True, nogil=True)
def squared_distances(blocked: Bools, cap: int) -> Ints32:
    """Return the squared distance of every cell centre to the nearest blocked square.

    Parameters
    ----------
    blocked : ndarray of bool, shape (rows, cols)
    cap : int [(half cells)²]
        Larger ones are cut to this; at most `NOWHERE`.

    Returns
    -------
    ndarray of int32, shape (rows, cols) [(half cells)²]
    """
    rows, cols = blocked.shape
    squared = np.empty((rows, cols), dtype=np.int32)
    vertical = _down_columns(blocked)
    room = cols + 1
    border, at = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    starts = np.empty(room, dtype=np.int64)
    for row in range(rows):
        size = envelope(vertical[row], border, at, starts)
        k = 0
        for col in range(cols):
            x = 2 * col + 1
            least = vertical[row, col]
            if size > 0:
                while k + 1 < size and starts[k + 1] <= x:
                    k += 1
                away = x - at[k]
                least = min(least, away * away + border[k])
            squared[row, col] = min(least, cap)
    return squared


@njit(cache=True, nogil=True)
def squared_distances_3d(blocked: Bools, cap: int) -> Ints32:
    """Return the squared distance of every voxel's centre to the nearest blocked cube.

    Each layer is transformed as in 2-D, then the columns across layers, where cubes begin
    2 k - 1 half voxels away like squares.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    cap : int [(half voxels)²]
        Larger ones are cut to this; at most `NOWHERE`.

    Returns
    -------
    ndarray of int32, shape (layers, rows, cols) [(half voxels)²]
    """
    squared = np.empty(blocked.shape, dtype=np.int32)
    fill_squared_distances_3d(blocked, cap, squared)
    return squared


@njit(cache=True, nogil=True)
def fill_squared_distances_3d(blocked: Bools, cap: int, squared: Ints32) -> None:
    """Write the distances of `squared_distances_3d` to an array of any type that holds the cap.

    Parameters
    ----------
    blocked : ndarray of bool, shape (layers, rows, cols)
    cap : int [(half voxels)²]
        Larger ones are cut to this.
    squared : ndarray of int32, uint32 or uint16, shape (layers, rows, cols)
        Set.
    """
    layers, rows, cols = blocked.shape
    for layer in range(layers):
        # Cut within the layers, too: what is added across them only makes distances larger.
        squared[layer] = squared_distances(blocked[layer], cap)
    within = np.empty((cols, layers), dtype=np.int64)
    room = layers + 1
    border, at = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    starts = np.empty(room, dtype=np.int64)
    for row in range(rows):
        for layer in range(layers):
            for col in range(cols):
                within[col, layer] = squared[layer, row, col]
        for col in range(cols):
            _across_layers(within[col], border, at, starts)
        for layer in range(layers):
            for col in range(cols):
                squared[layer, row, col] = min(within[col, layer], cap)


@njit(cache=True, nogil=True)
def _across_layers(within: Ints, border: Ints, at: Ints, starts: Ints) -> None:
    """Turn squared distances within the layers of a column into distances over all layers."""
    size, k = envelope(within, border, at, starts), 0
    for layer in range(len(within)):
        x = 2 * layer + 1
        if size > 0:
            while k + 1 < size and starts[k + 1] <= x:
                k += 1
            away = x - at[k]
            within[layer] = min(within[layer], away * away + border[k])


@njit(cache=True, nogil=True)
def _down_columns(blocked: Bools) -> Ints:
    """Return the squared vertical distance to the nearest blocked square of the same column."""
    rows, cols = blocked.shape
    far = rows + 1
    steps = np.empty((rows, cols), dtype=np.int64)
    for row in range(rows):
        for col in range(cols):
            if blocked[row, col]:
                steps[row, col] = 0
            else:
                steps[row, col] = steps[row - 1, col] + 1 if row > 0 else far
    for row in range(rows - 1, -1, -1):
        for col in range(cols):
            if row + 1 < rows:
                steps[row, col] = min(steps[row, col], steps[row + 1, col] + 1)
    for row in range(rows):
        for col in range(cols):
            k = steps[row, col]
            if k >= far:
                steps[row, col] = NOWHERE
            elif k > 0:
                steps[row, col] = (2 * k - 1) ** 2
    return steps


@njit(cache=True, nogil=True)
def envelope(vertical: Ints, border: Ints, at: Ints, starts: Ints) -> int:
    """Write the lower envelope of the parabolas of the borders and return their number.

    Parabola k is ``(x - at[k])² + border[k]``, which is the lowest from ``starts[k]`` on.

    Parameters
    ----------
    vertical : ndarray of int64, shape (cols,)
        Squared distances within the columns; `NOWHERE` or more for none.
    border, at, starts : ndarray of int64, shape (cols + 1,)
        Receive the parabolas.
    """
    cols, size = len(vertical), 0
    for b in range(cols + 1):
        height = NOWHERE
        if b > 0:
            height = vertical[b - 1]
        if b < cols:
            height = min(height, vertical[b])
        if height >= NOWHERE:
            continue
        position, start = 2 * b, 0
        while size > 0:
            # The first integer x at which the new parabola is lower than the last one.
            rise = height - border[size - 1] + position * position - at[size - 1] * at[size - 1]
            start = rise // (2 * (position - at[size - 1])) + 1
            if start > starts[size - 1]:
                break
            size -= 1
        border[size], at[size], starts[size] = height, position, start if size > 0 else 0
        size += 1
    return size
