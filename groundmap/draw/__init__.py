"""Pictures; the only package that imports matplotlib, on the first call that draws.

Every function draws on `ax`, or on new axes, and returns the artists that it created. The four
states are distinct in greyscale as well: free is the lightest, then unknown, contested, and
non-free, which is nearly black.
"""

from groundmap.draw.case import draw_case
from groundmap.draw.curves import curves_png, draw_curves
from groundmap.draw.figure import check_picture, figure_png, new_figure, save_figure
from groundmap.draw.graphs import draw_graph
from groundmap.draw.maps import (
    draw_cells,
    draw_grid,
    draw_keep_out,
    draw_trajectory,
    draw_verdicts,
    known_bounds,
)
from groundmap.draw.routes import draw_route, draw_routes
from groundmap.draw.truth import draw_difference, draw_truth
from groundmap.draw.views import draw_view
from groundmap.draw.voxels import voxel_figure

__all__ = [
    "check_picture",
    "curves_png",
    "draw_case",
    "draw_cells",
    "draw_curves",
    "draw_difference",
    "draw_graph",
    "draw_grid",
    "draw_keep_out",
    "draw_route",
    "draw_routes",
    "draw_trajectory",
    "draw_truth",
    "draw_verdicts",
    "draw_view",
    "figure_png",
    "known_bounds",
    "new_figure",
    "save_figure",
    "voxel_figure",
]
