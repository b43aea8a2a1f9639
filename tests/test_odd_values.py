"""Values that no caller should give are refused by name in the whole public API."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure

from groundmap import (
    ConfidenceGrid,
    GroundPlane,
    GroundSettings,
    MapperSettings,
    StereoRig,
    View,
    read_views,
    write_views,
)
from groundmap.arrays import as_number, is_number
from groundmap.draw import draw_curves, draw_graph, draw_route, draw_trajectory, new_figure
from groundmap.errors import CameraError, FileFormatError, InputError, SettingsError
from groundmap.simulate import DriveSettings, Hole, Solid, World, drive, sample_landmarks
from groundmap.simulate.shapes import box, pole, wall
from groundmap.view.ground_fit import fit_ground
from planners import (
    Footprint,
    PlanningProblem,
    Roadmap,
    distance_field,
    plan,
    plan_many,
    shortcut,
    smooth,
)
from planners.errors import ProblemError

RIG: dict[str, Any] = {"fx": 700.0, "fy": 700.0, "cx": 320.0, "cy": 240.0, "baseline": 0.5}
NO_NUMBERS = (
    "1", None, True, 1j, np.complex128(1), Decimal("NaN"), Fraction(10**400), 10**400,
    np.timedelta64(1, "s"), np.array([1.0, 2.0]), [1.0], float("nan"), float("-inf"),
)  # fmt: skip


def problem(**options: Any) -> PlanningProblem:
    grid = ConfidenceGrid(resolution=0.5)
    grid.fuse(np.array([0, 0]), np.full((24, 24), -1.0, dtype=np.float32))
    given: dict[str, Any] = {"start": (2, 2), "goal": (9, 6), "footprint": 0.4} | options
    return PlanningProblem(grid, **given)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: f"{value!r:.20}")
def test_what_is_no_finite_number_is_refused_by_name(value: Any) -> None:
    assert not is_number(value)
    with pytest.raises(InputError, match=r"^depth: expected a number, got"):
        as_number("depth", value, "a number")


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), np.int8(2), Fraction(2)])
def test_numbers_of_any_type_are_floats(value: Any) -> None:
    assert as_number("depth", value, "a number", least=2.0) == 2.0
    with pytest.raises(InputError, match=r"^depth: expected more, got"):
        as_number("depth", value, "more", above=2.0)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: f"{value!r:.20}")
@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda value: StereoRig(**RIG | {"fx": value}), "^fx: expected a number above 0"),
        (lambda value: StereoRig(**RIG | {"cx": value}), "^cx, cy: expected finite numbers"),
        (
            lambda value: GroundPlane(normal=np.array([0.0, 0.0, 1.0]), offset=value),
            "^plane: expected a finite",
        ),
        (lambda value: pole(value, 1.0), "^x: expected a number"),
        (lambda value: box(value, 1.0, 2.0, 2.0), "^box: expected"),
        (lambda value: Solid(box(0, 0, 1, 1), top=value), "^top: expected a height"),
        (lambda value: World(bounds=(0, 0, 1, 1), ground_lines=value), "^ground_lines: expected"),
        (lambda value: problem(clear_start_radius=[value]), "^clear_start_radius: expected"),
        (lambda value: problem(start=(value, 2)), "^start: expected x, y"),
        (lambda value: Footprint.of([(0, 0), (1, 0), (0, value)]), "^footprint: expected"),
        (lambda value: distance_field(problem(), (2, value)), "^source: expected x, y"),
    ],
)
def test_every_value_is_checked_where_it_is_given(
    call: Callable[[Any], object], match: str, value: Any
) -> None:
    if isinstance(value, str | bool) and match == "^footprint: expected":
        return  # arrays take numbers as strings, and truth values as 0 and 1, as NumPy does
    with pytest.raises((InputError, ProblemError), match=match):
        call(value)


def test_ragged_pixels_and_huge_ids_are_refused() -> None:
    rig = StereoRig(**RIG)
    with pytest.raises(InputError, match=r"^pixels: expected numbers of shape"):
        rig.triangulate([[1.0, 2.0, 3.0], [1.0]])
    with pytest.raises(InputError, match=r"^point_ids: expected whole numbers"):
        View.from_pixels(np.eye(4), rig, points_px=[(9, 8, 1)], point_ids=[[1], [2, 3]])
    with pytest.raises(InputError, match=r"^point_ids: expected whole numbers within 64 bits"):
        View.from_pixels(
            np.eye(4), rig, points_px=[(9, 8, 1)], point_ids=np.array([2**64 - 1], np.uint64)
        )


def test_a_pose_of_huge_entries_is_no_rotation() -> None:
    with pytest.raises(CameraError, match="orthonormal rows"):
        StereoRig(**RIG, T_base_camera=np.full((4, 4), 1e300))


def test_a_camera_height_is_checked_before_the_first_view() -> None:
    heights: Any = np.array([1.0, 2.0])
    with pytest.raises(InputError, match=r"^camera_height: expected a number above 0"):
        fit_ground([], camera_height=heights)


def test_settings_that_no_computation_can_hold_are_refused() -> None:
    with pytest.raises(SettingsError, match=r"^support_width: expected less than or equal to"):
        MapperSettings(support_width=1e300)
    with pytest.raises(
        SettingsError, match=r"^drift: expected a number within 1e\+09, got 1e\+300"
    ):
        DriveSettings(stops=((0, 0, 0),), drift=1e300)
    with pytest.raises(SettingsError, match=r"^window: expected less than or equal to 10000"):
        GroundSettings(window=2**62)


@pytest.mark.parametrize(
    ("stops", "match"),
    [
        ([(0, 0, 0), (9e7, 0, 0)], "a drive of at most 100000 views, got 9e"),
        ([(0, 0, 0), (1e300, 0, 0)], r"places within 1e\+08 m of the origin"),
    ],
)
def test_a_drive_that_takes_gigabytes_is_refused(stops: Any, match: str) -> None:
    with pytest.raises(InputError, match=f"^stops: expected {match}"):
        drive(DriveSettings(stops=stops), np.random.default_rng(1))


def test_a_wall_beyond_every_map_is_refused() -> None:
    with pytest.raises(InputError, match=r"^wall: expected corners within 1e\+08 m"):
        wall([(0, 0), (1e300, 0)])
    with pytest.raises(InputError, match=r"^thickness: expected a number up to"):
        wall([(0, 0), (1, 0)], thickness=1e155)


@pytest.mark.parametrize("value", [1e7, np.array(-1.0), [(0, 0), (1e9, 0), (0, 1)], 1e300])
def test_footprints_are_within_a_thousand_kilometres(value: Any) -> None:
    with pytest.raises(ProblemError, match=r"^footprint: expected a radius"):
        Footprint.of(value)


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda ax: new_figure((0, 0, 1e300, 1e-300)), "^bounds: expected a box within"),
        (lambda ax: draw_route([(0, 0), (np.nan, 1)], footprint=1.0, ax=ax), "^waypoints: "),
        (lambda ax: draw_route([], footprint=1.0, ax=ax), "^waypoints: expected 1 or more points"),
        (lambda ax: draw_route([(0, 0)], footprint=-1.0, ax=ax), "^footprint: expected a radius"),
        (lambda ax: draw_route([(0, 0)], footprint=[(0, 0)], ax=ax), "^footprint: expected 3 or"),
        (
            lambda ax: draw_route(
                [(0, 0)], footprint=[(0, 0), (1, 0), (0, 1)], headings=[0, 1], ax=ax
            ),
            r"^headings: expected shape \(1,\)",
        ),
        (lambda ax: draw_graph([(0, 0)], [(0, 0.5)], ax=ax), "^edges: expected indices"),
        (lambda ax: draw_trajectory([(0, 0, np.inf)], ax=ax), "^poses: expected finite"),
        (lambda ax: draw_curves({"a": [[0], [0], [0]]}, ax=[ax, ax]), "^a: expected numbers of"),
        (lambda ax: draw_curves({"a": [[9], [2], [0]]}, ax=[ax, ax]), "^a: expected shares from"),
    ],
)
def test_pictures_of_what_can_not_be_drawn_are_refused(
    call: Callable[[Any], object], match: str
) -> None:
    with pytest.raises(InputError, match=match):
        call(Figure().subplots())


@pytest.mark.parametrize("limit", ["1", -1.0, float("nan"), [1], 10**400])
def test_time_limits_are_numbers_or_none(limit: Any) -> None:
    posed = problem()
    with pytest.raises(ProblemError, match=r"^time_limit: expected a number of 0 or more"):
        distance_field(posed, (2, 2), time_limit=limit)
    with pytest.raises(ProblemError, match=r"^time_limit: expected a number of 0 or more"):
        smooth(posed, plan(posed), turning_radius=1.0, time_limit=limit)


def test_options_of_queries_are_checked() -> None:
    posed = problem()
    pairs: Any = 1
    huge: Any = Fraction(10**400)
    long: Any = np.longdouble(1.0)
    with pytest.raises(ProblemError, match=r"^pairs: expected pairs of a start and a goal"):
        plan_many(posed, pairs)
    with pytest.raises(ProblemError, match=r"^unknown: expected 'avoid', 'allow' or 'penalise'"):
        problem(unknown=np.array(["avoid", "allow"]))
    with pytest.raises(ProblemError, match=r"^clearance: expected a distance of 0 or more"):
        shortcut(posed, plan(posed), clearance=huge)
    assert shortcut(posed, plan(posed), clearance=long).audit == "clean"


@pytest.mark.parametrize("name", ["a\x00b", "\ud800", "x" * 5000])
def test_names_that_no_file_can_have_are_refused(name: str, tmp_path: Path) -> None:
    view = View.from_pixels(np.eye(4), StereoRig(**RIG), points_px=[(9, 8, 1)])
    with pytest.raises(FileFormatError, match="expected a new or empty folder, got"):
        write_views([view], tmp_path / name)
    with pytest.raises(FileFormatError, match="expected a log of views, got"):
        read_views(tmp_path / name)
    with pytest.raises(FileFormatError, match="expected a file that can be written, got"):
        ConfidenceGrid().save(tmp_path / name)


def test_the_walls_of_holes_count_as_a_world_s_landmarks() -> None:
    world = World(bounds=(0, 0, 8, 8), holes=(Hole(shapely.box(5, 5, 6, 6), depth=1e9),))
    with pytest.raises(InputError, match=r"^world: expected at most 1e\+06 landmarks"):
        sample_landmarks(world, np.random.default_rng(1))


@pytest.mark.parametrize("index", [1, (0.5, 0), (2**70, 0), ("a", "b"), (0, 0, 0), [(0, 0)]])
def test_a_tile_has_whole_numbers_for_an_index(index: Any) -> None:
    with pytest.raises(InputError, match=r"^index: expected"):
        ConfidenceGrid().tile(index)


def test_a_time_stamp_is_a_number() -> None:
    half: Any = Fraction(1, 2)
    stamp: Any = "now"
    view = View(T_map_base=np.eye(4), rig=StereoRig(**RIG), timestamp=half)
    assert isinstance(view.timestamp, float)
    with pytest.raises(InputError, match=r"^timestamp: expected a number"):
        View(T_map_base=np.eye(4), rig=StereoRig(**RIG), timestamp=stamp)


def test_who_grows_a_roadmap_is_a_name() -> None:
    planner: Any = np.array(["prm", "prmstar"])
    with pytest.raises(ProblemError, match=r"^planner: expected 'prm' or 'prmstar'"):
        Roadmap.grow(problem(), planner=planner)


def test_places_and_poses_beyond_every_map_are_refused() -> None:
    with pytest.raises(ProblemError, match=r"^goal: expected a place within 1e\+300 m"):
        problem(goal=(1e305, 2))
    with pytest.raises(InputError, match=r"^z: expected evidence in 2 dimensions"):
        ConfidenceGrid(resolution=0.5).fuse([0, 0], [[-1.0, -1.0], [-1.0]])  # type: ignore[arg-type]  # ragged
