"""Optimal lengths of the MovingAI benchmark, if its maps are available."""

from __future__ import annotations

from pathlib import Path

import pytest

from planners.bench.movingai import find_workloads, run

DATA = Path(__file__).parents[3] / "shared" / "data"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="the MovingAI maps are not part of the project"
)


@pytest.mark.parametrize("name", ["bg512", "cities", "dao", "mazes", "random", "rooms", "sc1"])
def test_lengths_are_the_published_optima(name: str) -> None:
    results = run(find_workloads(DATA / "movingai" / name, limit=15), "astar")
    assert all(answer.agrees for result in results for answer in result.answers)


def test_lengths_in_voxels_are_the_published_optima() -> None:
    results = run(find_workloads(DATA / "warframe3d", limit=300), "astar")
    assert all(answer.agrees for result in results for answer in result.answers)
