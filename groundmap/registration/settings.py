"""Settings of the registration."""

from __future__ import annotations

from pydantic import Field

from groundmap.settings import LARGEST, Settings


class RegistrationSettings(Settings):
    """Settings of `groundmap.register`, `groundmap.estimate_poses` and `groundmap.recognise`.

    Raises
    ------
    SettingsError
        A key is unknown (the nearest valid one is named), or a value is out of range.

    Examples
    --------
    >>> RegistrationSettings(max_translation=3.0).max_translation
    3.0
    """

    max_translation: float = Field(
        2.0, gt=0, le=LARGEST, description="largest motion, from the guess [m]"
    )
    max_rotation: float = Field(
        0.175, gt=0, le=3.15, description="largest rotation, from the guess [rad]; 10 degrees"
    )
    planar: bool = Field(
        False, description="whether the motion is one in the ground plane (3 instead of 6 unknowns)"
    )
    use_ids: bool = Field(True, description="whether features with landmark ids match by them")
    min_matches: int = Field(20, ge=4, description="least number of features that agree")
    rival: float = Field(
        0.75,
        gt=0,
        le=1,
        description="share of the matches from which another motion makes the answer ambiguous",
    )
    max_sigma: float = Field(
        0.1, gt=0, le=LARGEST, description="largest standard deviation of the translation [m]"
    )
    max_sigma_rotation: float = Field(
        0.02, gt=0, le=3.15, description="the same of the rotation [rad]"
    )
    rounds: int = Field(60, ge=1, le=10_000, description="largest number of rounds of the search")
    seed: int = Field(0, ge=0, description="seed of the choice of features in the search")
