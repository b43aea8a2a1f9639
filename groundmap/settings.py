"""Settings: frozen, keyword-only, validated; an unknown key names the nearest valid one."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from groundmap.errors import SettingsError
from groundmap.printable import format_value

LARGEST_NUMBER = 1e9  # of any setting: squares and sums of such are still exact enough, and finite
LARGEST = 1e4  # of lengths [m], ratios and angles: nothing that a rig sees needs more
FINEST = 20_000  # cells, or samples, along max_range: more keep one view busy for minutes


class Settings(BaseModel):
    """Base of every settings class, in both packages.

    Raises
    ------
    SettingsError
        A key that does not exist (the nearest one is named), a value out of range, or values that
        do not fit together (`check`).

    Examples
    --------
    >>> MapperSettings(resolutoin=0.1)
    Traceback (most recent call last):
        ...
    groundmap.errors.SettingsError: resolutoin: expected a setting of MapperSettings, got an \
unknown key. Did you mean 'resolution'?
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        known = type(self).model_fields
        for key in values:
            if key not in known:
                raise SettingsError(
                    key,
                    f"a setting of {type(self).__name__}",
                    "an unknown key",
                    hint=_nearest(key, list(known)),
                )
        try:
            super().__init__(**values)
        except ValidationError as error:
            first = error.errors()[0]
            name = ".".join(str(part) for part in first["loc"])
            if first["type"] == "missing":
                raise SettingsError(name, "a value", "none") from None
            expected = first["msg"].removeprefix("Input should be ")
            raise SettingsError(name, expected, format_value(first["input"])) from None
        for name, value in self:
            if isinstance(value, float) and abs(value) > LARGEST_NUMBER:
                raise SettingsError(name, f"a number within {LARGEST_NUMBER:g}", f"{value:g}")
        self.check()

    def check(self) -> None:
        """Raise `SettingsError` where valid fields do not fit together; a class may override it."""

    def check_order(self, lower: str, upper: str) -> None:
        """Raise `SettingsError` where the first of two fields is above the second."""
        least, most = getattr(self, lower), getattr(self, upper)
        if least > most:
            raise SettingsError(lower, f"at most {upper}, {most:g}", f"{least:g}")


def _nearest(key: str, known: list[str]) -> str:
    close = get_close_matches(key, known, n=1)
    return f"Did you mean {close[0]!r}?" if close else f"There are: {', '.join(sorted(known))}."


class MapperSettings(Settings):
    """All that `groundmap.GroundMapper` can be told; lengths in metres, angles in radians.

    Raises
    ------
    SettingsError
        Besides unknown keys and values out of range: a range of more than 4,000 cells.
    """

    resolution: float = Field(0.1524, gt=0, le=1000, description="size of a cell [m]; 6 inches")
    mode: Literal["2d"] = Field("2d", description="ground plane (2d)")
    frame: str = Field("map", description="name of the frame the map is in")
    fusion: Literal["average", "capped"] = Field("average", description="how views add up")
    cap: int = Field(
        50, ge=1, le=2**32 - 1, description="update count at which 'capped' starts to forget"
    )
    uncertainty: Literal["ellipsoid", "radius", "none"] = Field(
        "ellipsoid", description="how a surface spreads over the cells it may be in"
    )
    spread_sigmas: float = Field(
        2.0, ge=0, le=LARGEST, description="spread of a surface [standard deviations]"
    )
    min_range: float = Field(0.3, gt=0, le=LARGEST, description="nearer features are dropped [m]")
    max_range: float = Field(20.0, gt=0, le=LARGEST, description="farther features are dropped [m]")
    step_height: float = Field(0.15, gt=0, le=LARGEST, description="what the robot drives over [m]")
    robot_height: float = Field(
        2.0, gt=0, le=LARGEST, description="higher features are overhead [m]"
    )
    narrowest_footprint: float = Field(
        1.0, gt=0, description="width of the narrowest robot that will use the map [m]"
    )
    link_length: float = Field(
        0.5, ge=0, le=LARGEST, description="links up to this length are believed [m]"
    )
    link_angle: float = Field(
        0.04, ge=0, le=LARGEST, description="the same, per metre of range [rad]"
    )
    link_height: float = Field(
        0.5, ge=0, le=LARGEST, description="height band of a point feature, for links [m]"
    )
    doubt: float = Field(
        3.0,
        ge=1,
        le=LARGEST,
        description="unbelieved links up to this many times as long still end sight",
    )
    halo: float = Field(
        0.15,
        ge=0,
        le=LARGEST,
        description="what a feature is on may go on as far as this beside it [m]",
    )
    smoothing: float = Field(
        0.25,
        ge=0,
        le=LARGEST,
        description="features this near across the line of sight are averaged [m]",
    )
    grant_height: float = Field(
        0.5,
        gt=0,
        le=LARGEST,
        description="sight that comes down to this share of the camera's height grants freespace",
    )
    sight_gap: float = Field(
        0.8, ge=0, le=LARGEST, description="gap between lines of sight that counts as seen [m]"
    )
    support_width: float = Field(
        0.3,
        gt=0,
        le=LARGEST,
        description="half-width of the ground a ground feature vouches for [m]",
    )
    support_angle: float = Field(
        0.05, gt=0, le=LARGEST, description="its upper bound as a bearing [rad]"
    )

    def check(self) -> None:
        """Refuse ranges and heights out of order, and cells too small for the range."""
        self.check_order("min_range", "max_range")
        self.check_order("step_height", "robot_height")
        for name in ("resolution", "support_width"):
            if getattr(self, name) * FINEST < self.max_range:
                raise SettingsError(
                    name,
                    f"at least max_range / {FINEST}, which is {self.max_range / FINEST:.4g} m",
                    f"{getattr(self, name):g}",
                    hint=f"Give a larger {name}, or a smaller max_range [m].",
                )


class GroundSettings(Settings):
    """All that `groundmap.fit_ground` can be told."""

    window: int = Field(
        11, ge=1, le=10_000, description="views that one plane is fitted to [views]"
    )
    causal: bool = Field(False, description="use earlier views only, as a live mapper must")
    max_range: float = Field(
        20.0, gt=0, le=LARGEST, description="farther features are left out [m]"
    )
    lowest_camera: float = Field(
        0.1, gt=0, le=LARGEST, description="least height of the camera [m]"
    )
    highest_camera: float = Field(
        5.0, gt=0, le=LARGEST, description="greatest height of the camera [m]"
    )
    min_support: int = Field(
        12, ge=3, le=1_000_000, description="least features on a plane [features]"
    )

    def check(self) -> None:
        """Refuse camera heights out of order."""
        self.check_order("lowest_camera", "highest_camera")
