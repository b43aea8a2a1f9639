"""Scenarios on 3-D maps: their window, the true map, routes in it, the picture."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from groundmap.grid.grid import ConfidenceGrid
from groundmap.grid.window import CellState
from groundmap.settings import MapperSettings
from groundmap.simulate.drive import Drive, DriveSettings, drive
from groundmap.simulate.sensor import SensorSettings
from groundmap.simulate.voxel_truth import voxel_truth_of
from groundmap.simulate.world import Solid, World
from planners.scenario.queries import QuerySettings
from planners.scenario.routes import compare_with_truth, run_query, true_map
from planners.scenario.run import _picture
from planners.scenario.simulated import Simulated, _window

BOUNDS = (0.0, 0.0, 6.0, 3.0)
RESOLUTION = 0.2
WALL = shapely.box(2.9, 0.0, 3.1, 3.0)
# A wall with a window from 1.0 to 2.0 m, as wide as the room.
WORLD = World(
    bounds=BOUNDS,
    solids=(Solid(WALL, top=1.0), Solid(WALL, bottom=2.0, top=2.6)),
)
QUERY = QuerySettings(
    name="through", start=(1.0, 1.5, 0.6), goal=(5.0, 1.5, 0.6), footprint=0.3, robot_radius=0.25
)


def moves() -> Drive:
    return drive(DriveSettings(stops=((0.5, 1.5, 0), (2.0, 1.5, 0))), np.random.default_rng(1))


@pytest.fixture(scope="module")
def simulated() -> Simulated:
    """Return a world whose map is the truth, seen or not."""
    grid = ConfidenceGrid(resolution=RESOLUTION, origin=(0, 0, 0))
    box = grid.box((0, 0, -0.2, 6, 3, 3))
    blocked = voxel_truth_of(WORLD, moves(), SensorSettings(), box, MapperSettings()).nonfree
    grid.fuse(box.lower, np.where(blocked, 1.0, -1.0).astype(np.float32))
    window = _window(WORLD, grid, (0.15, 2.4))
    truth = voxel_truth_of(WORLD, moves(), SensorSettings(), window, MapperSettings())
    return Simulated(WORLD, grid, window, truth, np.zeros(window.count.shape, dtype=np.bool_))


def test_voxels_are_measured_whose_centres_are_between_the_heights(simulated: Simulated) -> None:
    assert simulated.window.origin[2] == pytest.approx(0.2)  # the voxel from 0 on is centred at 0.1
    assert simulated.window.shape[0] == 11  # up to the one that is centred at 2.3 m


def test_the_true_map_reaches_from_the_ground_to_above_all_solids(simulated: Simulated) -> None:
    fine = true_map(simulated)
    states = fine.window((2.95, 1.4, 0, 3.0, 1.45, 3.5)).states()[:, 0, 0]
    height = (np.arange(len(states)) + 0.5) * 0.05
    in_wall = (height < 1.0) | ((height > 2.0) & (height < 2.6))
    np.testing.assert_array_equal(states == CellState.NONFREE, in_wall)
    below = fine.window((1.0, 1.0, -0.049, 1.01, 1.01, -0.001)).states()
    assert (below == CellState.NONFREE).all()


def test_a_route_through_a_window_is_compared_with_the_best_one(simulated: Simulated) -> None:
    answer = compare_with_truth(run_query(QUERY, simulated.grid), simulated, true_map(simulated))
    figures = answer.figures
    assert figures["outcome"] == "route"
    assert figures["collisions"] == 0
    assert isinstance(figures["true_clearance"], float)
    assert 0.3 <= figures["true_clearance"] <= 0.6
    assert isinstance(figures["ratio"], float)
    assert 0.98 <= figures["ratio"] <= 1.1
    assert answer.waypoints is not None
    at_wall = np.interp(3.0, answer.waypoints[:, 0], answer.waypoints[:, 2])
    assert 1.3 <= at_wall <= 1.7


def test_a_route_along_the_ground_collides_with_it(simulated: Simulated) -> None:
    low = run_query(QUERY, simulated.grid)
    line = np.array([(1.0, 1.5, 0.2), (2.0, 1.5, 0.2)])
    answer = compare_with_truth(low._replace(waypoints=line), simulated, true_map(simulated))
    assert answer.figures["collisions"] == 1
    assert answer.figures["true_clearance"] == pytest.approx(0.2)


def test_the_clearance_of_a_line_is_that_to_each_solid_and_the_ground(simulated: Simulated) -> None:
    line = np.array([(1.0, 1.5, 1.2), (5.0, 1.5, 1.2), (5.0, 1.5, 0.4)])
    expected = [0.2, 0.8, 0.4]
    np.testing.assert_allclose(simulated.truth.clearances(line), expected, atol=1e-9)


def test_the_picture_of_a_3d_map_is_drawn(simulated: Simulated) -> None:
    answer = run_query(QUERY, simulated.grid)
    assert _picture(simulated, [answer], "window").startswith(b"\x89PNG")
