"""Upper envelopes of edges by bearing, against a maximum over many bearings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from groundmap.arrays import Floats, Ints
from groundmap.kernels.envelope import fill_gaps, upper_envelope
from oracles import inverse_ranges
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


@settings(max_examples=100)
@given(rngs())
def test_a_second_envelope_speaks_only_in_the_gaps_of_the_first(rng: np.random.Generator) -> None:
    first = upper_envelope(*by_bearing(random_edges(rng, int(rng.integers(0, 6)))))
    second = upper_envelope(*by_bearing(random_edges(rng, int(rng.integers(0, 6)))))
    low, high, edge, from_second = fill_gaps(*first, *second)
    assert (low < high).all()
    assert (high[:-1] <= low[1:]).all()
    ours, theirs = at(DENSE, *first), at(DENSE, *second)
    np.testing.assert_array_equal(at(DENSE, low, high, edge), np.where(ours >= 0, ours, theirs))
    np.testing.assert_array_equal(
        at(DENSE, low, high, from_second.astype(np.int64)) == 1, (ours < 0) & (theirs >= 0)
    )


@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_narrow_gaps_are_filled(gap: float) -> None:
    first = (np.array([0.0, 1.0 + gap]), np.array([1.0, 2.0]), np.array([0, 1]))
    second = (np.array([-1.0]), np.array([3.0]), np.array([7]))
    low, high, edge, from_second = fill_gaps(*first, *second)
    assert edge.tolist() == [7, 0, 7, 1, 7]
    assert from_second.tolist() == [True, False, True, False, True]
    np.testing.assert_array_equal(high[:-1], low[1:])
