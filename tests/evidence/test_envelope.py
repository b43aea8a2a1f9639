"""What bounds sight by bearing: nearest edges, supports, gaps; against many single bearings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats, Ints
from groundmap.evidence.ground_plane.kernels.envelope import join_envelopes, upper_envelope
from groundmap.evidence.ground_plane.kernels.lines import gap_chords
from oracles import farthest, inverse_ranges, sight_ranges
from oracles import gap_chords as all_chords
from strategies import rngs

DENSE = np.linspace(-np.pi, np.pi, 4001)[1:-1] + 1e-5


def random_edges(rng: np.random.Generator, count: int) -> Floats:
    """Edges (counter-clockwise, off the viewpoint) that don't cross the seam; many cross others."""
    ends = rng.uniform(-8.0, 8.0, size=(8 * count, 2, 2))
    bearing = np.arctan2(ends[..., 1], ends[..., 0])
    bearing.sort(axis=1)
    radius = rng.uniform(0.5, 9.0, size=bearing.shape)
    ends = radius[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    narrow: Floats = ends[bearing[:, 1] - bearing[:, 0] < 3.0][:count]
    return narrow


def by_bearing(ends: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Bearings of the ends, and a, b so that a cos t + b sin t is 1 at both ends / range."""
    t0, t1 = np.arctan2(ends[..., 1], ends[..., 0]).T
    a, b = np.linalg.solve(ends, np.ones((len(ends), 2, 1)))[..., 0].T
    return t0, t1, a.copy(), b.copy()


def at(bearings: Floats, low: Floats, high: Floats, edge: Ints) -> Ints:
    """Edge of the piece at each bearing, -1 for none."""
    inside = (low[:, None] <= bearings) & (bearings < high[:, None])
    assert (inside.sum(axis=0) <= 1).all()
    piece, bearing = np.nonzero(inside)
    found = np.full(len(bearings), -1)
    found[bearing] = edge[piece]
    return found


@settings(max_examples=150)
@given(rngs())
def test_the_envelope_is_the_largest_at_every_bearing(rng: np.random.Generator) -> None:
    ends = random_edges(rng, int(rng.integers(1, 20)))
    t0, t1, a, b = by_bearing(ends)
    low, high, edge = upper_envelope(t0, t1, a, b)
    inverse = inverse_ranges(ends, DENSE)
    covered = inverse.max(axis=0) > -np.inf
    found = at(DENSE, low, high, edge)
    np.testing.assert_array_equal(found >= 0, covered)
    own = inverse[found[covered], np.flatnonzero(covered)]
    np.testing.assert_allclose(own, inverse.max(axis=0)[covered], rtol=1e-9)


@settings(max_examples=150)
@given(rngs())
def test_pieces_are_in_order_and_lie_on_their_edges(rng: np.random.Generator) -> None:
    t0, t1, a, b = by_bearing(random_edges(rng, int(rng.integers(1, 20))))
    low, high, edge = upper_envelope(t0, t1, a, b)
    assert (low < high).all()
    assert (high[:-1] <= low[1:]).all()
    assert ((t0[edge] <= low) & (high <= t1[edge])).all()


@settings(max_examples=60)
@given(rngs())
def test_a_chain_of_edges_stays_a_chain(rng: np.random.Generator) -> None:
    bearing = np.sort(rng.uniform(-3.0, 3.0, size=rng.integers(3, 12)))
    radius = rng.uniform(1.0, 9.0, size=len(bearing))
    corners = radius[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    ends = np.stack([corners[:-1], corners[1:]], axis=1)
    order = rng.permutation(len(ends))
    low, high, edge = upper_envelope(*by_bearing(ends[order]))
    np.testing.assert_array_equal(order[edge], np.arange(len(ends)))
    np.testing.assert_array_equal(high[:-1], low[1:])


def test_crossing_edges_change_at_the_crossing() -> None:
    ends = np.array([[(1.0, -1.0), (3.0, 1.0)], [(3.0, -1.0), (1.0, 1.0)]])
    low, high, edge = upper_envelope(*by_bearing(ends))
    assert edge.tolist() == [0, 1]
    np.testing.assert_allclose([low[0], high[0], high[1]], [-np.pi / 4, 0.0, np.pi / 4])
    assert low[1] == high[0]


def test_no_edges_have_an_empty_envelope() -> None:
    none = np.empty(0)
    assert [len(part) for part in upper_envelope(none, none, none, none)] == [0, 0, 0]


class Joined(NamedTuple):
    """Nearest edges and farthest supports, and what joining them gives."""

    edges: Floats
    alone: Bools
    supports: Floats
    low: Floats
    high: Floats
    edge: Ints
    second: Bools


def joined(edges: Floats, alone: Bools, supports: Floats) -> Joined:
    t0, t1, a, b = by_bearing(edges)
    far_t0, far_t1, far_a, far_b = by_bearing(supports)
    nearest = upper_envelope(t0, t1, a, b)
    farthest = upper_envelope(far_t0, far_t1, -far_a, -far_b)
    found = join_envelopes(*nearest, alone, a, b, *farthest, far_a, far_b)
    return Joined(edges, alone, supports, *found)


def random_joined(rng: np.random.Generator, share_alone: float) -> Joined:
    edges, supports = (random_edges(rng, int(rng.integers(0, 12))) for _ in range(2))
    return joined(edges, rng.uniform(size=len(edges)) < share_alone, supports)


ALONE = st.sampled_from([0.0, 0.5, 1.0])


@settings(max_examples=200)
@given(rngs(), ALONE)
def test_edges_bound_alone_and_the_others_with_supports_the_nearer_of_both(
    rng: np.random.Generator, share_alone: float
) -> None:
    parts = random_joined(rng, share_alone)
    expected = sight_ranges(parts.edges, parts.alone, parts.supports, DENSE)
    piece = at(DENSE, parts.low, parts.high, np.arange(len(parts.low)))
    np.testing.assert_array_equal(piece >= 0, expected > 0)
    (spoken,) = np.nonzero(piece >= 0)
    edge, second = parts.edge[piece[spoken]], parts.second[piece[spoken]]
    inverse = np.empty(len(spoken))
    for ends, rows in ((parts.edges, ~second), (parts.supports, second)):
        inverse[rows] = inverse_ranges(ends, DENSE[spoken[rows]])[edge[rows], np.arange(rows.sum())]
    np.testing.assert_allclose(inverse * expected[spoken], 1.0, rtol=1e-9)


@settings(max_examples=200)
@given(rngs(), ALONE)
def test_joined_pieces_are_in_order_and_lie_on_what_they_are_of(
    rng: np.random.Generator, share_alone: float
) -> None:
    parts = random_joined(rng, share_alone)
    assert (parts.low < parts.high).all()
    assert (parts.high[:-1] <= parts.low[1:]).all()
    for ends, rows in ((parts.edges, ~parts.second), (parts.supports, parts.second)):
        t0, t1, _, _ = by_bearing(ends)
        edge = parts.edge[rows]
        assert ((t0[edge] <= parts.low[rows]) & (parts.high[rows] <= t1[edge])).all()


def test_an_edge_that_crosses_its_support_bounds_up_to_the_crossing() -> None:
    edge = np.array([[(1.0, -1.0), (3.0, 1.0)]])
    support = np.array([[(3.0, -1.0), (1.0, 1.0)]])
    parts = joined(edge, np.array([False]), support)
    # The support begins behind the edge and ends before it; from -45 degrees on there is no edge.
    slope = np.arctan2(1.0, 3.0)
    np.testing.assert_allclose(parts.low, [-slope, 0.0, slope], atol=1e-12)
    np.testing.assert_allclose(parts.high, [0.0, slope, np.pi / 4], atol=1e-12)
    assert parts.second.tolist() == [False, True, True]
    alone = joined(edge, np.array([True]), support)
    np.testing.assert_allclose(alone.low, [-np.pi / 4, slope])
    assert alone.second.tolist() == [False, True]


def test_an_edge_that_does_not_stand_alone_says_nothing_without_support() -> None:
    edge = np.array([[(4.0, -1.0), (4.0, 1.0)]])
    assert len(joined(edge, np.array([False]), np.empty((0, 2, 2))).low) == 0
    assert joined(edge, np.array([True]), np.empty((0, 2, 2))).second.tolist() == [False]


@pytest.mark.parametrize("gap", [1e-3, 1e-9])
@pytest.mark.parametrize("alone", [False, True])
def test_narrow_gaps_are_filled(gap: float, alone: bool) -> None:
    low, high = np.array([0.0, 1.0 + gap]), np.array([1.0, 2.0])
    nearest = (low, high, np.array([0, 1]), np.full(2, alone), np.full(2, 2.0), np.full(2, 2.0))
    behind = (np.array([-0.5]), np.array([2.2]), np.array([7]), np.full(8, 0.1), np.full(8, 0.2))
    out_low, out_high, edge, second = join_envelopes(*nearest, *behind)
    assert edge.tolist() == [7, 0, 7, 1, 7]
    assert second.tolist() == [True, False, True, False, True]
    np.testing.assert_array_equal(out_high[:-1], out_low[1:])


# Gaps between lines of sight


def random_lines(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Bearings, ascending, some equal, and ranges, some equal."""
    count = int(rng.integers(0, 25))
    bearings = rng.uniform(-3.1, 3.1, size=count) * rng.choice([0.1, 0.5, 1.0])
    ranges = rng.uniform(0.5, 12.0, size=count)
    if count > 4:
        bearings[1], ranges[3] = bearings[0], ranges[2]
    order = np.argsort(bearings, kind="stable")
    return bearings[order], ranges[order]


@settings(max_examples=200)
@given(rngs(), st.sampled_from([0.0, 0.3, 0.8, 3.0]))
def test_neighbours_say_what_all_pairs_of_lines_say(
    rng: np.random.Generator, widest: float
) -> None:
    bearings, ranges = random_lines(rng)
    ts = rng.uniform(-np.pi, np.pi, size=400)
    np.testing.assert_allclose(
        farthest(gap_chords(bearings, ranges, np.zeros(len(ranges)), 1.0, widest)[0], ts),
        farthest(all_chords(bearings, ranges, widest), ts),
        rtol=1e-9,
    )


@settings(max_examples=200)
@given(rngs(), st.sampled_from([0.3, 0.8, 3.0]))
def test_a_place_is_vouched_for_if_the_lines_beside_it_are_near_enough_there(
    rng: np.random.Generator, widest: float
) -> None:
    bearings, ranges = random_lines(rng)
    ts, rhos = rng.uniform(-3.1, 3.1, size=300), rng.uniform(0.05, 12.0, size=300)
    reached = farthest(gap_chords(bearings, ranges, np.zeros(len(ranges)), 1.0, widest)[0], ts)
    for t, rho, range_ in zip(ts, rhos, reached, strict=True):
        right, left = (
            bearings[(ranges >= rho) & (bearings <= t)],
            bearings[(ranges >= rho) & (bearings > t)],
        )
        gap = left.min() - right.max() if len(left) and len(right) else np.inf
        vouched = gap < 1.5 and 2 * rho * np.sin(gap / 2) <= widest
        # A chord is nearer than the arc between its ends, by the cosine of half the gap at most.
        if range_ >= rho:
            assert vouched
        if vouched:
            assert range_ >= rho * np.cos(gap / 2) - 1e-9


def test_chords_turn_counter_clockwise() -> None:
    bearings, ranges = random_lines(np.random.default_rng(1))
    chords, _ = gap_chords(bearings, ranges, np.zeros(len(ranges)), 1.0, 0.8)
    assert len(chords) > 10
    first, last = np.moveaxis(chords, 1, 0)
    assert (first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0] > 0).all()


@settings(max_examples=100)
@given(rngs(), st.sampled_from([0.3, 3.0]))
def test_the_ends_of_a_chord_are_on_its_lines_of_sight(
    rng: np.random.Generator, widest: float
) -> None:
    bearings, ranges = random_lines(rng)
    heights, eye = rng.uniform(0.0, 1.0, size=len(ranges)), float(rng.uniform(0.5, 2.0))
    chords, ends = gap_chords(bearings, ranges, heights, eye, widest)
    for (x, y), height in zip(chords.reshape(-1, 2), ends.reshape(-1), strict=True):
        on_line = np.abs(np.arctan2(y, x) - bearings) < 1e-9
        shares = np.hypot(x, y) / ranges[on_line]
        there = eye * (1 - shares) + shares * heights[on_line]
        assert np.abs(there - height).min() < 1e-9
