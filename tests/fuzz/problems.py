"""Maps and problems for calls: mostly sensible, small, of any scale and anywhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely

from fuzz.draw import Draw
from fuzz.values import array, flag, number, odd, word
from groundmap import ConfidenceGrid
from groundmap.settings import Settings
from planners import CostSettings, PlanningProblem

SEQUENCES: tuple[Callable[[list[float]], Any], ...] = (tuple, list, np.array)
SIDE = 24  # cells
ORIGINS = ((0.0, 0.0), (0.0, 0.0), (-3.3, 7.7), (5.4e6, 3.1e5), (1e8, -1e8))
OUTLINE = ((-0.5, -0.4), (1.0, -0.4), (1.0, 0.4), (-0.5, 0.4))  # shares of the drawn size


def grid(draw: Draw, *, flat: bool = True) -> ConfidenceGrid:
    """Return a map of 24 x 24 cells (in 3-D of 8 x 8 x 8) with some that are blocked or unknown."""
    resolution = draw.pick((0.25, 0.5, 0.5, 1.0, 0.01, 1000.0))
    origin: tuple[float, ...] = draw.pick(ORIGINS)
    shape: tuple[int, ...] = (SIDE, SIDE)
    if not flat:
        shape, origin = (8, 8, 8), (*origin, 0.0)
    made = ConfidenceGrid(resolution=resolution, origin=origin)
    kinds = draw.pick(((0.0, 0.0), (0.05, 0.0), (0.1, 0.05), (0.2, 0.2), (1.0, 0.0)))
    chance = draw.numpy.random(shape)
    z = np.where(chance < kinds[0], 1.0, -0.8)
    z[chance > 1.0 - kinds[1]] = draw.pick((0.0, 0.001))
    made.fuse(np.zeros(len(shape), dtype=np.int64), z.astype(np.float32))
    draw.noted("grid", f"resolution {resolution}, origin {origin}, shares {kinds}")
    return made


def free_grid(shape: tuple[int, ...]) -> ConfidenceGrid:
    """Return a map on which every cell is free, with cells of 0.5 m."""
    made = ConfidenceGrid(resolution=0.5, origin=(0.0,) * len(shape))
    made.fuse(np.zeros(len(shape), dtype=np.int64), np.full(shape, -1.0, dtype=np.float32))
    return made


def place(draw: Draw, on: ConfidenceGrid, *, yaw: float = 0.5, odds: float = 0.1) -> Any:
    """Return a place on a map, with a yaw in some cases, or an odd value."""
    side = (SIDE if on.ndim == 2 else 8) * on.resolution
    xy = [float(low) + draw.number(0.02, 0.98) * side for low in on.origin]
    if draw.chance(0.3):  # on a centre or a corner of a cell
        step = on.resolution / 2.0
        xy = [
            float(low) + round((at - low) / step) * step
            for at, low in zip(xy, on.origin, strict=True)
        ]
    pose = [*xy, draw.number(-4.0, 4.0)] if draw.chance(yaw) else xy
    return array(draw, draw.pick(SEQUENCES)(pose), share=odds)


def footprint(draw: Draw, resolution: float, *, odds: float = 0.15) -> Any:
    """Return a radius or an outline in proportion to the cells, or an odd value."""
    size = resolution * draw.pick((0.0, 0.3, 0.9, 1.5, 3.0))
    if draw.chance(0.35):
        return array(draw, np.array(OUTLINE) * (size or resolution), share=2 * odds)
    return draw.either(odds, lambda: odd(draw), lambda: size)


def problem(
    draw: Draw, *, on: ConfidenceGrid | None = None, odds: float = 0.08, yaw: float = 0.5
) -> PlanningProblem:
    """Return a problem on a map of its own; the more often impossible, the higher the odds."""
    here = on or grid(draw, flat=not draw.chance(0.05))
    options: dict[str, Any] = {
        "start": place(draw, here, yaw=yaw, odds=odds),
        "goal": place(draw, here, yaw=yaw, odds=odds),
        "footprint": footprint(draw, here.resolution, odds=odds),
    }
    if draw.chance(0.5):
        options["unknown"] = draw.pick(("avoid", "allow", "penalise"))
    if draw.chance(odds):
        options["unknown"] = word(draw, "avoid")
    if draw.chance(0.2):
        options["clear_start"] = flag(draw)
    if draw.chance(0.2):
        options["clear_start_radius"] = number(draw, 0.0, 5.0 * here.resolution, odds)
    if draw.chance(0.1):
        options["cleared_at"] = place(draw, here, odds=odds)
    if draw.chance(0.1):
        options["epsilon"] = number(draw, 0.001, 0.5, odds)
    if draw.chance(0.3):
        options["costs"] = CostSettings(**settings_of(draw, CostSettings, odds=odds))
    if draw.chance(0.15):
        options["recent"] = cells(draw, here, odds=odds)
    if draw.chance(0.25):
        drawn = draw.pick((cells, areas))(draw, here, odds=odds)
        options["keep_out"] = draw.either(odds, lambda: odd(draw), lambda: drawn)
    for name, value in options.items():
        draw.noted(name, value)
    return PlanningProblem(here, **options)


def cells(draw: Draw, on: ConfidenceGrid, *, odds: float) -> Any:
    """Return some cells of a map and around it, or an odd value."""
    made = draw.numpy.integers(-3, SIDE + 3, (draw.whole(0, 6), on.ndim))
    return array(draw, made, share=odds)


def areas(draw: Draw, on: ConfidenceGrid, *, odds: float) -> Any:
    """Return triangles and boxes on a map and around it, some of them no polygons."""
    made: list[Any] = []
    for _ in range(draw.whole(0, 3)):
        size = SIDE * on.resolution * draw.pick((0.05, 0.2, 1.0, 0.0))
        low = on.origin[:2] + draw.numpy.uniform(-0.1, 1.0, 2) * SIDE * on.resolution
        corners = low + draw.numpy.uniform(0.0, 1.0, (draw.pick((3, 3, 4)), 2)) * size
        made.append(
            shapely.Polygon(corners) if draw.chance(0.5) else shapely.box(*low, *low + size)
        )
        if draw.chance(odds):
            made.append(draw.pick((shapely.Point(*low), shapely.Polygon(), odd(draw))))
    return made[0] if len(made) == 1 else made


def settings_of(
    draw: Draw,
    kind: type[Settings],
    *,
    most: int = 3,
    odds: float = 0.5,
    leave: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return some settings of a class, each its default, another size of it, or an odd value."""
    known = sorted(name for name in kind.model_fields if name not in leave)
    chosen: dict[str, Any] = {}
    for name in draw.random.sample(known, min(draw.whole(0, most), len(known))):
        default = kind.model_fields[name].default
        if draw.chance(odds) or default is None:
            value = odd(draw)
        elif isinstance(default, float):
            value = default * draw.pick((0.0, 0.5, 1.0, 2.0, 100.0))
        else:
            value = default
        chosen[name] = draw.noted(name, value)
    if draw.chance(0.01):
        chosen[draw.pick(("resolutoin", "", "a" * 5000, "\x1b[2J"))] = 1
    return chosen
