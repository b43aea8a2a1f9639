"""Rows sorted by view: a check of their order, and a split into views."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Ints


class Wrong(NamedTuple):
    """The first row in a wrong place."""

    row: int
    expected: str
    got: str
    hint: str


def first_wrong(column: Ints, last: int, views: int) -> Wrong | None:
    """Return the first view index that is out of range or below the previous one, or None.

    Parameters
    ----------
    column : ndarray of int, shape (n,)
        View of each row.
    last : int
        View of the row before the first.
    views : int
        Number of views.

    Examples
    --------
    >>> first_wrong(np.array([0, 2, 1]), 0, 3)
    Wrong(row=2, expected='views in ascending order', got='view 1 after view 2', \
hint='Sort the rows by view.')
    """
    before = np.concatenate([[last], column[:-1]])
    outside = (column < 0) | (column >= views)
    wrong = np.flatnonzero(outside | (column < before))
    if not len(wrong):
        return None
    row = int(wrong[0])
    if outside[row]:
        expected = f"a view from 0 to {views - 1}"
        return Wrong(row, expected, str(column[row]), "It is the row in poses.txt, counted from 0.")
    got = f"view {column[row]} after view {before[row]}"
    return Wrong(row, "views in ascending order", got, "Sort the rows by view.")


def split_by_view(
    chunks: Iterable[npt.NDArray[Any]], views: int, row: np.dtype[Any]
) -> Iterator[npt.NDArray[Any]]:
    """Split sorted rows into one array per view, across the borders of chunks.

    Parameters
    ----------
    chunks : iterable of ndarray
        Of type `row`.
    views : int
        Number of views.
    row : dtype
        With a field ``view``.
    """
    pending = [np.empty(0, dtype=row)]
    view = 0
    for chunk in chunks:
        for piece in np.split(chunk, np.flatnonzero(np.diff(chunk["view"])) + 1):
            while len(piece) and view < piece["view"][0]:
                yield np.concatenate(pending)
                pending = [np.empty(0, dtype=row)]
                view += 1
            pending.append(piece)
    while view < views:
        yield np.concatenate(pending)
        pending = [np.empty(0, dtype=row)]
        view += 1
