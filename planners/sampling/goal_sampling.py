"""Where a search may end: the goal, other goals that will do, and what is near enough to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np

from groundmap.arrays import Bools, Floats
from groundmap.errors import SettingsError
from planners.errors import ProblemError
from planners.problem.problem import Pose
from planners.sampling.motion_validator import MotionValidator
from planners.sampling.motion_validator3d import MotionValidator3D
from planners.sampling.settings import FLAT, SamplingSettings

SAMPLES = 64  # of what is near enough to the goals, altogether
LEAST = 4  # and for each of them
TRIES = 1024  # at either way to find those of one goal


def goal_states(
    validator: MotionValidator | MotionValidator3D,
    settings: SamplingSettings,
    goal: Pose,
    seed: int,
    *,
    within: Bools | None = None,
    look: Callable[[], None] = lambda: None,
) -> list[Pose]:
    """Return the clear states in which a route may end; none if there is none.

    First come the goals themselves, then samples of what is near enough to them, nearest first.
    Samples are drawn evenly from the disc (in 3-D the ball) of ``goal_radius`` and from the
    headings within ``goal_yaw_tolerance``. Where most of these are not clear, the centres of cells
    are tried as well, so a pocket of free cells is not missed.

    Parameters
    ----------
    validator : MotionValidator or MotionValidator3D
    settings : SamplingSettings
    goal : tuple of float
        x, y (in 3-D: x, y, z) [m, map] and, where the space has it, yaw [rad]. Where any heading
        will do, it needs no yaw.
    seed : int
    within : ndarray of bool, shape (rows, cols), optional
        Cells that a route can end in; on voxels of shape (layers, rows, cols).
    look : callable, optional
        Called before each goal is sampled; it may raise.

    Returns
    -------
    list of states [m, corner; rad]

    Raises
    ------
    ProblemError
        A goal that lacks a yaw.
    SettingsError
        One of ``settings.goals`` that is not of so many numbers.

    Examples
    --------
    >>> from groundmap import ConfidenceGrid
    >>> from planners.costmap.costmap import Costmap
    >>> from planners.problem.problem import PlanningProblem
    >>> grid = ConfidenceGrid(resolution=0.5)
    >>> grid.fuse(np.array([0, 0]), np.full((64, 64), -1.0, dtype=np.float32))
    >>> problem = PlanningProblem(grid, start=(2, 2), goal=(9, 9), footprint=0.9)
    >>> validator = MotionValidator(Costmap.of(problem), "r2", 1.0)
    >>> states = goal_states(validator, SamplingSettings(goal_radius=0.5), (9, 9), seed=0)
    >>> states[0] == validator.state_of((9, 9)), len(states)
    (True, 65)
    >>> max(math.dist(states[0], state) for state in states) <= 0.5
    True
    """
    goals = _check_goals(validator, settings, goal)
    axes = _axes(validator)
    turns = validator.space not in FLAT
    exact = [
        state
        for place in goals
        if not turns or len(place) > axes
        for state in [validator.state_of(place)]
        if _will_do(validator, state, within)
    ]
    if settings.goal_radius == 0.0 and not (turns and settings.goal_yaw_tolerance > 0.0):
        return exact
    count = max(SAMPLES // len(goals), LEAST)
    samples: list[tuple[float, Pose]] = []
    for number, place in enumerate(goals):
        look()
        rng = np.random.default_rng([seed, number])
        samples += _samples(validator, settings, place, rng, count, within=within)
    return [*exact, *(state for _, state in sorted(samples))]


def _check_goals(
    validator: MotionValidator | MotionValidator3D, settings: SamplingSettings, goal: Pose
) -> list[Pose]:
    """Return all goals, each of as many numbers as the space asks for."""
    axes = _axes(validator)
    anyhow = validator.space in FLAT or settings.goal_yaw_tolerance >= math.pi
    counts = (axes, axes + 1) if anyhow else (axes + 1,)
    expected = f"{', '.join('xyz'[:axes])} [m] and {'optionally ' if anyhow else ''}yaw [rad]"
    if len(goal) not in counts:
        raise ProblemError("goal", f"{expected} in {validator.space}", str(goal))
    for number, other in enumerate(settings.goals):
        if len(other) not in counts:
            raise SettingsError(f"goals[{number}]", f"{expected} in {validator.space}", str(other))
    return [goal, *settings.goals]


def _samples(
    validator: MotionValidator | MotionValidator3D,
    settings: SamplingSettings,
    goal: Pose,
    rng: np.random.Generator,
    count: int,
    *,
    within: Bools | None,
) -> list[tuple[float, Pose]]:
    """Return clear states near enough to one goal, each after its distance to it."""
    found: list[tuple[float, Pose]] = []
    axes = _axes(validator)
    centre, yaw = goal[:axes], goal[axes:]
    centres = _centres(validator, settings, centre, rng, within)
    for place in chain(_disc(settings, centre, rng), centres):
        turn = 0.0
        pose = place
        if validator.space not in FLAT:
            turn = float(rng.uniform(-1.0, 1.0)) * (settings.goal_yaw_tolerance if yaw else math.pi)
            pose = (*place, (yaw[0] if yaw else 0.0) + turn)
        state = validator.state_of(pose)
        if _will_do(validator, state, within):
            away = math.dist(place, centre) + settings.yaw_weight * (abs(turn) if yaw else 0.0)
            found.append((away, state))
            if len(found) == count:
                break
    return found


def _disc(settings: SamplingSettings, centre: Pose, rng: np.random.Generator) -> Iterator[Pose]:
    """Yield places, evenly over the disc or ball around a goal [map]."""
    axes = len(centre)
    directions = rng.normal(size=(TRIES, axes))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = settings.goal_radius * rng.random((TRIES, 1)) ** (1.0 / axes)
    yield from map(tuple, (np.array(centre) + radii * directions).tolist())


def _centres(
    validator: MotionValidator | MotionValidator3D,
    settings: SamplingSettings,
    centre: Pose,
    rng: np.random.Generator,
    within: Bools | None,
) -> Iterator[Pose]:
    """Yield centres of cells near enough to a goal where the footprint may fit [map], shuffled."""
    window, radius = validator.costmap.window, settings.goal_radius
    if radius == 0.0:
        return
    places = _places(validator) if within is None else _places(validator) & within
    box = [
        validator.costmap.to_cells(np.array(centre) + side)[0, ::-1] for side in (-radius, radius)
    ]
    low, high = np.clip(np.floor(box), 0, np.array(places.shape) - 1).astype(np.int64)
    part = tuple(map(slice, low.tolist(), (high + 1).tolist()))
    centres: Floats = window.cell_to_world(np.argwhere(places[part]) + low)
    near = centres[np.linalg.norm(centres - centre, axis=1) <= radius]
    yield from map(tuple, rng.permutation(near)[:TRIES].tolist())


def come_near(
    validator: MotionValidator | MotionValidator3D,
    settings: SamplingSettings,
    goal: Pose,
    cells: Bools,
) -> bool:
    """Whether any place in some cells may be near enough to a goal: if not, that is a proof."""
    axes, window = _axes(validator), validator.costmap.window
    centres: Floats = window.cell_to_world(np.argwhere(cells))
    most = settings.goal_radius + math.sqrt(axes) * window.resolution
    goals = _check_goals(validator, settings, goal)
    return any((np.linalg.norm(centres - one[:axes], axis=1) <= most).any() for one in goals)


def _will_do(
    validator: MotionValidator | MotionValidator3D, state: Pose, within: Bools | None
) -> bool:
    clear = validator.is_clear(*state, *state)
    return clear and (within is None or bool(within[validator.cell_of(state)]))


def _places(validator: MotionValidator | MotionValidator3D) -> Bools:
    """Return the cells on whose centre base_link may be, and with a yaw some more."""
    if isinstance(validator, MotionValidator3D) or validator.space in FLAT:
        return validator.costmap.traversable
    costmap, radius = validator.costmap, validator.costmap.problem.shape.inscribed_radius
    if radius == 0.0:  # base_link may be over what is blocked
        return np.ones_like(costmap.blocked)
    return ~costmap.blocked & (costmap.clearance >= radius - costmap.window.resolution)


def _axes(validator: MotionValidator | MotionValidator3D) -> int:
    return 3 if validator.space == "r3" else 2
