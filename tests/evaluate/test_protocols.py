"""Held-out evaluation: its figures for known maps and for recorded logs."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from groundmap import ConfidenceGrid, Features, View, read_views
from groundmap.arrays import Bools, Floats
from groundmap.errors import InputError, NoGroundPlaneError
from groundmap.evaluate.held_out import HeldOut, judge, near_nonfree
from groundmap.evaluate.protocols import FOLDS, PROTOCOLS, Verdict, evaluate
from oracles import peak_memory
from sample_views import few_views

DATA = Path(__file__).parents[3] / "shared" / "data"
NONE = np.empty((0, 2))
FREE, NONFREE, UNSEEN = -1.0, 1.0, 0.0


def grid_of(z: Floats) -> ConfidenceGrid:
    grid = ConfidenceGrid(resolution=0.25)
    grid.fuse(np.array([0, 0]), z.astype(np.float32))
    return grid


def held_out(
    *, obstacles: Floats = NONE, grounds: Floats = NONE, viewpoints: Floats = NONE
) -> HeldOut:
    return HeldOut(obstacles, grounds, viewpoints)


def street() -> Floats:
    """8 m x 4 m of free cells, with a wall along the top and a last metre that is unknown."""
    z = np.full((16, 32), FREE)
    z[14:] = NONFREE
    z[:, 28:] = UNSEEN
    return z


DRIVE = np.array([(0.1, 1.1), (6.9, 1.1)])


def test_obstacles_are_judged_by_their_cell_and_the_cells_around_it() -> None:
    obstacles = np.array([(2.1, 3.6), (2.1, 3.3), (2.1, 3.1), (7.5, 1.0), (99.0, 1.0)])
    figures = judge(grid_of(street()), held_out(obstacles=obstacles), DRIVE).figures()
    # The wall's squares begin at y = 3.5: 3.3 is within 0.3 m of them, 3.1 is not.
    assert figures.obstacle_near_nonfree == pytest.approx(2 / 5)
    assert figures.obstacle_in_free == pytest.approx(2 / 5)
    assert figures.obstacle_unknown == pytest.approx(2 / 5)


def test_ground_features_are_judged_by_their_cell() -> None:
    grounds = np.array([(1.1, 1.1), (3.1, 2.1), (2.1, 3.6), (7.5, 1.1)])
    seen = held_out(grounds=grounds, viewpoints=np.tile((0.1, 1.1), (4, 1)))
    figures = judge(grid_of(street()), seen, DRIVE).figures()
    assert (figures.ground_free, figures.ground_nonfree, figures.ground_unknown) == (
        0.5,
        0.25,
        0.25,
    )


def test_sight_lines_stop_a_foot_before_the_feature() -> None:
    # Straight up into the wall: at 3.79 m the line still ends in front of it, at 3.9 m inside.
    for y, crosses in ((3.79, 0.0), (3.9, 1.0)):
        seen = held_out(grounds=np.array([(2.1, y)]), viewpoints=np.array([(2.1, 0.1)]))
        figures = judge(grid_of(street()), seen, DRIVE).figures()
        assert figures.sightline_crosses_nonfree == crosses
    assert figures.sightline_free == pytest.approx(3.4 / 3.5, abs=0.02)


def test_the_length_of_a_sight_line_in_unknown_space_is_not_free() -> None:
    seen = held_out(grounds=np.array([(7.9, 1.1)]), viewpoints=np.array([(3.9, 1.1)]))
    figures = judge(grid_of(street()), seen, DRIVE).figures()
    assert figures.sightline_free == pytest.approx(3.1 / 3.7, abs=0.02)
    assert figures.sightline_crosses_nonfree == 0.0


def test_the_trajectory_before_its_first_known_cell_is_reported_separately() -> None:
    z = street()
    z[:, :8] = UNSEEN
    z[4, 12] = NONFREE
    figures = judge(grid_of(z), held_out(), DRIVE).figures()
    assert figures.trajectory_unseen_start_m == pytest.approx(1.9, abs=0.1)
    assert figures.trajectory_nonfree == pytest.approx(1 / 20)
    assert figures.trajectory_free == pytest.approx(19 / 20)


def test_without_features_all_shares_are_zero_without_a_warning() -> None:
    figures = judge(grid_of(street()), held_out(), DRIVE).figures()
    assert figures.obstacles == figures.grounds == 0
    assert figures.obstacle_near_nonfree == figures.sightline_free == 0.0


@pytest.mark.parametrize("name", ["views", "ids", "thin"])
def test_each_feature_is_held_out_once_and_never_mapped_in_the_same_fold(name: str) -> None:
    split, _ = PROTOCOLS[name]
    ids = np.arange(1000)
    points = Features.points(np.ones((1000, 3)), np.tile(np.eye(3), (1000, 1, 1)), ids)
    views = [replace(view_with(points), timestamp=float(number)) for number in range(10)]
    pairs: list[tuple[int, int]] = []
    for fold in range(FOLDS):
        for number, view in enumerate(views):
            mapped_part, held_part = split(fold, number, view)
            mapped = set() if mapped_part is None else set(mapped_part.points.ids.tolist())
            held = set() if held_part is None else set(held_part.points.ids.tolist())
            assert not mapped & held
            if name == "thin":
                assert len(mapped) < 300
            pairs += [(number, landmark) for landmark in held]
    assert sorted(pairs) == [(number, landmark) for number in range(10) for landmark in range(1000)]


def test_small_cells_around_many_points_do_not_fill_the_memory() -> None:
    grid = ConfidenceGrid(resolution=0.005)
    z = np.full((400, 400), -1.0, dtype=np.float32)
    z[200, 200] = 1.0
    grid.fuse(np.array([0, 0]), z)
    window = grid.window()
    states = window.states()
    points = np.random.default_rng(0).uniform(0.4, 1.6, (2000, 2))
    near: list[Bools] = []

    def work() -> None:
        near.append(near_nonfree(window, states, points))

    assert peak_memory(work) < 100e6  # the boxes of all points take 1 GB
    offset = np.maximum(np.abs(points - 1.0025) - 0.0025, 0.0)
    np.testing.assert_array_equal(near[0], np.hypot(*offset.T) <= 0.3)


def test_a_short_log_is_refused() -> None:
    with pytest.raises(InputError, match="at least 5 views, got 2"):
        evaluate(few_views(2))


def test_points_without_ids_are_refused() -> None:
    with pytest.raises(InputError, match=r"landmark id for every point, .* at view 0"):
        evaluate(few_views(6))


def test_a_camera_height_replaces_fitted_planes_in_maps_and_held_out_views() -> None:
    bare = [
        replace(
            view,
            T_map_base=view.T_map_camera,
            rig=replace(view.rig, T_base_camera=np.eye(4)),
            points=replace(view.points.select(np.arange(8)), ids=np.arange(8)),
        )
        for view in few_views(5)
    ]
    with pytest.raises(NoGroundPlaneError, match="--camera-height"):
        evaluate(bare, ground={"window": 1})
    figures = evaluate(bare, camera_height=1.0)["views"].figures
    assert (figures.grounds, figures.obstacles) == (40, 0)
    assert figures.ground_free > 0.5
    # For a higher camera, the same features are obstacles.
    assert evaluate(bare, camera_height=2.0)["views"].figures.obstacles == 40


def view_with(points: Features) -> View:
    (view,) = few_views(1)
    return replace(view, points=points)


@pytest.fixture(scope="module")
def kitti00() -> dict[str, Verdict]:
    if not (DATA / "kitti00_vo").is_dir():
        pytest.skip("the recorded drive kitti00_vo is not beside the checkout")
    return evaluate(read_views(DATA / "kitti00_vo"))


# Figures that were the first to show a regression in experiments with other rules.
BOUNDS: dict[str, dict[str, tuple[float, float]]] = {
    "views": {
        "obstacle_near_nonfree": (0.96, 1.0),
        "obstacle_in_free": (0.0, 0.06),
        "ground_free": (0.955, 1.0),
        "sightline_free": (0.99, 1.0),
        "sightline_crosses_nonfree": (0.0, 0.06),
        "trajectory_free": (0.98, 1.0),
        "trajectory_nonfree": (0.0, 0.0),
    },
    "ids": {
        "obstacle_in_free": (0.0, 0.09),
        "sightline_free": (0.99, 1.0),
        "sightline_crosses_nonfree": (0.0, 0.06),
        "trajectory_free": (0.98, 1.0),
        "trajectory_nonfree": (0.0, 0.0),
    },
    "thin": {
        "obstacle_in_free": (0.0, 0.16),
        "trajectory_free": (0.98, 1.0),
        "trajectory_nonfree": (0.0, 0.0),
    },
}


@pytest.mark.parametrize(
    ("protocol", "figure"),
    [(protocol, figure) for protocol, figures in BOUNDS.items() for figure in figures],
)
def test_figures_of_a_recorded_drive_are_within_bounds(
    kitti00: dict[str, Verdict], protocol: str, figure: str
) -> None:
    low, high = BOUNDS[protocol][figure]
    assert low <= asdict(kitti00[protocol].figures)[figure] <= high


def test_stamping_leaves_more_of_the_sight_lines_unknown_than_mapping(
    kitti00: dict[str, Verdict],
) -> None:
    stamped, mapped = kitti00["stamping"].figures, kitti00["views"].figures
    assert stamped.sightline_free < mapped.sightline_free - 0.05
    assert stamped.sightline_crosses_nonfree > mapped.sightline_crosses_nonfree
