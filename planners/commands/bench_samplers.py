"""``groundmap bench planning --samplers``: OMPL's planners side by side."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from groundmap.draw.anytime import Panel, Progress, anytime_figure
from groundmap.draw.figure import check_picture, save_figure
from planners.bench.benchmark_problems import CART, WORKLOADS
from planners.bench.maps import find_maps
from planners.bench.samplers import SPACES, Refused, list_trials, optima, processors, row, run
from planners.bench.trials import Workload
from planners.commands.console import emit, emit_rows, show_progress
from planners.commands.options import outline
from planners.errors import ProblemError
from planners.problem.footprint import Footprint
from planners.registry import get_planner
from planners.sampling.ompl_module import samplers

COLUMNS = ("solved", "first_ms", "first_p95_ms", "median_ms", "cost", "ratio")


class Entry(NamedTuple):
    """What the command line asks for; an empty list is all."""

    workloads: list[str]
    maps: list[Path]
    planners: list[str]
    spaces: list[str]
    footprint: str | None
    turning_radius: float
    seeds: int
    time_limit: float
    improve_for: float
    jobs: int | None
    plot: Path | None


def race_samplers(entry: Entry, *, as_json: bool) -> None:
    """Run all that was entered; print figures, and draw costs over time."""
    began = time.perf_counter()
    if entry.plot is not None:
        check_picture(entry.plot, sources=entry.maps)
    names = _known("planner", entry.planners, _samplers())
    spaces = [space for space in SPACES if space in _known("space", entry.spaces, SPACES)]
    works = _works(entry)
    trials, refused = list_trials(
        works,
        names,
        spaces,
        seeds=entry.seeds,
        time_limit=entry.time_limit,
        improve_for=entry.improve_for,
    )

    def watch(steps: Iterable[Any]) -> Iterable[Any]:
        return show_progress(steps, total=len(trials), what="attempts")

    races = run(trials, jobs=entry.jobs or processors(), watch=watch)
    best = optima(works, races)
    rows = [row(race, best[race.work, race.space]) for race in races]
    if entry.plot is not None and rows:
        save_figure(_figure(rows), entry.plot)
    seconds = time.perf_counter() - began
    if as_json:
        told = {key: getattr(entry, key) for key in ("seeds", "time_limit", "improve_for")}
        left_out = [one._asdict() for one in refused]
        result = {**told, "seconds": seconds, "rows": rows, "refused": left_out}
        emit(result, as_json=True, title="")
    else:
        _print(rows, refused, seconds)


def _samplers() -> list[str]:
    found = sorted(samplers())
    if not found:
        get_planner("rrtconnect")  # says how to install them
    return found


def _known(option: str, asked: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return what was asked for, or all; each of it must be known."""
    for one in asked:
        if one not in known:
            raise ProblemError(option, f"one of {', '.join(known)}", repr(one))
    return list(dict.fromkeys(asked)) or list(known)


def _works(entry: Entry) -> list[Workload]:
    """Return the workloads: those of ours, unless only maps were asked for."""
    footprint: Any = CART if entry.footprint is None else outline(entry.footprint)
    Footprint.of(footprint)  # refuses what is none before anything runs
    if isinstance(footprint, list):
        footprint = tuple(footprint)
    ours = [Workload(name) for name in _known("workload", entry.workloads, list(WORKLOADS))]
    asked = {file: path for path in entry.maps for file in find_maps(path)}
    counts = Counter(_title(file, path) for file, path in asked.items())
    titles = {file: _title(file, path) for file, path in asked.items()}
    maps = [
        Workload(
            title if counts[title] == 1 else file.as_posix(), file, footprint, entry.turning_radius
        )
        for file, title in titles.items()
    ]
    return maps if maps and not entry.workloads else ours + maps


def _title(file: Path, asked: Path) -> str:
    return file.name if file == asked else file.relative_to(asked).as_posix()


def _groups(rows: list[dict[str, Any]]) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """Return the rows of each workload and space."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in rows:
        groups.setdefault((one["workload"], one["space"]), []).append(one)
    return groups


def _figure(rows: list[dict[str, Any]]) -> Any:
    """Return a picture with a row of panels for each workload."""
    groups = _groups(rows)
    panels = [
        Panel(
            title=f"{work}, {space}",
            progress={
                one["system"]: Progress(one["curve"], one["solved"], one["queries"])
                for one in group
            },
            note=_against(group[0]),
        )
        for (work, space), group in groups.items()
    ]
    return anytime_figure(panels, columns=len({space for _, space in groups}))


def _against(one: dict[str, Any]) -> str:
    """Return what a row's costs are held against."""
    if one["optimum"] is None:
        return "nobody found a route"
    kind = "best known" if one["best_known"] else "shortest"
    return f"{kind}: {one['optimum']:.2f} m"


def _print(rows: list[dict[str, Any]], refused: list[Refused], seconds: float) -> None:
    """Print a table for each workload and space, what is refused, and who failed why."""
    for (work, space), group in _groups(rows).items():
        shown = {
            one["system"]: {
                **{key: "-" if one[key] is None else one[key] for key in COLUMNS},
                "solved": f"{one['solved']} of {one['queries']}",
            }
            for one in group
        }
        emit_rows(shown, title=f"{work}, {space} ({_against(group[0])})")
        for one in group:
            if one["reason"] is not None:
                print(f"  {one['system']}: {one['reason']}")
    for planner, space, reason in refused:
        print(f"{planner} in {space}: {reason}")
    print(f"{sum(one['queries'] for one in rows)} attempts in {seconds:.0f} s")
