"""Run a scenario: map, plan, measure, compare with the bounds, draw."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from groundmap import GridWindow, GroundmapError, GroundMapper, draw, fit_ground, read_views
from groundmap.evaluate.protocols import evaluate
from groundmap.simulate.measures import measure
from groundmap.simulate.truth import Truth
from planners.scenario.case import Scenario, load_scenario
from planners.scenario.outcome import Bound, Figure, Outcome
from planners.scenario.queries import bounds_of
from planners.scenario.routes import QueryOutcome, compare_with_truth, run_query, true_map
from planners.scenario.simulated import Simulated, moving_figures, simulate

DPI = 100  # of the pictures in the report
MARGIN = 1.5  # [m] around the world, in pictures


def run_scenario(path: Path) -> Outcome:
    """Run the scenario of a file.

    A scenario whose world can't be mapped fails, with the message of the error.

    Raises
    ------
    FileFormatError
        The file is not a scenario.
    """
    scenario = load_scenario(path)
    if scenario.log is not None and not scenario.log.exists():
        return Outcome(
            scenario.name, scenario.why, passed=None, skipped=f"there is no log {scenario.log}"
        )
    began = time.perf_counter()
    try:
        result = _run_recorded(scenario) if scenario.log else _run_simulated(scenario)
    except GroundmapError as error:
        result = CaseResult({}, [], b"", f"{type(error).__name__}: {error}")
    figures, bounds = dict(result.figures), dict(scenario.bounds)
    for answer in result.answers:
        name = answer.query.name
        figures |= {f"{name}.{key}": value for key, value in answer.figures.items()}
        own_bounds = bounds_of(answer.query, known_world=scenario.log is None)
        bounds |= {f"{name}.{key}": bound for key, bound in own_bounds.items()}
    missed = (result.error,) if result.error else _list_missed(figures, bounds, result.answers)
    return Outcome(
        name=scenario.name,
        why=scenario.why,
        passed=not missed,
        figures=figures,
        bounds=bounds,
        missed=missed,
        picture=result.picture,
        seconds=time.perf_counter() - began,
    )


class CaseResult(NamedTuple):
    """Figures of a scenario, before they are compared with its bounds."""

    figures: dict[str, Figure]
    answers: list[QueryOutcome]
    picture: bytes  #: PNG
    error: str = ""  #: why there are no figures


def _run_simulated(scenario: Scenario) -> CaseResult:
    """Map a simulated world; compare map and routes with it."""
    simulated = simulate(scenario)
    figures: dict[str, Figure] = dict(measure(simulated.window, simulated.truth).to_dict())
    figures |= moving_figures(simulated)
    answers = [run_query(query, simulated.grid) for query in scenario.queries]
    if answers:
        fine = true_map(simulated)
        answers = [compare_with_truth(answer, simulated, fine) for answer in answers]
    return CaseResult(figures, answers, _picture(simulated, answers, scenario.name))


def _run_recorded(scenario: Scenario) -> CaseResult:
    """Map a log without ground truth, and judge the map by features held out of it."""
    assert scenario.log is not None
    settings, ground = scenario.mapper.model_dump(), scenario.ground.model_dump()
    verdicts = evaluate(read_views(scenario.log), ground=ground, **settings)
    figures: dict[str, Figure] = {
        f"{protocol}.{key}": value
        for protocol, verdict in verdicts.items()
        for key, value in asdict(verdict.figures).items()
    }
    mapper = GroundMapper(**settings)
    for view in fit_ground(read_views(scenario.log), **ground):
        mapper.integrate(view)
    answers = [run_query(query, mapper.grid) for query in scenario.queries]
    figure, axes = draw.new_figure(draw.known_bounds(mapper.grid))
    draw.draw_grid(mapper.grid, ax=axes)
    draw.draw_trajectory(mapper.grid.trajectory, ax=axes)
    for answer in answers:
        if answer.waypoints is not None:
            draw.draw_route(answer.waypoints, footprint=answer.query.radius, ax=axes)
    return CaseResult(figures, answers, draw.figure_png(figure, dpi=DPI))


def _picture(simulated: Simulated, answers: list[QueryOutcome], title: str) -> bytes:
    """Draw truth, map and difference of the world and a margin around it; in 3-D, the map."""
    truth, window = simulated.truth, simulated.window
    if not isinstance(truth, Truth):
        return _picture_3d(simulated, answers)
    corners = window.world_to_cell(np.reshape(simulated.world.bounds, (2, 2)))
    margin = int(np.ceil(MARGIN / window.resolution))
    low = np.maximum(corners[0] - margin, 0)
    part = tuple(slice(a, b + 1) for a, b in zip(low, corners[1] + margin, strict=True))
    figure = draw.draw_case(
        simulated.grid,
        outline=truth.obstacles,
        nonfree=truth.nonfree[part],
        visible=truth.visible[part],
        behind=~truth.in_line[part],
        window=GridWindow(
            window.confidence[part],
            window.count[part],
            window.origin + low[::-1] * window.resolution,
            window.resolution,
        ),
        routes=[
            (answer.query.name, answer.waypoints, answer.query.radius)
            for answer in answers
            if answer.waypoints is not None
        ],
        failed=[
            (answer.query.name, answer.query.start[:2], answer.query.goal[:2])
            for answer in answers
            if answer.waypoints is None
        ],
        trajectory=simulated.grid.trajectory,
        title=title,
    )
    return draw.figure_png(figure, dpi=DPI)


def _picture_3d(simulated: Simulated, answers: list[QueryOutcome]) -> bytes:
    """Draw a 3-D map and the routes on it."""
    window = simulated.window
    xmin, ymin, xmax, ymax = simulated.world.bounds
    top = window.origin[2] + window.shape[0] * window.resolution
    routes = {a.query.name: a.waypoints for a in answers if a.waypoints is not None}
    figure = draw.voxel_figure(
        simulated.grid,
        bounds=(xmin, ymin, -window.resolution, xmax, ymax, top),
        routes=routes,
        footprint=max([a.query.radius for a in answers], default=0.0),
    )
    return draw.figure_png(figure, dpi=DPI)


def _list_missed(
    figures: dict[str, Figure], bounds: dict[str, Bound], answers: list[QueryOutcome]
) -> tuple[str, ...]:
    """Return a sentence for each missed bound."""
    reasons = {f"{answer.query.name}.outcome": answer.reason for answer in answers}
    routeless = tuple(f"{answer.query.name}." for answer in answers if answer.reason)
    sentences = []
    for name, bound in bounds.items():
        query, _, figure = name.rpartition(".")
        outcome = bounds.get(f"{query}.outcome")
        unexpected = outcome is not None and not outcome.holds(figures.get(f"{query}.outcome"))
        # With an unexpected outcome, the other bounds of a query are not reported.
        if bound.holds(figures.get(name)) or (unexpected and figure != "outcome"):
            continue
        if name not in figures and not name.startswith(routeless):
            sentences.append(f"there is no figure {name}; there are {', '.join(figures)}")
            continue
        value, reason = figures.get(name), reasons.get(name, "")
        shown = f"{value:.4g}" if isinstance(value, float) else str(value)
        sentences.append(f"{name} is {shown}, not {bound}" + (f" ({reason})" if reason else ""))
    return tuple(sentences)
