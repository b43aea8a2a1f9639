"""With any settings, a sampling planner ends with a route or one of our errors.

Each planner runs in a process of its own, as OMPL may crash it: this file, run as a script.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any, get_args

import numpy as np
import pytest

from groundmap.arrays import Floats32
from groundmap.errors import SettingsError
from oracles_planning import BLOCKED, FREE, free_field, grid_of
from planners import NoRouteError, PlanningProblem, ProblemError, SamplingSettings, plan
from planners.sampling.ompl_module import has_parameter, samplers
from planners.sampling.ompl_parameters import PARAMETERS
from planners.sampling.ompl_search import THREADED
from planners.sampling.settings import REFUSED, StateSpace, refusal

NAMES = [name for name in sorted(samplers()) if (name, None) not in REFUSED]
SPACES: tuple[StateSpace, ...] = tuple(space for space in get_args(StateSpace) if space != "r3")
CAR = [(-0.3, -0.2), (0.5, -0.2), (0.5, 0.2), (-0.3, 0.2)]
PATIENCE = 240.0  # [s] for all cases of one planner, which take some seconds
MEMORY = 4 * 2**30  # [bytes] limit of its address space
BRIEF: dict[str, Any] = {"time_limit": 0.05, "improve_for": 0.01}
needs_ompl = pytest.mark.skipif(not NAMES, reason="ompl is not installed")


def doorway() -> Floats32:
    z = free_field(40, 40)
    z[20], z[20, 16:24] = BLOCKED, FREE
    return z


def bay() -> Floats32:
    z = free_field(40, 40)
    z[:16], z[4:16, 18:22] = BLOCKED, FREE
    return z


def needle() -> Floats32:
    z = free_field(40, 40)
    z[16:24], z[16:24, 18:20] = BLOCKED, FREE
    return z


# Maps in cells of 0.25 m: evidence, start, goal.
MAPS = {
    "doorway": (doorway(), (2.0, 2.0, 0.5), (8.0, 8.5, 1.0)),
    "bay": (bay(), (2.0, 7.0, 0.0), (5.0, 2.0, 1.5)),
    "needle": (needle(), (2.0, 2.0, 0.5), (8.0, 8.5, 1.0)),
    "open": (free_field(40, 40), (2.0, 2.0, 0.0), (8.0, 2.0, 0.0)),
    "tiny": (free_field(4, 4), (0.45, 0.5, 0.5), (0.5, 0.5, 0.4)),
    "at the goal": (free_field(40, 40), (5.0, 5.0, 0.5), (5.0, 5.0 + 1e-9, 0.5)),
    "other yaw": (free_field(40, 40), (5.0, 5.0, 0.5), (5.0, 5.0, -2.5)),
    "just behind": (free_field(40, 40), (5.0, 5.0, 0.0), (4.99, 5.0, 0.0)),
}
COMMON: dict[str, list[Any]] = {
    "seed": [2**31 - 1],
    "time_limit": [0.0, 1e-6],
    "improve_for": [0.0],
    "iterations": [1, 2, 300],
    "simplify": [False],
    "keep_graph": [True],
    "warm_start": [True],
    "goal_radius": [1e-9, 100.0],
    "time_weight": [1e-9, 1000.0],
}
SHAPED: dict[StateSpace, dict[str, list[Any]]] = {
    "r2": {},
    "se2": {"yaw_weight": [5e-324, 1e-12, 1000.0], "goal_yaw_tolerance": [3.1]},
    "dubins": {"turning_radius": [0.01, 1000.0]},
    "reeds_shepp": {"turning_radius": [0.01, 1000.0]},
}


def ends_of(name: str) -> list[Any]:
    """Return the least and the greatest value of a parameter."""
    field = SamplingSettings.model_fields[name]
    bounds = {
        key: getattr(rule, key)
        for rule in field.metadata
        for key in ("ge", "gt", "le")
        if hasattr(rule, key)
    }
    return [bounds.get("ge", 5e-324), bounds.get("le", 1e300)] if bounds else [False, True]


def cases_of(name: str, space: StateSpace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield maps and settings to try a planner with in a space."""
    yield from ((place, {}) for place in MAPS)
    for key, values in (COMMON | SHAPED[space]).items():
        if key == "iterations" and name in THREADED:
            continue
        for value in values:
            yield "doorway", {key: value}
    if space == "r2":
        yield "open", {"time_limit": None}
    if space in {"r2", "reeds_shepp"}:
        own = [key for key in PARAMETERS if has_parameter(name, key)]
        for key in own:
            for value in ends_of(key):
                yield ("doorway" if space == "r2" else "open"), {key: value}
        yield "doorway", {key: ends_of(key)[0] for key in own}


def try_plan(name: str, space: StateSpace, place: str, options: dict[str, Any]) -> str:
    """Plan, and return the outcome."""
    z, start, goal = MAPS[place]
    problem = PlanningProblem(
        grid_of(z, resolution=0.25),
        start=start,
        goal=goal,
        footprint=0.25 if space == "r2" else CAR,
        clear_start=False,
    )
    try:
        return f"{plan(problem, name, space=space, **(BRIEF | options)).length:.1f} m"
    except (NoRouteError, ProblemError, SettingsError) as error:
        return type(error).__name__


def interrupt_often(name: str) -> str:
    """Interrupt a search at many moments, then plan."""

    def alarm(*_: Any) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, alarm)
    caught = 0
    for moment in np.linspace(0.001, 0.05, 12):
        try:
            signal.setitimer(signal.ITIMER_REAL, moment)
            try_plan(name, "r2", "needle", {"time_limit": 1.0, "improve_for": 1.0})
        except KeyboardInterrupt:
            caught += 1
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    return f"{caught} times, then {try_plan(name, 'r2', 'open', {})}"


def try_all(name: str) -> None:
    """Print a line for each combination, before it and after it."""
    for space in SPACES:
        if refusal(name, space) is None:
            for place, options in cases_of(name, space):
                print(space, place, options, end=": ", flush=True)
                print(try_plan(name, space, place, options), flush=True)
    print("interrupted:", interrupt_often(name), flush=True)
    print("the end")


@pytest.mark.parametrize("name", NAMES)
def test_every_case_ends_with_a_route_or_one_of_our_errors(name: str) -> None:
    try:
        ran = subprocess.run(
            [sys.executable, __file__, name],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},  # oracles, strategies
        )
    except subprocess.TimeoutExpired as error:
        pytest.fail(f"{name} hangs: {bytes(error.stdout or b'').decode()[-200:]}")
    lines = ran.stdout.splitlines()
    assert ran.returncode == 0, f"{lines[-1:]} {ran.stderr[-2000:]}"
    assert ran.stderr == ""
    assert lines[-1] == "the end"
    assert sum(" m" in line for line in lines) > len(MAPS)


@pytest.mark.parametrize(
    ("name", "space"),
    [(name, space) for name, one in REFUSED for space in ([one] if one else SPACES)],
)
@needs_ompl
def test_unsupported_spaces_are_rejected_with_a_reason(name: str, space: StateSpace) -> None:
    z, start, goal = MAPS["doorway"]
    problem = PlanningProblem(grid_of(z, resolution=0.25), start=start, goal=goal, footprint=0.5)
    with pytest.raises(ProblemError, match=rf"one that works in '{space}', got {name}\.") as caught:
        plan(problem, name, space=space)
    assert str(caught.value).endswith(str(refusal(name, space)))


@pytest.mark.parametrize("name", [name for name in PARAMETERS if ends_of(name)[0] is not False])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), -1])
def test_invalid_numbers_are_rejected_as_parameters(name: str, value: float) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(SettingsError, match=rf"^{name}: expected "):
        SamplingSettings(**options)


if __name__ == "__main__":
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try_all(sys.argv[1])
