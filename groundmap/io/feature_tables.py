"""Tables of features sorted by view, from csv files (streamed) or an npz archive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from groundmap.arrays import as_floats
from groundmap.errors import FileFormatError, InputError
from groundmap.files.array_files import read_arrays
from groundmap.io.columns import KINDS, LARGEST_ID, LAYOUTS, Kind, Layout, Noise, find_layout
from groundmap.io.rows import open_rows, read_rows
from groundmap.io.view_order import first_wrong, split_by_view
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features

COVARIANCE = "a covariance that is "


class ViewFeatures(NamedTuple):
    """The features of one view in a table."""

    features: Features
    dropped: Counter[str]  #: rows without a 3-D point, by reason


class FeatureTable(ABC):
    """Rows of one kind of feature, in ascending order of their views."""

    layout: Layout

    @property
    @abstractmethod
    def is_empty(self) -> bool:
        """Whether there is no table at all."""

    @abstractmethod
    def chunks(self, views: int) -> Iterable[npt.NDArray[Any]]:
        """Iterate over the rows; their views are checked to ascend, and to be below `views`."""

    def by_view(self, views: int, rig: StereoRig, noise: Noise) -> Iterator[ViewFeatures]:
        """Iterate over the views, including those without rows.

        Parameters
        ----------
        views : int
            Number of views.
        rig : StereoRig
        noise : callable
            See `Layout.features`.
        """
        for rows in split_by_view(self.chunks(views), views, self.layout.row):
            yield ViewFeatures(*self.layout.features(rows, rig, noise))


class CsvTable(FeatureTable):
    """A csv file, which every iteration reads again; a missing file is an empty table."""

    def __init__(self, path: Path, kind: Kind) -> None:
        self.path, self.exists = path, path.exists()
        self.layout = LAYOUTS[kind][0]
        if self.exists:
            with open_rows(path) as stream:
                header = stream.readline().strip()
            names = tuple(name.strip() for name in header.split(",")) if header else ()
            self.layout = find_layout(path, kind, names)

    @property
    def is_empty(self) -> bool:
        """Whether the file is missing."""
        return not self.exists

    def chunks(self, views: int) -> Iterator[npt.NDArray[Any]]:
        """Iterate over the rows, a chunk of lines at a time."""
        if not self.exists:
            return
        last = 0
        for values, lines in read_rows(self.path, self.layout.row, delimiter=",", header=True):
            wrong = first_wrong(values["view"], last, views)
            if wrong is not None:
                raise FileFormatError(
                    self.path,
                    wrong.expected,
                    wrong.got,
                    line=int(lines[wrong.row]),
                    hint=wrong.hint,
                )
            bad = self.layout.wrong_covariance(values)
            if bad is not None:
                line = int(lines[bad.row])
                raise FileFormatError(self.path, COVARIANCE + bad.expected, bad.got, line=line)
            yield values
            last = int(values["view"][-1])


class ArrayTable(FeatureTable):
    """Rows held in memory."""

    def __init__(self, path: Path, layout: Layout, rows: npt.NDArray[Any]) -> None:
        self.path, self.layout, self.rows = path, layout, rows

    @property
    def is_empty(self) -> bool:
        """Whether there are no rows."""
        return not len(self.rows)

    def chunks(self, views: int) -> Iterator[npt.NDArray[Any]]:
        """Yield all rows as one chunk."""
        wrong = first_wrong(self.rows["view"], 0, views)
        if wrong is not None:
            got = f"{wrong.got} in row {wrong.row}"
            raise FileFormatError(self.path, wrong.expected, got, hint=wrong.hint)
        bad = self.layout.wrong_covariance(self.rows)
        if bad is not None:
            got = f"{bad.got} in row {bad.row}"
            raise FileFormatError(self.path, COVARIANCE + bad.expected, got)
        yield self.rows


def read_npz(path: Path) -> dict[Kind, FeatureTable]:
    """Read the tables of an archive into memory.

    Raises
    ------
    FileFormatError
        Not an archive, unknown arrays, ids that are not whole numbers.
    """
    arrays = read_arrays(path)
    known = [*KINDS, *(f"{kind}_columns" for kind in KINDS)]
    unknown = sorted(set(arrays) - set(known))
    if unknown or not set(arrays) & set(KINDS):
        got = f"{unknown[0]!r}" if unknown else "neither points nor segments"
        raise FileFormatError(path, f"arrays named {', '.join(known)}", got)
    return {kind: _array_table(path, kind, arrays) for kind in KINDS}


def _array_table(path: Path, kind: Kind, arrays: dict[str, npt.NDArray[Any]]) -> ArrayTable:
    if kind not in arrays:
        layout = LAYOUTS[kind][0]
        return ArrayTable(path, layout, np.empty(0, dtype=layout.row))
    names = arrays.get(f"{kind}_columns", np.empty(0, dtype=str))
    layout = find_layout(path, kind, tuple(map(str, names.ravel().tolist())))
    try:
        table = as_floats(kind, arrays[kind], (None, len(layout.columns)))
    except InputError as error:
        raise FileFormatError(path, f"{kind} of {error.expected}", error.got) from error
    rows = np.empty(len(table), dtype=layout.row)
    rows["values"] = table[:, 2:]
    for column, name in enumerate(("view", "id")):
        numbers = table[:, column]
        wrong = np.flatnonzero((np.rint(numbers) != numbers) | (np.abs(numbers) > LARGEST_ID))
        if len(wrong):
            got = f"{numbers[wrong[0]]} in row {wrong[0]} of {kind}"
            raise FileFormatError(path, f"whole numbers in column {name}", got)
        rows[name] = numbers
    return ArrayTable(path, layout, rows)
