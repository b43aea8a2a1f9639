"""A 4-ary min-heap in one array, whose rows hold a key, and a tie and a node in one integer.

With four children per entry, it is half as deep as a binary heap, and the 64 bytes of four siblings
share one or two cache lines. Among equal keys, the entry of the smallest tie comes first.
"""

from __future__ import annotations

from numba import njit

from groundmap.arrays import Ints

TIE_SHIFT = 21  # of the tie's 52 bits, the upper 31 are stored beside the node's 32


@njit(cache=True, nogil=True)
def push(heap: Ints, size: int, key: int, tie: int, node: int) -> int:
    """Insert one entry and return the new size.

    Parameters
    ----------
    heap : ndarray of int64, shape (room, 2)
        It must have room for one more entry.
    size, key, tie, node : int
    """
    second = _pack(tie, node)
    i = size
    while i > 0:
        above = (i - 1) >> 2
        if key > heap[above, 0] or (key == heap[above, 0] and second >= heap[above, 1]):
            break
        heap[i, 0], heap[i, 1] = heap[above, 0], heap[above, 1]
        i = above
    heap[i, 0], heap[i, 1] = key, second
    return size + 1


@njit(cache=True, nogil=True)
def top_node(heap: Ints) -> int:
    """Return the node of the smallest entry."""
    return int(heap[0, 1] & 0xFFFFFFFF)


@njit(cache=True, nogil=True)
def drop_top(heap: Ints, size: int) -> int:
    """Remove the smallest entry, row 0, and return the new size.

    Parameters
    ----------
    heap : ndarray of int64, shape (room, 2)
    size : int
    """
    size -= 1
    _sink(heap, size, heap[size, 0], heap[size, 1])
    return size


@njit(cache=True, nogil=True)
def replace_top(heap: Ints, size: int, key: int, tie: int, node: int) -> None:
    """Replace the smallest entry, which is cheaper than a removal and an insertion.

    Parameters
    ----------
    heap : ndarray of int64, shape (room, 2)
    size, key, tie, node : int
    """
    _sink(heap, size, key, _pack(tie, node))


@njit(cache=True, nogil=True)
def _pack(tie: int, node: int) -> int:
    return ((tie >> TIE_SHIFT) << 32) | node


@njit(cache=True, nogil=True)
def _sink(heap: Ints, size: int, key: int, second: int) -> None:
    """Write an entry over row 0 and sift it down."""
    i = 0
    while True:
        child = 4 * i + 1
        if child >= size:
            break
        least, least_key = child, heap[child, 0]
        for other in range(child + 1, min(child + 4, size)):
            other_key = heap[other, 0]
            if other_key < least_key or (
                other_key == least_key and heap[other, 1] < heap[least, 1]
            ):
                least, least_key = other, other_key
        if key < least_key or (key == least_key and second <= heap[least, 1]):
            break
        heap[i, 0], heap[i, 1] = least_key, heap[least, 1]
        i = least
    heap[i, 0], heap[i, 1] = key, second
