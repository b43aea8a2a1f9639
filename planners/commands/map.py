"""``groundmap map``: fuse a log of views into a map."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from groundmap import CellState, GroundMapper, View, fit_ground, pose_jumps, read_views
from groundmap.arrays import Floats
from groundmap.errors import InputError
from groundmap.files.archive import check_writable
from groundmap.mapper import warm_up
from groundmap.stopwatch import Stopwatch
from groundmap.view.diagnosis import SAMPLE, describe_dropped, likely_mistakes
from groundmap.view.jumps import Jump
from planners.commands.console import (
    JsonOption,
    emit,
    print_message,
    seconds_since_start,
    show_progress,
)
from planners.commands.settings_file import ConfigOption, read_settings

SHOWN_JUMPS = 5  # jumps of the poses, one warning each
NOT_MAPPING = {"startup", "read", "compile", "save", "other"}


def map_command(
    source: Annotated[Path, typer.Argument(help="Folder with a log of views.")],
    out: Annotated[Path, typer.Option(help="File of the map: .npz.")],
    poses: Annotated[
        Path | None,
        typer.Option(help="File with poses to use instead: TUM rows, or id + 16 numbers."),
    ] = None,
    format: Annotated[
        str | None, typer.Option(help="Format of the log; default: detected from its files.")
    ] = None,
    resolution: Annotated[
        float | None, typer.Option(help="Side of a cell [m]; default: 0.1524 m.")
    ] = None,
    uncertainty: Annotated[
        str | None,
        typer.Option(
            help="Uncertainty of surfaces: ellipsoid, radius or none; default: ellipsoid."
        ),
    ] = None,
    fusion: Annotated[
        str | None, typer.Option(help="Update rule: average or capped; default: average.")
    ] = None,
    max_range: Annotated[
        float | None, typer.Option(help="Drop farther features [m]; default: 20 m.")
    ] = None,
    camera_height: Annotated[
        float | None,
        typer.Option(help="Height of the camera above the ground [m]; default: fitted."),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Map a log of views into a confidence grid."""
    stopwatch = Stopwatch(outside="other")
    stopwatch.seconds["startup"] = seconds_since_start()
    check_writable(out)
    tables = read_settings(config)
    given = {
        "resolution": resolution,
        "uncertainty": uncertainty,
        "fusion": fusion,
        "max_range": max_range,
    }
    settings = tables["mapper"] | {key: value for key, value in given.items() if value is not None}
    mapper = GroundMapper(stages=stopwatch, **settings)
    with stopwatch.measure("compile"):
        warm_up(mapper.settings)
    with stopwatch.measure("read"):
        log = read_views(source, format=format, poses=poses)
        total = len(log)
    if total == 0:
        raise InputError(str(source), "at least one view", "none")
    views = fit_ground(stopwatch.each("read", log), camera_height=camera_height, **tables["ground"])
    timed = stopwatch.each("ground", views)
    mapped = _integrate(mapper, show_progress(timed, total=total, what="mapping views"))
    warnings = _warnings(mapper, mapped.sample) + _jump_warnings(mapped.jumps)
    for warning in warnings:
        print_message(f"warning: {warning}")
    with stopwatch.measure("save"):
        mapper.grid.save(out)
    summary = _summary(mapper, mapped, stopwatch, out) | {"warnings": warnings}
    emit(summary, as_json=as_json, title=f"map of {source}")


class _Mapped(NamedTuple):
    """What is known of a log after all its views were mapped."""

    sample: list[View]  # its first views
    jumps: list[Jump]  # of the poses
    camera_heights: list[float]  # [m] above the ground, of each view


def _integrate(mapper: GroundMapper, views: Iterable[View]) -> _Mapped:
    """Map all views."""
    sample: list[View] = []
    positions: list[Floats] = []
    times: list[float] = []
    heights: list[float] = []
    for view in views:
        mapper.integrate(view)
        positions.append(view.T_map_base[:3, 3])
        assert view.plane is not None
        heights.append(float(view.plane.height(view.rig.T_base_camera[:3, 3])))
        if view.timestamp is not None:
            times.append(view.timestamp)
        if len(sample) < SAMPLE:
            sample.append(view)
    jumps = pose_jumps(positions, times if len(times) == len(positions) else None)
    return _Mapped(sample, jumps, heights)


def _warnings(mapper: GroundMapper, sample: list[View]) -> list[str]:
    """Return warnings of likely mistakes in a log, and of a map without freespace."""
    warnings = likely_mistakes(sample)
    # Where the robot stood, the ground is free in every map.
    if mapper.stats.features_used == 0 or mapper.grid.area(CellState.FREE) == 0:
        stats = mapper.stats
        total = stats.features_used + stats.features_dropped.total()
        dropped = describe_dropped(stats.features_dropped)
        reasons = f" (dropped: {dropped})" if dropped else ""
        warnings.insert(
            0,
            f"the map has no free cell but where the robot stood: "
            f"{stats.features_used:,} of {total:,} features of {stats.views} views were used"
            f"{reasons}.",
        )
    return warnings


def _jump_warnings(jumps: list[Jump]) -> list[str]:
    """Return a warning for each of the first jumps of the poses."""
    warnings = [
        f"the pose of view {jump.view} is {jump.step:.4g} m from that of view {jump.view - 1}, "
        f"where steps are {jump.typical_step:.2g} m: is one of them wrong? A view with a wrong "
        "pose is mapped at a wrong place."
        for jump in jumps[:SHOWN_JUMPS]
    ]
    if len(jumps) > SHOWN_JUMPS:
        warnings.append(f"{len(jumps) - SHOWN_JUMPS} more poses jump; --json lists them")
    return warnings


def _summary(
    mapper: GroundMapper, mapped: _Mapped, stopwatch: Stopwatch, out: Path
) -> dict[str, Any]:
    grid, stats = mapper.grid, mapper.stats
    area = {state: grid.area(state) for state in (CellState.FREE, CellState.NONFREE)}
    seconds = stopwatch.stop()
    mapping = sum(time for stage, time in seconds.items() if stage not in NOT_MAPPING)
    return {
        "views": stats.views,
        "views_per_s": stats.views / mapping,
        "features_used": stats.features_used,
        "features_dropped": dict(stats.features_dropped),
        "seen_through": stats.seen_through,
        "through_viewpoint": stats.through_viewpoint,
        "pose_jumps": [jump._asdict() for jump in mapped.jumps],
        "camera_height": float(np.median(mapped.camera_heights)),
        "camera_height_swing": float(np.ptp(mapped.camera_heights)),
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
