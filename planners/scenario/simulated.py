"""Map a simulated world, and compute the truth to compare the map with."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from groundmap import CellState, ConfidenceGrid, GridWindow, GroundMapper, View, fit_ground
from groundmap.arrays import Bools
from groundmap.draw import known_bounds
from groundmap.errors import InputError
from groundmap.simulate import Drive, World, drive, observe, sample_landmarks
from groundmap.simulate.scan import scan
from groundmap.simulate.truth import Truth, touched_cells, truth_of
from planners.scenario.case import Scenario

MOST_CELLS = 4e6  # in a world, since it is compared cell by cell


class Simulated(NamedTuple):
    """A world, its map, and the truth."""

    world: World
    grid: ConfidenceGrid
    window: GridWindow  #: cells of the map that the truth covers
    truth: Truth
    moving: Bools  #: cells of the window that moving solids are in at the end


def simulate(scenario: Scenario) -> Simulated:
    """Drive through a scenario's world and map the views as those of a log."""
    world = build_world(scenario)
    assert scenario.drive is not None
    moves = drive(scenario.drive, np.random.default_rng((scenario.seed, 1)))
    mapper = GroundMapper(**scenario.mapper.model_dump())
    height = scenario.sensor.camera_height if scenario.level_ground else None
    views = views_of(scenario, world, moves)
    for view in fit_ground(views, camera_height=height, **scenario.ground.model_dump()):
        mapper.integrate(view)
    window = _window(world, mapper.grid)
    truth = truth_of(world, moves, scenario.sensor, window, scenario.mapper)
    time = float(moves.times[-1])
    return Simulated(world, mapper.grid, window, truth, _moving(scenario, world, window, time))


def moving_figures(simulated: Simulated) -> dict[str, float]:
    """Return how the last view and the map see the cells that moving solids are in at the end.

    ``moving_nonfree`` is the share that is non-free for planning with `ConfidenceGrid.recent`,
    ``moving_free_on_map`` the share that the map calls free. Without such solids, no figures.
    """
    if not simulated.moving.any():
        return {}
    states = simulated.window.states()[simulated.moving]
    recent = simulated.grid.recent
    first = np.rint((simulated.window.origin - recent.origin) / recent.resolution)
    now = recent.mask(first.astype(np.int64)[::-1], simulated.moving.shape)[simulated.moving]
    return {
        "moving_nonfree": float((now | (states == CellState.NONFREE)).mean()),
        "moving_free_on_map": float((states == CellState.FREE).mean()),
    }


def _moving(scenario: Scenario, world: World, window: GridWindow, time: float) -> Bools:
    """Return the cells that moving solids are in at a time [s]."""
    solids = tuple(solid for solid in world.solids if solid.velocity != (0.0, 0.0))
    heights = scenario.mapper.step_height, scenario.mapper.robot_height
    there = replace(world, solids=solids).at(time).obstacles(*heights)
    return touched_cells(there, window.origin, window.resolution, window.count.shape)


def build_world(scenario: Scenario) -> World:
    """Return the world of a scenario: that of its generator with the listed solids and holes."""
    assert scenario.world is not None
    world = scenario.world.make(np.random.default_rng((scenario.seed, 0)))
    solids = [solid for settings in scenario.solids for solid in settings.solids()]
    holes = [settings.hole() for settings in scenario.holes]
    return replace(world, solids=(*world.solids, *solids), holes=(*world.holes, *holes))


def views_of(scenario: Scenario, world: World, moves: Drive) -> Iterable[View]:
    """Return the views of the scenario's sensor; with ``[scan]``, those of an ideal sensor.

    Parameters
    ----------
    scenario : Scenario
    world : World
    moves : Drive
    """
    if scenario.scan is not None:
        return scan(world, moves, scenario.sensor, scenario.scan, scenario.mapper)
    landmarks = sample_landmarks(world, np.random.default_rng((scenario.seed, 2)))
    return observe(world, landmarks, moves, scenario.sensor, seed=scenario.seed)


def _window(world: World, grid: ConfidenceGrid) -> GridWindow:
    """Return the cells of the map in the bounds of the world and of all observed cells."""
    known = known_bounds(grid)
    low = np.minimum(world.bounds[:2], known[:2])
    high = np.maximum(world.bounds[2:], known[2:])
    cells = float(np.prod((high - low) / grid.resolution))
    if cells > MOST_CELLS:
        raise InputError(
            "world",
            f"{MOST_CELLS:g} cells at most",
            f"{cells:.3g}",
            hint="Give smaller bounds [m], or a coarser resolution [m].",
        )
    return grid.window(np.concatenate([low, high]))
