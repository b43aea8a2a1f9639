"""How Polyanya's kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def borrowing(kernel: Kernel) -> Kernel:
    """Compile a function that only borrows its caller's arrays: it makes none, and keeps none.

    Its calls then need not count who holds the arrays. The kernels of Polyanya look at a few
    numbers of many arrays each; with counting, a search node takes 2.3 µs instead of 0.5 µs.
    Where a function makes an array after all, numba refuses to compile it.
    """
    compiler: Any = njit  # Any: the option is not among those that its type names
    compiled: Kernel = compiler(cache=True, nogil=True, _nrt=False)(kernel)
    return compiled
