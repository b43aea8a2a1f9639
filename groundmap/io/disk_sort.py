"""Sort of the rows of a table by view, on disk."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterable, Iterator
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Ints

CHUNK_ROWS = 65_536


class RowsByView:
    """Rows sorted by their column ``view``; rows of the same view keep their order.

    A counting sort between two temporary files (in the folder that TMPDIR names). Memory holds
    one chunk, and two numbers per view. On most systems the files have no name, and are deleted
    with this object, however the program ends.

    Parameters
    ----------
    chunks : iterable of ndarray
        Of type `row`.
    views : int
        Number of views; every value of the column ``view`` is below it.
    row : dtype

    Examples
    --------
    >>> table = np.array([(1, 7), (0, 8), (1, 9)], dtype=[("view", np.int64), ("id", np.int64)])
    >>> rows = RowsByView([table], 3, table.dtype)
    >>> [rows.of_view(view)["id"].tolist() for view in range(3)]
    [[8], [7, 9], []]
    """

    def __init__(self, chunks: Iterable[npt.NDArray[Any]], views: int, row: np.dtype[Any]) -> None:
        self._row = row
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 (open for the lifetime of this object)
        weakref.finalize(self, self._file.close)
        counts = np.zeros(views, dtype=np.int64)
        with tempfile.TemporaryFile() as spool:
            for chunk in chunks:
                counts += np.bincount(chunk["view"], minlength=views)
                spool.write(chunk.tobytes())
            self._offsets = np.concatenate([[0], np.cumsum(counts)])
            spool.seek(0)
            _place(_chunks_of(spool, row), self._file, self._offsets[:-1].copy())
        self._file.flush()

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self._offsets[-1])

    def of_view(self, view: int) -> npt.NDArray[Any]:
        """Return the rows of one view, read from disk."""
        start, stop = self._offsets[view : view + 2].tolist()
        if start == stop:
            return np.empty(0, dtype=self._row)
        # Mapping, unlike seeking, does not affect other threads and forked processes.
        offset, shape = start * self._row.itemsize, (stop - start,)
        return np.array(np.memmap(self._file, self._row, mode="r", offset=offset, shape=shape))


def _chunks_of(spool: IO[bytes], row: np.dtype[Any]) -> Iterator[npt.NDArray[Any]]:
    while data := spool.read(CHUNK_ROWS * row.itemsize):
        yield np.frombuffer(data, dtype=row)


def _place(chunks: Iterable[npt.NDArray[Any]], file: IO[bytes], free: Ints) -> None:
    """Write every row to the next free place of its view, and advance `free`."""
    # Written, not mapped: a full disk raises here, but kills a process that maps.
    for chunk in chunks:
        grouped = chunk[np.argsort(chunk["view"], kind="stable")]
        views, first, counts = np.unique(grouped["view"], return_index=True, return_counts=True)
        for start, place, count in zip(
            first.tolist(), free[views].tolist(), counts.tolist(), strict=True
        ):
            file.seek(place * chunk.itemsize)
            file.write(grouped[start : start + count].tobytes())
        free[views] += counts
