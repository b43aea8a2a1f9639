"""Settings: validated, frozen, and helpful about typing errors."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from groundmap.errors import SettingsError
from groundmap.settings import GroundSettings, MapperSettings, Settings
from groundmap.simulate import SensorSettings

BOTH: list[type[Settings]] = [MapperSettings, GroundSettings]
NUMBERS = [
    (kind, name)
    for kind in BOTH
    for name, field in kind.model_fields.items()
    if field.annotation in (int, float)
]


def build(kind: type[Settings], **values: Any) -> Settings:
    """Build settings with keys and values that a type checker would refuse."""
    return kind(**values)


@pytest.mark.parametrize("kind", BOTH)
def test_the_defaults_are_valid_and_described(kind: type[Settings]) -> None:
    again = build(kind, **kind().model_dump())
    assert again == kind()
    assert all(field.description for field in kind.model_fields.values())


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("resolutoin", "resolution"),
        ("maxrange", "max_range"),
        ("stepheight", "step_height"),
        ("Fusion", "fusion"),
        ("narrowest_footprnt", "narrowest_footprint"),
    ],
)
def test_an_unknown_key_names_the_nearest(typed: str, meant: str) -> None:
    with pytest.raises(SettingsError, match=f"^{typed}: .*unknown key. Did you mean '{meant}'"):
        build(MapperSettings, **{typed: 1.0})


def test_a_key_like_no_other_lists_all_there_are() -> None:
    with pytest.raises(SettingsError, match=r"There are: causal, .*, window"):
        build(GroundSettings, qqq=1)


@pytest.mark.parametrize(("kind", "name"), NUMBERS)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, "much", None])
def test_no_number_may_be_nan_infinite_negative_or_a_word(
    kind: type[Settings], name: str, value: object
) -> None:
    with pytest.raises(SettingsError, match=f"^{name}: expected "):
        build(kind, **{name: value})


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("resolution", 0.0, "greater than 0"),
        ("cap", 0, "greater than or equal to 1"),
        ("fusion", "mean", "'average', 'capped', 'exponential', 'log_odds' or 'absolute'"),
        ("uncertainty", "", "'ellipsoid', 'gaussian', 'radius' or 'none'"),
        ("min_range", 0.0, "greater than 0"),
    ],
)
def test_a_value_out_of_range_is_refused_with_the_range(
    name: str, value: object, expected: str
) -> None:
    with pytest.raises(SettingsError, match=f"^{name}: expected {expected}, got {value!r}"):
        build(MapperSettings, **{name: value})


@given(st.floats(5e-3, 10.0), st.integers(1, 1000))
def test_settings_hold_what_they_were_given(resolution: float, cap: int) -> None:
    settings = MapperSettings(resolution=resolution, cap=cap)
    assert (settings.resolution, settings.cap) == (resolution, cap)


def test_settings_are_frozen() -> None:
    settings = MapperSettings()
    with pytest.raises(ValidationError, match="frozen"):
        settings.resolution = 1.0  # type: ignore[misc]  # mypy sees it, too
    assert settings.resolution == 0.1524


def test_settings_are_given_by_name() -> None:
    with pytest.raises(TypeError, match="positional"):
        MapperSettings(0.1)  # type: ignore[call-arg]  # mypy sees it, too


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"min_range": 5.0, "max_range": 4.0}, "min_range: expected at most max_range, 4, got 5"),
        ({"max_range": 0.2}, "min_range: expected at most max_range, 0.2, got 0.3"),
        ({"step_height": 3.0}, "step_height: expected at most robot_height, 2, got 3"),
    ],
)
def test_settings_in_the_wrong_order_are_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(SettingsError, match=f"^{message}"):
        build(MapperSettings, **values)


def test_disparities_of_false_matches_in_the_wrong_order_are_refused() -> None:
    with pytest.raises(SettingsError, match=r"^false_disparity_px: .* ascending .*, got 120, 5"):
        SensorSettings(false_disparity_px=(120, 5))


def test_a_range_of_too_many_cells_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"^resolution: expected at least max_range / 20000"):
        build(MapperSettings, resolution=0.0009)
    assert build(MapperSettings, resolution=0.0009, max_range=16.0)
