"""Put the rows of a table in the order of their views, on disk."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Ints

CHUNK_ROWS = 65_536


def sort_on_disk(
    chunks: Iterable[npt.NDArray[Any]], views: int, row: np.dtype[Any]
) -> tuple[npt.NDArray[Any], Ints]:
    """Sort rows by their column ``view``, keeping the order of rows with the same view.

    A counting sort whose rows live in temporary files (in the folder that TMPDIR names): memory
    holds one chunk, and one number per view.

    Parameters
    ----------
    chunks : iterable of ndarray, of type `row`
    views : int
        Number of views; the column ``view`` is below it.
    row : dtype

    Returns
    -------
    rows : ndarray, shape (n,), of type `row`
        Mapped from a file that has no name any more: its space is free again as soon as the
        array is gone, however the program ends.
    offsets : ndarray, shape (views + 1,)
        The rows of view ``i`` are ``rows[offsets[i]:offsets[i + 1]]``.

    Examples
    --------
    >>> table = np.array([(1, 7), (0, 8), (1, 9)], dtype=[("view", np.int64), ("id", np.int64)])
    >>> rows, offsets = sort_on_disk([table], 3, table.dtype)
    >>> rows["id"].tolist(), offsets.tolist()
    ([8, 7, 9], [0, 1, 3, 3])
    """
    counts = np.zeros(views, dtype=np.int64)
    with tempfile.TemporaryFile() as spool, tempfile.TemporaryFile() as target:
        for chunk in chunks:
            counts += np.bincount(chunk["view"], minlength=views)
            spool.write(chunk.tobytes())
        offsets = np.concatenate([[0], np.cumsum(counts)])
        # A mapped file with holes kills the process when the disk is full; a copy has none, and
        # fails with an exception.
        spool.seek(0)
        shutil.copyfileobj(spool, target)
        target.flush()
        ordered = np.memmap(target, dtype=row, mode="r+", shape=(int(offsets[-1]),))
        spool.seek(0)
        _place(_chunks_of(spool, row), ordered, offsets[:-1].copy())
    return ordered.view(np.ndarray), offsets


def _chunks_of(spool: IO[bytes], row: np.dtype[Any]) -> Iterator[npt.NDArray[Any]]:
    while data := spool.read(CHUNK_ROWS * row.itemsize):
        yield np.frombuffer(data, dtype=row)


def _place(chunks: Iterable[npt.NDArray[Any]], ordered: npt.NDArray[Any], free: Ints) -> None:
    """Write every row to the next free place of its view; `free` is moved on."""
    for chunk in chunks:
        grouped = chunk[np.argsort(chunk["view"], kind="stable")]
        views, first, counts = np.unique(grouped["view"], return_index=True, return_counts=True)
        within = np.arange(len(grouped)) - np.repeat(first, counts)
        ordered[np.repeat(free[views], counts) + within] = grouped
        free[views] += counts
