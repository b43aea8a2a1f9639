"""Sampling of the states that a path may end in: the goals, and states within the tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np

from groundmap.arrays import Bools, Floats
from groundmap.errors import SettingsError
from planners.costmap.regions import nearest_cells
from planners.costmap.voxel_map import Voxels
from planners.errors import ProblemError
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.settings import FLAT, SamplingSettings

SAMPLES = 64  # states within the tolerances of all goals
MIN_SAMPLES = 4  # least number of them per goal
MAX_ATTEMPTS = 1024  # states tried per goal, at random and at centres of cells each


def goal_states(
    validator: MotionValidator,
    settings: SamplingSettings,
    goal: Pose,
    seed: int,
    *,
    within: Bools | None = None,
    poll: Callable[[], None] = lambda: None,
) -> list[Pose]:
    """Return the clear states in which a route may end.

    The goals themselves come first, then samples within the tolerances, nearest first. Samples are
    uniform over the disc (in 3-D the ball) of ``goal_radius`` and the yaws within
    ``goal_yaw_tolerance``. Where most of these are not clear, the centres of cells are tried as
    well, so a pocket of free cells is not missed.

    Parameters
    ----------
    validator : MotionValidator
    settings : SamplingSettings
    goal : tuple of float
        x, y (, z) [m, map] and, where the space has one, yaw [rad]; the yaw is optional if the
        tolerance covers all yaws.
    seed : int
    within : ndarray of bool, shape (rows, cols), optional
        Cells that a route can end in; on voxels of shape (layers, rows, cols).
    poll : callable, optional
        Called before each goal is sampled; it may raise to end the search.

    Returns
    -------
    list of states [m, corner; rad]
        Empty if none is clear.

    Raises
    ------
    ProblemError
        The goal has no yaw where the space needs one.
    SettingsError
        One of ``settings.goals`` has another number of coordinates.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.problem import PlanningProblem
    >>> from planners.sampling.motion_validator2d import MotionValidator2D
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(9, 9), footprint=0.9)
    >>> validator = MotionValidator2D(Costmap.of(problem), "r2", 1.0)
    >>> states = goal_states(validator, SamplingSettings(goal_radius=0.5), (9, 9), seed=0)
    >>> states[0] == validator.state_of((9, 9)), len(states)
    (True, 65)
    >>> max(math.dist(states[0], state) for state in states) <= 0.5
    True
    """
    goals = _check_goals(validator, settings, goal)
    has_yaw = validator.space not in FLAT
    exact = [
        state
        for place in goals
        if not has_yaw or len(place) > validator.axes
        for state in [validator.state_of(place)]
        if _is_valid(validator, state, within)
    ]
    if settings.goal_radius == 0.0 and not (has_yaw and settings.goal_yaw_tolerance > 0.0):
        return exact
    count = max(SAMPLES // len(goals), MIN_SAMPLES)
    samples: list[tuple[float, Pose]] = []
    for number, place in enumerate(goals):
        poll()
        rng = np.random.default_rng([seed, number])
        samples += _sample(validator, settings, place, rng, count, within=within)
    return [*exact, *(state for _, state in sorted(samples))]


def _check_goals(validator: MotionValidator, settings: SamplingSettings, goal: Pose) -> list[Pose]:
    """Return all goals; raise an error for one with a wrong number of coordinates."""
    axes = validator.axes
    any_yaw = validator.space in FLAT or settings.goal_yaw_tolerance >= math.pi
    counts = (axes, axes + 1) if any_yaw else (axes + 1,)
    expected = f"{', '.join('xyz'[:axes])} [m] and {'optionally ' if any_yaw else ''}yaw [rad]"
    if len(goal) not in counts:
        raise ProblemError("goal", f"{expected} in {validator.space}", str(goal))
    for number, other in enumerate(settings.goals):
        if len(other) not in counts:
            raise SettingsError(f"goals[{number}]", f"{expected} in {validator.space}", str(other))
    return [goal, *settings.goals]


def _sample(
    validator: MotionValidator,
    settings: SamplingSettings,
    goal: Pose,
    rng: np.random.Generator,
    count: int,
    *,
    within: Bools | None,
) -> list[tuple[float, Pose]]:
    """Return (distance to the goal, state) of clear states within the tolerances of one goal."""
    samples: list[tuple[float, Pose]] = []
    axes = validator.axes
    centre, yaw = goal[:axes], goal[axes:]
    centres = _cell_centres(validator, settings, centre, rng, within)
    for place in chain(_places_in_ball(settings, centre, rng), centres):
        turn = 0.0
        pose = place
        if validator.space not in FLAT:
            turn = float(rng.uniform(-1.0, 1.0)) * (settings.goal_yaw_tolerance if yaw else math.pi)
            pose = (*place, (yaw[0] if yaw else 0.0) + turn)
        state = validator.state_of(pose)
        if _is_valid(validator, state, within):
            distance = math.dist(place, centre)
            distance += settings.yaw_weight * (abs(turn) if yaw else 0.0)
            samples.append((distance, state))
            if len(samples) == count:
                break
    return samples


def _places_in_ball(
    settings: SamplingSettings, centre: Pose, rng: np.random.Generator
) -> Iterator[Pose]:
    """Yield places, uniformly over the disc or ball around a goal [map]."""
    axes = len(centre)
    directions = rng.normal(size=(MAX_ATTEMPTS, axes))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = settings.goal_radius * rng.random((MAX_ATTEMPTS, 1)) ** (1.0 / axes)
    yield from map(tuple, (np.array(centre) + radii * directions).tolist())


def _cell_centres(
    validator: MotionValidator,
    settings: SamplingSettings,
    centre: Pose,
    rng: np.random.Generator,
    within: Bools | None,
) -> Iterator[Pose]:
    """Yield, in random order, the centres of possibly clear cells within the goal radius [map]."""
    window, radius = validator.costmap.window, settings.goal_radius
    if radius == 0.0:
        return
    cells = _candidate_cells(validator) if within is None else _candidate_cells(validator) & within
    box = [
        validator.costmap.to_cells(np.array(centre) + side)[0, ::-1] for side in (-radius, radius)
    ]
    low, high = np.clip(np.floor(box), 0, np.array(cells.shape) - 1).astype(np.int64)
    part = tuple(map(slice, low.tolist(), (high + 1).tolist()))
    centres: Floats = window.cell_to_world(np.argwhere(cells[part]) + low)
    near = centres[np.linalg.norm(centres - centre, axis=1) <= radius]
    yield from map(tuple, rng.permutation(near)[:MAX_ATTEMPTS].tolist())


def may_contain_goal(
    cells: Bools, validator: MotionValidator, settings: SamplingSettings, goal: Pose
) -> bool:
    """Whether some cells may contain a place within the radius of a goal; False is a proof.

    Parameters
    ----------
    cells : ndarray of bool, shape (rows, cols) or (layers, rows, cols)
    validator : MotionValidator
    settings : SamplingSettings
    goal : tuple of float
        As for `goal_states`.
    """
    axes, window = validator.axes, validator.costmap.window
    limit = settings.goal_radius + math.sqrt(axes) * window.resolution
    goals = _check_goals(validator, settings, goal)
    return any(nearest_cells(window, cells, one[:axes])[1] <= limit for one in goals)


def _is_valid(validator: MotionValidator, state: Pose, within: Bools | None) -> bool:
    clear = validator.is_clear(*state, *state)
    return clear and (within is None or bool(within[validator.cell_of(state)]))


def _candidate_cells(validator: MotionValidator) -> Bools:
    """Return the cells at whose centre base_link may be clear; with a yaw, a superset of them."""
    costmap = validator.costmap
    if isinstance(costmap, Voxels) or validator.space in FLAT:
        return costmap.traversable
    radius = costmap.problem.shape.inscribed_radius
    if radius == 0.0:  # base_link may be over a blocked cell
        return np.ones_like(costmap.blocked)
    return ~costmap.blocked & (costmap.clearance >= radius - costmap.window.resolution)
