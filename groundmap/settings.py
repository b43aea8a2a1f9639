"""Settings classes: frozen, keyword-only and validated."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from groundmap.errors import SettingsError
from groundmap.printable import format_value

LARGEST_NUMBER = 1e9  # bound of all settings; their squares and sums stay finite and exact enough
LARGEST = 1e4  # bound of lengths [m], ratios and angles
FINEST = 20_000  # cells or samples along max_range; more would take minutes per view


class Settings(BaseModel):
    """Base of the settings classes of both packages.

    Parameters
    ----------
    **values
        Fields of the class; missing ones get their defaults.

    Raises
    ------
    SettingsError
        A key is unknown (the nearest valid one is named), a value is out of range, or values are
        inconsistent.

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
        """Raise `SettingsError` if fields are inconsistent; overridden by subclasses."""

    def check_order(self, lower: str, upper: str) -> None:
        """Raise `SettingsError` if one field is above another.

        Parameters
        ----------
        lower, upper : str
            Names of the fields.
        """
        least, most = getattr(self, lower), getattr(self, upper)
        if least > most:
            raise SettingsError(lower, f"at most {upper}, {most:g}", f"{least:g}")


def _nearest(key: str, known: list[str]) -> str:
    close = get_close_matches(key, known, n=1)
    return f"Did you mean {close[0]!r}?" if close else f"There are: {', '.join(sorted(known))}."


class MapperSettings(Settings):
    """Settings of `groundmap.GroundMapper`.

    Features of a view are dropped, or classified by their height above the ground plane. Obstacle
    features are linked to surfaces, which end lines of sight and become non-free cells. Cells that
    lines of sight pass over become free, and the evidence of all views is fused.

    Raises
    ------
    SettingsError
        A key is unknown (the nearest valid one is named), a value is out of range, a lower bound
        is above its upper bound, or `max_range` is longer than 20,000 cells.

    Examples
    --------
    >>> MapperSettings(resolution=0.1, max_range=15.0).max_range
    15.0
    """

    resolution: float = Field(0.1524, gt=0, le=1000, description="side of a cell [m]; 6 inches")
    mode: Literal["2d", "3d"] = Field(
        "2d",
        description="kind of map: cells of the ground plane ('2d'), or voxels ('3d')",
    )
    frame: str = Field("map", description="name of the coordinate frame of the map")
    fusion: Literal["average", "capped", "exponential", "log_odds", "absolute"] = Field(
        "average",
        description="update rule: 'average' of all views; 'capped' or 'exponential', which forget "
        "old views; 'log_odds' (Bayesian); or 'absolute' (the newest view decides)",
    )
    cap: int = Field(
        50, ge=1, le=2**32 - 1, description="update count from which 'capped' forgets old views"
    )
    alpha: float = Field(0.2, gt=0, le=1, description="weight of the newest view, 'exponential'")
    nonfree_probability: float = Field(
        0.7,
        gt=0.5,
        le=0.999,
        description="probability that non-free evidence of one view is right, 'log_odds'",
    )
    free_probability: float = Field(
        0.7, gt=0.5, le=0.999, description="the same of free evidence, 'log_odds'"
    )
    most_probable: float = Field(
        0.97, gt=0.5, le=0.999, description="largest probability that a cell reaches, 'log_odds'"
    )
    uncertainty: Literal["ellipsoid", "gaussian", "radius", "none"] = Field(
        "ellipsoid",
        description="spread of surfaces over cells: by their covariance ('ellipsoid'), the same "
        "with most of it near the surface ('gaussian'), equal in all directions ('radius'), or "
        "'none'",
    )
    spread_sigmas: float = Field(
        2.0, ge=0, le=LARGEST, description="extent of this spread [standard deviations]"
    )
    min_range: float = Field(
        0.3, gt=0, le=LARGEST, description="least horizontal distance of features [m]"
    )
    max_range: float = Field(
        20.0, gt=0, le=LARGEST, description="largest horizontal distance of features [m]"
    )
    step_height: float = Field(
        0.15, gt=0, le=LARGEST, description="height of steps that the robot can drive over [m]"
    )
    robot_height: float = Field(
        2.0, gt=0, le=LARGEST, description="height of the robot; higher features are ignored [m]"
    )
    narrowest_footprint: float = Field(
        1.0, gt=0, description="width of the narrowest robot that will use the map [m]"
    )
    link_length: float = Field(
        0.5, ge=0, le=LARGEST, description="largest length of a link between obstacle features [m]"
    )
    link_angle: float = Field(
        0.04,
        ge=0,
        le=LARGEST,
        description="the same as an angle, which allows longer links far from the camera [rad]",
    )
    link_height: float = Field(
        0.5, ge=0, le=LARGEST, description="largest height difference of linked features [m]"
    )
    doubt: float = Field(
        3.0,
        ge=1,
        le=LARGEST,
        description="links up to this many times too long end lines of sight, but are not mapped",
    )
    halo: float = Field(
        0.15,
        ge=0,
        le=LARGEST,
        description="distance beside a feature over which its surface may continue [m]",
    )
    smoothing: float = Field(
        0.25,
        ge=0,
        le=LARGEST,
        description="distance across the line of sight over which features are smoothed [m]",
    )
    grant_height: float = Field(
        0.5,
        gt=0,
        le=LARGEST,
        description="lines of sight to surfaces grant freespace if they end below this share of "
        "the camera height",
    )
    sight_gap: float = Field(
        0.8,
        ge=0,
        le=LARGEST,
        description="largest gap between lines of sight that counts as observed [m]",
    )
    support_width: float = Field(
        0.3,
        gt=0,
        le=LARGEST,
        description="half-width of the observed ground around a ground feature [m]",
    )
    support_angle: float = Field(
        0.05, gt=0, le=LARGEST, description="upper bound of this half-width as an angle [rad]"
    )
    recent_views: int = Field(
        2,
        ge=0,
        le=10_000,
        description="number of newest views whose non-free cells are kept beside the map",
    )
    recent_seconds: float | None = Field(
        None,
        gt=0,
        description="the same as a time, for views with timestamps; replaces recent_views [s]",
    )
    recent_depth: float = Field(
        4.5,
        ge=0,
        le=LARGEST,
        description="distance behind newly seen things over which hidden cells are kept, too [m]",
    )

    discontinuities: Literal["halo", "cautious", "strict"] = Field(
        "halo",
        description="3-D: sight over a gap in depth ends at near corners within `depth_halo`, "
        "elsewhere at far ones ('halo'), or at the nearest corner ('cautious'), or the gap is a "
        "surface like any other ('strict')",
    )
    depth_ratio: float = Field(
        1.3, ge=1, le=LARGEST, description="3-D: ratio of depths from which there is a gap"
    )
    depth_halo: float = Field(
        0.8,
        ge=0,
        le=LARGEST,
        description="3-D: lines of sight that pass this near to the near corner of a gap in depth "
        "end there [m]",
    )

    def check(self) -> None:
        """Check the order of ranges and heights, and the number of cells along `max_range`."""
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
    """Settings of `groundmap.fit_ground`.

    Raises
    ------
    SettingsError
        A key is unknown (the nearest valid one is named), a value is out of range, or
        `lowest_camera` is above `highest_camera`.

    Examples
    --------
    >>> GroundSettings(window=21, causal=True).window
    21
    """

    window: int = Field(
        11, ge=1, le=10_000, description="number of views that each plane is fitted to"
    )
    causal: bool = Field(
        False, description="whether a plane depends on earlier views only, as in live mapping"
    )
    max_range: float = Field(
        20.0, gt=0, le=LARGEST, description="largest horizontal distance of features [m]"
    )
    lowest_camera: float = Field(
        0.1, gt=0, le=LARGEST, description="least height of the camera above the ground [m]"
    )
    highest_camera: float = Field(
        5.0, gt=0, le=LARGEST, description="largest height of the camera above the ground [m]"
    )
    min_support: int = Field(
        12, ge=3, le=1_000_000, description="least number of features on a plane"
    )

    def check(self) -> None:
        """Check the order of the camera heights."""
        self.check_order("lowest_camera", "highest_camera")
