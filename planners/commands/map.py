"""``groundmap map``: from a log of views to a map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap import CellState, GroundMapper, View, fit_ground, pose_jumps, read_views
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.files.archive import check_writable
from groundmap.mapper import warm_up
from groundmap.stopwatch import Stopwatch
from groundmap.view.diagnosis import SAMPLE, describe_dropped, likely_mistakes
from groundmap.view.jumps import Jump
from planners.commands.console import JsonOption, emit, say, seconds_since_start, show_progress
from planners.commands.settings_file import ConfigOption, read_settings

SHOWN_JUMPS = 5  # of the poses, one line each
NOT_MAPPING = {"startup", "read", "compile", "save", "other"}


def map_command(
    source: Annotated[Path, typer.Argument(help="Folder with a log of views.")],
    out: Annotated[Path, typer.Option(help="File to write the map to.")],
    poses: Annotated[
        Path | None, typer.Option(help="File with other poses: TUM rows, or id + 16 numbers.")
    ] = None,
    format: Annotated[
        str | None, typer.Option(help="Format of the log; recognised unless told.")
    ] = None,
    resolution: Annotated[
        float | None, typer.Option(help="Size of a cell [m]; 0.1524 unless told.")
    ] = None,
    uncertainty: Annotated[
        str | None, typer.Option(help="Spread of surfaces: ellipsoid (default), radius, none.")
    ] = None,
    fusion: Annotated[
        str | None, typer.Option(help="Update rule: average (default), capped.")
    ] = None,
    max_range: Annotated[
        float | None, typer.Option(help="Drop farther features [m]; 20 unless told.")
    ] = None,
    camera_height: Annotated[
        float | None,
        typer.Option(help="Height of the camera above level ground [m]; fitted unless told."),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Map a log of views into a confidence grid."""
    stages = Stopwatch(outside="other")
    stages.seconds["startup"] = seconds_since_start()
    check_writable(out)
    tables = read_settings(config)
    given = {
        "resolution": resolution,
        "uncertainty": uncertainty,
        "fusion": fusion,
        "max_range": max_range,
    }
    chosen = tables["mapper"] | {key: value for key, value in given.items() if value is not None}
    mapper = GroundMapper(stages=stages, **chosen)
    with stages.measure("compile"):
        warm_up(mapper.settings)
    with stages.measure("read"):
        log = read_views(source, format=format, poses=poses)
        total = len(log)
    if total == 0:
        raise InputError(str(source), "at least one view", "none")
    views = fit_ground(stages.each("read", log), camera_height=camera_height, **tables["ground"])
    sample: list[View] = []
    positions: list[Floats] = []
    times: list[float | None] = []
    for view in show_progress(stages.each("ground", views), total=total, what="mapping views"):
        mapper.integrate(view)
        positions.append(view.T_map_base[:3, 3])
        times.append(view.timestamp)
        if len(sample) < SAMPLE:
            sample.append(view)
    jumps = _jumps(positions, times)
    warnings = _warnings(mapper, sample) + _jump_warnings(jumps)
    for warning in warnings:
        say(f"warning: {warning}")
    with stages.measure("save"):
        mapper.grid.save(out)
    summary = _summary(mapper, jumps, stages, out) | {"warnings": warnings}
    emit(summary, as_json=as_json, title=f"map of {source}")


def _warnings(mapper: GroundMapper, sample: list[View]) -> list[str]:
    """Return what is likely wrong with a log, or with its map."""
    warnings = likely_mistakes(sample)
    if mapper.grid.area(CellState.FREE) == 0:
        stats = mapper.stats
        total = stats.features_used + stats.features_dropped.total()
        dropped = describe_dropped(stats.features_dropped)
        reasons = f" (dropped: {dropped})" if dropped else ""
        warnings.insert(
            0,
            f"the map has no free cell: {stats.features_used:,} of {total:,} features of "
            f"{stats.views} views were used{reasons}.",
        )
    return warnings


def _jumps(positions: list[Floats], times: list[float | None]) -> list[Jump]:
    """Return the jumps of the poses."""
    known = [time for time in times if time is not None]
    return pose_jumps(positions, known if len(known) == len(times) else None)


def _jump_warnings(jumps: list[Jump]) -> list[str]:
    """Return a warning for each of the first jumps of the poses."""
    warnings = [
        f"the pose of view {jump.view} is {jump.step:.4g} m from that of view {jump.view - 1}, "
        f"where steps are {jump.typical_step:.2g} m: is one of them wrong? What is seen from a "
        "wrong pose lies at a wrong place in the map."
        for jump in jumps[:SHOWN_JUMPS]
    ]
    if len(jumps) > SHOWN_JUMPS:
        warnings.append(f"{len(jumps) - SHOWN_JUMPS} more poses jump; --json lists them")
    return warnings


def _summary(
    mapper: GroundMapper, jumps: list[Jump], stages: Stopwatch, out: Path
) -> dict[str, Any]:
    grid, stats = mapper.grid, mapper.stats
    area = {state: grid.area(state) for state in (CellState.FREE, CellState.NONFREE)}
    seconds = stages.stop()
    mapping = sum(time for stage, time in seconds.items() if stage not in NOT_MAPPING)
    return {
        "views": stats.views,
        "views_per_s": stats.views / mapping,
        "features_used": stats.features_used,
        "features_dropped": dict(stats.features_dropped),
        "seen_through": stats.seen_through,
        "through_viewpoint": stats.through_viewpoint,
        "pose_jumps": [jump._asdict() for jump in jumps],
        "area_free_m2": area[CellState.FREE],
        "area_nonfree_m2": area[CellState.NONFREE],
        "resolution": grid.resolution,
        "first_pose": grid.trajectory[0].tolist(),
        "last_pose": grid.trajectory[-1].tolist(),
        "map_bytes": grid.nbytes,
        "out": str(out),
        "stages_s": seconds,
        "wall_s": seconds_since_start(),
    }
