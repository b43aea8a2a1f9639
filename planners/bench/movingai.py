"""The MovingAI benchmark: its queries put to a planner, its published lengths held against it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from groundmap.errors import FileFormatError, InputError
from groundmap.io.map_images import BlockedMap, BlockedVoxels
from groundmap.io.movingai import read_movingai_map, read_movingai_voxels
from groundmap.io.movingai_scen import MovingAIQuery, read_movingai_scen
from planners.bench.benchmark_runner import BenchmarkAnswer, BenchmarkRunner, warm_up

SUFFIXES = {".scen", ".3dscen"}


class Workload(NamedTuple):
    """Queries of one file on one map."""

    name: str  #: the map's, with the folders that lead to it
    scen: Path  #: where the queries stand
    map_file: Path
    queries: list[MovingAIQuery]


class WorkloadResult(NamedTuple):
    """A planner's answers to a workload."""

    workload: Workload
    setup_ms: float  #: from the map's grid to a planner that can be asked
    answers: list[BenchmarkAnswer]


def find_workloads(path: Path, *, limit: int | None = None) -> list[Workload]:
    """Return the queries of a ``.scen`` or ``.3dscen``, or of all of them below a folder.

    Parameters
    ----------
    path : Path
    limit : int, optional
        Of each file take that many queries at most, evenly spread over it.

    Raises
    ------
    FileFormatError
        A file that breaks its format, or names a map that is not beside it.
    InputError
        Nothing of that name, no such file below the folder, no query in any.
    """
    if not path.exists():
        raise InputError(str(path), "a folder, or a .scen", "nothing of that name")
    files = [path] if path.is_file() else sorted(_scens_below(path))
    if not files:
        expected = "a folder with files .scen or .3dscen, at any depth"
        raise InputError(str(path), expected, "none", hint="Each lies beside its map.")
    workloads = [work for file in files for work in _workloads(file, path, limit)]
    if not workloads:
        raise InputError(str(path), "at least one query", "none")
    return workloads


def run(
    workloads: Iterable[Workload],
    planner: str,
    *,
    watch: Callable[[list[Any]], Iterable[Any]] = lambda steps: steps,
) -> list[WorkloadResult]:
    """Return a planner's answers: on each map an engine of its own, asked time and again.

    Parameters
    ----------
    workloads : iterable of Workload
    planner : str
        A name in `planners.PLANNERS`; on voxels, ``"astar"``.
    watch : callable, optional
        Given the list of queries, yields them one by one: for progress.

    Raises
    ------
    ProblemError
        No planner of that name, or one whose lengths can't be compared.
    FileFormatError
        A map that breaks its format, or is none that its queries are about.
    """
    workloads = list(workloads)
    for dimensions in {len(work.queries[0].start) for work in workloads}:
        warm_up(planner, dimensions)
    results: list[WorkloadResult] = []
    runner: BenchmarkRunner | None = None
    asked = [(work, query) for work in workloads for query in work.queries]
    for work, query in watch(asked):
        if runner is None or results[-1].workload is not work:
            runner = BenchmarkRunner(read_map(work), planner)
            results.append(WorkloadResult(work, runner.setup_ms, []))
        results[-1].answers.append(runner.ask(query))
    return results


def _scens_below(folder: Path) -> Iterable[Path]:
    return (file for file in folder.rglob("*") if file.suffix.lower() in SUFFIXES)


def _workloads(scen: Path, root: Path, limit: int | None) -> list[Workload]:
    queries = read_movingai_scen(scen)
    if limit is not None and len(queries) > limit:
        queries = [queries[i] for i in np.linspace(0, len(queries) - 1, limit).round().astype(int)]
    found = []
    by_map = sorted(queries, key=lambda query: query.map_file)  # stable: else as in the file
    for map_file, group in groupby(by_map, key=lambda query: query.map_file):
        asked = list(group)
        if not map_file.is_file():
            expected = f"its map {map_file.name} beside it"
            raise FileFormatError(scen, expected, "no such file", line=asked[0].line)
        name = map_file.relative_to(root) if root.is_dir() else Path(map_file.name)
        found.append(Workload(name.as_posix(), scen, map_file, asked))
    return found


def read_map(work: Workload) -> BlockedMap | BlockedVoxels:
    """Read the map of a workload, and check that it is the one that the queries are about."""
    found: BlockedMap | BlockedVoxels
    if len(work.queries[0].start) == 3:
        found = read_movingai_voxels(work.map_file)
    else:
        found = read_movingai_map(work.map_file)
    shape = found.blocked.shape
    for query in work.queries:
        inside = (np.maximum(query.start, query.goal) < shape).all()
        if query.shape not in ((), shape) or not inside:
            size = " x ".join(map(str, shape[::-1]))
            expected = f"a query on {work.map_file.name}, which is {size} cells"
            raise FileFormatError(work.scen, expected, "another", line=query.line)
    return found
