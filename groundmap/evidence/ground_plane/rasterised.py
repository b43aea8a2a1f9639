"""Surfaces and freespace of one view, drawn into cells: non-free wins over free."""

from __future__ import annotations

import numpy as np

from groundmap.arrays import FARTHEST_CELL, Floats, Ints
from groundmap.errors import InputError
from groundmap.evidence.evidence import Evidence
from groundmap.evidence.ground_plane.height_classes import GroundView
from groundmap.evidence.ground_plane.kernels.raster import draw_surfaces, fill_star
from groundmap.evidence.ground_plane.missing_ground import missing_ground
from groundmap.evidence.ground_plane.surfaces import SurfaceKind, Surfaces
from groundmap.evidence.ground_plane.visibility import SightFan
from groundmap.evidence.uncertainty import MODELS
from groundmap.grid.grid import ConfidenceGrid
from groundmap.printable import format_value
from groundmap.settings import MapperSettings

MARGIN = 1  # [cells] around what is drawn, so that rounding can't push a border cell outside
MOST_CELLS = 2**26  # a block of 256 MiB: more is a resolution in the wrong unit


def evidence_of(
    ground_view: GroundView,
    surfaces: Surfaces,
    fan: SightFan,
    grid: ConfidenceGrid,
    settings: MapperSettings,
) -> Evidence:
    """Draw surfaces and freespace of a view into cells.

    Freespace is -1 in the fan; surfaces are above 0, spread by the uncertainty model. Where both
    fall into a cell the surface wins: letting the last ray win erases walls.

    Raises
    ------
    InputError
        The view reaches over more than 2**26 cells.
    """
    model = MODELS[settings.uncertainty]
    to_cells = _CellsOf(ground_view, grid)
    origin = to_cells(np.zeros((1, 2)))[0]
    free, ends, cores = map(to_cells, (fan.free, surfaces.ends, surfaces.cores))
    outlines = to_cells(model.outline(surfaces.cores, surfaces.reach))
    caps = model.caps(surfaces.reach) / grid.resolution
    discs = surfaces.discs / grid.resolution
    corners = [free, outlines, ends, *_around(cores, caps), *_around(ends, discs[:, None])]
    drawn = np.concatenate([origin[None], *(array.reshape(-1, 2) for array in corners)])
    if not (np.abs(drawn) < FARTHEST_CELL).all():
        raise InputError(
            "view",
            f"evidence within {FARTHEST_CELL * grid.resolution:.3g} m of the origin",
            f"a viewpoint at {format_value((origin * grid.resolution).tolist())} m",
            hint="Is a pose wrong?",
        )
    lower = np.floor(drawn.min(axis=0)) - MARGIN
    shape = (np.floor(drawn.max(axis=0)) - lower).astype(np.int64) + 1 + MARGIN
    if np.prod(shape.astype(np.float64)) > MOST_CELLS:
        raise InputError(
            "resolution",
            f"one that cuts a view into {MOST_CELLS} cells at most",
            f"{grid.resolution} m, which makes {shape[1]} x {shape[0]}",
            hint="Give a coarser resolution, or a smaller max_range [m].",
        )
    z = np.zeros(shape[::-1], dtype=np.float32)
    on_surface, around = model.evidence(surfaces.reach, grid.resolution)
    belief = fan.contradictions.belief
    drawn = surfaces.kind != SurfaceKind.DOUBTFUL
    if len(free):
        odd = np.zeros(z.shape, dtype=np.uint8)
        free = free - lower
        fill_star(z, odd, origin - lower, free[:, 0], free[:, 1], fan.joined)
    draw_surfaces(
        z,
        ends[drawn] - lower,
        cores[drawn] - lower,
        outlines[drawn] - lower,
        caps[drawn],
        discs[drawn],
        (on_surface * belief)[drawn],
        (around * belief)[drawn],
    )
    return Evidence(lower[::-1].astype(np.int64), z)


def drop_off_cells(ground_view: GroundView, grid: ConfidenceGrid) -> Ints:
    """Return the cells ``[row, col]`` where the ground is missing, each once.

    Those under features below the ground, and those that their lines of sight pass over between
    the ground's level and the feature: had there been ground, it would have been in the way.
    """
    places = np.concatenate(
        [ground_view.drop_offs, missing_ground(ground_view, 0.5 * grid.resolution)]
    )
    cells = np.floor(_CellsOf(ground_view, grid)(places)).astype(np.int64)
    return np.unique(cells[:, ::-1], axis=0)


class _CellsOf:
    """From the frame ``view`` to cells (x along columns), unrounded."""

    def __init__(self, ground_view: GroundView, grid: ConfidenceGrid) -> None:
        self.ground_view, self.grid = ground_view, grid

    def __call__(self, xy: Floats) -> Floats:
        x, y = xy[..., 0], xy[..., 1]
        cos, sin = self.ground_view.forward
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        cells: Floats = (
            self.ground_view.viewpoint + turned - self.grid.origin
        ) / self.grid.resolution
        return cells


def _around(ends: Floats, radius: Floats) -> tuple[Floats, Floats]:
    return ends - radius[..., None], ends + radius[..., None]
