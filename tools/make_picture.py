"""Draw the pictures of README.md: the four steps from features to a route; routes of all planners.

`python tools/make_picture.py` uses the log of `groundmap demo`.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from groundmap import ConfidenceGrid, GroundMapper, fit_ground, read_views
from groundmap.draw import (
    draw_grid,
    draw_route,
    draw_routes,
    draw_trajectory,
    new_figure,
    save_figure,
)
from groundmap.draw.views import draw_fan, draw_features, draw_triangulation
from planners import OWN_PLANNERS, PlanningProblem, plan
from planners.commands.demo import FOOTPRINT, GOAL

ROOT = Path(__file__).parent.parent
VIEW = 47  # with distant features
VIEW_BOUNDS = (-0.5, -7.0, 13.5, 7.0)  # [m, view]
MAP_BOUNDS = (-1.0, -1.0, 25.0, 17.0)  # [m, map]


def main() -> None:
    """Map, plan, draw, save."""
    views = list(fit_ground(read_views(ROOT / "planners" / "demo_data")))
    mapper = GroundMapper()
    parts = mapper.explain(views[VIEW])
    for view in views:
        mapper.integrate(view)
    start = mapper.grid.trajectory[0, :2]
    route = plan(PlanningProblem(mapper.grid, start=start, goal=GOAL, footprint=FOOTPRINT))
    figure = Figure(figsize=(15.0, 3.5), layout="constrained")
    axes = figure.subplots(1, 4, width_ratios=(1.0, 1.0, 1.45, 1.45))
    draw_features(parts, ax=axes[0])
    figure.axes[-1].remove()  # the scale of the heights
    draw_fan(parts, ax=axes[1])
    draw_triangulation(parts, ax=axes[1])
    for ax in axes[2:]:
        for scale in draw_grid(mapper.grid, bounds=MAP_BOUNDS, ax=ax)[1:3]:
            scale.remove()  # it would cover a wall
        ax.get_legend().remove()
    draw_trajectory(mapper.grid.trajectory, ax=axes[2])
    axes[2].get_legend().remove()
    draw_route(route.waypoints, footprint=FOOTPRINT, ax=axes[3])
    axes[3].get_legend().remove()
    titles = (
        "1  features of one view, by height",
        "2  its surfaces and sight fan",
        f"3  {len(views)} views fused: confidence",
        f"4  a route of {route.length:.1f} m, audited",
    )
    for ax, title in zip(axes, titles, strict=True):
        frame(ax, title)
    for ax in axes[:2]:
        ax.set(xlim=VIEW_BOUNDS[::2], ylim=VIEW_BOUNDS[1::2])
        ax.plot(0.0, 0.0, "^", color="0.1", markersize=7)
    save_figure(figure, ROOT / "docs" / "pipeline.png", dpi=100)
    draw_planners(mapper.grid)


def draw_planners(grid: ConfidenceGrid) -> None:
    """Draw the route of every planner through the courtyard's doorway."""
    start = grid.trajectory[0]
    problem = PlanningProblem(grid, start=start, goal=(*GOAL, 0.0), footprint=FOOTPRINT)
    routes = {name: plan(problem, name).waypoints for name in sorted(OWN_PLANNERS)}
    figure, ax = new_figure(MAP_BOUNDS)
    draw_grid(grid, bounds=MAP_BOUNDS, ax=ax)
    if (legend := ax.get_legend()) is not None:
        legend.remove()  # the other picture has a legend of these colours
    draw_routes(routes, ax=ax)
    save_figure(figure, ROOT / "docs" / "planners.png", dpi=80)


def frame(ax: Axes, title: str) -> None:
    """Set the title of a panel, and remove ticks and labels."""
    ax.set_title("")
    ax.set_title(title, fontsize=11, loc="left")
    ax.set(xticks=[], yticks=[], xlabel="", ylabel="", aspect="equal")


if __name__ == "__main__":
    main()
