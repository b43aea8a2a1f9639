"""The matcher: exact by default, with errors of the set rates and kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Floats
from groundmap.errors import SettingsError
from groundmap.simulate.matching import GAP, MatchingSettings, break_segments, match
from strategies import rngs

MANY = 20_000
PERFECT: dict[str, Any] = {"pixel_noise_px": 0.0, "missing": 0.0, "false_matches": 0.0}


def matcher(**options: Any) -> MatchingSettings:
    return MatchingSettings(**{**PERFECT, **options})


def pixels_of(rng: np.random.Generator, count: int, ends: int) -> Floats:
    left, v = rng.uniform(0.0, 700.0, (2, count, ends))
    return np.stack([left, left - rng.uniform(5.0, 90.0, (count, ends)), v], axis=-1)


def disparities(pixels: Floats) -> Floats:
    return pixels[..., 0] - pixels[..., 1]


def assert_share(count: int, rate: float) -> None:
    assert abs(count / MANY - rate) <= 5.0 * np.sqrt(rate * (1.0 - rate) / MANY)


@given(rngs(), st.integers(0, 40), st.sampled_from([1, 2]))
def test_a_perfect_matcher_returns_the_true_pixels(
    rng: np.random.Generator, count: int, ends: int
) -> None:
    pixels, period = pixels_of(rng, count, ends), rng.uniform(0.0, 30.0, count)
    matched, found = match(pixels, period, matcher(), rng)
    np.testing.assert_array_equal(matched, pixels)
    assert found.shape == (count,)
    assert found.all()


def test_noise_has_the_set_standard_deviation_in_every_coordinate() -> None:
    rng = np.random.default_rng(1)
    pixels = pixels_of(rng, MANY, 2)
    before = pixels.copy()
    matched, _ = match(pixels, np.zeros(MANY), matcher(pixel_noise_px=0.7), rng)
    noise = (matched - pixels).reshape(MANY, -1)
    np.testing.assert_allclose(noise.std(axis=0), 0.7, rtol=5.0 / np.sqrt(2 * MANY))
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=5 * 0.7 / np.sqrt(MANY))
    assert np.abs(np.corrcoef(noise.T) - np.eye(6)).max() < 5.0 / np.sqrt(MANY)
    np.testing.assert_array_equal(pixels, before)  # the input is not changed


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.9])
def test_missing_false_and_ghost_matches_occur_at_the_set_rates(rate: float) -> None:
    rng = np.random.default_rng(1)
    pixels, period = pixels_of(rng, MANY, 1), np.full(MANY, 4.0)
    _, found = match(pixels, period, matcher(missing=rate), rng)
    assert_share(int((~found).sum()), rate)
    for name in ("false_matches", "ghosts"):
        matched, _ = match(pixels, period, matcher(**{name: rate}), rng)
        assert_share(int((matched != pixels).any(axis=(1, 2)).sum()), rate)


def test_a_missing_rate_of_1_matches_nothing() -> None:
    rng = np.random.default_rng(1)
    _, found = match(pixels_of(rng, 50, 1), np.zeros(50), matcher(missing=1.0), rng)
    assert not found.any()


@given(rngs(), st.sampled_from([1, 2]))
def test_false_matches_have_any_disparity_in_range(rng: np.random.Generator, ends: int) -> None:
    pixels = pixels_of(rng, 300, ends)
    options = matcher(false_matches=1.0, false_disparity_px=(20.0, 60.0))
    matched, found = match(pixels, np.full(300, 5.0), options, rng)
    wrong = disparities(matched)
    assert found.all()
    assert ((wrong >= 20.0 - 1e-9) & (wrong <= 60.0 + 1e-9)).all()
    assert np.histogram(wrong[:, 0], bins=4, range=(20.0, 60.0))[0].min() > 30
    assert np.ptp(wrong, axis=1).max() < 1e-9  # one match, one disparity
    np.testing.assert_array_equal(matched[..., [0, 2]], pixels[..., [0, 2]])


@given(rngs(), st.floats(0.05, 2.0), st.sampled_from([0.0, 0.5]))
def test_a_quantised_disparity_is_the_nearest_multiple(
    rng: np.random.Generator, quantum: float, noise: float
) -> None:
    pixels = pixels_of(rng, 100, 2)
    seed = int(rng.integers(2**32))
    options = {"pixel_noise_px": noise, "false_matches": 0.1}
    exact, _ = match(pixels, np.zeros(100), matcher(**options), np.random.default_rng(seed))
    coarse = matcher(**options, quantum_px=quantum)
    matched, _ = match(pixels, np.zeros(100), coarse, np.random.default_rng(seed))
    steps = disparities(matched) / quantum
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-7)
    assert (np.abs(disparities(matched) - disparities(exact)) <= quantum / 2 + 1e-9).all()
    np.testing.assert_array_equal(matched[..., [0, 2]], exact[..., [0, 2]])


@given(rngs(), st.sampled_from([1, 2]))
def test_ghosts_are_one_period_off_and_only_on_patterns(
    rng: np.random.Generator, ends: int
) -> None:
    pixels = pixels_of(rng, 200, ends)
    period = rng.uniform(1.0, 9.0, 200) * (rng.random(200) < 0.7)
    matched, _ = match(pixels, period, matcher(ghosts=1.0), rng)
    off = matched[..., 1] - pixels[..., 1]
    np.testing.assert_allclose(np.abs(off), np.tile(period[:, None], ends), atol=1e-9)
    assert np.ptp(off, axis=1).max() < 1e-9  # both ends of a segment move alike
    near, far = (off[:, 0] < -0.5).sum(), (off[:, 0] > 0.5).sum()
    assert near > 30
    assert far > 30
    np.testing.assert_array_equal(matched[..., [0, 2]], pixels[..., [0, 2]])


@settings(max_examples=60)
@given(rngs(), st.integers(0, 40), st.sampled_from([0.0, 0.5, 1.0]))
def test_pieces_of_a_broken_segment_lie_on_it_with_a_gap_of_a_tenth(
    rng: np.random.Generator, count: int, rate: float
) -> None:
    segments = pixels_of(rng, count, 2)
    pieces, row = break_segments(segments, matcher(fragments=rate), rng)
    assert len(pieces) == len(row)
    for number, (first, last) in enumerate(segments):
        mine = pieces[row == number]
        way = last - first
        shares = (mine - first) @ way / (way @ way)
        np.testing.assert_allclose(mine, first + shares[..., None] * way, atol=1e-9)
        if len(mine) == 1:
            np.testing.assert_array_equal(mine[0], (first, last))
            continue
        (start, before), (after, end) = shares
        assert (start, end) == (pytest.approx(0.0, abs=1e-12), pytest.approx(1.0))
        assert after - before == pytest.approx(GAP) == pytest.approx(0.1)
        assert before >= 0.15 - 1e-9
        assert after <= 0.85 + 1e-9
    assert sorted(set(row.tolist())) == list(range(count))
    if rate != 0.5:
        assert len(pieces) == count * (1 + rate)


def test_segments_are_broken_at_the_set_rate() -> None:
    rng = np.random.default_rng(1)
    _, row = break_segments(pixels_of(rng, MANY, 2), matcher(fragments=0.3), rng)
    assert_share(len(row) - MANY, 0.3)


@pytest.mark.parametrize("name", ["missing", "false_matches", "ghosts", "fragments"])
@pytest.mark.parametrize("rate", [-0.1, 1.1, float("nan")])
def test_a_rate_outside_0_to_1_is_refused(name: str, rate: float) -> None:
    with pytest.raises(SettingsError, match=rf"^{name}: expected"):
        matcher(**{name: rate})


@pytest.mark.parametrize("name", ["pixel_noise_px", "quantum_px"])
def test_negative_noise_is_refused(name: str) -> None:
    with pytest.raises(SettingsError, match=rf"^{name}: expected greater than or equal to 0"):
        matcher(**{name: -0.1})
