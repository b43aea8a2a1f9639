"""The exceptions: their tree and their messages."""

from __future__ import annotations

import pickle
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap import errors
from groundmap.errors import (
    CameraError,
    FileFormatError,
    GroundmapError,
    InputError,
    MergeError,
    NoGroundPlaneError,
    SettingsError,
)

SHARED = {errors.FactualError, errors.WrongValueError}  # bases of the tree of planners, too
words = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=20)


def test_every_exception_is_a_groundmap_error() -> None:
    own = [
        value
        for name, value in vars(errors).items()
        if name.endswith("Error") and value not in SHARED
    ]
    assert len(own) == 8
    assert all(issubclass(error, GroundmapError) for error in own)


@pytest.mark.parametrize("error", [InputError, SettingsError, CameraError, FileFormatError])
def test_invalid_arguments_are_value_errors(error: type[Exception]) -> None:
    assert issubclass(error, InputError)
    assert issubclass(error, ValueError)


@pytest.mark.parametrize("error", [NoGroundPlaneError, MergeError])
def test_refused_views_and_maps_are_not_value_errors(error: type[Exception]) -> None:
    assert not issubclass(error, ValueError)


@given(words, words, words, words, words)
def test_a_message_holds_every_fact_in_reading_order(
    name: str, expected: str, got: str, where: str, hint: str
) -> None:
    error = InputError(name, expected, got, where=where, hint=hint)
    assert str(error) == f"{name}: expected {expected}, got {got} at {where}. {hint}"
    facts = (error.name, error.expected, error.got, error.where, error.hint)
    assert facts == (name, expected, got, where, hint)


def test_a_message_without_place_and_hint_has_no_gap() -> None:
    assert str(InputError("fx", "a number", "a word")) == "fx: expected a number, got a word."


def test_a_file_error_names_file_and_line() -> None:
    error = FileFormatError("a/b.csv", "7 columns", "6", line=3)
    assert (error.path, error.line) == ("a/b.csv", 3)
    assert str(error) == "a/b.csv: expected 7 columns, got 6 at line 3."
    assert str(FileFormatError("b.csv", "a table", "none")) == "b.csv: expected a table, got none."


@pytest.mark.parametrize(
    "error",
    [
        InputError("baseline", "a number above 0 [m]", "0.0", hint="Give the rig's."),
        FileFormatError("poses.txt", "8 columns", "7", line=12),
        NoGroundPlaneError("the camera looks at the sky"),
    ],
)
def test_an_error_can_be_pickled_with_its_facts(error: GroundmapError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.__dict__ == error.__dict__


@given(st.text(min_size=1))
def test_a_message_with_any_facts_is_printable(text: str) -> None:
    for error in (InputError(text, text, text, where=text, hint=text), MergeError(text)):
        assert str(error).isprintable()


def test_a_message_is_of_a_bounded_length_and_shows_both_ends_of_a_fact() -> None:
    error = FileFormatError("a" + "x" * 5000 + "b", "c" + "y" * 5000 + "d", "e" + "z" * 5000 + "f")
    assert re.fullmatch(r"ax+\.\.\.x+b: expected cy+\.\.\.y+d, got ez+\.\.\.z+f\.", str(error))
    assert len(str(error)) < 2000


def test_control_and_bidirectional_characters_are_escaped() -> None:
    error = FileFormatError("a\x1b[2J\u202e.map", "a map", "none")
    assert str(error) == r"a\x1b[2J\u202e.map: expected a map, got none."
