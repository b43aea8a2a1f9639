"""Try every planner of OMPL in every space, each in a process of its own, to see who crashes.

What is refused by `planners.sampling.settings.REFUSED` is tried all the same. Run it when another
version of OMPL comes out::

    .venv/bin/python tools/try_samplers.py [--seeds 3] [--planner NAME]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from typing import get_args

import numpy as np

from groundmap import ConfidenceGrid
from planners import NoRouteError, PlanningProblem, plan
from planners.sampling import settings
from planners.sampling.door import samplers
from planners.sampling.settings import Space

SIDE, DOOR = 32, 8  # [cells] of a room, of a door
CAR = [(-0.5, -0.45), (1.5, -0.45), (1.5, 0.45), (-0.5, 0.45)]
PATIENCE = 30.0  # [s] of which a search takes 5 at most


def rooms() -> ConfidenceGrid:
    """Return 4 x 4 rooms of 8 m with doors of 2 m."""
    z = np.full((4 * SIDE, 4 * SIDE), -1.0, dtype=np.float32)
    rng = np.random.default_rng(0)
    for wall in range(SIDE, 4 * SIDE, SIDE):
        z[wall], z[:, wall] = 1.0, 1.0
    for wall in range(SIDE, 4 * SIDE, SIDE):
        for begin in range(0, 4 * SIDE, SIDE):
            for line in (z[wall], z[:, wall]):
                door = begin + rng.integers(6, SIDE - DOOR - 6)
                line[door : door + DOOR] = -1.0
    grid = ConfidenceGrid(resolution=0.25)
    grid.fuse(np.array([0, 0]), z)
    return grid


def child(planner: str, space: str, seed: int) -> None:
    """Plan once, whatever comes, and print what did."""
    settings.REFUSED.clear()
    problem = PlanningProblem(
        rooms(),
        start=(3.0, 3.0, 0.5),
        goal=(29.0, 28.0, 1.0),
        footprint=0.5 if space == "r2" else CAR,
        clear_start=False,
    )
    try:
        route = plan(problem, planner, space=space, seed=seed, time_limit=5, improve_for=0.5)
    except NoRouteError as error:
        print(f"{type(error).__name__}: {error}")
    else:
        print(f"{route.length:.1f} m, {route.seconds:.2f} s")


def answer(planner: str, space: str, seed: int) -> str:
    """Return what a process of its own says, or how it ended."""
    command = [sys.executable, __file__, "--child", planner, space, str(seed)]
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


def main() -> None:
    """Print a line for each planner, space and seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--planner", choices=sorted(samplers()))
    parser.add_argument("--child", nargs=3, help=argparse.SUPPRESS)
    told = parser.parse_args()
    if told.child:
        child(told.child[0], told.child[1], int(told.child[2]))
        return
    for planner in [told.planner] if told.planner else sorted(samplers()):
        for space in get_args(Space):
            for seed in range(told.seeds):
                print(f"{planner:14} {space:12} {seed}: {answer(planner, space, seed)}", flush=True)


if __name__ == "__main__":
    main()
