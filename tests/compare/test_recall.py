"""The comparison with the ray caster on four rooms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from groundmap.draw import draw_curves
from groundmap.errors import InputError, SettingsError
from planners.compare.recall import POINTS, Curve, Curves, compare_recall, random_room

ROOMS = 4
# What makes the fan more than its lines of sight. Links bound freespace: they add none.
BROKEN = {
    "no gaps": {"sight_gap": 0.0, "support_angle": 1e-6},
    "neither": {"link_length": 0.0, "link_angle": 0.0, "sight_gap": 0.0, "support_angle": 1e-6},
}


@pytest.fixture(scope="module")
def curves() -> Curves:
    return compare_recall(rooms=ROOMS, seed=2)


def at(curve: Curve, count: int) -> tuple[float, float]:
    """Return recall and false freespace with that many features."""
    (row,) = np.flatnonzero(curve.counts == count)
    return curve.free_recall[row], curve.false_free_beyond[row]


def margins(curves: Curves) -> dict[str, float]:
    """Return by how much recall exceeds that of more rays, by the claim."""
    points, segments, rays = curves
    return {
        "50 points, 150 rays": at(points, 50)[0] - at(rays, 150)[0],
        "100 points, 300 rays": at(points, 100)[0] - at(rays, 300)[0],
        "300 points, 300 rays": at(points, 300)[0] - at(rays, 300)[0] - 0.05,
        "50 segments, 200 rays": at(segments, 50)[0] - at(rays, 200)[0],
        "150 segments, 600 rays": at(segments, 150)[0] - at(rays, 600)[0],
    }


def test_the_fan_finds_more_than_several_times_as_many_rays(curves: Curves) -> None:
    assert min(margins(curves).values()) > 0.01, margins(curves)


@pytest.mark.parametrize("settings", BROKEN.values(), ids=BROKEN)
def test_a_fan_that_fills_no_gaps_finds_less(settings: dict[str, Any]) -> None:
    broken = margins(compare_recall(rooms=1, seed=2, **settings))
    assert max(broken.values()) < -0.02, broken


def test_rays_have_more_false_freespace(curves: Curves) -> None:
    # Rays pass over low boxes; the fan ends at the nearest surface.
    for count in (300, 900):
        assert at(curves.rays, count)[1] > 1.5 * at(curves.points, count)[1]


def test_the_fan_has_no_freespace_behind_boxes_as_high_as_the_camera() -> None:
    high = compare_recall(rooms=1, seed=2, lowest_box=1.0)
    assert max(high.points.false_free_beyond.max(), high.segments.false_free_beyond.max()) < 1e-3


def test_features_can_be_evenly_spread_over_the_image() -> None:
    image = compare_recall(rooms=1, seed=2, spread="image", resolution=0.1524)
    surfaces = compare_recall(rooms=1, seed=2, resolution=0.1524)
    assert at(image.points, 100)[0] < at(surfaces.points, 100)[0]


def test_more_points_show_more_freespace(curves: Curves) -> None:
    up_to_300 = POINTS.index(300) + 1
    for curve in (curves.points, curves.rays):
        assert (np.diff(curve.free_recall[:up_to_300]) > 0).all()


def test_shares_are_between_0_and_1(curves: Curves) -> None:
    for curve in curves:
        for shares in curve[1:]:
            assert shares.shape == curve.counts.shape
            assert ((shares >= 0) & (shares <= 1)).all()


def test_the_same_seed_gives_the_same_curves() -> None:
    first, second = (compare_recall(rooms=1, seed=5) for _ in range(2))
    np.testing.assert_array_equal(np.hstack(first), np.hstack(second))


def test_watch_receives_every_room_once() -> None:
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


def test_an_unknown_spread_is_refused() -> None:
    with pytest.raises(InputError, match="spread: expected surfaces or image, got 'sky'"):
        compare_recall(spread="sky")  # type: ignore[arg-type]


@pytest.mark.parametrize("height", [0.0, 1.9, np.nan])
def test_a_lowest_box_higher_than_the_highest_is_refused(height: float) -> None:
    with pytest.raises(InputError, match=r"lowest_box: expected above 0, up to 1\.8"):
        compare_recall(lowest_box=height)


def test_settings_are_checked_before_rooms_are_generated() -> None:
    with pytest.raises(SettingsError, match="Did you mean 'link_length'"):
        compare_recall(link_lenght=1.0)


def axes() -> tuple[Axes, Axes]:
    left, right = Figure().subplots(1, 2)
    return left, right


def test_curves_are_drawn_unchanged() -> None:
    ax = axes()
    rows: dict[str, list[list[float]]] = {
        "fan": [[50, 100, 110], [0.5, 0.6, 0.7], [0.0, 0.1, 0.2]],
        "rays": [[50, 100, 300], [0.1, 0.2, 0.3], [0.3, 0.2, 0.1]],
    }
    lines = draw_curves(rows, ax=ax)
    assert len(lines) == 4
    for row, axis in enumerate(ax, start=1):
        assert [line.get_label() for line in axis.lines] == ["fan", "rays"]
        for line, values in zip(axis.lines, rows.values(), strict=True):
            assert isinstance(line, Line2D)
            np.testing.assert_array_equal(line.get_xdata(), values[0])
            np.testing.assert_array_equal(line.get_ydata(), values[row])
        assert axis.get_xscale() == "log"
        assert axis.get_xlabel() == "features in the view"
        # 110 has no room beside 100.
        assert [tick.get_text() for tick in axis.get_xticklabels()] == ["50", "100", "300"]
        legend = axis.get_legend()
        assert legend is not None
        assert [text.get_text() for text in legend.get_texts()] == ["fan", "rays"]


def test_invalid_curves_are_refused() -> None:
    with pytest.raises(InputError, match="fan"):
        draw_curves({"fan": [[1.0, 2.0]]}, ax=axes())
    with pytest.raises(InputError, match="fan"):
        draw_curves({"fan": [[1.0], [np.nan], [0.0]]}, ax=axes())
