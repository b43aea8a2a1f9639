"""Optimal lengths of the MovingAI benchmark, where its maps are at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from groundmap.arrays import Floats32
from oracles_planning import BLOCKED, FREE, grid_of
from planners import AStarSettings, PlanningProblem
from planners.astar import AStar
from planners.costmap import Costmap

MAPS = Path(__file__).parents[2] / "shared" / "data" / "movingai"
QUERIES = 40

pytestmark = pytest.mark.skipif(
    not MAPS.is_dir(), reason="the MovingAI maps are not part of the project"
)


def evidence(path: Path) -> Floats32:
    """Return the map's cells; its row 0 is row 0 here, so that y stays y."""
    lines = path.read_text(encoding="ascii").splitlines()
    first = lines.index("map") + 1
    rows = [[FREE if cell == "." else BLOCKED for cell in line] for line in lines[first:] if line]
    return np.array(rows, dtype=np.float32)


@pytest.mark.parametrize("name", ["dao/arena", "dao/den312d", "cities/Berlin_0_256"])
def test_lengths_are_the_published_optima(name: str) -> None:
    grid = grid_of(evidence(MAPS / f"{name}.map"))
    lines = (MAPS / f"{name}.map.scen").read_text(encoding="ascii").splitlines()[1:]
    chosen = np.random.default_rng(0).permutation(len(lines))[:QUERIES]
    planner: AStar | None = None
    for line in (lines[i] for i in chosen):
        *ends, optimal = (float(word) for word in line.split()[-5:])
        start, goal = (ends[0] + 0.5, ends[1] + 0.5), (ends[2] + 0.5, ends[3] + 0.5)
        if planner is None:
            problem = PlanningProblem(grid, start=start, goal=goal, footprint=0, clear_start=False)
            planner = AStar(Costmap.of(problem))
        found = planner.search(start, goal, AStarSettings())
        assert found is not None
        length = np.hypot(*np.diff(found.waypoints, axis=0).T).sum()
        assert length == pytest.approx(optimal, abs=0.01)
