"""Patterns of scenario files."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundmap.errors import InputError
from planners.scenario.patterns import PLAIN, check_pattern, is_found


@given(st.text(max_size=5), st.text("abc.*+?[]()|^$\\{} ", max_size=4))
def test_plain_patterns_are_found_as_python_finds_them(text: str, pattern: str) -> None:
    if PLAIN.fullmatch(pattern):
        assert is_found(pattern, text) == (re.search(pattern, text) is not None)


@pytest.mark.parametrize(
    ("pattern", "found"), [(r"area of \d\.\d m²", True), (r"^area", False), ("a.*m²$", True)]
)
def test_regular_expressions_are_found(pattern: str, found: bool) -> None:
    assert is_found(pattern, "an area of 2.5 m²") == found


def test_an_endless_search_is_stopped_and_finds_nothing() -> None:
    assert not is_found("(a+)+$", "a" * 200 + "b")


@pytest.mark.parametrize(
    "pattern", ["(", "a{99999999999}", "(" * 400, "x" * 501, "[[" * 10], ids=len
)
def test_an_invalid_pattern_is_refused(pattern: str) -> None:
    with pytest.raises(InputError, match=r"^reason: expected (a regular|500 characters)"):
        check_pattern("reason", pattern)


def test_python_warnings_about_a_pattern_are_suppressed() -> None:
    check_pattern("reason", "[[a]")
