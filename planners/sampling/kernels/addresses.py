"""Arrays that a kernel finds by one address: a call from Python then unpacks one number.

To unpack an array takes longer than to check a short line. So what many calls share is listed in
a table, once, and each call is told where the table is. Whoever keeps the table keeps the arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from groundmap.arrays import Bools, Floats, Ints

WORDS = 3  # of the table per array: its address, rows and columns; one column if it has one axis


def _to_pointer(_: Any, __: Any) -> Any:
    """Tell numba how an address becomes a pointer."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), build


_pointer: Any = intrinsic(_to_pointer)


@njit(cache=True)
def bools_at(table: int, k: int) -> Bools:
    """Return the table's array k, which holds truth values, shape (rows, columns)."""
    words = _words(table, k)
    view: Bools = carray(_pointer(words[0]), (words[1], words[2]), np.bool_)
    return view


@njit(cache=True)
def ints_at(table: int, k: int) -> Ints:
    """Return the table's array k, which holds int64, shape (rows, columns)."""
    words = _words(table, k)
    view: Ints = carray(_pointer(words[0]), (words[1], words[2]), np.int64)
    return view


@njit(cache=True)
def floats_at(table: int, k: int) -> Floats:
    """Return the table's array k, which holds float64, shape (rows, columns)."""
    words = _words(table, k)
    view: Floats = carray(_pointer(words[0]), (words[1], words[2]), np.float64)
    return view


@njit(cache=True)
def _words(table: int, k: int) -> Ints:
    words: Ints = carray(_pointer(table + 8 * WORDS * k), WORDS, np.int64)
    return words
