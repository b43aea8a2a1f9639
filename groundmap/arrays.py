"""Array types, and checks of array and number arguments."""

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

FARTHEST_CELL = 2**60  # sums and differences of such cells are within int64
REAL_KINDS = "biufOSU"  # kinds of dtypes; not complex numbers, dates and records


def as_floats(name: str, values: npt.ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    """Return values as a float64 array of a given shape.

    Parameters
    ----------
    name : str
        Name of the argument, for error messages.
    values : array_like
    shape : tuple of int or None
        None for any length.

    Raises
    ------
    InputError
        `values` are not real numbers, or have another shape.

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
    """Return one or more positions as a float64 array of shape (n, length).

    Parameters
    ----------
    name : str
        Name of the argument, for error messages.
    values : array_like, shape (length,) or (n, length)
    length : int
        Number of coordinates.

    Raises
    ------
    InputError
        `values` are not real numbers, have another shape, or are NaN or infinite.

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
    """Return one or more cells as an int64 array of shape (n, ndim).

    Parameters
    ----------
    name : str
        Name of the argument, for error messages.
    values : array_like, shape (ndim,) or (n, ndim)
    ndim : int
        Number of dimensions of the grid.

    Raises
    ------
    InputError
        `values` are not whole numbers, have another shape, or are beyond `FARTHEST_CELL`.

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
    # Before the conversion, which would make large values of uint64 negative.
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
    """Return whether a value is a finite real number, and not a truth value.

    Examples
    --------
    >>> is_number(2), is_number(np.float32(0.5)), is_number(True), is_number("2"), is_number(np.nan)
    (True, True, False, False, False)
    """
    if isinstance(value, (bool, np.bool_, np.timedelta64)):  # to NumPy, durations are integers
        return False
    if not isinstance(value, (Real, np.floating)):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:  # a whole number beyond the range of floats
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
        Name of the argument, for error messages.
    value : object
    expected : str
        The expected value, for error messages.
    least, above : float, default -inf
        Inclusive and exclusive lower bounds.
    error : type of InputError, default InputError

    Raises
    ------
    InputError
        `value` is not a finite number, or is out of range.

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
    """Check that values are finite.

    Parameters
    ----------
    name : str
        Name of the argument, for error messages.
    values : ndarray
    hint : str, optional
        A sentence about what to do, for error messages.

    Raises
    ------
    InputError
        A value is NaN or infinite; the first one is named.
    """
    wrong = ~np.isfinite(values)
    if wrong.any():
        index = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f"index {index if len(index) != 1 else index[0]}" if index else ""
        raise InputError(name, "finite numbers", str(values[index]), where=where, hint=hint)


def as_numbers(name: str, values: npt.ArrayLike, expected: str) -> Floats:
    """Return values as a float64 array of any shape; numbers beyond its range become infinite.

    Parameters
    ----------
    name : str
        Name of the argument, for error messages.
    values : array_like
    expected : str
        The expected values, for error messages.

    Raises
    ------
    InputError
        `values` are not real numbers.
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
