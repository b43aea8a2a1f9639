"""Pictures of costs over time: lines, markers and the table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from groundmap.draw import figure_png
from groundmap.draw.anytime import (
    ALL,
    COLOURS,
    NONE,
    SOME,
    Panel,
    Progress,
    anytime_figure,
    draw_anytime,
    draw_success,
    styles,
)
from groundmap.errors import InputError

LINE = [(0.02, 1.5), (0.1, 1.2), (1.0, 1.01)]
PLANNERS = {
    "rrtstar": Progress(LINE, 20, 20),
    "bitstar": Progress([(0.5, 1.3), (0.9, 1.1)], 15, 20),
    "rrt": Progress([(0.05, 1.4)], 20, 20),
    "fmt": Progress([], 0, 20),
}
PANEL = Panel("rooms, r2", PLANNERS)


def axes() -> Axes:
    ax: Axes = Figure().add_subplot()
    return ax


def drawn(progress: dict[str, Progress]) -> tuple[dict[str, Line2D], Axes]:
    ax = axes()
    artists: Any = draw_anytime(progress, style=styles([Panel("", progress)]), ax=ax)
    return {line.get_label(): line for line in artists}, ax


def test_a_line_ends_in_the_marker_of_the_returned_route() -> None:
    lines, _ = drawn(PLANNERS)
    assert lines.keys() == {"rrtstar", "bitstar", "rrt"}
    np.testing.assert_array_equal(lines["rrtstar"].get_xydata(), LINE)
    assert lines["rrtstar"].get_markevery() == [2]
    assert lines["rrtstar"].get_drawstyle() == "steps-post"
    assert lines["rrt"].get_markevery() == [0]


def test_a_marker_is_hollow_if_some_seed_was_not_solved() -> None:
    lines, _ = drawn(PLANNERS)
    assert lines["bitstar"].get_markerfacecolor() == "white"
    assert lines["rrtstar"].get_markerfacecolor() == lines["rrtstar"].get_color()


def test_both_axes_are_logarithmic_and_the_optimum_is_near_the_bottom() -> None:
    _, ax = drawn(PLANNERS)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    low, high = ax.get_ylim()
    assert 0.95 < low < 1.0
    assert high > 1.5
    assert all(low < tick < high for tick in ax.get_yticks())


@pytest.mark.parametrize("points", [[(1.0, np.nan)], [(1.0, 2.0, 3.0)]])
def test_invalid_points_are_refused(points: Any) -> None:
    with pytest.raises(InputError, match=r"rrt: expected "):
        drawn({"rrt": Progress(points, 1, 1)})


def test_planners_that_improve_routes_come_first_in_distinct_colours() -> None:
    once, better = Progress([(1, 2)], 1, 1), Progress([(1, 2), (2, 1)], 1, 1)
    names = {f"p{i:02}": once if i < 30 else better for i in range(30 + len(COLOURS))}
    style = styles([Panel("", names)])
    lined = [name for name, how in style.items() if how.lined]
    assert list(style)[: len(lined)] == lined == [f"p{i}" for i in range(30, 30 + len(COLOURS))]
    assert len({style[name].color for name in lined}) == len(COLOURS)
    assert len({how[:2] for how in style.values()}) == len(names)


def test_the_table_counts_the_seeds_that_were_solved() -> None:
    other = Panel("rooms, se2", {"rrt": Progress([], 4, 20)})
    ax = axes()
    artists = draw_success([PANEL, other], style=styles([PANEL, other]), ax=ax)
    texts = {(t.get_position()): t.get_text() for t in artists if isinstance(t, Text)}
    order = ["bitstar", "rrtstar", "fmt", "rrt"]
    assert [texts[0, row] for row in range(4)] == ["15", "20", "0", "20"]
    assert [texts[1, row] for row in range(4)] == ["-", "-", "-", "4"]
    assert [text for text in texts.values() if text in order] == order
    boxes = [box for box in artists if isinstance(box, Rectangle)]
    shades = {box.get_xy(): box.get_facecolor() for box in boxes}
    expected = [SOME, ALL, NONE, ALL]
    for row, shade in enumerate(expected):
        assert shades[-0.5, row - 0.5] == Rectangle((0, 0), 1, 1, facecolor=shade).get_facecolor()
    handles = [line for line in artists if isinstance(line, Line2D)]
    assert [line.get_linewidth() > 0 for line in handles] == [True, True, False, False]


def test_all_panels_of_a_figure_span_the_same_times() -> None:
    late = Panel("rooms, se2", {"rrt": Progress([(9.0, 2.0)], 20, 20)})
    unsolved = Panel("rooms, dubins", {"fmt": Progress([], 0, 20)})
    figure = anytime_figure([PANEL, late, unsolved], columns=2)
    *panels, table = [ax for ax in figure.get_axes() if ax.get_title(loc="left")]
    assert [ax.get_title(loc="left") for ax in panels] == [
        panel.title for panel in (PANEL, late, unsolved)
    ]
    assert len({ax.get_xlim() for ax in panels}) == 1
    low, high = panels[0].get_xlim()
    assert low < 0.02
    assert high > 9.0
    assert table.get_title(loc="left").startswith("seeds solved, of 20")
    assert figure_png(figure).startswith(b"\x89PNG")


def test_a_figure_without_any_route_can_be_drawn() -> None:
    figure = anytime_figure([Panel("a, r2", {"fmt": Progress([], 0, 3)})], columns=1)
    assert figure_png(figure).startswith(b"\x89PNG")


def test_a_figure_without_panels_is_refused() -> None:
    with pytest.raises(InputError, match=r"panels: expected at least one, got none"):
        anytime_figure([], columns=1)
