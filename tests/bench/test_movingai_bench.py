"""The MovingAI benchmark: workloads, answers, figures, and the command."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import run as groundmap
from groundmap.errors import FileFormatError, InputError
from groundmap.io.map_images import BlockedMap
from groundmap.io.movingai_scen import MovingAIQuery
from planners import PLANNERS, ProblemError
from planners.bench.benchmark_runner import BenchmarkAnswer, BenchmarkRunner, figures
from planners.bench.movingai import find_workloads, run
from planners.registry import Planner
from planners.search.base import SearchResult

DIAGONAL = math.sqrt(2.0)
ROOM = "type octile\nheight 3\nwidth 4\nmap\n...@\n.@.@\n...@\n"
ROWS = {
    "0 maps/room.map 4 3 0 0 0 2 2.0": True,
    "0 maps/room.map 4 3 0 0 2 2 4.0": True,
    "0 maps/room.map 4 3 2 0 0 2 4.0": True,
}
BLOCK = "voxel 2 2 2\n1 0 0\n"
BLOCK_ROWS = [f"0 0 0 1 1 1 {1 + DIAGONAL:.8f} 1.1", "0 0 0 0 1 1 1.41421356 1.0"]


def room(folder: Path, *rows: str) -> Path:
    """Write a ring around a blocked cell, with queries on it."""
    (folder / "room.map").write_text(ROOM)
    (folder / "room.map.scen").write_text("\n".join(["version 1", *(rows or ROWS)]))
    return folder


def block(folder: Path, *rows: str) -> Path:
    """Write eight voxels, one of them blocked, with queries on them."""
    (folder / "block.3dmap").write_text(BLOCK)
    lines = ["version 1", "block.3dmap", *(rows or BLOCK_ROWS)]
    (folder / "block.3dmap.3dscen").write_text("\n".join(lines))
    return folder


def answers(folder: Path, planner: str = "astar") -> list[BenchmarkAnswer]:
    return [answer for result in run(find_workloads(folder), planner) for answer in result.answers]


# Workloads


def test_workloads_are_found_at_any_depth_and_named_by_their_maps(tmp_path: Path) -> None:
    for name in ("dao/old", "rooms"):
        (tmp_path / name).mkdir(parents=True)
        room(tmp_path / name)
    block(tmp_path / "rooms")
    names = [work.name for work in find_workloads(tmp_path)]
    assert names == ["dao/old/room.map", "rooms/block.3dmap", "rooms/room.map"]
    [alone] = find_workloads(tmp_path / "rooms" / "room.map.scen")
    assert (alone.name, len(alone.queries)) == ("room.map", len(ROWS))


def test_a_limit_selects_evenly_spaced_queries(tmp_path: Path) -> None:
    room(tmp_path, *(f"{i} room.map 4 3 0 0 0 0 0" for i in range(100)))
    lines = [query.line for query in find_workloads(tmp_path, limit=4)[0].queries]
    assert lines == [2, 35, 68, 101]
    assert len(find_workloads(tmp_path, limit=101)[0].queries) == 100


def test_each_map_of_a_file_is_a_workload(tmp_path: Path) -> None:
    (tmp_path / "hall.map").write_text(ROOM)
    row = next(iter(ROWS))
    room(tmp_path, row, row.replace("room", "hall"), row)
    found = {work.name: [query.line for query in work.queries] for work in find_workloads(tmp_path)}
    assert found == {"hall.map": [3], "room.map": [2, 4]}


def test_a_folder_without_queries_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected a folder with files .scen or .3dscen, .* none"):
        find_workloads(tmp_path)
    with pytest.raises(
        InputError, match=r"expected a folder, or a .scen, got nothing of that name"
    ):
        find_workloads(tmp_path / "gone")
    (tmp_path / "a.scen").write_text("version 1\n")
    with pytest.raises(InputError, match="expected at least one query, got none"):
        find_workloads(tmp_path)


def test_a_missing_map_is_named_before_anything_runs(tmp_path: Path) -> None:
    room(tmp_path, *ROWS, "0 maps/gone.map 4 3 0 0 0 2 2.0")
    with pytest.raises(
        FileFormatError, match=r"scen: expected its map gone.map beside it, .*ine 5"
    ):
        find_workloads(tmp_path)


def test_queries_about_another_map_are_refused(tmp_path: Path) -> None:
    room(tmp_path, *ROWS, "0 maps/room.map 5 3 0 0 0 2 2.0")
    with pytest.raises(FileFormatError, match=r"on room.map, which is 4 x 3 cells, .* at line 5"):
        answers(tmp_path)
    (tmp_path / "room.map.scen").unlink()
    block(tmp_path, *BLOCK_ROWS, "0 0 0 0 0 2 2 1")
    with pytest.raises(FileFormatError, match=r"block.3dmap, which is 2 x 2 x 2 cells, .*line 5"):
        answers(tmp_path)


# Answers


@pytest.mark.parametrize("planner", ["astar", "dijkstra"])
def test_published_lengths_are_found(tmp_path: Path, planner: str) -> None:
    found = answers(room(tmp_path), planner)
    assert [answer.length for answer in found] == pytest.approx([2.0, 4.0, 4.0])
    assert all(answer.agrees and answer.ms > 0 for answer in found)


def test_published_lengths_are_found_in_voxels(tmp_path: Path) -> None:
    found = answers(block(tmp_path))
    assert [answer.length for answer in found] == pytest.approx([1.0 + DIAGONAL, DIAGONAL])
    assert all(answer.agrees for answer in found)


@pytest.mark.parametrize(
    ("row", "agrees"),
    [
        ("0 room.map 4 3 0 0 2 2 4.009", True),
        ("0 room.map 4 3 0 0 2 2 4.02", False),
        ("0 room.map 4 3 0 0 2 2 3.98", False),
        ("0 room.map 4 3 0 0 2 2 0", False),  # published as unsolvable
        ("0 room.map 4 3 0 0 3 2 0", True),  # it is: the goal is blocked
        ("0 room.map 4 3 0 0 3 2 4.5", False),
        ("0 room.map 4 3 0 0 0 0 0", True),
    ],
)
def test_an_answer_agrees_within_a_hundredth_of_a_cell(
    tmp_path: Path, row: str, agrees: bool
) -> None:
    [answer] = answers(room(tmp_path, row))
    assert answer.agrees == agrees


def test_any_angle_lengths_can_be_shorter_than_published(monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = np.zeros((5, 5), dtype=bool)
    query = MovingAIQuery(Path(), (5, 5), (0, 0), (1, 3), 2.0 + DIAGONAL, 0)
    engine = straight(bound=None)
    for planner, agrees in (("theta", True), ("crow", False)):
        monkeypatch.setitem(PLANNERS, planner, Planner(engine, PLANNERS["astar"].settings))
        assert (
            BenchmarkRunner(BlockedMap(blocked, blocked, 1.0, (0, 0)), planner).run(query).agrees
            == agrees
        )


@pytest.mark.parametrize(("bound", "agrees"), [(1.0, False), (1.5, True), (1.2, False)])
def test_a_length_within_the_bound_agrees(
    monkeypatch: pytest.MonkeyPatch, bound: float, agrees: bool
) -> None:
    engine = straight(bound=bound, detour=2.0)
    monkeypatch.setitem(PLANNERS, "drifter", Planner(engine, PLANNERS["astar"].settings))
    blocked = np.zeros((5, 5), dtype=bool)
    query = MovingAIQuery(Path(), (5, 5), (0, 0), (0, 4), 4.0, 0)
    runner = BenchmarkRunner(BlockedMap(blocked, blocked, 1.0, (0, 0)), "drifter")
    assert runner.run(query).agrees == agrees


@pytest.mark.parametrize("changes", [{"headings": np.zeros(3)}, {"bound": None}])
def test_planners_whose_lengths_are_not_comparable_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    engine = straight(**changes)
    monkeypatch.setitem(PLANNERS, "curler", Planner(engine, PLANNERS["astar"].settings))
    with pytest.raises(ProblemError, match=r"planner: expected one that moves .*, got 'curler'"):
        answers(room(tmp_path), "curler")


def test_planners_that_need_a_heading_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Curler:
        def __init__(self, costmap: Any) -> None:
            pass

        def search(self, start: tuple[float, ...], goal: tuple[float, ...], _: Any) -> None:
            raise ProblemError("start", "a heading", repr(start))

    engine: Any = Curler
    monkeypatch.setitem(PLANNERS, "curler", Planner(engine, PLANNERS["astar"].settings))
    with pytest.raises(ProblemError, match=r"planner: expected one that moves .*, got 'curler'"):
        answers(room(tmp_path), "curler")


def straight(*, detour: float = 0.0, **changes: Any) -> Any:
    """Return the class of an engine that goes straight, and once beyond the goal and back."""

    class Straight:
        def __init__(self, costmap: Any) -> None:
            pass

        def search(self, start: tuple[float, ...], goal: tuple[float, ...], _: Any) -> SearchResult:
            beyond = (goal[0] + detour / 2.0, goal[1])
            return SearchResult(np.array([start, beyond, goal]), 0)._replace(**changes)

    return Straight


def test_voxels_are_supported_by_astar_only(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="planner: expected 'astar', on voxels, got 'dijkstra'"):
        answers(block(tmp_path), "dijkstra")


def test_figures_are_of_all_answers(tmp_path: Path) -> None:
    rows = [*ROWS, "0 room.map 4 3 0 0 3 2 0", "0 room.map 4 3 0 0 2 2 3.98"]
    found = figures(answers(room(tmp_path, *rows)))
    counts = {key: found[key] for key in ("queries", "solved", "unsolvable", "mismatches")}
    assert counts == {"queries": 5, "solved": 4, "unsolvable": 1, "mismatches": 1}
    assert 0 < found["median_ms"] <= found["p95_ms"]


# The command


def test_the_command_counts_and_times_every_query(tmp_path: Path) -> None:
    ran = groundmap("bench", "planning", "--movingai", block(room(tmp_path)), "--json")
    assert ran.code == 0
    counts = {key: ran.json[key] for key in ("planner", "queries", "solved", "mismatches")}
    assert counts == {"planner": "astar", "queries": 5, "solved": 5, "mismatches": 0}
    assert 0 < ran.json["median_ms"] <= ran.json["p95_ms"]
    rows = {row["workload"]: (row["system"], row["queries"]) for row in ran.json["rows"]}
    assert rows == {"block.3dmap": ("astar", 2), "room.map": ("astar", 3)}
    shown = groundmap("bench", "planning", "--movingai", tmp_path, "--limit", "1")
    assert [line.split()[:4] for line in shown.out.splitlines()[2:]] == [
        ["block.3dmap", "1", "1", "0"],
        ["room.map", "1", "1", "0"],
        ["all", "2", "2", "0"],
    ]


def test_mismatches_are_named_and_exit_with_1(tmp_path: Path) -> None:
    wrong = [
        "0 room.map 4 3 0 0 2 2 3.5",
        "0 room.map 4 3 0 0 3 2 4.5",
        *(["0 room.map 4 3 0 0 2 2 0"] * 5),
    ]
    ran = groundmap("bench", "planning", "--movingai", room(tmp_path, *wrong), "--json")
    assert (ran.code, ran.json["mismatches"]) == (1, 7)
    first, second, third, *_, last = ran.err.splitlines()
    assert first.endswith("room.map.scen:2: expected a length of 3.5, got 4")
    assert second.endswith("room.map.scen:3: expected a length of 4.5, got no route")
    assert third.endswith("room.map.scen:4: expected no route, got 4")
    assert last == "... and 2 more"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            [],
            "--movingai: expected a folder with maps and queries of the MovingAI benchmark, got no",
        ),
        (["--movingai", "nowhere"], "nowhere: expected a folder, or a .scen, got nothing of that"),
    ],
)
def test_bad_options_are_refused(options: list[str], message: str) -> None:
    ran = groundmap("bench", "planning", *options)
    assert ran.code == 2
    assert message in ran.err
    assert ran.out == ""


def test_an_unknown_planner_is_refused(tmp_path: Path) -> None:
    ran = groundmap("bench", "planning", "--movingai", room(tmp_path), "--planner", "teleport")
    assert ran.code == 2
    assert "planner: expected one of " in ran.err
    assert "got 'teleport'" in ran.err
