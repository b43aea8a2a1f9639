"""Running a scenario: map, plan, measure, compare with the bounds, draw."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path

from groundmap import GroundMapper, draw, fit_ground, read_views
from groundmap.evaluate import evaluate
from groundmap.simulate.measures import measure
from planners.scenario.case import Scenario, load_scenario
from planners.scenario.outcome import Bound, Figure, Outcome
from planners.scenario.routes import Answer, ask, bounds_of, held_to_truth, true_map
from planners.scenario.simulated import Simulated, simulate

DPI = 75  # of the pictures in the report


def run_scenario(path: Path) -> Outcome:
    """Run the scenario of a file.

    Raises
    ------
    FileFormatError
        The file is no scenario.
    InputError
        A bound on a figure that the scenario does not have.
    """
    began = time.perf_counter()
    scenario = load_scenario(path)
    if scenario.log is not None and not scenario.log.exists():
        return Outcome(
            scenario.name, scenario.why, passed=None, skipped=f"there is no log {scenario.log}"
        )
    figures, answers, picture = _recorded(scenario) if scenario.log else _simulated(scenario)
    bounds = dict(scenario.bounds)
    for answer in answers:
        name = answer.query.name
        figures |= {f"{name}.{key}": value for key, value in answer.figures.items()}
        bounds |= {f"{name}.{key}": bound for key, bound in bounds_of(answer.query).items()}
    missed = _missed(figures, bounds, answers)
    return Outcome(
        name=scenario.name,
        why=scenario.why,
        passed=not missed,
        figures=figures,
        bounds=bounds,
        missed=missed,
        picture=picture,
        seconds=time.perf_counter() - began,
    )


Result = tuple[dict[str, Figure], list[Answer], bytes]


def _simulated(scenario: Scenario) -> Result:
    """Map a world and hold map and routes against it."""
    simulated = simulate(scenario)
    figures: dict[str, Figure] = dict(asdict(measure(simulated.window, simulated.truth)))
    answers = [ask(query, simulated.grid) for query in scenario.queries]
    if answers:
        fine = true_map(simulated)
        answers = [held_to_truth(answer, simulated, fine) for answer in answers]
    return figures, answers, _picture(simulated, answers, scenario.name)


def _recorded(scenario: Scenario) -> Result:
    """Map a log, whose truth nobody knows, and judge it by features held out of it."""
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
    answers = [ask(query, mapper.grid) for query in scenario.queries]
    figure, axes = draw.new_figure(draw.known_bounds(mapper.grid))
    draw.draw_grid(mapper.grid, ax=axes)
    draw.draw_trajectory(mapper.grid.trajectory, ax=axes)
    for answer in answers:
        if answer.waypoints is not None:
            draw.draw_route(answer.waypoints, footprint=answer.query.footprint, ax=axes)
    return figures, answers, draw.figure_png(figure, dpi=DPI)


def _picture(simulated: Simulated, answers: list[Answer], title: str) -> bytes:
    truth = simulated.truth
    figure = draw.draw_case(
        simulated.grid,
        outline=truth.obstacles,
        nonfree=truth.nonfree,
        visible=truth.visible,
        behind=~truth.in_line,
        window=simulated.window,
        routes=[
            (answer.query.name, answer.waypoints, answer.query.footprint)
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


def _missed(
    figures: dict[str, Figure], bounds: dict[str, Bound], answers: list[Answer]
) -> tuple[str, ...]:
    """Return a sentence for each bound that does not hold.

    Raises
    ------
    InputError
        A bound on a figure that there is none of.
    """
    reasons = {f"{answer.query.name}.outcome": answer.reason for answer in answers}
    sentences = []
    for name, bound in bounds.items():
        value = figures.get(name)
        if name not in figures and not isinstance(bound.equals, str) and not answers:
            raise InputError(f"bounds.{name}", f"one of {', '.join(figures)}", "another figure")
        if not bound.holds(value):
            shown = f"{value:.4g}" if isinstance(value, float) else str(value)
            reason = reasons.get(name, "")
            sentences.append(f"{name} is {shown}, not {bound}" + (f" ({reason})" if reason else ""))
    return tuple(sentences)
