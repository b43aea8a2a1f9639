"""Update rules on single cells: the mean of all views, and the one that forgets."""

from __future__ import annotations

from math import ceil, log
from random import Random

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dense_grid import rounding_of_mean
from groundmap.arrays import Counts, Floats32
from groundmap.errors import InputError, SettingsError
from groundmap.grid.fusion import (
    RULES,
    Absolute,
    Average,
    Capped,
    Exponential,
    LogOdds,
    UpdateRule,
    rule_from,
)
from groundmap.grid.window import EPSILON
from groundmap.settings import MapperSettings

evidence = st.one_of(st.just(0.0), st.just(-0.0), st.floats(-1.0, 1.0, width=32))
views = hnp.arrays(np.float32, st.tuples(st.integers(0, 40), st.just(4)), elements=evidence)

EVERY_RULE = [Average(), Capped(5), Exponential(0.3), LogOdds(), Absolute()]


def fused(rule: UpdateRule, z: Floats32) -> tuple[Floats32, Counts]:
    """Fuse the rows of `z`, one after the other, into unseen cells."""
    confidence = np.zeros(z.shape[1:], dtype=np.float32)
    count = np.zeros(z.shape[1:], dtype=np.uint32)
    for row in z:
        rule.update(confidence, count, row.copy())
    return confidence, count


def steady(z: float, n: int) -> Floats32:
    return np.full((n, 1), z, dtype=np.float32)


@given(views)
def test_average_is_the_mean_of_what_is_not_zero(z: Floats32) -> None:
    confidence, count = fused(Average(), z)
    for cell, column in enumerate(z.T.astype(np.float64)):
        said = column[column != 0]
        assert count[cell] == len(said)
        mean = said.mean() if len(said) else 0.0
        assert abs(confidence[cell] - mean) <= rounding_of_mean(len(said))


@given(views, views)
def test_zeros_change_neither_value_nor_count(before: Floats32, after: Floats32) -> None:
    for rule in EVERY_RULE:
        confidence, count = fused(rule, before)
        was = confidence.tobytes(), count.tobytes()
        for row in np.zeros_like(after):
            rule.update(confidence, count, row)
        assert (confidence.tobytes(), count.tobytes()) == was


@given(views, st.randoms(use_true_random=False))
def test_the_order_of_views_does_not_matter_to_the_average(z: Floats32, random: Random) -> None:
    order = list(range(len(z)))
    random.shuffle(order)
    confidence, count = fused(Average(), z)
    shuffled, count_shuffled = fused(Average(), z[order])
    npt.assert_array_equal(count, count_shuffled)
    assert (np.abs(confidence - shuffled) <= 2 * rounding_of_mean(count)).all()


@given(views, views)
def test_merged_averages_are_the_average_of_all_views(a: Floats32, b: Floats32) -> None:
    confidence, count = fused(Average(), a)
    Average().merge(confidence, count, *fused(Average(), b))
    expected, expected_count = fused(Average(), np.concatenate([a, b]))
    npt.assert_array_equal(count, expected_count)
    assert (np.abs(confidence - expected) <= 2 * rounding_of_mean(count)).all()


def test_the_average_still_moves_after_a_million_views() -> None:
    confidence = np.array([-1.0], dtype=np.float32)
    count = np.array([1_000_000], dtype=np.uint32)
    Average().update(confidence, count, np.array([1.0], dtype=np.float32))
    assert count[0] == 1_000_001
    assert confidence[0] + 1.0 == pytest.approx(2e-6, rel=0.05)


@given(views, st.integers(1, 8))
def test_capped_is_the_average_up_to_its_cap(z: Floats32, cap: int) -> None:
    confidence, count = fused(Capped(cap), z[:cap])
    expected, expected_count = fused(Average(), z[:cap])
    npt.assert_array_equal(confidence, expected)
    npt.assert_array_equal(count, expected_count)


@given(views, st.integers(1, 8))
def test_the_count_of_capped_stops_at_its_cap(z: Floats32, cap: int) -> None:
    confidence, count = fused(Capped(cap), z)
    npt.assert_array_equal(count, np.minimum((z != 0).sum(axis=0), cap))
    assert (np.abs(confidence) <= 1.0).all()


@given(views, st.integers(1, 8))
def test_capped_is_the_recursion_of_equation_1_with_k_at_most_cap(z: Floats32, cap: int) -> None:
    confidence, _ = fused(Capped(cap), z)
    for cell, column in enumerate(z.T.astype(np.float64)):
        x = 0.0
        for k, value in enumerate(column[column != 0]):
            x += (value - x) / (min(k, cap) + 1)
        # From the cap on, errors fade by cap / (cap + 1) a view: cap + 1 of them add up.
        assert abs(confidence[cell] - x) <= rounding_of_mean(4 * (cap + 1))


@pytest.mark.parametrize("cap", [10, 20, 50, 100])
def test_capped_forgets_200_free_views_after_0_7_cap_nonfree_ones(cap: int) -> None:
    # x = 1 - 2 (cap / (cap + 1))^n reaches epsilon at this n, and log(2) = 0.69.
    needed = log(2 / (1 - EPSILON)) / log(1 + 1 / cap)
    assert 0.69 * cap < needed < 0.75 * cap + 1
    free = steady(-1.0, 200)
    almost, _ = fused(Capped(cap), np.concatenate([free, steady(1.0, ceil(needed) - 1)]))
    enough, count = fused(Capped(cap), np.concatenate([free, steady(1.0, ceil(needed))]))
    assert almost[0] < EPSILON <= enough[0]
    assert count[0] == cap


def test_the_average_never_forgets() -> None:
    # (n - 200) / (n + 200) reaches 0.01 at n = 204.04.
    free = steady(-1.0, 200)
    for n, nonfree in ((36, False), (204, False), (205, True)):
        confidence, _ = fused(Average(), np.concatenate([free, steady(1.0, n)]))
        assert (confidence[0] >= EPSILON) == nonfree


def views_until(rule: UpdateRule, before: Floats32, z: float) -> int:
    """Return after how many views with evidence `z` a cell has the sign of z."""
    confidence, count = fused(rule, before)
    for n in range(1, 1000):
        rule.update(confidence, count, steady(z, 1)[0])
        if confidence[0] * np.sign(z) >= EPSILON:
            return n
    raise AssertionError(f"{rule} does not change its mind")


@pytest.mark.parametrize(
    ("rule", "false_wall", "new_wall"),
    [
        (Average(), 4, 205),
        (Capped(50), 4, 36),
        (Capped(2), 2, 2),
        (Exponential(0.2), 4, 4),
        (Exponential(0.5), 2, 2),
        # 3 views add 3 ln(7/3), so 4 undo them; 200 views are clamped at 4.1 ln(7/3).
        (LogOdds(), 4, 5),
        (Absolute(), 1, 1),
    ],
    ids=str,
)
def test_views_until_a_false_wall_disappears_and_until_a_new_wall_appears(
    rule: UpdateRule, false_wall: int, new_wall: int
) -> None:
    assert views_until(rule, steady(1.0, 3), -1.0) == false_wall
    assert views_until(rule, steady(-1.0, 200), 1.0) == new_wall


@given(views, st.floats(0.01, 1.0))
def test_exponential_weighs_each_view_by_alpha_and_those_before_by_the_rest(
    z: Floats32, alpha: float
) -> None:
    confidence, count = fused(Exponential(alpha), z)
    for cell, column in enumerate(z.T.astype(np.float64)):
        said = column[column != 0]
        assert count[cell] == len(said)
        if len(said):
            weights = alpha * (1 - alpha) ** np.arange(len(said))[::-1]
            weights[0] = (1 - alpha) ** (len(said) - 1)
            assert abs(confidence[cell] - weights @ said) <= rounding_of_mean(4 * len(said))


@given(views, st.floats(0.55, 0.95), st.floats(0.55, 0.95))
def test_log_odds_multiplies_the_odds_of_all_views(
    z: Floats32, nonfree: float, free: float
) -> None:
    # Six views of at most ln 19 each stay below the clamp of this rule only if they are few.
    rule = LogOdds(nonfree, free, 0.999)
    confidence, count = fused(rule, z[:2])
    for cell, column in enumerate(z[:2].T.astype(np.float64)):
        odds = 1.0
        for value in column[column != 0]:
            right = nonfree if value > 0 else free
            p = (1 + value * (2 * right - 1)) / 2
            odds *= p / (1 - p)
        assert count[cell] == (column != 0).sum()
        assert confidence[cell] == pytest.approx((odds - 1) / (odds + 1), abs=1e-6)


@given(views)
def test_log_odds_never_exceed_their_clamp(z: Floats32) -> None:
    confidence, _ = fused(LogOdds(0.9, 0.9, 0.8), z)
    assert (np.abs(confidence) <= np.float32(0.6)).all()


@given(views)
def test_absolute_holds_the_newest_evidence(z: Floats32) -> None:
    confidence, _ = fused(Absolute(), z)
    for cell, column in enumerate(z.T):
        said = column[column != 0]
        assert confidence[cell] == (said[-1] if len(said) else 0.0)


@pytest.mark.parametrize("rule", EVERY_RULE, ids=str)
def test_one_view_does_not_outweigh_itself_except_with_perfect_data(rule: UpdateRule) -> None:
    one, two = fused(rule, steady(1.0, 1)), fused(rule, steady(1.0, 2))
    assert rule.outweighs_one_view(*one)[0] == isinstance(rule, Absolute)
    assert rule.outweighs_one_view(*two)[0]
    assert not rule.outweighs_one_view(*fused(rule, steady(-1.0, 5)))[0]


@pytest.mark.parametrize("alpha", [0.0, 1.1, -0.2, float("nan"), True, "much"])
def test_an_alpha_that_is_no_weight_is_refused(alpha: object) -> None:
    with pytest.raises(InputError, match=r"^alpha: expected a number above 0 and at most 1, got"):
        rule_from({"name": "exponential", "alpha": alpha})


@pytest.mark.parametrize("name", ["nonfree_probability", "free_probability", "most_probable"])
@pytest.mark.parametrize("value", [0.5, 1.0, float("nan"), True, "sure"])
def test_a_probability_without_information_or_doubt_is_refused(name: str, value: object) -> None:
    with pytest.raises(InputError, match=rf"^{name}: expected a probability above 0.5 and at most"):
        rule_from({"name": "log_odds", name: value})


def test_only_the_average_adds_up() -> None:
    assert [name for name, rule in RULES.items() if rule.mergeable] == ["average"]


@pytest.mark.parametrize("rule", [*EVERY_RULE, Capped(), LogOdds(0.9, 0.6, 0.99)])
def test_a_rule_comes_back_from_its_description(rule: UpdateRule) -> None:
    assert rule_from(rule.to_dict()) == rule
    assert type(rule_from(rule.to_dict())) is type(rule)


@pytest.mark.parametrize("described", [{"name": "mean"}, {}, {"cap": 5}])
def test_an_unknown_rule_is_refused_with_the_known_ones(described: dict[str, object]) -> None:
    with pytest.raises(
        InputError,
        match=r"^rule: expected one of average, capped, exponential, log_odds, absolute, got",
    ):
        rule_from(described)


@pytest.mark.parametrize("cap", [0, -1])
def test_a_cap_below_one_is_refused(cap: int) -> None:
    with pytest.raises(InputError, match=r"^cap: expected a count of 1 to 4294967295"):
        Capped(cap)


MOST = 2**32 - 1
counts = st.one_of(st.integers(0, 3), st.integers(MOST - 3, MOST), st.integers(0, MOST))
beliefs = st.floats(-1.0, 1.0, width=32)


def cell_of(confidence: float, count: int) -> tuple[Floats32, Counts]:
    return np.array([confidence], dtype=np.float32), np.array([count], dtype=np.uint32)


@given(beliefs, counts, beliefs, counts)
def test_merged_counts_stop_at_their_largest(a: float, k: int, b: float, n: int) -> None:
    confidence, count = cell_of(a, k)
    Average().merge(confidence, count, *cell_of(b, n))
    assert count[0] == min(k + n, MOST)
    mean = (k * a + n * b) / (k + n) if k + n else a
    assert confidence[0] == np.float32(a if n == 0 else mean)


@given(beliefs, counts, beliefs.filter(bool), st.one_of(st.just(MOST), st.integers(1, MOST)))
def test_counts_of_views_stop_at_their_largest(a: float, k: int, z: float, cap: int) -> None:
    others = [(rule, MOST) for rule in EVERY_RULE if not isinstance(rule, Capped)]
    for rule, most in (*others, (Capped(cap), cap)):
        confidence, count = cell_of(a, k)
        rule.update(confidence, count, np.array([z], dtype=np.float32))
        assert count[0] == max(k, min(k + 1, most))
        assert -1.0 <= confidence[0] <= 1.0


@pytest.mark.parametrize("cap", [2**32, 2**64, -(10**5000), 10**5000], ids=lambda n: n.bit_length())
def test_a_cap_that_no_count_reaches_is_refused(cap: int) -> None:
    with pytest.raises(
        InputError, match=r"^cap: expected a count of 1 to 4294967295, got .{1,20}$"
    ):
        Capped(cap)


@pytest.mark.parametrize("cap", [2**32, 2**64])
def test_a_setting_of_a_cap_that_no_count_reaches_is_refused(cap: int) -> None:
    with pytest.raises(
        SettingsError, match=r"^cap: expected less than or equal to 4294967295, got"
    ):
        MapperSettings(fusion="capped", cap=cap)


def test_a_cap_that_is_a_truth_value_is_refused() -> None:
    with pytest.raises(InputError, match=r"^cap: expected a count of 1 to 4294967295, got True"):
        Capped(True)
