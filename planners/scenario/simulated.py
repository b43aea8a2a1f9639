"""Map a simulated world, and compute the truth to compare the map with."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from groundmap import CellState, ConfidenceGrid, GridWindow, GroundMapper, View, fit_ground
from groundmap.arrays import Bools
from groundmap.draw import known_bounds
from groundmap.errors import InputError
from groundmap.simulate import Drive, World, drive, observe, sample_landmarks
from groundmap.simulate.known_map import KnownMap
from groundmap.simulate.scan import scan
from groundmap.simulate.truth import touched_cells, truth_of
from groundmap.simulate.voxel_truth import voxel_truth_of
from planners.scenario.case import Scenario

MOST_CELLS = 4e6  # in a world, since it is compared cell by cell
#: By dimension of the map.
TRUTHS: dict[int, Callable[..., KnownMap]] = {2: truth_of, 3: voxel_truth_of}


class Simulated(NamedTuple):
    """A world, its map, and the truth."""

    world: World
    grid: ConfidenceGrid
    window: GridWindow  #: cells of the map that the truth covers
    truth: KnownMap
    moving: Bools  #: cells of the window that moving solids are in at the end


def simulate(scenario: Scenario) -> Simulated:
    """Drive through a scenario's world and map the views as those of a log."""
    world = build_world(scenario)
    assert scenario.drive is not None
    moves = drive(scenario.drive, np.random.default_rng((scenario.seed, 1)))
    if world.relief is not None:
        moves = moves.lifted(world.relief)
    mapper = GroundMapper(**scenario.mapper.model_dump())
    height = scenario.sensor.camera_height if scenario.level_ground else None
    views = views_of(scenario, world, moves)
    if not scenario.flies:
        views = fit_ground(views, camera_height=height, **scenario.ground.model_dump())
    for view in views:
        mapper.integrate(view)
    window = _window(world, mapper.grid, scenario.heights)
    make_truth = TRUTHS[mapper.grid.ndim]
    truth = make_truth(world, moves, scenario.sensor, window, scenario.mapper)
    moving = _moving(scenario, world, window, float(moves.times[-1]))
    return Simulated(world, mapper.grid, window, truth, moving)


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
    """Return the cells that moving solids are in at a time [s]; none on a 3-D map."""
    if window.count.ndim == 3:
        return np.zeros(window.count.shape, dtype=np.bool_)
    solids = tuple(solid for solid in world.solids if solid.velocity != (0.0, 0.0))
    heights = scenario.mapper.step_height, scenario.mapper.robot_height
    there = replace(world, solids=solids).at(time).obstacles(*heights)
    return touched_cells(there, window.origin, window.resolution, window.count.shape)


def build_world(scenario: Scenario) -> World:
    """Return the world of a scenario: that of its generator with the listed parts."""
    assert scenario.world is not None
    world = scenario.world.make(np.random.default_rng((scenario.seed, 0)))
    solids = [solid for settings in scenario.solids for solid in settings.solids()]
    holes = [settings.hole() for settings in scenario.holes]
    return replace(
        world,
        solids=(*world.solids, *solids),
        holes=(*world.holes, *holes),
        relief=scenario.relief.relief() if scenario.relief else None,
    )


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


def _window(world: World, grid: ConfidenceGrid, heights: tuple[float, float]) -> GridWindow:
    """Return the cells of the map in the bounds of the world and of all observed cells.

    In 3-D, only voxels whose centres are between two heights.
    """
    known = known_bounds(grid)
    low = np.minimum(world.bounds[:2], known[:2])
    high = np.maximum(world.bounds[2:], known[grid.ndim : grid.ndim + 2])
    if grid.ndim == 3:
        half = 0.5 * grid.resolution
        low, high = np.append(low, heights[0] + half), np.append(high, heights[1] - half)
    cells = float(np.prod((high - low) / grid.resolution))
    if cells > MOST_CELLS:
        raise InputError(
            "world",
            f"{MOST_CELLS:g} cells at most",
            f"{cells:.3g}",
            hint="Give smaller bounds [m], or a coarser resolution [m].",
        )
    return grid.window(np.concatenate([low, high]))
