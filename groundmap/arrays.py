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
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(name, f"numbers of shape {_shown(shape)}", repr(values)[:60]) from error
    if array.size == 0 and None in shape and array.ndim != len(shape):
        array = array.reshape([0 if length is None else length for length in shape])
    fits = array.ndim == len(shape) and all(
        wanted is None or wanted == got for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise InputError(name, f"shape {_shown(shape)}", f"shape {array.shape}")
    return array


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number, and not a truth value.

    Examples
    --------
    >>> is_number(2), is_number(np.float32(0.5)), is_number(True), is_number("2"), is_number(np.nan)
    (True, True, False, False, False)
    """
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (Real, np.floating)):
        return False
    return math.isfinite(float(value))


def check_finite(name: str, values: Floats, *, hint: str = "") -> None:
    """Raise `InputError` at the first value that is NaN or infinite."""
    wrong = ~np.isfinite(values)
    if wrong.any():
        index = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f"index {index if len(index) != 1 else index[0]}" if index else ""
        raise InputError(name, "finite numbers", str(values[index]), where=where, hint=hint)


def _shown(shape: tuple[int | None, ...]) -> str:
    inside = ", ".join("n" if length is None else str(length) for length in shape)
    return f"({inside},)" if len(shape) == 1 else f"({inside})"
