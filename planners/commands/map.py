"""``groundmap map``: fuse a log of views into a map."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap import CellState, GroundMapper, View, estimate_poses, fit_ground, pose_jumps
from groundmap.arrays import Floats
from groundmap.files.archive import check_writable
from groundmap.mapper import warm_up
from groundmap.registration.trajectory import with_poses
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
from planners.commands.settings_file import ConfigOption, ModeOption, read_settings
from planners.commands.sources import (
    CameraHeightOption,
    FormatOption,
    GuessOption,
    LevelOption,
    PointNoiseOption,
    PosesOrModeOption,
    ScaleOption,
    ScalePointsOption,
    SourceArgument,
    open_source,
)

SHOWN_JUMPS = 5  # jumps of the poses, one warning each
MODES = ("estimate", "refine")  # of --poses, beside files
NOT_MAPPING = {"startup", "read", "compile", "save", "other"}


def map_command(
    source: SourceArgument,
    out: Annotated[Path, typer.Option(help="File of the map: .npz.")],
    poses: PosesOrModeOption = None,
    format: FormatOption = None,
    scale: ScaleOption = None,
    scale_points: ScalePointsOption = None,
    camera_height: CameraHeightOption = None,
    level: LevelOption = None,
    point_noise: PointNoiseOption = None,
    guess_visibility: GuessOption = False,
    mode: ModeOption = None,
    resolution: Annotated[
        float | None, typer.Option(help="Side of a cell [m]; default: 0.1524 m.")
    ] = None,
    uncertainty: Annotated[
        str | None,
        typer.Option(
            help="Uncertainty of surfaces: ellipsoid, gaussian, radius or none; default: ellipsoid."
        ),
    ] = None,
    fusion: Annotated[
        str | None,
        typer.Option(
            help="Update rule: average, capped, exponential, log_odds or absolute; "
            "default: average."
        ),
    ] = None,
    max_range: Annotated[
        float | None, typer.Option(help="Drop farther features [m]; default: 20 m.")
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
        "mode": mode,
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
        opened = open_source(
            source,
            format=format,
            poses=None if str(poses) in MODES else poses,
            scale=scale,
            scale_points=scale_points,
            camera_height=camera_height,
            level=level,
            point_noise=point_noise,
            guess_visibility=guess_visibility,
        )
    read = stopwatch.each("read", opened.views)
    found: dict[str, Any] = {}
    if str(poses) in MODES:
        read, found = _register_views(list(read), str(poses), stopwatch)
    views = fit_ground(
        read,
        camera_height=opened.camera_height,
        **tables["ground"],
    )
    timed = opened.watch(stopwatch.each("ground", views))
    shown = show_progress(timed, total=len(opened.views), what="mapping views")
    sample, jumps = _integrate(mapper, shown)
    for sentence in opened.sentences():
        print_message(sentence)
    warnings = opened.warnings() + _warnings(mapper, sample) + _jump_warnings(jumps)
    for warning in warnings:
        print_message(f"warning: {warning}")
    with stopwatch.measure("save"):
        mapper.grid.save(out)
    summary = _summary(mapper, jumps, stopwatch, out) | opened.summary() | found
    summary |= {"warnings": warnings}
    emit(summary, as_json=as_json, title=f"map of {source}")


def _register_views(
    views: list[View], mode: str, stopwatch: Stopwatch
) -> tuple[Iterator[View], dict[str, Any]]:
    """Return views with estimated or refined poses, and how these were found, as JSON values."""
    with stopwatch.measure("register"):
        trajectory = estimate_poses(views, mode="refine" if mode == "refine" else "estimate")
    found = {
        "poses": mode,
        "registered": len(trajectory.edges) - len(trajectory.refused),
        "places_seen_again": len(trajectory.closures),
        "registration_refused": {str(view): why for view, why in trajectory.refused.items()},
    }
    if trajectory.refused:
        count, first = len(trajectory.refused), min(trajectory.refused)
        print_message(
            f"warning: registration of {count} views was refused, and their given poses relative "
            f"to the views before are used; the first is view {first}: {trajectory.refused[first]}"
        )
    return with_poses(views, trajectory.poses), found


def _integrate(mapper: GroundMapper, views: Iterable[View]) -> tuple[list[View], list[Jump]]:
    """Map all views; return the first ones, as a sample of the log, and the jumps of the poses."""
    sample: list[View] = []
    positions: list[Floats] = []
    times: list[float] = []
    for view in views:
        mapper.integrate(view)
        positions.append(view.T_map_base[:3, 3])
        if view.timestamp is not None:
            times.append(view.timestamp)
        if len(sample) < SAMPLE:
            sample.append(view)
    return sample, pose_jumps(positions, times if len(times) == len(positions) else None)


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
            "the map has no free cell but where the robot stood: "
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
    mapper: GroundMapper, jumps: list[Jump], stopwatch: Stopwatch, out: Path
) -> dict[str, Any]:
    grid, stats = mapper.grid, mapper.stats
    extent, unit = ("area", "m2") if grid.ndim == 2 else ("volume", "m3")
    seconds = stopwatch.stop()
    mapping = sum(time for stage, time in seconds.items() if stage not in NOT_MAPPING)
    return {
        "views": stats.views,
        "views_per_s": stats.views / mapping,
        "features_used": stats.features_used,
        "features_dropped": dict(stats.features_dropped),
        "seen_through": stats.seen_through,
        "through_viewpoint": stats.through_viewpoint,
        "pose_jumps": [jump._asdict() for jump in jumps],
        f"{extent}_free_{unit}": grid.area(CellState.FREE),
        f"{extent}_nonfree_{unit}": grid.area(CellState.NONFREE),
        "resolution": grid.resolution,
        "first_pose": grid.trajectory[0].tolist(),
        "last_pose": grid.trajectory[-1].tolist(),
        "map_bytes": grid.nbytes,
        "out": str(out),
        "stages_s": seconds,
        "wall_s": seconds_since_start(),
    }
