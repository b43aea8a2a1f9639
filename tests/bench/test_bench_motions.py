"""The benchmark of motion checks: the Python lambda, the rows, and the command."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import run as groundmap
from oracles_planning import BLOCKED, FREE, grid_of
from planners.bench.motions import COMPILED, LAMBDA, REACH, compare_motions, lambda_of
from planners.costmap.costmap import Costmap
from planners.errors import ProblemError
from planners.problem.problem import PlanningProblem
from planners.sampling.motion_validator2d import MotionValidator2D
from planners.sampling.ompl_module import samplers

needs_ompl = pytest.mark.skipif(not samplers(), reason="ompl is not installed")
CAR = [(-0.5, -0.45), (1.0, -0.45), (1.0, 0.45), (-0.5, 0.45)]
SIZE = 0.5  # [m] of a cell
KEYS = {"workload", "system", "median_ms", "p95_ms", "ratio", "motions_per_s", "agree", "solved"}


def walls() -> Any:
    """Return two rooms of 16 x 16 m and a door of 4 m."""
    field = np.full((32, 64), FREE, dtype=np.float32)
    field[:12, 32] = field[20:, 32] = BLOCKED
    return grid_of(field, resolution=SIZE)


QUERIES = [((3.0, 3.0, 0.5), (29.0, 13.0, 1.0)), ((16.25, 1.0, 0.0), (29.0, 13.0, 1.0))]


@needs_ompl
@pytest.mark.parametrize(("footprint", "space"), [(0.0, "r2"), (0.6, "r2"), (CAR, "se2")])
def test_a_lambda_and_the_compiled_check_mostly_agree(footprint: Any, space: str) -> None:
    rows = compare_motions(walls(), footprint=footprint, queries=QUERIES, seeds=2)
    assert all(set(row) == KEYS for row in rows)
    motions = [row for row in rows if row["workload"] == f"motions, {space}"]
    routes = [row for row in rows if row["workload"] == f"first route, {space}"]
    assert [row["system"] for row in motions] == [LAMBDA, COMPILED]
    assert [row["system"] for row in routes] == [LAMBDA, COMPILED, REACH]
    assert motions[0]["ratio"] == routes[0]["ratio"] == 1.0
    assert all(row["solved"] == 1.0 for row in routes)
    for row in motions:
        assert row["agree"] > 0.8
        assert row["motions_per_s"] > 0.0


class State:
    """Has the interface of a state of OMPL."""

    def __init__(self, *pose: float) -> None:
        self.pose = pose

    def __getitem__(self, axis: int) -> float:
        return self.pose[axis]

    def getX(self) -> float:  # noqa: N802 (OMPL's name)
        return self.pose[0]

    def getY(self) -> float:  # noqa: N802 (OMPL's name)
        return self.pose[1]

    def getYaw(self) -> float:  # noqa: N802 (OMPL's name)
        return self.pose[2]


@pytest.mark.parametrize(("footprint", "space"), [(0.0, "r2"), (CAR, "se2")])
def test_the_lambda_is_right_about_states(footprint: Any, space: Any) -> None:
    problem = PlanningProblem(
        walls(), start=QUERIES[0][0], goal=QUERIES[0][1], footprint=footprint, clear_start=False
    )
    validator = MotionValidator2D(Costmap.of(problem), space, 1.0)
    is_valid, rng = lambda_of(validator), np.random.default_rng(0)
    high = np.array(validator.costmap.blocked.shape[::-1]) * SIZE
    results = []
    for _ in range(300):
        state = (*rng.uniform(0.0, high).tolist(), rng.uniform(-math.pi, math.pi))
        own = state[:2] if space == "r2" else state
        results.append((is_valid(State(*state)), validator.is_clear(*own, *own)))
        assert isinstance(results[-1][0], bool)
    agree = np.mean([valid == clear for valid, clear in results])
    assert agree >= (1.0 if space == "r2" else 0.95)  # a corner of a cell fits between two points


def test_queries_that_have_no_route_are_not_measured() -> None:
    with pytest.raises(ProblemError, match=r"queries: expected one that can have a route, got"):
        compare_motions(walls(), footprint=0.0, queries=QUERIES[1:], seeds=1)


YARD = [
    "type octile", "height 16", "width 32", "map",
    *["." * 15 + ("." if 5 <= row < 11 else "T") + "." * 16 for row in range(16)],
]  # fmt: skip


@needs_ompl
def test_the_command_prints_rows_of_both_checks(tmp_path: Path) -> None:
    (tmp_path / "yard.map").write_text("\n".join([*YARD, ""]))
    scen = tmp_path / "yard.map.scen"
    scen.write_text("version 1\n0\tyard.map\t32\t16\t2\t2\t29\t13\t32.0\n")
    options = ["--queries", "1", "--seeds", "1"]
    ran = groundmap("bench", "motions", scen, *options, "--json")
    assert ran.code == 0
    rows = json.loads(ran.out)["rows"]
    assert [row["system"] for row in rows] == [LAMBDA, COMPILED, LAMBDA, COMPILED, REACH]
    shown = groundmap("bench", "motions", scen, *options, "--footprint", "-1,-1 1,-1 1,1 -1,1")
    assert "motions, se2: compiled" in shown.out


def test_the_command_refuses_voxels(tmp_path: Path) -> None:
    (tmp_path / "cube.3dmap").write_text("voxel 4 4 4\n1 1 1\n")
    scen = tmp_path / "cube.3dmap.3dscen"
    scen.write_text("version 1\ncube.3dmap\n0 0 0 3 3 3 5.2 1.0\n")
    ran = groundmap("bench", "motions", scen)
    assert ran.code == 2
    assert "expected queries on a 2-D map" in ran.err
