"""Checks of arrays: valid values pass unchanged, others are refused."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from groundmap.arrays import Floats, as_floats, check_finite
from groundmap.errors import InputError

finite = st.floats(-1e9, 1e9)


@given(hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2), elements=finite))
def test_values_of_the_right_shape_pass_unchanged(values: Floats) -> None:
    npt.assert_array_equal(as_floats("v", values.tolist(), (None, values.shape[1])), values)
    npt.assert_array_equal(as_floats("v", values, (len(values), None)), values)


@pytest.mark.parametrize(
    ("values", "shape", "message"),
    [
        ([1.0, 2.0], (3,), r"v: expected shape \(3,\), got shape \(2,\)"),
        ([1.0, 2.0], (None, 2), r"v: expected shape \(n, 2\), got shape \(2,\)"),
        ([[1.0], [2.0]], (None, 2), r"v: expected shape \(n, 2\), got shape \(2, 1\)"),
        (1.0, (None,), r"v: expected shape \(n,\), got shape \(\)"),
        (np.empty((0, 3)), (None, 2), r"v: expected shape \(n, 2\), got shape \(0, 3\)"),
        ([[1.0], [2.0, 3.0]], (None, 2), r"v: expected numbers of shape \(n, 2\)"),
        ("word", (None,), r"v: expected numbers of shape \(n,\), got 'word'"),
        ([{}], (1,), r"v: expected numbers of shape \(1,\)"),
    ],
)
def test_other_shapes_and_values_that_are_not_numbers_are_refused(
    values: object, shape: tuple[int | None, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        as_floats("v", values, shape)  # type: ignore[arg-type] # what is refused


def test_an_empty_list_is_an_empty_table() -> None:
    assert as_floats("v", [], (None, 2, 3)).shape == (0, 2, 3)


def test_an_empty_list_is_not_a_vector_of_fixed_length() -> None:
    with pytest.raises(InputError, match=r"expected shape \(3,\), got shape \(0,\)"):
        as_floats("v", [], (3,))


@given(
    hnp.arrays(np.float64, (3, 4), elements=finite),
    st.sets(st.integers(0, 11), max_size=4),
    st.sampled_from([np.nan, np.inf, -np.inf]),
)
def test_the_first_value_that_is_not_finite_is_named(
    values: Floats, wrong: set[int], bad: float
) -> None:
    values.flat[list(wrong)] = bad
    if not wrong:
        check_finite("v", values)
        return
    row, col = divmod(min(wrong), 4)
    with pytest.raises(InputError, match=rf"got {bad} at index \({row}, {col}\)\. Look there"):
        check_finite("v", values, hint="Look there.")


def test_the_index_in_a_vector_is_a_single_number() -> None:
    with pytest.raises(InputError, match=r"v: expected finite numbers, got nan at index 1\.$"):
        check_finite("v", np.array([0.0, np.nan]))
