"""Why one triangulates: what the comparison with the ray caster must show, on three rooms."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from groundmap.errors import InputError, SettingsError
from planners.compare.why import POINTS, SEGMENTS, Curve, Curves, compare_recall, random_room

ROOMS = 3


@pytest.fixture(scope="module")
def curves() -> Curves:
    return compare_recall(rooms=ROOMS, seed=2)


def at(curve: Curve, count: int) -> tuple[float, float]:
    """Return recall and false freespace with that many features."""
    (row,) = np.flatnonzero(curve.counts == count)
    return curve.free_recall[row], curve.false_free_beyond[row]


def test_segments_show_more_freespace_than_as_many_rays(curves: Curves) -> None:
    for count in (50, 100, 150):
        assert at(curves.segments, count)[0] > at(curves.rays, count)[0] + 0.1


def test_segments_show_as_much_freespace_as_twice_as_many_rays(curves: Curves) -> None:
    assert at(curves.segments, 50)[0] > at(curves.rays, 100)[0]
    assert at(curves.segments, 100)[0] > at(curves.rays, 200)[0]


def test_of_what_rays_claim_more_is_false(curves: Curves) -> None:
    # Rays pass over low boxes; the fan ends at the nearest surface.
    for count in (100, 300, 900):
        assert at(curves.rays, count)[1] > 1.5 * at(curves.points, count)[1]
    for count in SEGMENTS:
        assert at(curves.rays, count)[1] > at(curves.segments, count)[1]


def test_more_points_show_more_freespace(curves: Curves) -> None:
    up_to_300 = POINTS.index(300) + 1
    for curve in (curves.points, curves.rays):
        assert (np.diff(curve.free_recall[:up_to_300]) > 0).all()


def test_shares_are_shares(curves: Curves) -> None:
    for curve in curves:
        for shares in curve[1:]:
            assert shares.shape == curve.counts.shape
            assert ((shares >= 0) & (shares <= 1)).all()


def test_the_same_seed_gives_the_same_curves() -> None:
    first, second = (compare_recall(rooms=1, seed=5) for _ in range(2))
    np.testing.assert_array_equal(np.hstack(first), np.hstack(second))


def test_every_room_is_announced_once() -> None:
    seen: list[int] = []

    def watch(rooms: list[int]) -> list[int]:
        seen.extend(rooms)
        return rooms

    compare_recall(rooms=2, seed=5, watch=watch)
    assert seen == [0, 1]


def test_rooms_have_boxes_within_their_walls() -> None:
    for seed in range(50):
        room = random_room(np.random.default_rng(seed))
        walls, *boxes = room.solids
        assert 4 <= len(boxes) <= 8
        assert all(0.5 <= box.top <= 1.8 for box in boxes)
        inside = shapely.box(*room.bounds).buffer(1e-9)
        assert all(inside.covers(box.outline) for box in boxes)
        assert walls.outline.disjoint(inside.buffer(-1e-6))


def test_no_room_is_refused() -> None:
    with pytest.raises(InputError, match="rooms: expected 1 or more, got 0"):
        compare_recall(rooms=0)


def test_settings_are_checked_before_anything_is_made() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'link_length'"):
        compare_recall(link_lenght=1.0)
