"""``groundmap evaluate``: judge the map of a log by features that were held out of it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from groundmap import draw, read_views
from groundmap.evaluate.protocols import Verdict, evaluate
from planners.commands.console import JsonOption, emit, emit_columns, show_progress
from planners.commands.settings_file import ConfigOption, ModeOption, read_settings


def evaluate_command(
    source: Annotated[Path, typer.Argument(help="Folder with a log of views.")],
    poses: Annotated[
        Path | None,
        typer.Option(help="File with poses to use instead: TUM rows, or id + 16 numbers."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the map and the held-out features: .png, .pdf, .svg.")
    ] = None,
    mode: ModeOption = None,
    camera_height: Annotated[
        float | None,
        typer.Option(help="Height of the camera above level ground [m]; default: fitted."),
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Judge maps of a log by features held out of them; figures are shares from 0 to 1.

    A 3-D map is judged by its collapse to 2-D.
    """
    if plot is not None:
        draw.check_picture(plot)
    log = read_views(source, poses=poses)

    def watch(steps: list[Any]) -> Any:
        return show_progress(steps, total=len(steps), what="mapping and judging")

    settings = read_settings(config)
    verdicts = evaluate(
        log,
        watch=watch,
        ground=settings["ground"],
        camera_height=camera_height,
        **settings["mapper"] | ({} if mode is None else {"mode": mode}),
    )
    if plot is not None:
        _draw(verdicts["views"], plot)
    figures = {name: asdict(verdict.figures) for name, verdict in verdicts.items()}
    if as_json:
        emit(figures, as_json=True, title="")
    else:
        emit_columns(figures, title=f"held-out evaluation of {source}")


def _draw(verdict: Verdict, picture: Path) -> None:
    figure, axes = draw.new_figure(draw.known_bounds(verdict.grid))
    draw.draw_grid(verdict.grid, ax=axes)
    draw.draw_trajectory(verdict.grid.trajectory, ax=axes)
    draw.draw_verdicts(
        verdict.grid,
        obstacles=verdict.held_out.obstacles,
        grounds=verdict.held_out.grounds,
        ax=axes,
    )
    draw.save_figure(figure, picture)
