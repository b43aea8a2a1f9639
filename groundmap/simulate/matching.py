"""The errors of a stereo matcher: noise, gaps, false matches, ghosts, broken segments."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import SettingsError
from groundmap.settings import Settings

UL, UR = 0, 1  # columns of a matched pixel; the third is v
GAP = 0.1  # of the length of a broken segment


class MatchingSettings(Settings):
    """The errors of the matcher; all rates are shares of the features in sight, 0 to 1."""

    pixel_noise_px: float = Field(
        0.5, ge=0, description="standard deviation of a matched coordinate [px]"
    )
    quantum_px: float = Field(0.0, ge=0, description="step of the disparity; 0 for none [px]")
    missing: float = Field(0.1, ge=0, le=1, description="share not matched")
    false_matches: float = Field(
        0.02, ge=0, le=1, description="share matched with a random disparity"
    )
    false_disparity_px: tuple[float, float] = Field(
        (5.0, 120.0), description="least and largest disparity of false matches [px]"
    )
    ghosts: float = Field(
        0.0,
        ge=0,
        le=1,
        description="share matched one period off, of features of a repeated pattern",
    )
    fragments: float = Field(
        0.0, ge=0, le=1, description="share of segments broken in two, with a gap between them"
    )

    def check(self) -> None:
        """Refuse disparities of false matches that are not in ascending order."""
        low, high = self.false_disparity_px
        if low > high:
            expected = "two disparities in ascending order [px]"
            raise SettingsError("false_disparity_px", expected, f"{low:g}, {high:g}")


def match(
    pixels: Floats, period_px: Floats, settings: MatchingSettings, rng: np.random.Generator
) -> tuple[Floats, Bools]:
    """Return the matched pixels of features, and which features are matched.

    Parameters
    ----------
    pixels : ndarray, shape (n, ends, 3) [px]
        True (uL, uR, v).
    period_px : ndarray, shape (n,) [px]
        Period of a repeated pattern in the images; 0 for no pattern.
    settings : MatchingSettings
    rng : numpy Generator

    Returns
    -------
    matched : ndarray, shape (n, ends, 3) [px]
    found : ndarray of bool, shape (n,)

    Notes
    -----
    A ghost is off by one period, too near or too far, with all features around it, so that it looks
    like a surface. Ghosts beyond infinity have no disparity and are not matched.
    """
    count = len(pixels)
    matched = pixels + rng.normal(size=pixels.shape) * settings.pixel_noise_px
    ghost = (rng.random(count) < settings.ghosts) & (period_px > 0)
    side = np.where(rng.random(count) < 0.5, 1.0, -1.0)
    matched[:, :, UR] += np.where(ghost, side * period_px, 0.0)[:, None]
    wrong = rng.random(count) < settings.false_matches
    disparities = rng.uniform(*settings.false_disparity_px, count)
    matched[:, :, UR] = np.where(
        wrong[:, None], matched[:, :, UL] - disparities[:, None], matched[:, :, UR]
    )
    if settings.quantum_px > 0:
        disparity = matched[:, :, UL] - matched[:, :, UR]
        steps = np.round(disparity / settings.quantum_px)
        matched[:, :, UR] = matched[:, :, UL] - steps * settings.quantum_px
    found: Bools = rng.random(count) >= settings.missing
    return matched, found


def break_segments(
    segments: Floats, settings: MatchingSettings, rng: np.random.Generator
) -> tuple[Floats, Ints]:
    """Break some segments in two, with a gap of a tenth of their length at a random place.

    Parameters
    ----------
    segments : ndarray, shape (n, 2, 3) [px]
        Matched ends; pixels and disparity are linear along a segment.
    settings : MatchingSettings
    rng : numpy Generator

    Returns
    -------
    pieces : ndarray, shape (m, 2, 3) [px], m >= n
        Unbroken segments come first.
    row : ndarray, shape (m,)
        Index of the segment of each piece.
    """
    breaks = rng.random(len(segments)) < settings.fragments
    first, last = np.moveaxis(segments[breaks], 1, 0)
    at = rng.uniform(0.2, 0.8, (len(first), 1))
    before = first + (at - GAP / 2) * (last - first)
    after = first + (at + GAP / 2) * (last - first)
    halves = [np.stack([first, before], axis=1), np.stack([after, last], axis=1)]
    rows = np.flatnonzero(breaks)
    return (
        np.concatenate([segments[~breaks], *halves]),
        np.concatenate([np.flatnonzero(~breaks), rows, rows]),
    )
