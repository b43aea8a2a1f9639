"""Evidence of one view: its surfaces and freespace, drawn into cells."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import Bools, Floats, Floats32, Ints
from groundmap.evidence.evidence import MARGIN, Evidence, block_around
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.raster import (
    EDGE,
    draw_surfaces,
    fill_star,
    lowest_sight,
    roll_over,
)
from groundmap.evidence.ground_plane.missing_ground import missing_ground, on_slopes
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces
from groundmap.evidence.ground_plane.visibility import NO_SURFACE, SightFan
from groundmap.evidence.uncertainty import MODELS
from groundmap.grid.grid import ConfidenceGrid
from groundmap.settings import MapperSettings

LOW_SIGHT = 4.0  # [step heights], lines of sight from this height up give the least evidence
LEAST_SURE = 0.25  # -z below high lines of sight
CONFIRMED = 0.5  # [m], a drop-off without another within this is most likely a false match
MOST_CELLS = 2**26  # a block of 256 MiB; larger ones are due to a resolution in another unit


def evidence_of(
    ground_view: GroundView,
    surfaces: Surfaces,
    fan: SightFan,
    grid: ConfidenceGrid,
    settings: MapperSettings,
) -> Evidence:
    """Return the evidence of a view: its surfaces and freespace, drawn into cells.

    Cells in the fan are free: -1 where a line of sight reaches the ground, closer to 0 the higher
    the lowest line of sight passes. Cells below the base are free within the narrowest footprint.
    Surfaces are above 0, spread by the uncertainty model up to `max_range`, and override free
    cells. Cells with missing ground are non-free, too.

    Parameters
    ----------
    ground_view : GroundView
    surfaces : Surfaces
    fan : SightFan
    grid : ConfidenceGrid
        Grid that defines the cells.
    settings : MapperSettings

    Raises
    ------
    InputError
        The view spans more than 2**26 cells, or is too far from the origin.
    """
    model = MODELS[settings.uncertainty]
    to_cells = _CellsOf(ground_view, grid)
    origin = to_cells(np.zeros((1, 2)))[0]
    firm = np.flatnonzero(surfaces.kind != SurfaceKind.DOUBTFUL)
    firm_cores, reach = surfaces.cores[firm], surfaces.reach[firm]
    spread = model.outline(firm_cores, reach)
    free, ends, cores, outlines = map(to_cells, (fan.free, surfaces.ends[firm], firm_cores, spread))
    caps = model.caps(reach) / grid.resolution
    discs = surfaces.discs[firm] / grid.resolution
    wheels, half_width = (
        to_cells(ground_view.base),
        0.5 * settings.narrowest_footprint / grid.resolution,
    )
    corners = [
        *_around(wheels, np.full((1, 1), half_width)),
        free,
        outlines,
        ends,
        *_around(cores, caps),
        *_around(ends, discs[:, None]),
    ]
    farthest = settings.max_range / grid.resolution
    drawn = np.concatenate([origin[None], *(array.reshape(-1, 2) for array in corners)])
    drawn = np.clip(drawn, origin - farthest - MARGIN, origin + farthest + MARGIN)
    lower, shape = block_around(drawn, grid.resolution, most_cells=MOST_CELLS)
    z = np.zeros(shape[::-1], dtype=np.float32)
    height = np.full(z.shape, ground_view.camera_height, dtype=np.float32)
    on_surface, around = model.evidence(reach, grid.resolution)
    belief = fan.contradictions.belief[firm]
    if len(free):
        odd = np.zeros(z.shape, dtype=np.uint8)
        free = free - lower
        fill_star(z, odd, origin - lower, free[:, 0], free[:, 1], fan.joined)
        _draw_sight(height, lower, ground_view, fan, to_cells)
        surest = 1.0 - height / (LOW_SIGHT * settings.step_height)
        z *= np.clip(surest, LEAST_SURE, 1.0, dtype=np.float32)
    for wheel in wheels - lower:
        roll_over(z, height, wheel, half_width)
    for shell, share in enumerate(model.falloff, start=1):
        within = reach * (shell / len(model.falloff))
        spread = model.outline(firm_cores, within)
        draw_surfaces(
            z,
            height,
            ends - lower,
            cores - lower,
            to_cells(spread) - lower,
            to_cells(_within(spread, settings.max_range)) - lower,
            model.caps(within) / grid.resolution,
            discs,
            on_surface * belief,
            share * around * belief,
            surfaces.tops[firm].max(axis=1),
            origin - lower,
            farthest,
        )
    evidence = Evidence(lower[::-1].astype(np.int64), z, height)
    return with_drop_offs(evidence, ground_view, grid)


def _within(places: Floats, farthest: float) -> Floats:
    """Return places, shape (..., 2) [m, view], pulled along their rays to within a distance."""
    ranges = np.hypot(places[..., 0], places[..., 1])
    within: Floats = places * np.minimum(farthest / np.maximum(ranges, farthest), 1.0)[..., None]
    return within


def _draw_sight(
    height: Floats32, lower: Floats, ground_view: GroundView, fan: SightFan, to_cells: _CellsOf
) -> None:
    """Lower the heights of cells to the lines of sight that end on the ground or a surface."""
    walls = fan.surface != NO_SURFACE
    ends = np.concatenate([fan.supports.chords, fan.ends[walls]])
    heights = np.concatenate([fan.supports.heights, fan.bottoms[walls]])
    viewpoint = to_cells(np.zeros((1, 2)))[0] - lower
    lowest_sight(height, viewpoint, ground_view.camera_height, to_cells(ends) - lower, heights)


def with_drop_offs(evidence: Evidence, ground_view: GroundView, grid: ConfidenceGrid) -> Evidence:
    """Return the evidence of a view with its drop-offs added.

    Ground is missing at features below the ground, and where their lines of sight run below ground
    level, as ground would block them. The z of these cells is raised to the confidence of the
    drop-off. Features that a gentle slope leads down to are left out.

    Parameters
    ----------
    evidence : Evidence
    ground_view : GroundView
    grid : ConfidenceGrid
        Grid that defines the cells.
    """
    deep = (ground_view.drop_off_sureness > 0) & ~_alone(ground_view.drop_offs)
    if deep.any():
        deep &= ~on_slopes(ground_view)
    if not deep.any():
        return evidence
    ground_view = ground_view._replace(
        drop_offs=ground_view.drop_offs[deep],
        drop_off_heights=ground_view.drop_off_heights[deep],
        drop_off_sureness=ground_view.drop_off_sureness[deep],
    )
    passed, line = missing_ground(ground_view, 0.5 * grid.resolution)
    number = np.concatenate([np.arange(len(ground_view.drop_offs)), line])
    places = np.concatenate([ground_view.drop_offs, passed])
    cells = np.floor(_CellsOf(ground_view, grid)(places) + EDGE).astype(np.int64)[:, ::-1]
    lower, z, height, _ = _extend(evidence, cells.min(axis=0), cells.max(axis=0) + 1)
    # In ascending confidence; at equal confidence the least deep comes last.
    order = np.lexsort(
        [ground_view.drop_off_heights[number], ground_view.drop_off_sureness[number]]
    )
    for row, col, value, depth in zip(
        *(cells[order] - lower).T,
        ground_view.drop_off_sureness[number][order].astype(np.float32),
        ground_view.drop_off_heights[number][order],
        strict=True,
    ):
        if value >= z[row, col]:
            z[row, col] = value
            if height is not None:
                height[row, col] = depth
    return Evidence(lower, z, height)


def _alone(places: Floats) -> Bools:
    """Return which places, shape (n, 2) [m], have no other place within `CONFIRMED`."""
    apart = np.hypot(*np.moveaxis(places[:, None] - places[None], -1, 0))
    alone: Bools = (apart <= CONFIRMED).sum(axis=1) == 1
    return alone


def _extend(evidence: Evidence, lower: Ints, upper: Ints) -> Evidence:
    """Return the evidence, its block extended to the cells from `lower` up to `upper`."""
    before = np.maximum(evidence.lower - lower, 0)
    after = np.maximum(upper - evidence.lower - evidence.z.shape, 0)
    margins = list(zip(before.tolist(), after.tolist(), strict=True))
    height = None if evidence.height is None else np.pad(evidence.height, margins)
    return Evidence(evidence.lower - before, np.pad(evidence.z, margins), height)


class _CellsOf:
    """Transform from the frame ``view`` to fractional cells, x along columns."""

    def __init__(self, ground_view: GroundView, grid: ConfidenceGrid) -> None:
        self.ground_view, self.grid = ground_view, grid

    def __call__(self, xy: Floats) -> Floats:
        cells: Floats = (self.ground_view.to_map(xy) - self.grid.origin) / self.grid.resolution
        return cells


def _around(ends: Floats, radius: Floats) -> tuple[Floats, Floats]:
    return ends - radius[..., None], ends + radius[..., None]
