"""Mapping a simulated world, and the truth to compare the map with."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from groundmap import ConfidenceGrid, GridWindow, GroundMapper, View, fit_ground
from groundmap.draw import known_bounds
from groundmap.errors import InputError
from groundmap.simulate import Drive, World, drive, observe, sample_landmarks
from groundmap.simulate.scan import scan
from groundmap.simulate.truth import Truth, truth_of
from planners.scenario.case import Scenario

MOST_CELLS = 4e6  # of a world that is compared cell by cell


class Simulated(NamedTuple):
    """A world, what was mapped of it, and what is true."""

    world: World
    grid: ConfidenceGrid
    window: GridWindow  #: of the grid: all that the truth speaks of
    truth: Truth


def simulate(scenario: Scenario) -> Simulated:
    """Drive through a scenario's world and map it, as a user would map a log."""
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
    return Simulated(world, mapper.grid, window, truth)


def build_world(scenario: Scenario) -> World:
    """Return the world of a scenario: what its generator makes, and what is named one by one."""
    assert scenario.world is not None
    made = scenario.world.make(np.random.default_rng((scenario.seed, 0)))
    solids = [solid for settings in scenario.solids for solid in settings.solids()]
    holes = [settings.hole() for settings in scenario.holes]
    return replace(made, solids=(*made.solids, *solids), holes=(*made.holes, *holes))


def views_of(scenario: Scenario, world: World, moves: Drive) -> Iterable[View]:
    """Return the views of the scenario's sensor, or of the ideal one that it asks for."""
    if scenario.scan is not None:
        return scan(world, moves, scenario.sensor, scenario.scan, scenario.mapper)
    landmarks = sample_landmarks(world, np.random.default_rng((scenario.seed, 2)))
    return observe(world, landmarks, moves, scenario.sensor, seed=scenario.seed)


def _window(world: World, grid: ConfidenceGrid) -> GridWindow:
    """Return the map's window around the world and all that the map speaks of."""
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
