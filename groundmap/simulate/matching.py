"""What a stereo matcher makes of what is in sight: noise, gaps, false matches, broken segments."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from groundmap.arrays import Bools, Floats, Ints
from groundmap.errors import SettingsError
from groundmap.settings import Settings

UL, UR = 0, 1  # columns of a matched pixel; the third is v
GAP = 0.1  # of a broken segment's length


class MatchingSettings(Settings):
    """How good the matcher is; all rates are shares of the features in sight, 0 to 1."""

    pixel_noise_px: float = Field(
        0.5, ge=0, description="standard deviation of a matched coordinate [px]"
    )
    quantum_px: float = Field(0.0, ge=0, description="step of the disparity; 0 for none [px]")
    missing: float = Field(0.1, ge=0, le=1, description="not matched at all")
    false_matches: float = Field(0.02, ge=0, le=1, description="matched with any disparity")
    false_disparity_px: tuple[float, float] = Field(
        (5.0, 120.0), description="disparities of false matches, from and to [px]"
    )
    ghosts: float = Field(
        0.0, ge=0, le=1, description="of features of a repeated pattern: matched one piece off"
    )
    fragments: float = Field(
        0.0, ge=0, le=1, description="of segments: broken in two, with a gap between"
    )

    def check(self) -> None:
        """Refuse disparities of false matches out of order."""
        low, high = self.false_disparity_px
        if low > high:
            expected = "two disparities in ascending order [px]"
            raise SettingsError("false_disparity_px", expected, f"{low:g}, {high:g}")


def match(
    pixels: Floats, period_px: Floats, settings: MatchingSettings, rng: np.random.Generator
) -> tuple[Floats, Bools]:
    """Return features as matched, and which of them are.

    Parameters
    ----------
    pixels : ndarray, shape (n, ends, 3) [px]
        (uL, uR, v) as they truly are.
    period_px : ndarray, shape (n,) [px]
        How far apart the pieces of a repeated pattern are in the images; 0 for no pattern.
    settings : MatchingSettings
    rng : numpy Generator

    Returns
    -------
    matched : ndarray, shape (n, ends, 3) [px]
    found : ndarray of bool, shape (n,)

    Notes
    -----
    A ghost is one pattern too near or too far with all the features around it, so that it looks
    like a surface; what it would put behind infinity is not matched.
    """
    count = len(pixels)
    matched = pixels + rng.normal(size=pixels.shape) * settings.pixel_noise_px
    ghost = (rng.random(count) < settings.ghosts) & (period_px > 0)
    side = np.where(rng.random(count) < 0.5, 1.0, -1.0)
    matched[:, :, UR] += np.where(ghost, side * period_px, 0.0)[:, None]
    wrong = rng.random(count) < settings.false_matches
    anything = rng.uniform(*settings.false_disparity_px, count)
    matched[:, :, UR] = np.where(
        wrong[:, None], matched[:, :, UL] - anything[:, None], matched[:, :, UR]
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
    """Break some segments in two, each with a gap of a tenth of it at a random place.

    Parameters
    ----------
    segments : ndarray, shape (n, 2, 3) [px]
        Matched ends; pixels and disparity are linear along a segment.

    Returns
    -------
    pieces : ndarray, shape (m, 2, 3) [px], m >= n
        Those left whole come first.
    row : ndarray, shape (m,)
        The segment that each is a piece of.
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
