"""``groundmap bench planning --samplers``: a comparison of OMPL's planners."""

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


class SamplerOptions(NamedTuple):
    """Options of the command line; an empty list stands for all."""

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


def compare_samplers(options: SamplerOptions, *, as_json: bool) -> None:
    """Run all trials, print their figures, and draw costs over time."""
    began = time.perf_counter()
    if options.plot is not None:
        check_picture(options.plot, sources=options.maps)
    names = _select("planner", options.planners, _samplers())
    spaces = [space for space in SPACES if space in _select("space", options.spaces, SPACES)]
    works = _workloads(options)
    trials, refused = list_trials(
        works,
        names,
        spaces,
        seeds=options.seeds,
        time_limit=options.time_limit,
        improve_for=options.improve_for,
    )

    def watch(steps: Iterable[Any]) -> Iterable[Any]:
        return show_progress(steps, total=len(trials), what="attempts")

    races = run(trials, jobs=options.jobs or processors(), watch=watch)
    best = optima(works, races)
    rows = [row(race, best[race.work, race.space]) for race in races]
    if options.plot is not None and rows:
        save_figure(_figure(rows), options.plot)
    seconds = time.perf_counter() - began
    if as_json:
        given = {key: getattr(options, key) for key in ("seeds", "time_limit", "improve_for")}
        left_out = [one._asdict() for one in refused]
        result = {**given, "seconds": seconds, "rows": rows, "refused": left_out}
        emit(result, as_json=True, title="")
    else:
        _print(rows, refused, seconds)


def _samplers() -> list[str]:
    names = sorted(samplers())
    if not names:
        get_planner("rrtconnect")  # raises, and explains how to install ompl
    return names


def _select(option: str, values: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return the values of an option, each of them known; without values, all that are known."""
    for value in values:
        if value not in known:
            raise ProblemError(option, f"one of {', '.join(known)}", repr(value))
    return list(dict.fromkeys(values)) or list(known)


def _workloads(options: SamplerOptions) -> list[Workload]:
    """Return the built-in workloads, the given maps, or both if both are selected."""
    footprint: Any = CART if options.footprint is None else outline(options.footprint)
    Footprint.of(footprint)  # an invalid footprint is refused before anything runs
    if isinstance(footprint, list):
        footprint = tuple(footprint)
    names = _select("workload", options.workloads, list(WORKLOADS))
    built_in = [Workload(name) for name in names]
    titles = {file: _title(file, path) for path in options.maps for file in find_maps(path)}
    counts = Counter(titles.values())
    maps = [
        Workload(
            title if counts[title] == 1 else file.as_posix(),
            file,
            footprint,
            options.turning_radius,
        )
        for file, title in titles.items()
    ]
    return maps if maps and not options.workloads else built_in + maps


def _title(file: Path, given: Path) -> str:
    return file.name if file == given else file.relative_to(given).as_posix()


def _groups(rows: list[dict[str, Any]]) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """Return the rows of each workload and space."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in rows:
        groups.setdefault((one["workload"], one["space"]), []).append(one)
    return groups


def _figure(rows: list[dict[str, Any]]) -> Any:
    """Return a figure with a row of panels for each workload."""
    groups = _groups(rows)
    panels = [
        Panel(
            title=f"{work}, {space}",
            progress={
                one["system"]: Progress(one["curve"], one["solved"], one["queries"])
                for one in group
            },
            note=_optimum(group[0]),
        )
        for (work, space), group in groups.items()
    ]
    return anytime_figure(panels, columns=len({space for _, space in groups}))


def _optimum(one: dict[str, Any]) -> str:
    """Return the optimum of a row, which its costs are compared with."""
    if one["optimum"] is None:
        return "no planner found a route"
    kind = "best known" if one["best_known"] else "shortest"
    return f"{kind}: {one['optimum']:.2f} m"


def _print(rows: list[dict[str, Any]], refused: list[Refused], seconds: float) -> None:
    """Print a table for each workload and space, with reasons of failures and refusals."""
    for (work, space), group in _groups(rows).items():
        shown = {
            one["system"]: {
                **{key: "-" if one[key] is None else one[key] for key in COLUMNS},
                "solved": f"{one['solved']} of {one['queries']}",
            }
            for one in group
        }
        emit_rows(shown, title=f"{work}, {space} ({_optimum(group[0])})")

        for one in group:
            if one["reason"] is not None:
                print(f"  {one['system']}: {one['reason']}")
    for planner, space, reason in refused:
        print(f"{planner} in {space}: {reason}")
    print(f"{sum(one['queries'] for one in rows)} attempts in {seconds:.0f} s")
