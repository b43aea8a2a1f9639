"""Try every planner of OMPL in every space, each in a process of its own, to see who crashes.

What is refused by `planners.sampling.settings.REFUSED` is tried all the same. Run it when another
version of OMPL comes out::

    .venv/bin/python tools/try_samplers.py [--seeds 3] [--planner NAME] [--map NAME]

tries the maps; a line for each says how that ended: in a route, in an error of ours (which is as
good), or in the end of the process, in a search that hangs, in noise on stderr. With

    .venv/bin/python tools/try_samplers.py --extremes [--planner NAME]

every parameter of the planners is tried at both ends of what its setting allows, in the rooms and
where nothing is in the way. Bounds that are too wide show up here. All takes hours; lines that are
in capitals are those to look at::

    .venv/bin/python tools/try_samplers.py --extremes | grep -E "ENDS|HANGS|NOISE|FOREIGN"
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, NamedTuple, get_args

import numpy as np

from groundmap import ConfidenceGrid
from groundmap.arrays import Floats32
from groundmap.errors import SettingsError
from planners import NoRouteError, PlanningProblem, ProblemError, SamplingSettings, plan
from planners.sampling import settings
from planners.sampling.door import has_parameter, samplers
from planners.sampling.settings import PARAMETERS, Space

SIDE, DOOR = 32, 8  # [cells] of a room, of a door
CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
PATIENCE = 30.0  # [s] of which a search takes 5 at most
MEMORY = 4 * 2**30  # [bytes] that a search may ask for
SPACES: tuple[Space, ...] = tuple(space for space in get_args(Space) if space != "r3")
Pose = tuple[float, float, float]


class World(NamedTuple):
    """Evidence in cells of 0.25 m, and from where to where."""

    z: Floats32
    start: Pose
    goal: Pose


def free(side: int) -> Floats32:
    """Return a field."""
    return np.full((side, side), -1.0, dtype=np.float32)


def rooms() -> World:
    """Return 4 x 4 rooms of 8 m with doors of 2 m."""
    z = free(4 * SIDE)
    rng = np.random.default_rng(0)
    for wall in range(SIDE, 4 * SIDE, SIDE):
        z[wall], z[:, wall] = 1.0, 1.0
    for wall in range(SIDE, 4 * SIDE, SIDE):
        for begin in range(0, 4 * SIDE, SIDE):
            for line in (z[wall], z[:, wall]):
                door = begin + rng.integers(6, SIDE - DOOR - 6)
                line[door : door + DOOR] = -1.0
    return World(z, (3.0, 3.0, 0.5), (29.0, 28.0, 1.0))


def bay() -> World:
    """Return a parking place, 1.5 m wide."""
    z = free(80)
    z[:24], z[4:24, 38:44] = 1.0, -1.0
    return World(z, (4.0, 10.0, 0.0), (10.25, 3.0, np.pi / 2))


def needle() -> World:
    """Return a wall with a gap that nobody finds."""
    z = free(48)
    z[20:28], z[20:28, 22:24] = 1.0, -1.0
    return World(z, (2.0, 2.0, 0.5), (9.5, 10.0, 1.0))


def pebble() -> World:
    """Return what all but touches the straight line: the best route is hardly longer."""
    z = free(400)
    z[38, 200] = 1.0
    return World(z, (5.0, 10.15, 0.0), (95.0, 10.15, 0.0))


WORLDS: dict[str, Callable[[], World]] = {
    "rooms": rooms,
    "bay": bay,
    "needle": needle,
    "pebble": pebble,
    "field": lambda: World(free(400), (5.0, 5.0, 0.5), (95.0, 90.0, 1.0)),
    "huge": lambda: World(free(2000), (20.0, 20.0, 0.0), (24.0, 20.5, 0.3)),
    "near": lambda: World(free(48), (5.0, 5.0, 0.5), (5.0 + 1e-9, 5.0, 0.5)),
    "turn": lambda: World(free(48), (5.0, 5.0, 0.5), (5.0, 5.0, -2.5)),
    "behind": lambda: World(free(48), (5.0, 5.0, 0.0), (4.99, 5.0, 0.0)),
}


def child(planner: str, space: Space, world: str, told: dict[str, Any]) -> None:
    """Plan once, whatever comes, and print what did."""
    settings.REFUSED.clear()
    z, start, goal = WORLDS[world]()
    grid = ConfidenceGrid(resolution=0.25)
    grid.fuse(np.array([0, 0]), z)
    footprint = 0.5 if space == "r2" else CAR
    problem = PlanningProblem(grid, start=start, goal=goal, footprint=footprint, clear_start=False)
    try:
        route = plan(problem, planner, space=space, time_limit=5, **({"improve_for": 0.5} | told))
    except (NoRouteError, ProblemError, SettingsError) as error:
        print(f"{type(error).__name__}: {error}")
    except Exception as error:  # whatever it is, it is told
        print(f"FOREIGN {type(error).__name__}: {error}")
    else:
        print(f"{route.length:.1f} m, {route.seconds:.2f} s")


def answer(planner: str, space: Space, world: str, told: dict[str, Any]) -> str:
    """Return what a process of its own says, or how it ended."""
    command = [sys.executable, __file__, "--child", planner, space, world, json.dumps(told)]
    began = time.perf_counter()
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return "HANGS"
    noise = "; NOISE: " + done.stderr.strip().splitlines()[0] if done.stderr.strip() else ""
    if done.returncode != 0:
        return f"ENDS with {done.returncode} after {time.perf_counter() - began:.1f} s{noise}"
    return " | ".join(done.stdout.strip().splitlines()) + noise


def extremes(planner: str) -> Iterator[dict[str, Any]]:
    """Yield each parameter of a planner with the least and the greatest that it may be."""
    for name in PARAMETERS:
        if not has_parameter(planner, name):
            continue
        rules = SamplingSettings.model_fields[name].metadata
        bounds = {
            key: getattr(rule, key)
            for rule in rules
            for key in ("ge", "gt", "le")
            if hasattr(rule, key)
        }
        least = bounds.get("ge", 5e-324)
        values = [least, bounds.get("le", 1e300)] if bounds else [False, True]
        yield from ({name: value} for value in values)


def main() -> None:
    """Print a line for each planner, space, map and seed, or each extreme."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--planner", choices=sorted(samplers()))
    parser.add_argument("--map", choices=sorted(WORLDS))
    parser.add_argument("--extremes", action="store_true")
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    told = parser.parse_args()
    if told.child:
        if sys.platform == "linux":
            import resource  # noqa: PLC0415 -- not everywhere

            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        planner, space, world, values = told.child
        child(planner, space, world, json.loads(values))
        return
    for planner in [told.planner] if told.planner else sorted(samplers()):
        trials = (
            list(extremes(planner)) if told.extremes else [{"seed": s} for s in range(told.seeds)]
        )
        worlds = ["rooms", "field"] if told.extremes else sorted(WORLDS)
        for space, world, values in product(SPACES, [told.map] if told.map else worlds, trials):
            said = answer(planner, space, world, values)
            print(f"{planner:15} {space:11} {world:6} {values}: {said}", flush=True)


if __name__ == "__main__":
    main()
