"""Names for the array types, and the checks that every public function opens with."""

from __future__ import annotations

import math
from numbers import Real
from typing import TypeAlias, TypeGuard

import numpy as np
import numpy.typing as npt

from groundmap.errors import InputError

Floats: TypeAlias = npt.NDArray[np.float64]
Floats32: TypeAlias = npt.NDArray[np.float32]
Ints: TypeAlias = npt.NDArray[np.int64]
Ints32: TypeAlias = npt.NDArray[np.int32]
Counts: TypeAlias = npt.NDArray[np.uint32]
Bytes: TypeAlias = npt.NDArray[np.uint8]
Bools: TypeAlias = npt.NDArray[np.bool_]

FARTHEST_CELL = 2**60  # sums and differences of such cells stay within int64
REAL_KINDS = "biufOSU"  # of dtypes: complex numbers, dates and records are no real numbers


def as_floats(name: str, values: npt.ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return `values` as float64 of the given shape, ``None`` being any length.

    Raises
    ------
    InputError
        Not numbers, or of another shape.

    Examples
    --------
    >>> as_floats("points", [(0, 1), (2, 3)], (None, 2)).shape
    (2, 2)
    >>> as_floats("points", [0, 1], (None, 2))
    Traceback (most recent call last):
        ...
    groundmap.errors.InputError: points: expected shape (n, 2), got shape (2,).
    """
    array = as_numbers(name, values, f"numbers of shape {_format(shape)}")
    if array.size == 0 and None in shape and array.ndim != len(shape):
        array = array.reshape([0 if length is None else length for length in shape])
    fits = array.ndim == len(shape) and all(
        wanted is None or wanted == got for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise InputError(name, f"shape {_format(shape)}", f"shape {array.shape}")
    return array


def as_positions(name: str, values: npt.ArrayLike, length: int) -> Floats:
    """Return one position or several as float64 of shape (n, length).

    Raises
    ------
    InputError
        Not numbers, of another shape, NaN or infinite.

    Examples
    --------
    >>> as_positions("xy", (1, 2), 2)
    array([[1., 2.]])
    """
    array = as_numbers(name, values, f"numbers of shape {_format((None, length))}")
    positions = as_floats(name, np.atleast_2d(array), (None, length))
    check_finite(name, positions)
    return positions


def as_cell(name: str, values: npt.ArrayLike, ndim: int) -> Ints:
    """Return one cell as int64 of shape (ndim,).

    Parameters
    ----------
    name : str
    values : array_like of int, shape (ndim,)
    ndim : int

    Raises
    ------
    InputError
        Not one cell of whole numbers, or one farther than `FARTHEST_CELL` from cell 0.
    """
    cells = as_cells(name, values, ndim)
    if len(cells) != 1:
        raise InputError(name, f"{ndim} whole numbers", f"{len(cells)} cells")
    cell: Ints = cells[0]
    return cell


def as_cells(name: str, values: npt.ArrayLike, ndim: int) -> Ints:
    """Return one cell or several as int64 of shape (n, ndim).

    Raises
    ------
    InputError
        Not whole numbers, of another shape, or farther than `FARTHEST_CELL` from cell 0.

    Examples
    --------
    >>> as_cells("cells", [0, 2], 2)
    array([[0, 2]])
    """
    expected = f"whole numbers of shape {_format((None, ndim))}"
    try:
        given = np.asarray(values)
    except ValueError as error:
        raise InputError(name, expected, repr(values)[:60]) from error
    if given.size and given.dtype.kind not in "iu":
        raise InputError(name, expected, f"{given.dtype} of shape {given.shape}")
    cells = np.atleast_2d(given) if given.size else given.reshape(-1, ndim)
    if cells.ndim != 2 or cells.shape[1] != ndim:
        raise InputError(name, expected, f"shape {given.shape}")
    # Compared as they came: uint64 beyond the range would turn negative.
    far = (cells > FARTHEST_CELL) | (cells < -FARTHEST_CELL)
    if far.any():
        row = int(np.argwhere(far)[0, 0])
        raise InputError(
            name,
            f"cells within {FARTHEST_CELL} of cell 0",
            str(cells[row].tolist()),
            where=f"row {row}",
        )
    return cells.astype(np.int64)


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number, and not a truth value.

    Examples
    --------
    >>> is_number(2), is_number(np.float32(0.5)), is_number(True), is_number("2"), is_number(np.nan)
    (True, True, False, False, False)
    """
    if isinstance(value, (bool, np.bool_, np.timedelta64)):  # NumPy counts durations as whole
        return False
    if not isinstance(value, (Real, np.floating)):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:  # a whole number beyond what a float holds
        return False


def as_number(
    name: str,
    value: object,
    expected: str,
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    error: type[InputError] = InputError,
) -> float:
    """Return a finite number as a float.

    Parameters
    ----------
    name : str
    value : object
    expected : str
        What the value should be, for the message.
    least, above : float
        The least number that is taken; the number that it must be above.
    error : type of InputError, default InputError

    Raises
    ------
    InputError
        Not a number (`is_number`), or out of the range.

    Examples
    --------
    >>> as_number("depth", 2, "a number above 0 [m]", above=0.0)
    2.0
    >>> as_number("depth", "2", "a number above 0 [m]", above=0.0)
    Traceback (most recent call last):
        ...
    groundmap.errors.InputError: depth: expected a number above 0 [m], got '2'.
    """
    if not (is_number(value) and value >= least and value > above):
        raise error(name, expected, repr(value)[:60])
    return float(value)


def check_finite(name: str, values: Floats, *, hint: str = "") -> None:
    """Raise `InputError` at the first value that is NaN or infinite."""
    wrong = ~np.isfinite(values)
    if wrong.any():
        index = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f"index {index if len(index) != 1 else index[0]}" if index else ""
        raise InputError(name, "finite numbers", str(values[index]), where=where, hint=hint)


def as_numbers(name: str, values: npt.ArrayLike, expected: str) -> Floats:
    """Return `values` as float64 of any shape; numbers beyond its range become infinite.

    Raises
    ------
    InputError
        Not real numbers, which are not what was `expected`.
    """
    try:
        given = np.asarray(values)
        if given.dtype.kind not in REAL_KINDS:
            raise InputError(name, expected, f"{given.dtype} of shape {given.shape}")
        with np.errstate(over="ignore"):
            return np.asarray(given, dtype=np.float64)
    except InputError:
        raise
    except (OverflowError, TypeError, ValueError) as error:
        raise InputError(name, expected, repr(values)[:60]) from error


def _format(shape: tuple[int | None, ...]) -> str:
    inside = ", ".join("n" if length is None else str(length) for length in shape)
    return f"({inside},)" if len(shape) == 1 else f"({inside})"
