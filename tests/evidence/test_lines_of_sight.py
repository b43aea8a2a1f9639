"""Lines of sight: surfaces that are seen through, and the gaps that are seen as a whole."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundmap.arrays import Bools, Floats
from groundmap.evidence.ground_plane.free_support import support_chords
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.lines import count_contradicting
from groundmap.evidence.ground_plane.missing_ground import missing_ground
from groundmap.evidence.ground_plane.see_through import Contradictions, contradictions
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces, find_surfaces
from groundmap.evidence.ground_plane.visibility import NO_SURFACE, SightFan, visible_freespace
from groundmap.evidence.triangulation import triangulate
from groundmap.settings import MapperSettings
from oracles import counted_against, farthest, peak_memory, places_without_ground, usual_gap
from oracles import gap_chords as all_chords
from oracles import support_chords as single_chords
from strategies import Cloud, flat_view, rngs, rooms

SHARP = MapperSettings(uncertainty="none", halo=0.0)
MADE_OF = np.array([2.0, 2.0, 1.0, 1.0])  # features: segment, link, lone point, doubtful link


def surfaces_of(ground_view: GroundView, options: MapperSettings = SHARP) -> Surfaces:
    return find_surfaces(
        ground_view, triangulate(ground_view.points, ground_view.segments), options
    )


def doubts(ground_view: GroundView, options: MapperSettings = SHARP) -> Contradictions:
    return contradictions(ground_view, surfaces_of(ground_view, options))


def sight(ground_view: GroundView, options: MapperSettings = SHARP, bearing: float = 0.0) -> float:
    """Range up to which freespace is seen at a bearing."""
    fan = visible_freespace(ground_view, surfaces_of(ground_view, options), options)
    return float(farthest(fan.ends, np.array([bearing]))[0])


# Counting


def crowd(room: Cloud, rng: np.random.Generator) -> GroundView:
    """A room of low and high obstacles with ground around, as uncertain as a stereo rig's."""
    ground = rng.uniform(-12.0, 12.0, size=(rng.integers(0, 30), 2))
    ground = ground[np.hypot(*ground.T) > 0.3]
    ground_view = flat_view(
        room.points,
        room.segments,
        heights=rng.uniform(0.0, 1.9, size=len(room.points)),
        covariance=(0.005 * (room.points**2).sum(axis=1) * rng.uniform()) ** 2,
        supports=ground,
        support_heights=rng.uniform(-0.1, 0.1, size=len(ground)),
        camera_height=float(rng.uniform(0.5, 2.0)),
    )
    # Some rows of ground are samples of one segment.
    feature = ground_view.feature.copy()
    sampled = feature[len(room.points) :]
    sampled[:] = sampled // rng.integers(1, 5) + len(room.points)
    return ground_view._replace(feature=feature)


@settings(max_examples=150)
@given(rooms(), rngs())
def test_each_surface_is_contradicted_by_the_features_seen_through_it(
    room: Cloud, rng: np.random.Generator
) -> None:
    ground_view = crowd(room, rng)
    surfaces = surfaces_of(ground_view, MapperSettings())
    found = contradictions(ground_view, surfaces)
    # A feature right behind the end of a surface may be counted or not.
    (fewest, sure), (most, perhaps) = (
        counted_against(ground_view, surfaces, slack) for slack in (-1e-9, 1e-9)
    )
    assert (fewest - 1e-9 <= found.against).all()
    assert (found.against <= most + 1e-9).all()
    firm = np.flatnonzero(surfaces.kind != SurfaceKind.DOUBTFUL)
    assert len(set().union(*(sure[row] for row in firm))) <= found.features
    assert found.features <= len(set().union(*(perhaps[row] for row in firm)))


@settings(max_examples=60)
@given(rooms(), rngs())
def test_belief_is_whole_unless_outnumbered_and_else_the_share_of_those_who_make_it(
    room: Cloud, rng: np.random.Generator
) -> None:
    ground_view = crowd(room, rng)
    surfaces = surfaces_of(ground_view, MapperSettings())
    found = contradictions(ground_view, surfaces)
    made = MADE_OF[surfaces.kind]
    outnumbered = found.against > made
    np.testing.assert_array_equal(found.hiding, ~outnumbered)
    assert (found.belief[~outnumbered] == 1.0).all()
    share = made / (made + found.against)
    np.testing.assert_allclose(found.belief[outnumbered], share[outnumbered])
    assert (found.belief[outnumbered] < 0.5).all()


@settings(max_examples=60)
@given(rooms(), rngs())
def test_the_order_of_the_features_does_not_change_what_contradicts(
    room: Cloud, rng: np.random.Generator
) -> None:
    ground_view = crowd(room, rng)
    surfaces = surfaces_of(ground_view)
    order = rng.permutation(len(ground_view.supports))
    feature = ground_view.feature.copy()
    feature[len(ground_view.points) :] = feature[len(ground_view.points) :][order]
    shuffled = ground_view._replace(
        supports=ground_view.supports[order],
        support_heights=ground_view.support_heights[order],
        feature=feature,
    )
    one, other = contradictions(ground_view, surfaces), contradictions(shuffled, surfaces)
    np.testing.assert_allclose(one.against, other.against)
    assert one.features == other.features


class Passed(NamedTuple):
    against: Floats
    passes: Bools


def passed(
    ends: npt.ArrayLike,
    points: list[tuple[float, float]],
    heights: list[float],
    *,
    reach: float = 0.0,
    top: float = 1.5,
    below: float = 0.0,
) -> Passed:
    """What the kernel counts for one surface, seen from 1 m up."""
    places = np.array(points)
    bearings = np.arctan2(places[:, 1], places[:, 0])
    order = np.argsort(bearings)
    against, passes = np.zeros(1), np.zeros(len(points), dtype=np.bool_)
    count_contradicting(
        np.array([ends], dtype=np.float64),
        np.full((1, 2), reach),
        np.full((1, 2), top),
        bearings[order],
        places[order],
        np.array(heights)[order],
        np.ones(len(points)),
        1.0,
        0.05,
        below,
        against,
        passes,
    )
    return Passed(against, passes)


@pytest.mark.parametrize(
    "ends",
    [
        [(4.0, 0.0), (4.0, 0.0)],  # no length
        [(4.0, 1.0), (8.0, 2.0)],  # end-on
        [(4.1, 1.3), (8.2, 2.6)],  # end-on, as far as rounding lets it
        [(-4.0, 1.0), (-4.0, -1.0)],  # across the seam
    ],
)
def test_nothing_is_seen_through_a_surface_that_covers_no_bearing_ahead(
    ends: list[tuple[float, float]],
) -> None:
    behind = [(2 * x, 2 * y) for x, y in ends] + [(12.0, 3.0), (8.2, 2.6), (12.3, 3.9)]
    assert passed(ends, behind, [0.0] * len(behind)).against.tolist() == [0.0]


@pytest.mark.parametrize(("behind", "count"), [(0.04, 0), (0.06, 1)])
@pytest.mark.parametrize("reach", [0.0, 0.3])
def test_a_feature_within_twice_the_reach_is_on_the_surface(
    behind: float, count: int, reach: float
) -> None:
    found = passed([(4, -1), (4, 1)], [(4.0 + 2 * reach + behind, 0.0)], [0.5], reach=reach)
    assert found.against.tolist() == [count]
    assert found.passes.tolist() == [bool(count)]


@pytest.mark.parametrize(("below", "height", "count"), [(0.05, 0.94, 1), (0.05, 0.96, 0)])
@pytest.mark.parametrize("margin", [True, False])
def test_sight_that_passes_a_little_below_a_top_may_have_passed_over_it(
    below: float, height: float, count: int, margin: bool
) -> None:
    # Half-way to a feature of height 2 h - 1, sight from 1 m up is at h; the top is 1 m.
    found = passed(
        [(4, -1), (4, 1)], [(8.0, 0.0)], [2 * height - 1], top=1.0, below=below if margin else 0.0
    )
    assert found.against.tolist() == [count if margin else 1.0]


@pytest.mark.parametrize(("beside", "count"), [(0.0, 1), (0.018, 1), (-0.018, 1), (0.022, 0)])
def test_only_what_is_seen_through_the_thinnest_pole_contradicts_a_lone_point(
    beside: float, count: int
) -> None:
    ground_view = flat_view([(4.0, 0.0)], heights=1.5, supports=[(8.0, 2 * beside)])
    assert doubts(ground_view).against.tolist() == [count]
    assert SHARP.resolution / 2 > 0.022  # though its disc hides more


@pytest.mark.parametrize(("height", "firm", "doubtful"), [(0.85, 1, 1), (0.95, 0, 1), (1.05, 0, 0)])
def test_a_doubtful_surface_has_no_margin_below_its_top(
    height: float, firm: int, doubtful: int
) -> None:
    ground_view = flat_view(
        [(4.0, 0.0)], heights=1.0, supports=[(8.0, 0.01)], support_heights=height
    )
    surfaces = surfaces_of(ground_view, MapperSettings(uncertainty="none"))
    found = contradictions(ground_view, surfaces)
    beside = surfaces.kind == SurfaceKind.DOUBTFUL
    assert found.against[~beside].tolist() == [firm]
    assert sorted(found.against[beside].tolist()) == [0, doubtful]  # the right half, the left one
    assert found.features == firm


# A hedge or a ghost 4 m ahead, a wall 8 m ahead; the camera is 1 m up.
AHEAD = [(4.0, -1.0), (4.0, 1.0), (8.0, -3.0), (8.0, 3.0)]
TWO_WALLS = [(0, 1), (2, 3)]


def count_seen_through(
    heights: list[float], extra: list[tuple[float, float]], extra_heights: list[float]
) -> int:
    """Count for two walls with those tops and points beside them."""
    return doubts(flat_view(AHEAD + extra, TWO_WALLS, heights=heights + extra_heights)).features


def test_a_wall_seen_over_a_hedge_is_not_seen_through_it() -> None:
    # From 1.0 m up, over a hedge of 0.5 m, the ray at 8 m is at or above 0 m.
    assert count_seen_through([0.5, 0.5, 1.8, 1.8], [(8.0, 0.0)], [0.2]) == 0


def test_a_wall_seen_through_a_ghost_is_counted_once_per_feature() -> None:
    # The ray to a point 1.4 m up is at 1.2 m where the ghost is 1.8 m high.
    assert count_seen_through([1.8, 1.8, 1.8, 1.8], [(8.0, 0.0)], [1.4]) == 1
    through = [(8.0, -0.5), (8.0, 0.0), (8.0, 0.5)]
    assert count_seen_through([1.8, 1.8, 1.8, 1.8], through, [1.4, 1.4, 1.4]) == 3


def test_a_feature_seen_through_two_surfaces_is_one_that_contradicts_both() -> None:
    ghosts = [(4.0, -1.0), (4.0, 1.0), (5.0, -1.0), (5.0, 1.0)]
    ground_view = flat_view(ghosts, TWO_WALLS, heights=1.0, supports=[(9.0, 0.0)])
    found = doubts(ground_view)
    assert found.features == 1
    walls = surfaces_of(ground_view).kind == SurfaceKind.SEGMENT
    assert found.against[walls].tolist() == [1.0, 1.0]


def test_a_segment_seen_through_a_ghost_is_one_feature() -> None:
    ground_view = flat_view(
        [*AHEAD, (7.0, -0.5), (7.0, 0.5)], [*TWO_WALLS, (4, 5)], heights=[1.8] * 4 + [1.2] * 2
    )
    found = doubts(ground_view)
    assert found.features == 1
    assert found.against.tolist() == [1.0, 0.0, 0.0]


def test_half_a_segment_seen_through_a_ghost_is_half_a_contradiction() -> None:
    ground_view = flat_view(
        [*AHEAD[:2], (7.0, 0.5), (7.0, 5.5)], [(0, 1), (2, 3)], heights=[1.8] * 2 + [1.2] * 2
    )
    assert doubts(ground_view).against.tolist() == [0.5, 0.0]


@pytest.mark.parametrize(("height", "count"), [(0.89, 1), (0.91, 0)])
def test_the_line_of_sight_is_compared_with_the_top_where_it_passes(
    height: float, count: int
) -> None:
    # A top that falls from 1.5 m to 0.5 m is 1.0 m high in the middle, where a ray to a point
    # of `height` at twice the range passes at the mean of 1.0 m and `height`: 0.05 m lower is
    # below it.
    assert count_seen_through([1.5, 0.5, 1.8, 1.8], [(8.0, 0.0)], [height]) == count


def test_features_beside_or_in_front_of_a_surface_are_not_seen_through_it() -> None:
    assert count_seen_through([1.8] * 4, [(2.0, 0.0), (8.0, 2.5), (4.0, 0.0)], [0.5] * 3) == 0


def test_ground_seen_through_a_wall_is_counted() -> None:
    ground_view = flat_view(
        AHEAD[:2], TWO_WALLS[:1], heights=1.5, supports=[(6.0, 0.0), (3.0, 0.0)]
    )
    assert doubts(ground_view).features == 1


def test_ground_seen_over_a_kerb_is_not_seen_through_it() -> None:
    ground_view = flat_view(AHEAD[:2], TWO_WALLS[:1], heights=0.2, supports=[(6.0, 0.0)])
    assert doubts(ground_view).against.tolist() == [0.0]
    assert doubts(ground_view).features == 0


def test_nothing_is_seen_through_without_surfaces_or_features() -> None:
    for ground_view in (flat_view(supports=[(6.0, 0.0), (3.0, 0.0)]), flat_view()):
        found = doubts(ground_view)
        assert (len(found.against), len(found.hiding), found.features) == (0, 0, 0)


# What outnumbers

GROUND = [(8.0, -0.02), (8.0, 0.0), (8.0, 0.02), (8.0, 0.04)]


@pytest.mark.parametrize(("through", "range_"), [(0, 3.0), (1, 3.0), (2, 9.0), (4, 9.0)])
def test_two_features_seen_through_a_lone_point_open_it_and_one_does_not(
    through: int, range_: float
) -> None:
    # A stone, or a ghost, 3 m ahead and 0.8 m high; a wall 9 m ahead.
    places = [(3.0, 0.0), (9.0, -4.0), (9.0, 4.0)]
    ground_view = flat_view(places, [(1, 2)], heights=[0.45, 0.1, 0.1], supports=GROUND[:through])
    ground_view = ground_view._replace(support_heights=np.full(through, -1.0))
    assert sight(ground_view) == pytest.approx(range_)
    found = doubts(ground_view)
    assert found.hiding.tolist() == [True, through < 2]
    assert found.belief[1] == (1.0 if through < 2 else 1.0 / (1.0 + through))


@pytest.mark.parametrize(("through", "opens"), [(2, False), (3, True)])
@pytest.mark.parametrize("kind", [SurfaceKind.SEGMENT, SurfaceKind.LINK])
def test_it_takes_three_features_to_open_what_two_make_up(
    through: int, opens: bool, kind: SurfaceKind
) -> None:
    segments = [(0, 1)] if kind == SurfaceKind.SEGMENT else []
    ground_view = flat_view([(4, -0.2), (4, 0.2)], segments, heights=1.5, supports=GROUND[:through])
    assert surfaces_of(ground_view).kind.tolist() == [kind]
    found = doubts(ground_view)
    assert found.against.tolist() == [through]
    assert found.hiding.tolist() == [not opens]


def test_a_wall_is_not_contradicted_by_the_many_features_seen_over_it() -> None:
    rng = np.random.default_rng(3)
    over = np.column_stack([np.full(50, 9.0), rng.uniform(-1.5, 1.5, size=50)])
    ground_view = flat_view(
        [(4.0, -1.0), (4.0, 1.0), *over.tolist()], [(0, 1)], heights=[0.5, 0.5, *[0.4] * 50]
    )
    assert doubts(ground_view).features == 0
    assert sight(ground_view) == pytest.approx(4.0)


def test_a_pole_with_nothing_seen_through_it_hides_though_all_around_is_seen() -> None:
    around = [(9.0, y) for y in (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)]
    ground_view = flat_view([(4.0, 0.0)], heights=0.45, supports=around)
    found = doubts(ground_view)
    assert (found.against.tolist(), found.belief.tolist(), found.features) == ([0.0], [1.0], 0)
    assert sight(ground_view) == pytest.approx(4.0)


@pytest.mark.parametrize(("through", "range_"), [(0, 10.0 / 3.0), (1, 5.0), (2, 9.0)])
def test_a_doubtful_link_closes_what_nothing_is_seen_through(through: int, range_: float) -> None:
    # Two posts 1.2 m apart: a wall without texture between them, or an open door.
    places = [(5.0, -0.6), (5.0, 0.6), (9.0, -4.0), (9.0, 4.0)]
    ground_view = flat_view(
        places, [(2, 3)], heights=0.45, supports=[(5.5, -0.2), (5.5, 0.1)][:through]
    )
    found, surfaces = doubts(ground_view), surfaces_of(ground_view)
    link = surfaces.kind == SurfaceKind.DOUBTFUL
    assert link.sum() == 1
    assert found.against[link] == through
    assert found.hiding[link] == (through < 2)
    assert found.features == 0  # a link that is not believed is not contradicted either
    # It ends sight, but grants nothing: the lines to the posts do, and the ground beyond.
    assert sight(ground_view) == pytest.approx(range_)


@pytest.mark.parametrize(("through", "range_"), [(0, 0.0), (1, 4.0), (2, 8.0)])
def test_beside_a_feature_sight_ends_unless_more_is_seen_there(through: int, range_: float) -> None:
    # Ground 8 m ahead is seen 0.12 m to the left of a pole 4 m ahead.
    options = MapperSettings(uncertainty="none", sight_gap=0.0)
    behind = [(8.0, 0.24), (8.0, 0.23)][:through]
    ground_view = flat_view([(4.0, 0.0)], heights=1.5, supports=behind)
    found = sight(ground_view, options, bearing=0.03)
    assert found == pytest.approx(range_, abs=0.02)
    if through:
        without = MapperSettings(uncertainty="none", sight_gap=0.0, halo=0.0)
        assert sight(ground_view, without, bearing=0.03) == pytest.approx(8.0, abs=0.02)


# What is granted


@settings(max_examples=100)
@given(rngs(), st.floats(0.2, 2.0), st.floats(0.0, 1.0))
def test_a_ground_feature_vouches_for_what_both_images_see(
    rng: np.random.Generator, border: float, baseline: float
) -> None:
    options = MapperSettings(sight_gap=0.0)
    supports = rng.uniform((0.4, -8.0), (9.0, 8.0), size=(20, 2))
    ground_view = flat_view(supports=supports, border=border, baseline=baseline)
    found = support_chords(ground_view, options).chords[:20]  # no gap lies between lines of sight
    expected = single_chords(ground_view, options.support_width, options.support_angle)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    for place, chord in zip(supports, found, strict=True):
        for x, y in chord:
            at_feature = np.hypot(x - place[0], y - place[1]) < 1e-9
            in_both = y >= -border * x - 1e-9 and y + baseline <= border * x + 1e-9
            # Of one end only that is beyond the border is the feature's own.
            assert in_both or at_feature or chord_is_beyond(place, (x, y), border, baseline)


def chord_is_beyond(
    place: Floats, end: tuple[float, float], border: float, baseline: float
) -> bool:
    """Whether an end is on the inner side of a feature that is itself beyond a border."""
    left = place[1] + baseline > border * place[0]
    right = place[1] < -border * place[0]
    turn = place[0] * end[1] - place[1] * end[0]
    return bool((left and turn <= 1e-9) or (right and turn >= -1e-9))


def test_at_an_images_border_a_ground_feature_vouches_inwards_only() -> None:
    at_border = 0.5  # of 0.5 m per metre
    for side, reach in ((1.0, (4.98, 0.0)), (-1.0, (4.98, 0.0))):
        bearing = side * np.arctan(at_border)
        place = 5.0 * np.array([np.cos(bearing), np.sin(bearing)])
        ground_view = flat_view(supports=[place], border=at_border)
        inner, outer = (sight(ground_view, bearing=bearing - side * off) for off in (0.02, -0.02))
        assert (inner, outer) == pytest.approx(reach, abs=0.03)


@settings(max_examples=100)
@given(rngs(), st.sampled_from(["ellipsoid", "gaussian", "radius", "none"]))
def test_lines_to_low_obstacles_count_as_far_as_surely_before_them(
    rng: np.random.Generator, model: Literal["ellipsoid", "gaussian", "radius", "none"]
) -> None:
    options = MapperSettings(uncertainty=model, support_angle=1e-9)
    points = rng.uniform((0.4, -4.0), (9.0, 4.0), size=(12, 2))
    sigma = rng.uniform(0.0, 0.5, size=12)
    ground_view = flat_view(
        points,
        heights=rng.uniform(0.2, 1.2, size=12),
        covariance=sigma**2,
        supports=rng.uniform((0.4, -4.0), (9.0, 4.0), size=(6, 2)),
        camera_height=1.4,
    )
    low = ground_view.heights <= 0.7
    reach = np.where(model == "none", 0.0, 2.0 * sigma[low])
    lines = np.concatenate([ground_view.supports, points[low]])
    ranges = np.hypot(*lines.T) - np.append(np.zeros(6), reach)
    kept = ranges > 0.3
    bearings = np.arctan2(lines[kept, 1], lines[kept, 0])
    ts = rng.uniform(-1.5, 1.5, size=300)
    np.testing.assert_allclose(
        farthest(support_chords(ground_view, options).chords, ts),
        farthest(
            all_chords(bearings, ranges[kept], usual_gap(bearings, ranges[kept], 1e-9, 0.8)), ts
        ),
        rtol=1e-9,
    )


# A wall 6 m ahead, seen from 1 m up


def reaches(fan: SightFan, bearing: float = 0.0) -> float:
    return float(farthest(fan.ends, np.array([bearing]))[0])


def seen(ground_view: GroundView, options: MapperSettings = SHARP) -> SightFan:
    return visible_freespace(ground_view, surfaces_of(ground_view, options), options)


WALL = [(6.0, -2.0), (6.0, 2.0)]


def test_a_wall_seen_high_up_only_grants_nothing() -> None:
    fan = seen(flat_view(WALL, [(0, 1)], heights=0.6))
    assert len(fan.ends) == 0
    granted = seen(flat_view(WALL, [(0, 1)], heights=0.5))
    assert reaches(granted) == pytest.approx(6.0)


def test_a_wall_seen_low_at_one_end_grants() -> None:
    for heights in ([0.4, 1.9], [1.9, 0.4]):
        fan = seen(flat_view(WALL, [(0, 1)], heights=heights))
        assert reaches(fan, 0.3) == pytest.approx(6.0 / np.cos(0.3))


def test_how_high_is_too_high_is_a_share_of_the_cameras_height() -> None:
    view = flat_view(WALL, [(0, 1)], heights=0.6, camera_height=1.3)
    assert reaches(seen(view)) == pytest.approx(6.0)
    strict = MapperSettings(uncertainty="none", grant_height=0.4)
    assert reaches(seen(view, strict)) == 0.0


def test_before_a_high_wall_freespace_reaches_as_far_as_the_ground_that_was_seen() -> None:
    fan = seen(flat_view(WALL, [(0, 1)], heights=1.2, supports=[(3.0, 0.0)]))
    assert reaches(fan) == pytest.approx(3.0 * np.cos(0.05))
    assert reaches(fan, 0.06) == 0.0
    assert fan.surface.tolist() == [NO_SURFACE]


def test_ground_seen_below_a_high_wall_grants_up_to_the_wall() -> None:
    fan = seen(flat_view(WALL, [(0, 1)], heights=1.2, supports=[(8.0, 0.0)]))
    assert reaches(fan) == pytest.approx(6.0)
    assert fan.surface.tolist() == [0]
    assert np.abs(fan.bearings).max() < 0.05


def test_lines_of_sight_side_by_side_grant_what_is_between_them() -> None:
    supports = [(5.0, -0.3), (5.0, 0.4)]
    fan = seen(flat_view(supports=supports), MapperSettings(support_width=0.01))
    assert reaches(fan) == pytest.approx(5.0, abs=0.01)
    wider = seen(flat_view(supports=[(5.0, -0.4), (5.0, 0.5)]), MapperSettings(support_width=0.01))
    # They are 0.9 m apart at 5 m, so 0.8 m apart nearer by.
    assert reaches(wider) == pytest.approx(5.0 * 0.8 / 0.9, rel=0.01)


def test_the_middle_of_a_gap_between_high_features_is_not_granted() -> None:
    for height, range_ in ((0.6, 0.0), (0.4, 5.0)):
        ground_view = flat_view([(5.0, -0.35), (5.0, 0.35)], heights=height)
        options = MapperSettings(link_length=0.0, link_angle=0.0)
        assert reaches(seen(ground_view, options)) == pytest.approx(range_)


def test_a_lone_obstacle_grants_up_to_a_reach_before_it() -> None:
    # The lines to both vouch for the gap, as far as both surely reach.
    ground_view = flat_view([(5.0, -0.35), (5.0, 0.35)], heights=0.4, covariance=0.2**2)
    options = MapperSettings(link_length=0.0, link_angle=0.0)
    radius = np.hypot(5.0, 0.35) - 2 * 0.2
    assert reaches(seen(ground_view, options)) == pytest.approx(radius * 5.0 / np.hypot(5.0, 0.35))


# Where the ground is missing


@settings(max_examples=200)
@given(rngs(), st.sampled_from([0.05, 0.25]))
def test_ground_is_missing_where_lines_of_sight_run_below_its_level(
    rng: np.random.Generator, step: float
) -> None:
    count = int(rng.integers(0, 8))
    ground_view = flat_view(
        drop_offs=rng.uniform((1.0, -5.0), (12.0, 5.0), size=(count, 2)),
        drop_off_heights=-rng.uniform(0.05, 2.0, size=count),
        supports=rng.uniform((1.0, -5.0), (12.0, 5.0), size=(rng.integers(0, 40), 2)),
        camera_height=float(rng.uniform(0.5, 2.0)),
    )
    found, _ = missing_ground(ground_view, step)
    expected = np.array(places_without_ground(ground_view, step)).reshape(-1, 2)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@settings(max_examples=100)
@given(rngs())
def test_where_the_ground_is_missing_sight_is_below_it_and_not_beyond_the_feature(
    rng: np.random.Generator,
) -> None:
    height = -float(rng.uniform(0.1, 0.6))
    place = rng.uniform((1.0, -2.0), (5.0, 2.0))
    ground_view = flat_view(drop_offs=[place], drop_off_heights=height)
    share = missing_ground(ground_view, 0.1)[0] @ place / (place @ place)
    sight_height = 1.0 + share * (height - 1.0)
    assert ((sight_height < 0.0) & (sight_height > height)).all()
    assert np.diff(share).max(initial=0.0) * np.hypot(*place) <= 0.1 + 1e-9
    # The first and the last place are within half a step of the ends.
    assert share[0] * np.hypot(*place) <= np.hypot(*place) / (1.0 - height) + 0.05 + 1e-9
    assert share[-1] * np.hypot(*place) >= np.hypot(*place) - 0.05 - 1e-9


def test_lines_below_the_ground_are_not_held_with_each_ground_feature() -> None:
    rng = np.random.default_rng(0)
    ground_view = flat_view(
        drop_offs=rng.uniform((4.0, -3.0), (5.0, 3.0), size=(2000, 2)),
        supports=rng.uniform((6.0, -3.0), (9.0, 3.0), size=(2000, 2)),
    )
    assert (
        peak_memory(lambda: missing_ground(ground_view, 0.1)) < 20e6
    )  # 4,000,000 pairs take 100 MB


@pytest.mark.parametrize(
    ("ground", "missing"),
    [
        ((4.0, 0.14), False),  # beside the line
        ((4.0, -0.14), False),
        ((4.0, 0.16), True),  # too far from it
        ((2.6, 0.0), True),  # before the line goes below the ground, at 2.5 m
        ((2.7, 0.0), False),
        ((4.8, 0.0), False),
        ((4.9, 0.0), True),  # at the feature, 5 m ahead
        ((5.5, 0.0), True),
    ],
)
def test_ground_beside_a_line_below_it_tells_of_a_false_match(
    ground: tuple[float, float], missing: bool
) -> None:
    ground_view = flat_view(drop_offs=[(5.0, 0.0)], supports=[ground])
    assert len(missing_ground(ground_view, 0.1)[0]) == (25 if missing else 0)
