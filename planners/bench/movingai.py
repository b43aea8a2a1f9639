"""The MovingAI benchmark: lengths and times of a planner, compared with published lengths."""

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

    name: str  #: path of the map below the folder of the benchmark
    scen: Path  #: file of the queries
    map_file: Path
    queries: list[MovingAIQuery]


class WorkloadResult(NamedTuple):
    """A planner's answers to a workload."""

    workload: Workload
    setup_ms: float  #: time to build costmap and engine from the grid
    answers: list[BenchmarkAnswer]


def find_workloads(path: Path, *, limit: int | None = None) -> list[Workload]:
    """Return the queries of a ``.scen`` or ``.3dscen``, or of all of them below a folder.

    Parameters
    ----------
    path : Path
    limit : int, optional
        Maximum number of queries per file, evenly spaced in the file.

    Raises
    ------
    FileFormatError
        A file violates its format, or its map is missing.
    InputError
        The path does not exist, or there is no file or no query below it.
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
    """Return the answers of a planner, which builds one engine per map for all its queries.

    Parameters
    ----------
    workloads : iterable of Workload
    planner : str
        A name in `planners.PLANNERS`; on voxels, ``"astar"``.
    watch : callable, optional
        Receives the list of queries and yields each of them, to show progress.

    Raises
    ------
    ProblemError
        There is no planner of that name, or its lengths can't be compared.
    FileFormatError
        A map violates its format, or does not have the size that the queries state.
    """
    workloads = list(workloads)
    for dimensions in {len(work.queries[0].start) for work in workloads}:
        warm_up(planner, dimensions)
    results: list[WorkloadResult] = []
    runner: BenchmarkRunner | None = None
    steps = [(work, query) for work in workloads for query in work.queries]
    for work, query in watch(steps):
        if runner is None or results[-1].workload is not work:
            runner = BenchmarkRunner(read_map(work), planner)
            results.append(WorkloadResult(work, runner.setup_ms, []))
        results[-1].answers.append(runner.run(query))
    return results


def _scens_below(folder: Path) -> Iterable[Path]:
    return (file for file in folder.rglob("*") if file.suffix.lower() in SUFFIXES)


def _workloads(scen: Path, root: Path, limit: int | None) -> list[Workload]:
    queries = read_movingai_scen(scen)
    if limit is not None and len(queries) > limit:
        queries = [queries[i] for i in np.linspace(0, len(queries) - 1, limit).round().astype(int)]
    workloads = []
    by_map = sorted(queries, key=lambda query: query.map_file)  # stable: keeps the file's order
    for map_file, group in groupby(by_map, key=lambda query: query.map_file):
        on_map = list(group)
        if not map_file.is_file():
            expected = f"its map {map_file.name} beside it"
            raise FileFormatError(scen, expected, "no such file", line=on_map[0].line)
        name = map_file.relative_to(root) if root.is_dir() else Path(map_file.name)
        workloads.append(Workload(name.as_posix(), scen, map_file, on_map))
    return workloads


def read_map(work: Workload) -> BlockedMap | BlockedVoxels:
    """Read the map of a workload, and check that it fits the queries."""
    blocked_map: BlockedMap | BlockedVoxels
    if len(work.queries[0].start) == 3:
        blocked_map = read_movingai_voxels(work.map_file)
    else:
        blocked_map = read_movingai_map(work.map_file)
    shape = blocked_map.blocked.shape
    for query in work.queries:
        inside = (np.maximum(query.start, query.goal) < shape).all()
        if query.shape not in ((), shape) or not inside:
            size = " x ".join(map(str, shape[::-1]))
            expected = f"a query on {work.map_file.name}, which is {size} cells"
            raise FileFormatError(work.scen, expected, "another", line=query.line)
    return blocked_map
