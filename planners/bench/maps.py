"""Queries on maps without published ones: two distant places in the same free region."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.io import load_map
from groundmap.io.load import LOADERS
from planners.bench.benchmark_problems import Case, Cases
from planners.costmap.costmap import Costmap
from planners.costmap.voxel_map import Voxels
from planners.errors import ProblemError
from planners.problem.footprint import Footprint
from planners.problem.problem import PlanningProblem

SAMPLES = 64  # random places; the two most distant ones are start and goal
SEED = 0  # of the random places


def find_maps(path: Path) -> list[Path]:
    """Return the file of a map, or the files of all maps below a folder.

    Raises
    ------
    InputError
        The path does not exist, or there is no map below the folder.
    """
    if path.is_file():
        return [path]
    if not path.exists():
        raise InputError(str(path), "a map, or a folder with maps", "nothing of that name")
    files = sorted(file for file in path.rglob("*") if file.suffix.lower() in LOADERS)
    if not files:
        raise InputError(str(path), f"a folder with maps ({', '.join(LOADERS)})", "none")
    return files


def cases_on(map_file: Path, footprint: Any, *, turning_radius: float) -> Cases:
    """Return one query on a map, for every state space of its dimension.

    Start and goal lie in the largest region in which the disc around the footprint can move; both
    headings point from the start to the goal. In 3-D the footprint is a ball of the same radius.

    Parameters
    ----------
    map_file : Path
    footprint : float [m] or array_like, shape (n, 2) [m, base_link]
    turning_radius : float [m]

    Raises
    ------
    ProblemError
        The footprint fits nowhere.
    """
    grid, shape = load_map(map_file), Footprint.of(footprint)
    problem = _make_problem(grid, shape if grid.ndim == 2 else Footprint.of(shape.radius))
    if grid.ndim == 3:
        return {"r3": Case(problem, {})}
    curve = {"turning_radius": turning_radius}
    return {
        "r2": Case(problem, {}),
        "se2": Case(problem, {}),
        "dubins": Case(problem, curve),
        "reeds_shepp": Case(problem, curve),
    }


def _make_problem(grid: ConfidenceGrid, footprint: Footprint) -> PlanningProblem:
    """Return a problem between two distant places."""
    low, high = np.split(grid.bounds(), 2)
    centre = tuple(((low + high) / 2.0).tolist())
    blank = PlanningProblem(grid, start=centre, goal=centre, footprint=footprint, clear_start=False)
    start, goal = _distant_places(Costmap.of(blank) if grid.ndim == 2 else Voxels.of(blank))
    if grid.ndim == 3:
        return replace(blank, start=tuple(start), goal=tuple(goal))
    yaw = math.atan2(*(goal - start)[::-1])
    return replace(blank, start=(*start, yaw), goal=(*goal, yaw))


def _distant_places(space: Costmap | Voxels) -> tuple[Floats, Floats]:
    """Return the centres of two distant cells in the largest traversable region [m, map]."""
    regions, count = ndimage.label(space.traversable)
    if count == 0:
        needed = f"a place for a footprint of radius {space.radius:.2f} m"
        raise ProblemError("map", needed, "none on the whole of it")
    largest = 1 + int(np.argmax(np.bincount(regions.ravel())[1:]))
    cells = np.argwhere(regions == largest)
    rng = np.random.default_rng(SEED)
    places = space.window.cell_to_world(cells[rng.integers(len(cells), size=SAMPLES)])
    distances = np.linalg.norm(places[:, None] - places, axis=-1)
    i, j = np.unravel_index(int(np.argmax(distances)), distances.shape)
    return places[i], places[j]
