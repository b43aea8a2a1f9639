"""Calls of `planners`: problems, planners, routes and what is made of them."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.calls import Call
from fuzz.draw import Draw
from fuzz.problems import (
    OUTLINE,
    SIDE,
    footprint,
    free_grid,
    grid,
    place,
    problem,
    settings_of,
)
from fuzz.values import array, flag, number, odd, settings, word
from groundmap.errors import GroundmapError
from planners import (
    OWN_PLANNERS,
    CostSettings,
    Footprint,
    IncrementalPlanner,
    NoRouteError,
    PlanningError,
    PlanningProblem,
    Roadmap,
    Route,
    SamplingSettings,
    distance_field,
    max_curvature,
    plan,
    plan_many,
    reachable,
    shortcut,
    smooth,
    widest_route,
)

OWN = tuple(sorted(OWN_PLANNERS))
SAMPLING = ("rrtconnect", "prm", "rrtstar", "bitstar", "fmt", "kpiece1", "est", "lazyprmstar")
COUNTED = {"time_limit": 0.2, "iterations": 200, "seed": 1}


def footprints(draw: Draw, _folder: Path) -> None:
    """Make a footprint, and ask all that it knows."""
    made = Footprint.of(draw.noted("footprint", footprint(draw, 1.0, odds=0.4)))
    assert made.radius >= made.inscribed_radius >= 0.0
    made.covering_discs()
    made.convex_parts()
    made.to_value()
    len(str(made.width))


def problems(draw: Draw, _folder: Path) -> None:
    """Pose a problem."""
    posed = problem(draw, odds=0.3)
    len(str((posed.start_xy, posed.clear_radius, posed.radius, posed.clear_place)))


def own_planners(draw: Draw, folder: Path) -> None:
    """Plan with one of our own planners."""
    posed = problem(draw, yaw=0.7)
    name = draw.noted("planner", draw.either(0.03, lambda: odd(draw), lambda: draw.pick(OWN)))
    given: dict[str, Any] = {}
    if isinstance(name, str) and name in OWN_PLANNERS and draw.chance(0.4):
        given = settings_of(draw, OWN_PLANNERS[name].settings, odds=0.4)
    _used(plan(posed, name, **given), draw, folder)


def sampling_planners(draw: Draw, folder: Path) -> None:
    """Plan with a sampling planner."""
    posed = problem(draw, yaw=0.7, odds=0.03)
    name = draw.noted("planner", draw.pick(SAMPLING))
    given = COUNTED | settings_of(draw, SamplingSettings, odds=0.3, leave=("time_limit",))
    _used(plan(posed, name, **given), draw, folder)


def _used(route: Route, draw: Draw, folder: Path) -> None:
    """Use a route as callers do."""
    assert np.isfinite(route.waypoints).all()
    assert np.isfinite(route.cost)
    name = draw.pick(("r.geojson", "r.csv", "r.yaml", "r.txt", "r"))
    route.save(folder / name)
    max_curvature(route.waypoints[:, :2])


def many(draw: Draw, _folder: Path) -> None:
    """Plan many queries on one map."""
    on = grid(draw)
    posed = problem(draw, on=on, odds=0.02)
    pairs: Any = [(place(draw, on), place(draw, on)) for _ in range(draw.whole(0, 3))]
    pairs = draw.noted("pairs", draw.either(0.15, lambda: odd(draw), lambda: pairs))
    options: dict[str, Any] = {}
    if draw.chance(0.5):
        options["threads"] = draw.either(0.3, lambda: odd(draw), lambda: draw.whole(1, 2))
    if draw.chance(0.3):
        options["audit"] = flag(draw)
    for key, value in options.items():
        draw.noted(key, value)
    name = draw.noted("planner", draw.pick(OWN))
    for answer in plan_many(posed, pairs, name, **options):
        assert isinstance(answer, Route | NoRouteError)


def fields(draw: Draw, _folder: Path) -> None:
    """Ask for a distance field, or for what can be reached."""
    posed = problem(draw, odds=0.03)
    source = draw.noted("source", place(draw, posed.grid, odds=0.4))
    if draw.chance(0.5):
        limit = draw.noted("time_limit", draw.either(0.4, lambda: odd(draw), lambda: 5.0))
        field = distance_field(posed, source, time_limit=limit)
        assert not (field < 0).any()
    else:
        radius = draw.either(0.5, lambda: None, lambda: number(draw, 0, 3))
        reachable(posed, source, radius=draw.noted("radius", radius))


def widest(draw: Draw, _folder: Path) -> None:
    """Ask for the widest route."""
    widest_route(problem(draw))


def reworked(draw: Draw, _folder: Path) -> None:
    """Pull a route tight, and round it."""
    posed = problem(draw, odds=0.02, yaw=0.3)
    route = plan(
        posed, draw.pick(("astar", "astar", "theta", "jps", "hybrid_astar", "weighted_astar"))
    )
    size = posed.grid.resolution
    if draw.chance(0.5):
        options: dict[str, Any] = {"clearance": draw.noted("clearance", number(draw, 0, 3 * size))}
        shortcut(posed, route, **options if draw.chance(0.8) else {})
        return
    options = {"turning_radius": number(draw, 0.3 * size, 3 * size), "time_limit": 2.0}
    if draw.chance(0.3):
        options["spacing"] = number(draw, 0.1 * size, size)
    if draw.chance(0.2):
        options["time_limit"] = draw.either(0.5, lambda: odd(draw), lambda: 0.5)
    for key, value in options.items():
        draw.noted(key, value)
    smooth(posed, route, **options)


def other_problem(draw: Draw, _folder: Path) -> None:
    """Rework a route of another problem."""
    on = grid(draw)
    route = plan(problem(draw, on=on, odds=0.0))
    other = draw.pick((problem(draw, on=on, odds=0.0), problem(draw, odds=0.0)))
    shortcut(other, route) if draw.chance(0.5) else smooth(other, route, turning_radius=1.0)


def curvature(draw: Draw, _folder: Path) -> None:
    """Measure how much a line bends."""
    line = np.array([[0.0, 0], [1, 0], [2, 1], [2, 2]])
    max_curvature(draw.noted("waypoints", array(draw, line, 0.9)))


def incremental(draw: Draw, _folder: Path) -> None:
    """Plan again and again while the map changes."""
    on = grid(draw)
    given = settings_of(draw, OWN_PLANNERS["dstar_lite"].settings, odds=0.4)
    planner = IncrementalPlanner(problem(draw, on=on, odds=0.02), **given)
    for _ in range(2):
        cell = np.array([draw.whole(0, 30), draw.whole(0, 30)])
        on.fuse(cell, np.full((1, 2), draw.pick((1.0, -1.0)), dtype=np.float32))
        changed = [cell, cell + np.array([0, 1])]
        planner.update(draw.noted("changed", array(draw, np.array(changed), 0.3)))
        options: dict[str, Any] = {}
        if draw.chance(0.7):
            options["start"] = draw.noted("start", place(draw, on, odds=0.15))
        if draw.chance(0.3):
            options["goal"] = draw.noted("goal", place(draw, on, odds=0.15))
        planner.plan(**options)


def roadmaps(draw: Draw, folder: Path) -> None:
    """Grow a roadmap, ask it, save and load it."""
    posed = problem(draw, odds=0.02)
    none: tuple[Any, ...] = (0, -1, float("nan"), "1", None)
    seconds = draw.noted("seconds", draw.either(0.1, lambda: draw.pick(none), lambda: 0.3))
    given: dict[str, Any] = {"iterations": 20, "seed": 1} | settings(draw, ROADMAP, most=2)
    planner = draw.noted("planner", word(draw, "prm", "prmstar"))
    grown = Roadmap.grow(posed, seconds=seconds, planner=planner, **given)
    grown.save(folder / "r.npz")
    Roadmap.load(folder / "r.npz", posed)
    grown.plan(place(draw, posed.grid), place(draw, posed.grid), audit=draw.pick((True, False)))


ROADMAP = {
    "space": lambda draw: word(draw, "r2", "se2", "dubins", "reeds_shepp"),
    "seed": lambda draw: number(draw, 0, 9),
    "turning_radius": lambda draw: number(draw, 0.3, 5),
    "yaw_weight": lambda draw: number(draw, 0, 5),
    "max_nearest_neighbors": lambda draw: draw.either(0.5, lambda: odd(draw), lambda: 5),
    "simplify": flag,
    "length_weight": lambda draw: number(draw, 0, 5),
    "time_weight": lambda draw: number(draw, 0, 5),
    "max_speed": lambda draw: number(draw, 0, 5),
}


def improving(draw: Draw, _folder: Path) -> None:
    """Plan with a planner that tells of its routes."""
    posed: PlanningProblem = problem(draw, odds=0.02)
    callback = draw.noted(
        "on_improved", draw.either(0.3, lambda: odd(draw), lambda: lambda _: None)
    )
    cancel = draw.noted("cancel", draw.either(0.3, lambda: odd(draw), lambda: None))
    plan(posed, draw.pick(("ara", "astar")), on_improved=callback, cancel=cancel, time_limit=1.0)


def _compiled(names: tuple[str, ...], **given: Any) -> None:
    """Have planners compile, or load, all that they need on flat and on deep maps."""
    flat, deep = (free_grid(shape) for shape in ((SIDE, SIDE), (8, 8, 8)))
    for name in names:
        for shape, costs in ((0.9, CostSettings(clearance_weight=2.0)), (OUTLINE, CostSettings())):
            asked = PlanningProblem(
                flat, start=(3, 3, 0), goal=(9, 8, 1), footprint=shape, costs=costs
            )
            with contextlib.suppress(PlanningError, GroundmapError):
                plan(asked, name, **given)
        with contextlib.suppress(PlanningError, GroundmapError):
            start, goal = (1, 1, 1), (3, 3, 3)
            plan(PlanningProblem(deep, start=start, goal=goal, footprint=0.4), name, **given)


PLAN_CALLS: tuple[Call, ...] = (
    Call("footprint", footprints, weight=2),
    Call("problem", problems, weight=3),
    Call("plan", own_planners, weight=5, warm=lambda: _compiled(OWN)),
    Call(
        "plan-sampling",
        sampling_planners,
        weight=0.3,
        warm=lambda: _compiled(SAMPLING, time_limit=1.0, iterations=50),
    ),
    Call("plan-many", many, weight=1),
    Call("fields", fields, weight=1.5),
    Call("widest", widest, weight=0.7),
    Call("rework", reworked, weight=1),
    Call("rework-other", other_problem, weight=0.3),
    Call("curvature", curvature, weight=1),
    Call("incremental", incremental, weight=1),
    Call("roadmaps", roadmaps, weight=0.1),
    Call("improving", improving, weight=0.3),
)
