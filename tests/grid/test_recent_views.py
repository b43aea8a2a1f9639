"""What is there now: the non-free cells of the newest views, and what new things hide."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from groundmap import CellState, ConfidenceGrid, GroundMapper, GroundPlane, StereoRig, View
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.view.frames import map_from_world
from planners import IncrementalPlanner, NonFreeError, PlanningProblem, plan

RIG = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
CAMERA = 1.2  # [m] above the ground


def road() -> Floats:
    rng = np.random.default_rng(0)
    return np.column_stack(
        [rng.uniform(-5, 5, 2000), np.full(2000, CAMERA), rng.uniform(1, 25, 2000)]
    )


def car(at: float, *, count: int = 40) -> Floats:
    """Features of the near face of a car, 1.8 m wide and 1.4 m high, `at` metres ahead."""
    rng = np.random.default_rng(1)
    heights = rng.uniform(0.1, 1.4, count)
    return np.column_stack([rng.uniform(-0.9, 0.9, count), CAMERA - heights, np.full(count, at)])


def view_of(features: Floats, *, timestamp: float | None = None) -> View:
    """See features (x right, y down, z ahead), without those that a car hides."""
    x, y, z = features.T
    u, v = 700.0 * x / z + 320.0, 700.0 * y / z + 240.0
    inside = (z < 19.0) & (np.abs(u - 320.0) < 320.0) & (v < 480.0)
    pixels = np.column_stack([u, u - 350.0 / z, v])[inside]
    pose = map_from_world(np.eye(4), "optical")
    view = View.from_pixels(pose, RIG, points_px=pixels, timestamp=timestamp)
    return view.with_plane(GroundPlane.below_camera(RIG, CAMERA))


def with_car(at: float, *, timestamp: float | None = None, count: int = 40) -> View:
    ground = road()
    hidden = (np.abs(ground[:, 0]) < 0.9 * ground[:, 2] / at) & (ground[:, 2] > at)
    return view_of(np.concatenate([ground[~hidden], car(at, count=count)]), timestamp=timestamp)


def empty_road(views: int = 10, **settings: Any) -> GroundMapper:
    mapper = GroundMapper(resolution=0.2, **settings)
    for _ in range(views):
        mapper.integrate(view_of(road(), timestamp=0.0))
    return mapper


def covered(mapper: GroundMapper, places: Floats) -> float:
    """Share of places that are in cells of `recent`."""
    recent = mapper.recent
    cells = np.floor((places - recent.origin) / recent.resolution).astype(np.int64)[:, ::-1]
    known = set(map(tuple, recent.cells.tolist()))
    return float(np.mean([tuple(cell) in known for cell in cells.tolist()]))


def under_car(at: float) -> Floats:
    x, y = np.meshgrid(np.arange(at + 0.1, at + 4.2, 0.2), np.arange(-0.7, 0.8, 0.2))
    return np.column_stack([x.ravel(), y.ravel()])


def test_a_car_on_a_road_that_was_empty_is_there_in_the_view_that_sees_it() -> None:
    mapper = empty_road()
    assert len(mapper.recent) == 0
    mapper.integrate(with_car(8.0))
    assert covered(mapper, under_car(8.0)) == 1.0
    # The average still calls the road free.
    assert (np.asarray(mapper.grid.confidence_at(under_car(8.0))) < 0).all()
    beside = under_car(8.0) + np.array([0.0, 2.5])
    assert covered(mapper, beside) == 0.0
    assert covered(mapper, under_car(1.0)) == 0.0


def test_it_is_gone_two_views_after_it_has_passed_and_the_average_is_that_without_recent() -> None:
    mapper, without = empty_road(), empty_road(recent_views=0)
    for view in (with_car(10.0), with_car(6.0), view_of(road())):
        mapper.integrate(view)
        without.integrate(view)
    assert covered(mapper, under_car(6.0)) == 1.0
    mapper.integrate(view_of(road()))
    without.integrate(view_of(road()))
    assert len(mapper.recent) == len(without.recent) == 0
    ours, theirs = mapper.grid.window(), without.grid.window()
    assert np.array_equal(ours.confidence, theirs.confidence)
    assert np.array_equal(ours.count, theirs.count)


def test_a_window_in_seconds_replaces_the_number_of_views() -> None:
    mapper = empty_road(recent_seconds=1.0)
    mapper.integrate(with_car(8.0, timestamp=10.0))
    for time in (10.3, 10.6, 11.0):
        mapper.integrate(view_of(road(), timestamp=time))
        assert len(mapper.recent) > 0
    mapper.integrate(view_of(road(), timestamp=11.1))
    assert len(mapper.recent) == 0
    views = mapper.stats.views
    with pytest.raises(InputError, match=r"timestamp: expected a time \[s\], got none"):
        mapper.integrate(view_of(road()))
    assert mapper.stats.views == views


def test_a_lone_feature_is_no_thing() -> None:
    mapper = empty_road()
    mapper.integrate(with_car(8.0, count=1))
    assert len(mapper.recent) == 0
    mapper.integrate(with_car(8.0, count=3))
    assert len(mapper.recent) > 0


def test_what_the_map_knows_hides_nothing_that_the_map_calls_free() -> None:
    """A wall that has long been there does not block the free space that it hides now."""
    mapper = GroundMapper(resolution=0.2)
    behind = np.column_stack([np.linspace(9, 12, 20), np.zeros(20)])
    lower = np.floor(behind[0] / 0.2).astype(np.int64)[::-1] - 5
    mapper.grid.fuse(lower, np.full((10, 20), -1.0, dtype=np.float32))
    for _ in range(3):
        mapper.integrate(with_car(8.0))
    states = mapper.grid.window().states()
    assert (states == CellState.NONFREE).any()
    assert covered(mapper, behind) == 0.0
    assert covered(mapper, car(8.0)[:, [2, 0]] * (1, -1)) > 0.9


def test_planning_keeps_away_from_what_is_there_now() -> None:
    mapper = empty_road()
    mapper.integrate(with_car(8.0))
    options: dict[str, Any] = {"start": (1.5, 0.0), "footprint": 0.5}
    blind = PlanningProblem(mapper.grid, goal=(10.0, 0.0), **options)
    through = plan(blind).length
    assert through < 9.0
    with pytest.raises(NonFreeError, match="the newest views saw as non-free"):
        plan(PlanningProblem(mapper.grid, goal=(10.0, 0.0), recent=mapper.recent, **options))
    live = IncrementalPlanner(blind)
    with pytest.raises(NonFreeError, match="the newest views saw as non-free"):
        live.plan()
    assert IncrementalPlanner(blind, recent=False).plan().length == pytest.approx(through)
    for _ in range(2):
        mapper.integrate(view_of(road()))
        live.update(mapper.changed)
    assert live.plan().length < 9.0


def test_a_saved_map_keeps_what_was_there_and_a_merged_one_does_not(tmp_path: Path) -> None:
    mapper = empty_road()
    mapper.integrate(with_car(8.0))
    mapper.grid.save(tmp_path / "map.npz")
    loaded = ConfidenceGrid.load(tmp_path / "map.npz")
    assert np.array_equal(loaded.recent.cells, mapper.recent.cells)
    assert len(loaded.recent) > 0
    loaded.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "map.npz").read_bytes()
    assert len(loaded.merge(ConfidenceGrid(resolution=0.2, heights=loaded.heights)).recent) == 0
