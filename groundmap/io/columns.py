"""The columns of feature tables: rows of points or segments, in pixels or in XYZ."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from groundmap.arrays import Floats
from groundmap.errors import FileFormatError
from groundmap.io.rows import record
from groundmap.view.stereo_rig import StereoRig
from groundmap.view.view import Features, WrongCovariance, wrong_covariance

# From rows and their positions, shape (n, 3) or (n, 2, 3), to covariances.
Noise = Callable[[npt.NDArray[Any], Floats], Floats]
Kind = Literal["points", "segments"]
KINDS: tuple[Kind, ...] = ("points", "segments")

PIXEL_FIELDS = ("uL", "uR", "v")
PLACE_FIELDS = ("x", "y", "z")
XYZ_FIELDS = ("x", "y", "z", "cxx", "cxy", "cxz", "cyy", "cyz", "czz")
# Indices of the six numbers of a covariance in its 3 x 3 matrix, and the reverse.
SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
UPPER = np.triu_indices(3)
LARGEST_ID = 2**53  # archives store ids as float64, which is exact up to here


@dataclass(frozen=True)
class Layout:
    """One form of one kind of table.

    Parameters
    ----------
    fields : tuple of str
        `PIXEL_FIELDS` [px], `PLACE_FIELDS` [m, camera] or `XYZ_FIELDS` [m and m², camera].
    ends : int
        1 for points, 2 for segments.

    Examples
    --------
    >>> Layout(PIXEL_FIELDS, 2).columns
    ('view', 'id', 'uL0', 'uR0', 'v0', 'uL1', 'uR1', 'v1')
    """

    fields: tuple[str, ...]
    ends: int

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, as in the header."""
        suffixes = ("",) if self.ends == 1 else ("0", "1")
        return ("view", "id", *(name + suffix for suffix in suffixes for name in self.fields))

    @property
    def row(self) -> np.dtype[Any]:
        """Type of a row."""
        return record(["view", "id"], self.ends * len(self.fields))

    def features(
        self, rows: npt.NDArray[Any], rig: StereoRig, noise: Noise
    ) -> tuple[Features, Counter[str]]:
        """Return the features of rows, and the number of rows without a 3-D point, by reason.

        Parameters
        ----------
        rows : ndarray, shape (n,)
            Of type `row`.
        rig : StereoRig
        noise : callable
            From rows and their positions to covariances, for columns without.
        """
        values, ids = self._values(rows), rows["id"]
        if self.fields == PIXEL_FIELDS:
            xyz, covariance, kept, dropped = rig.triangulate(values)
            return Features(xyz, covariance, ids[kept]), dropped
        # Copies, so that a view does not keep its table in memory.
        xyz = self.positions(rows)
        covariance = noise(rows, xyz) if self.fields == PLACE_FIELDS else _covariance(values)
        return Features(xyz, covariance, ids.copy()), Counter()

    def positions(self, rows: npt.NDArray[Any]) -> Floats:
        """Return the positions of rows in XYZ form, shape (n, 3) or (n, 2, 3) [m, camera]."""
        return self._values(rows)[..., :3].copy()

    def _values(self, rows: npt.NDArray[Any]) -> Floats:
        ends = () if self.ends == 1 else (2,)
        values: Floats = rows["values"].reshape(len(rows), *ends, len(self.fields))
        return values

    def wrong_covariance(self, rows: npt.NDArray[Any]) -> WrongCovariance | None:
        """Return the first row with an invalid covariance, or None."""
        if self.fields != XYZ_FIELDS:
            return None
        values = rows["values"].reshape(len(rows), self.ends, len(self.fields))
        return wrong_covariance(_covariance(values))


def _covariance(values: Floats) -> Floats:
    covariance: Floats = values[..., 3:][..., SYMMETRIC]
    return covariance


FORMS = (PIXEL_FIELDS, XYZ_FIELDS, PLACE_FIELDS)
LAYOUTS: dict[Kind, tuple[Layout, ...]] = {
    "points": tuple(Layout(fields, 1) for fields in FORMS),
    "segments": tuple(Layout(fields, 2) for fields in FORMS),
}


def find_layout(path: Path, kind: Kind, columns: tuple[str, ...]) -> Layout:
    """Return the layout with these columns.

    Parameters
    ----------
    path : Path
        For the error message.
    kind : {"points", "segments"}
    columns : tuple of str
        Names, as in the header.

    Raises
    ------
    FileFormatError
        No layout has these columns.
    """
    for layout in LAYOUTS[kind]:
        if layout.columns == columns:
            return layout
    known = " or ".join(",".join(layout.columns) for layout in LAYOUTS[kind])
    got = ",".join(columns)
    raise FileFormatError(path, f"the columns {known}", repr(got[:80]) if got else "none")


def values_of(features: Features) -> Floats:
    """Return the numbers of features in XYZ form, one row each, with upper half covariances."""
    upper = features.covariance[..., UPPER[0], UPPER[1]]
    numbers = np.concatenate([features.xyz, upper], axis=-1)
    return numbers.reshape(len(features), math.prod(numbers.shape[1:]))
