"""Hybrid A*: routes of bounded curvature, also through the narrowest passages."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from groundmap.arrays import Bools, Floats
from groundmap.errors import SettingsError
from oracles_curves import check_steered
from oracles_planning import BLOCKED, FREE, drawing, free_field, grid_of
from planners.costmap.costmap import Costmap
from planners.costmap.kernels.moves import COLS, ROWS
from planners.errors import ProblemError, TimeLimitError
from planners.geometry.curves import dubins, reeds_shepp
from planners.problem.costs import CostSettings
from planners.problem.problem import PlanningProblem
from planners.search.base import SearchResult
from planners.search.hybrid_astar import HybridAStar, HybridAStarSettings
from planners.search.kernels.hybrid_field import (
    DOUBT,
    SIDE,
    SLANT,
    UNREACHED,
    distance_of,
    seed_field,
)
from strategies import rngs

CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
ELL = [(-0.6, -0.6), (0.9, -0.6), (0.9, 0.0), (0.0, 0.0), (0.0, 0.9), (-0.6, 0.9)]
FOOTPRINTS: list[Any] = [0.5, CAR, ELL]
Place = tuple[float, float, float]
Motion = Literal["dubins", "reeds_shepp"]


def costmap_of(
    blocked: Bools, footprint: Any, *, resolution: float = 0.25, **options: Any
) -> Costmap:
    grid = grid_of(np.where(blocked, BLOCKED, FREE), resolution=resolution)
    anywhere = (0.1, 0.1, 0.0)
    return Costmap.of(
        PlanningProblem(
            grid, start=anywhere, goal=anywhere, footprint=footprint, clear_start=False, **options
        )
    )


def routed(costmap: Costmap, start: Place, goal: Place, **options: Any) -> SearchResult | None:
    """Return the route between two poses, checked, or None if there is none."""
    chosen = HybridAStarSettings(**options)
    found = HybridAStar(costmap).search(start, goal, chosen)
    if found is not None:
        check_steered(costmap, found, (start, goal), chosen)
    return found


def length(found: SearchResult | None) -> float:
    assert found is not None
    return float(np.hypot(*np.diff(found.waypoints, axis=0).T).sum())


def field(rows: int = 48, cols: int = 48) -> Bools:
    return np.zeros((rows, cols), dtype=np.bool_)


def rooms(rng: np.random.Generator) -> Bools:
    """Return four rooms with doors between them, and a few obstacles."""
    blocked = field(64, 64)
    blocked[31:33] = blocked[:, 31:33] = True
    for low, high in ((0, 31), (33, 64)):
        for doors in (blocked[31:33], blocked[:, 31:33].T):
            middle = rng.integers(low + 5, high - 5)
            doors[:, middle - 4 : middle + 4] = False
    for row, col in rng.integers(0, 62, (6, 2)):
        blocked[row : row + 2, col : col + 2] = True
    return blocked


@pytest.mark.parametrize("motion", ["dubins", "reeds_shepp"])
@given(rng=rngs())
@settings(max_examples=15)
def test_without_obstacles_the_route_is_the_curve(motion: Motion, rng: np.random.Generator) -> None:
    start, goal = rng.uniform((4, 4, -4), (8, 8, 4), (2, 3)).tolist()
    free = {"reverse_penalty": 1, "gear_change_penalty": 0, "steering_penalty": 0}
    costmap = costmap_of(field(), 0.2)
    found = routed(costmap, start, goal, turning_radius=0.8, motion=motion, **free)
    assert found is not None
    assert found.expanded == 1
    curve = (dubins if motion == "dubins" else reeds_shepp)(start, goal, radius=0.8)
    assert length(found) == pytest.approx(curve.length, rel=2e-3)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("motion", ["dubins", "reeds_shepp"])
def test_routes_through_rooms_can_be_steered_and_touch_nothing(
    footprint: Any, motion: Motion
) -> None:
    found = 0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        costmap = costmap_of(rooms(rng), footprint)
        engine, options = HybridAStar(costmap), HybridAStarSettings(motion=motion, time_limit=None)
        for _ in range(2):
            ends = clear_poses(engine, rng)
            route = engine.search(*ends, options)
            if route is not None:
                check_steered(costmap, route, ends, options)
                found += 1
    assert found >= (4 if motion == "reeds_shepp" else 2)


def clear_poses(engine: HybridAStar, rng: np.random.Generator) -> tuple[Place, Place]:
    """Return poses in opposite rooms, away from the walls and heading away from them."""
    while True:
        (x, y), (u, v) = rng.uniform(2.5, 5.5, 2), rng.uniform(10.5, 13.5, 2)
        yaw, turn = rng.uniform(-0.5, 2.0, 2)
        ends = (float(x), float(y), float(yaw)), (float(u), float(v), float(turn))
        if all(engine.search(end, end, HybridAStarSettings()) for end in ends):
            return ends


STREET = """
    ####################################
    #..................................#
    #..................................#
    #..................................#
    #..................................#
    #..................................#
    #..................................#
    #..................................#
    #########...............############
    #########...............############
    #########...............############
    #########...............############
    ####################################
"""


def test_a_car_parks_in_a_gap_by_driving_backward() -> None:
    street = costmap_of(drawing(STREET) == BLOCKED, CAR)
    start, goal = (1.2, 2.1, 0.0), (3.2, 0.75, 0.0)
    parked = routed(street, start, goal, turning_radius=1.5)
    assert parked is not None
    assert parked.headings is not None
    steps = np.diff(parked.waypoints, axis=0)
    ahead = steps[:, 0] * np.cos(parked.headings[1:]) + steps[:, 1] * np.sin(parked.headings[1:])
    assert ahead.min() < 0
    assert routed(street, start, goal, turning_radius=1.5, motion="dubins") is None


def test_a_corridor_as_wide_as_the_car_is_passed_straight_only() -> None:
    blocked = field(24, 64)
    blocked[:10, 20:40] = blocked[14:, 20:40] = True  # 1 m remains free
    costmap = costmap_of(blocked, [(-0.5, -0.5), (1.0, -0.5), (1.0, 0.5), (-0.5, 0.5)])
    through = routed(costmap, (1.0, 3.0, 0.0), (14.0, 3.0, 0.0))
    assert length(through) == pytest.approx(13.0)
    wider = costmap_of(blocked, [(-0.5, -0.501), (1.0, -0.501), (1.0, 0.501), (-0.5, 0.501)])
    assert routed(wider, (1.0, 3.0, 0.0), (14.0, 3.0, 0.0)) is None


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_a_closed_pocket_cannot_be_reached(footprint: Any) -> None:
    blocked = field()
    blocked[24:, 24] = blocked[24, 24:] = True
    assert routed(costmap_of(blocked, footprint), (2, 2, 0), (9, 9, 0)) is None


def test_a_pose_that_touches_blocked_cells_has_no_route() -> None:
    blocked = field()
    blocked[24, 24] = True
    costmap = costmap_of(blocked, CAR)
    across = (5.0, 6.1, 0.0)
    assert routed(costmap, across, (2, 2, 0)) is None
    assert routed(costmap, (2, 2, 0), across) is None
    assert routed(costmap, (2, 2, 0), (across[0], across[1], math.pi)) is not None


def test_equal_start_and_goal_give_two_equal_poses() -> None:
    pose = (5.0, 5.0, 7.0)
    found = routed(costmap_of(field(), CAR), pose, pose)
    assert found is not None
    assert found.waypoints.tolist() == [[5, 5], [5, 5]]


def test_penalties_decide_between_backing_up_and_turning_around() -> None:
    costmap = costmap_of(field(96, 96), 0.2)
    start, behind = (12.0, 12.0, 0.0), (6.0, 12.0, 0.0)
    assert length(routed(costmap, start, behind)) == pytest.approx(6.0)
    costly = routed(costmap, start, behind, reverse_penalty=20)
    assert length(costly) > 7.0


def test_a_costly_strip_is_avoided() -> None:
    z = free_field(48, 48)
    z[10:38, 22:26] = -0.1
    start, goal = (2.0, 6.0, 0.0), (10.0, 6.0, 0.0)
    lengths = []
    for weight in (0.0, 20.0):
        problem = PlanningProblem(
            grid_of(z, resolution=0.25),
            footprint=0.3,
            costs=CostSettings(confidence_weight=weight),
            start=start,
            goal=goal,
        )
        found = routed(Costmap.of(problem), start, goal)
        assert found is not None
        lengths.append(length(found))
        assert (found.cost is None) == (weight == 0)
        assert found.cost is None or found.cost >= lengths[-1] - 1e-9
    assert lengths[0] == pytest.approx(8.0)
    assert lengths[1] > 8.5


def test_slices_and_growing_arrays_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    costmap = costmap_of(rooms(np.random.default_rng(3)), CAR)
    ends = (3.0, 3.0, 0.0), (12.0, 12.5, 1.0)
    whole = routed(costmap, *ends)
    monkeypatch.setattr(HybridAStar, "slice_size", 7)
    monkeypatch.setattr(HybridAStar, "first_room", 4)
    sliced = routed(costmap, *ends)
    assert whole is not None
    assert sliced is not None
    np.testing.assert_array_equal(sliced.waypoints, whole.waypoints)
    assert sliced.expanded == whole.expanded > 4


def test_one_engine_serves_many_queries() -> None:
    rng = np.random.default_rng(5)
    costmap = costmap_of(rooms(rng), CAR)
    shared = HybridAStar(costmap)
    for _ in range(4):
        ends = clear_poses(shared, rng)
        pair = [
            engine.search(*ends, HybridAStarSettings()) for engine in (shared, HybridAStar(costmap))
        ]
        assert pair[0] is not None
        assert pair[1] is not None
        np.testing.assert_array_equal(pair[0].waypoints, pair[1].waypoints)


@pytest.mark.parametrize("goal", [(0, 0), (5, 7), (23, 1)])
def test_the_field_is_dijkstras_after_any_number_of_requests(goal: tuple[int, int]) -> None:
    rng = np.random.default_rng(sum(goal))
    blocked: Bools = rng.random((24, 24)) < 0.3
    blocked[goal] = False
    costmap = costmap_of(blocked, 0.13, resolution=0.25)
    grown = HybridAStar(costmap).field
    expected = field_distances(costmap, grown.moves, grown.narrow)
    row, col = (costmap.to_cells([[0.25 * goal[1] + 0.1, 0.25 * goal[0] + 0.1]])[0, ::-1]).astype(
        int
    )
    begin = row * costmap.width + col
    seed_field(grown, begin)
    for cell in rng.permutation(costmap.blocked.size).tolist():
        got = distance_of(grown, costmap.width, cell)
        assert (np.inf if got == UNREACHED else got) == expected(begin)[cell]


def field_distances(costmap: Costmap, moves: npt.NDArray[np.uint8], narrow: Bools) -> Any:
    edges = [
        (a, a + int(ROWS[k]) * costmap.width + int(COLS[k]), SLANT if k % 2 else SIDE)
        for a in range(len(moves))
        for k in range(8)
        if moves[a] >> k & 1
    ]
    tails, heads, steps = np.array(edges).T
    steps = np.where(narrow[tails] | narrow[heads], DOUBT, 1) * steps
    graph = coo_array((steps, (tails, heads)), shape=(len(moves), len(moves))).tocsr()

    def distances(source: int) -> Floats:
        found: Floats = dijkstra(graph, indices=source)
        return found

    return distances


def test_errors_name_the_expected_values() -> None:
    engine = HybridAStar(costmap_of(field(), CAR))
    with pytest.raises(ProblemError, match=r"goal: expected x, y \[m\] and yaw \[rad\] for hybrid"):
        engine.search((2, 2, 0), (9, 9), HybridAStarSettings())
    with pytest.raises(ProblemError, match=r"start: expected x, y \[m\] and yaw \[rad\]"):
        engine.search((2, 2), (9, 9, 0), HybridAStarSettings())
    with pytest.raises(TimeLimitError, match="hybrid_astar: no route within time_limit = 0 s"):
        engine.search((2, 2, 0), (2.1, 2, 0), HybridAStarSettings(time_limit=0))
    with pytest.raises(SettingsError, match="reverse_penalty: expected"):
        HybridAStarSettings(reverse_penalty=0.5)
