"""Random planning problems and planner settings for tools/crash_matrix.py."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, get_args

import numpy as np
from scipy import ndimage

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools, Floats, Floats32
from planners import PlanningProblem, SamplingSettings
from planners.problem.costs import CostSettings
from planners.problem.problem import Unknown
from planners.registry import OWN_PLANNERS
from planners.sampling.objectives import COST_AWARE
from planners.sampling.ompl_module import has_parameter, samplers
from planners.sampling.ompl_parameters import PARAMETERS
from planners.sampling.settings import TURNING, StateSpace, refusal

RESOLUTIONS = (-2.0, 3.0)  # decimal logarithm of a cell's side [m]
ORIGINS = (0.0, 7.0)  # decimal logarithm of the distance of the grid's origin [m]
SIDES, LARGE = (8, 40), (200, 600)  # of maps [cells]; a few are large
LIMITS = (0.0, 0.01, 0.03, 0.1)  # [s]
CAR = np.array([(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)])
ELL = np.array([(-0.4, -0.4), (1.2, -0.4), (1.2, 0.0), (0.0, 0.0), (0.0, 0.8), (-0.4, 0.8)])
UNKNOWN, CONTESTED = 0.0, 0.005  # confidence
UNIFORM = ("jps", "jps+", "lazy_theta", "polyanya", "theta")  # they need uniform costs
WEIGHING = (COST_AWARE | OWN_PLANNERS.keys()) - set(UNIFORM)  # planners that consider costs


class Attempt(NamedTuple):
    """A problem, a planner and its settings."""

    problem: PlanningProblem
    planner: str
    settings: dict[str, Any]


class Choice(NamedTuple):
    """Planners and spaces to draw from."""

    planners: tuple[str, ...]
    spaces: tuple[StateSpace, ...] = get_args(StateSpace)
    refused: bool = False  #: whether refused combinations are drawn, too


def all_planners() -> tuple[str, ...]:
    """Return the names of all planners, including OMPL's."""
    return (*sorted(OWN_PLANNERS), *sorted(samplers()))


def draw(choice: Choice, seed: int, number: int) -> Attempt:
    """Return an attempt; it depends only on seed and number."""
    rng = np.random.default_rng([seed, number])
    planner = str(rng.choice(choice.planners))
    space: StateSpace | None = None
    if planner in samplers():
        allowed = [s for s in choice.spaces if choice.refused or refusal(planner, s) is None]
        if not allowed:
            allowed = list(choice.spaces)
        space = allowed[rng.integers(len(allowed))]
    elif planner in ("astar", "auto") and "r3" in choice.spaces and rng.random() < 0.1:
        space = "r3"
    size = 10.0 ** rng.uniform(*RESOLUTIONS)
    axes = 3 if space == "r3" else 2
    field = _field(rng, axes)
    origin = np.zeros(axes)
    if rng.random() < 0.7:
        origin = rng.choice([-1.0, 1.0], axes) * 10.0 ** rng.uniform(*ORIGINS, axes)
    grid = ConfidenceGrid(resolution=size, origin=origin.tolist())
    grid.fuse(np.zeros(axes, dtype=np.int64), field)
    unknown = rng.choice(get_args(Unknown), p=[0.5, 0.2, 0.3]).item()
    radius = float(rng.choice([0.0, 0.3, 1.0, 2.5]))  # [cells]
    footprint: Any = size * radius
    if axes == 2 and rng.random() < 0.5:
        outline = CAR if rng.random() < 0.7 else ELL
        footprint = size * (0.3 + radius) * outline
    blocked = field > CONTESTED if unknown != "avoid" else field > -2.0 * CONTESTED
    places = _places(rng, ~blocked, radius)
    start, goal = (_pose(rng, places, size, origin) for _ in range(2))
    if rng.random() < 0.1:
        goal = _near(rng, start, size)
    problem = PlanningProblem(
        grid,
        start=start,
        goal=goal,
        footprint=footprint,
        unknown=unknown,
        costs=_costs(rng, size) if planner in WEIGHING or rng.random() < 0.1 else CostSettings(),
        clear_start=bool(rng.random() < 0.7),
    )
    settings: dict[str, Any] = {"time_limit": float(rng.choice(LIMITS))}
    if planner in samplers():
        assert space is not None
        settings["space"] = space
        settings |= _sampling(rng, planner, space, places=places, size=size, origin=origin)
    elif planner == "hybrid_astar":
        settings["turning_radius"] = _turning_radius(rng, size)
        settings["motion"] = rng.choice(["dubins", "reeds_shepp"]).item()
    return Attempt(problem, planner, settings)


def _field(rng: np.random.Generator, axes: int) -> Floats32:
    """Return evidence: random cells, walls, boxes or open space, partly unknown and contested."""
    low, high = SIDES if axes == 2 else (4, 14)
    if axes == 2 and rng.random() < 0.01:
        low, high = LARGE
    shape = tuple(rng.integers(low, high + 1, axes).tolist())
    field = np.full(shape, -1.0, dtype=np.float32)
    kind = rng.integers(4)
    if kind == 0:
        field[rng.random(shape) < rng.uniform(0.0, 0.35)] = 1.0
    elif kind == 1:
        _add_walls(rng, field)
    elif kind == 2:
        for _ in range(rng.integers(1, 6)):
            field[_box(rng, shape)] = 1.0
    for _ in range(rng.integers(3)):
        field[_box(rng, shape)] = rng.choice([UNKNOWN, CONTESTED, -CONTESTED])
    if rng.random() < 0.5:
        field *= rng.uniform(0.05, 1.0, shape).astype(np.float32)
    return field


def _add_walls(rng: np.random.Generator, field: Floats32) -> None:
    """Add walls across the map, each with a door."""
    for axis, length in enumerate(field.shape):
        for _ in range(rng.integers(1, 3)):
            wall: list[Any] = [slice(None)] * field.ndim
            wall[axis] = int(rng.integers(length))
            field[tuple(wall)] = 1.0
            for other in set(range(field.ndim)) - {axis}:
                at = int(rng.integers(field.shape[other]))
                wall[other] = slice(max(at - 3, 0), at + 3)
            field[tuple(wall)] = -1.0


def _box(rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[slice, ...]:
    edges = [np.sort(rng.integers(0, length + 1, 2)).tolist() for length in shape]
    return tuple(slice(low, high) for low, high in edges)


def _places(rng: np.random.Generator, free: Bools, radius: float) -> Bools:
    """Return cells for starts and goals: mostly those with clearance."""
    distance = ndimage.distance_transform_edt(np.pad(free, 1))[(slice(1, -1),) * free.ndim] - 0.5
    for places in (distance >= 1.5 * radius, free):
        if places.any() and rng.random() < 0.9:
            return np.asarray(places)
    return np.ones_like(free)


def _pose(
    rng: np.random.Generator, places: Bools, size: float, origin: Floats
) -> tuple[float, ...]:
    """Return a position in one of the cells, and a yaw on 2-D maps [map]."""
    cells = np.argwhere(places)
    cell = cells[rng.integers(len(cells))][::-1]
    within = 0.5 if rng.random() < 0.5 else rng.random(len(cell))
    place = (origin + (cell + within) * size).tolist()
    if places.ndim == 3:
        return tuple(place)
    yaw = rng.uniform(-math.pi, math.pi) if rng.random() < 0.7 else rng.choice([0.0, math.pi / 2])
    return (*place, float(yaw))


def _near(rng: np.random.Generator, pose: tuple[float, ...], size: float) -> tuple[float, ...]:
    """Return the same pose, or one that is slightly different."""
    shift = float(rng.choice([0.0, 1e-9, 0.01])) * size
    turn = float(rng.choice([0.0, 1e-9, math.pi]))
    return (pose[0] + shift, *pose[1:-1], pose[-1] + (turn if len(pose) == 3 else 0.0))


def _costs(rng: np.random.Generator, size: float) -> CostSettings:
    weights = rng.choice([0.0, 0.0, 0.5, 10.0, 1000.0], 3).tolist()
    return CostSettings(
        clearance_weight=weights[0],
        confidence_weight=weights[1],
        unknown_weight=weights[2],
        inflation_radius=min(float(rng.choice([0.0, 1.0, 5.0])) * size, 1000.0),
        cost_scaling_factor=min(float(rng.choice([0.0, 0.3, 3.0])) / size, 1000.0),
    )


def _turning_radius(rng: np.random.Generator, size: float) -> float:
    """Return a radius that suits the map, or sometimes an end of the valid range [m]."""
    if rng.random() < 0.1:
        return float(rng.choice([0.01, 1000.0]))
    return float(np.clip(size * rng.uniform(0.5, 8.0), 0.01, 1000.0))


def _sampling(
    rng: np.random.Generator,
    planner: str,
    space: StateSpace,
    *,
    places: Bools,
    size: float,
    origin: Floats,
) -> dict[str, Any]:
    """Return settings of a sampling planner."""
    settings: dict[str, Any] = {
        "seed": int(rng.integers(2**31)),
        "improve_for": float(rng.choice([0.0, 0.02, 1.0])),
        "warm_start": bool(rng.random() < 0.2),
        "keep_graph": bool(planner != "bitstar" and rng.random() < 0.1),
        "simplify": bool(rng.random() < 0.7),
    }
    if space in TURNING:
        settings["turning_radius"] = _turning_radius(rng, size)
    if space == "se2":
        settings["yaw_weight"] = float(np.clip(size * rng.choice([1e-6, 1.0, 100.0]), 1e-9, 1000.0))
    kind = rng.integers(4) if planner not in ("bfmt", "prm", "prmstar") else 0
    if kind == 1:
        count = rng.integers(1, 5)
        settings["goals"] = [_pose(rng, places, size, origin) for _ in range(count)]
    elif kind == 2:
        settings["goal_radius"] = min(float(rng.choice([0.5, 3.0, 100.0])) * size, 1e6)
        settings["goal_yaw_tolerance"] = float(rng.choice([0.0, 0.3, math.pi]))
    if rng.random() < 0.2:
        settings["time_weight"] = float(rng.choice([1e-6, 1.0, 1000.0]))
        settings["max_turn_rate"] = float(rng.choice([0.1, 1000.0]))
    if planner not in ("prm", "prmstar") and rng.random() < 0.2:
        settings["iterations"] = int(rng.choice([1, 10, 1000]))
    own = [name for name in PARAMETERS if has_parameter(planner, name)]
    for name in own:
        if rng.random() < 0.1:
            settings[name] = rng.choice(ends_of(name)).item()
    return settings


def ends_of(name: str) -> list[Any]:
    """Return the least and the greatest value of a parameter, and one in between."""
    field = SamplingSettings.model_fields[name]
    bounds = {
        key: getattr(rule, key)
        for rule in field.metadata
        for key in ("ge", "gt", "le")
        if hasattr(rule, key)
    }
    if not bounds:
        return [False, True]
    least, most = bounds.get("ge", 5e-324), bounds.get("le", 1e300)
    return [least, most, type(least)(math.sqrt(max(least, 1e-6) * most))]
