"""Access to arrays through the address of a table, so that a call from Python unpacks one number.

Unpacking an array takes longer than checking a short line. The table lists, once, the arrays that
many calls share, and each call passes its address. The owner of the table must own the arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from groundmap.arrays import Bools, Floats, Ints

WORDS = 3  # per array: its address, rows and columns (1 for an array of one axis)


def _to_pointer(_: Any, __: Any) -> Any:
    """Define for numba the conversion of an address to a pointer."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

    return types.voidptr(types.int64), build


_pointer: Any = intrinsic(_to_pointer)


@njit(cache=True)
def bools_at(table: int, k: int) -> Bools:
    """Return an array of bool, shape (rows, columns).

    Parameters
    ----------
    table : int
        Address of the table.
    k : int
        Number of the array.
    """
    words = _words(table, k)
    view: Bools = carray(_pointer(words[0]), (words[1], words[2]), np.bool_)
    return view


@njit(cache=True)
def ints_at(table: int, k: int) -> Ints:
    """Return an array of int64, shape (rows, columns).

    Parameters
    ----------
    table : int
        Address of the table.
    k : int
        Number of the array.
    """
    words = _words(table, k)
    view: Ints = carray(_pointer(words[0]), (words[1], words[2]), np.int64)
    return view


@njit(cache=True)
def floats_at(table: int, k: int) -> Floats:
    """Return an array of float64, shape (rows, columns).

    Parameters
    ----------
    table : int
        Address of the table.
    k : int
        Number of the array.
    """
    words = _words(table, k)
    view: Floats = carray(_pointer(words[0]), (words[1], words[2]), np.float64)
    return view


@njit(cache=True)
def _words(table: int, k: int) -> Ints:
    words: Ints = carray(_pointer(table + 8 * WORDS * k), WORDS, np.int64)
    return words
