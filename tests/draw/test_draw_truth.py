"""Pictures of the truth and of differences from it, checked by their arrays and pixels."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage, imread
from matplotlib.lines import Line2D

from groundmap import ConfidenceGrid
from groundmap.draw import draw_case, draw_difference, draw_truth, figure_png, new_figure
from groundmap.draw.truth import FINDINGS, GROUND, OBSTACLE, UNSEEN, Finding, findings
from groundmap.errors import InputError
from groundmap.grid.window import CellState

ROWS, COLS = 6, 8
POST = (3, 6)  # the one cell with an obstacle


def truth() -> dict[str, Any]:
    """Return a post, the visible ground left of it, and the cells that it hides."""
    nonfree = np.zeros((ROWS, COLS), dtype=np.bool_)
    nonfree[POST] = True
    behind = np.zeros_like(nonfree)
    behind[POST[0], POST[1] + 1] = True
    visible = np.zeros_like(nonfree)
    visible[:, :5] = True
    return {"nonfree": nonfree, "visible": visible, "behind": behind}


def states_of(state: CellState) -> np.ndarray:
    return np.full((ROWS, COLS), state, dtype=np.uint8)


def rgb(ax: Axes) -> np.ndarray:
    image = next(artist for artist in ax.images if isinstance(artist, AxesImage))
    return np.asarray(image.get_array())


def legend_of(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def rendered(figure: Figure) -> np.ndarray:
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255.0


def pixel(figure: Figure, ax: Axes, place: tuple[float, float]) -> np.ndarray:
    pixels = rendered(figure)
    x, y = ax.transData.transform(place)
    shown: np.ndarray = pixels[pixels.shape[0] - 1 - int(y), int(x)]
    return shown


def case(*, rows: int = ROWS, cols: int = COLS, **options: Any) -> Figure:
    grid = ConfidenceGrid(resolution=1.0)
    grid.fuse(np.array([0, 0]), np.full((rows, cols), -1.0, dtype=np.float32))
    nothing = np.zeros((rows, cols), dtype=np.bool_)
    return draw_case(
        grid,
        outline=shapely.box(5, 3, 6, 4),
        nonfree=nothing,
        visible=~nothing,
        behind=nothing,
        window=grid.window((0, 0, cols, rows)),
        **options,
    )


def test_all_findings_are_distinct_in_greyscale() -> None:
    colors = [color for _, color in FINDINGS.values()]
    levels = np.sort(np.array(colors) @ (0.299, 0.587, 0.114))
    assert np.diff(levels).min() >= 0.1


def test_worse_findings_are_darker() -> None:
    order = (Finding.UNSEEN, Finding.MISSED, Finding.FALSE_NONFREE, Finding.FALSE_FREE)
    levels = np.array([FINDINGS[finding][1] for finding in order]) @ (0.299, 0.587, 0.114)
    assert (np.diff(levels) < 0).all()


def test_free_is_false_on_obstacles_and_behind_them_only() -> None:
    found = findings(states_of(CellState.FREE), **truth())
    false = found == Finding.FALSE_FREE
    assert np.argwhere(false).tolist() == [[3, 6], [3, 7]]
    assert (found[~false] == Finding.FREE).all()


def test_non_free_is_right_up_to_one_cell_from_an_obstacle() -> None:
    found = findings(states_of(CellState.NONFREE), **truth())
    rows, cols = np.indices(found.shape)
    near = np.maximum(abs(rows - POST[0]), abs(cols - POST[1])) <= 1
    assert (found[near] == Finding.NONFREE).all()
    assert (found[~near] == Finding.FALSE_NONFREE).all()


@pytest.mark.parametrize("state", [CellState.UNKNOWN, CellState.CONTESTED])
def test_unknown_cells_are_missed_where_they_were_in_sight(state: CellState) -> None:
    found = findings(states_of(state), **truth())
    visible = truth()["visible"]
    assert (found[visible] == Finding.MISSED).all()
    assert (found[~visible] == Finding.UNSEEN).all()


@pytest.mark.parametrize("name", ["nonfree", "visible", "behind"])
def test_a_truth_of_another_shape_is_refused(name: str) -> None:
    other = {**truth(), name: np.zeros((2, 3), dtype=np.bool_)}
    with pytest.raises(InputError, match=rf"{name}: expected the shape \(6, 8\) of the map, got"):
        findings(states_of(CellState.FREE), **other)


def test_a_false_free_cell_is_red_at_exactly_its_pixel() -> None:
    states = states_of(CellState.UNKNOWN)
    states[POST] = CellState.FREE
    figure, ax = new_figure((0.0, 0.0, 1.0, 1.0))
    draw_difference(states, **truth(), origin=(10.0, 20.0), resolution=0.5, ax=ax)
    red = (rgb(ax) == FINDINGS[Finding.FALSE_FREE][1]).all(axis=-1)
    assert np.argwhere(red).tolist() == [list(POST)]
    centre = (10.0 + 6.5 * 0.5, 20.0 + 3.5 * 0.5)
    color = FINDINGS[Finding.FALSE_FREE][1]
    np.testing.assert_allclose(pixel(figure, ax, centre), color, atol=0.01)
    for dx, dy in ((0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)):
        beside = pixel(figure, ax, (centre[0] + dx, centre[1] + dy))
        assert abs(beside - color).max() > 0.2


def test_a_false_free_cell_is_visible_on_maps_of_any_size() -> None:
    nothing = np.zeros((1500, 2000), dtype=np.bool_)
    nonfree = nothing.copy()
    nonfree[700, 901] = True
    figure, ax = new_figure((0.0, 0.0, 2000.0, 1500.0))
    figure.set_dpi(30)
    states = np.full(nothing.shape, CellState.FREE, dtype=np.uint8)
    draw_difference(
        states, nonfree=nonfree, visible=~nonfree, behind=nothing,
        origin=(0.0, 0.0), resolution=1.0, ax=ax,
    )  # fmt: skip
    if (legend := ax.get_legend()) is not None:
        legend.remove()
    red, green, _ = np.moveaxis(rendered(figure), -1, 0)
    assert (red - green).max() > 0.4


def test_the_legend_of_the_difference_counts_cells() -> None:
    _, ax = new_figure((0.0, 0.0, 1.0, 1.0))
    states = states_of(CellState.FREE)
    draw_difference(states, **truth(), origin=(0.0, 0.0), resolution=1.0, ax=ax)
    assert legend_of(ax) == [
        "free, right: 46",
        "non-free, right: 0",
        "FALSE FREE: 2",
        "false non-free: 0",
        "visible, not known: 0",
        "not in sight: 0",
    ]


def test_ground_in_sight_is_light_and_the_rest_grey() -> None:
    _, ax = new_figure((0.0, 0.0, 1.0, 1.0))
    visible = truth()["visible"]
    draw_truth(shapely.Polygon(), visible=visible, origin=(0.0, 0.0), resolution=1.0, ax=ax)
    np.testing.assert_array_equal(rgb(ax)[visible], np.tile(GROUND, (30, 1)))
    np.testing.assert_array_equal(rgb(ax)[~visible], np.tile(UNSEEN, (18, 1)))
    assert (ax.get_xlim(), ax.get_ylim()) == ((0.0, 8.0), (0.0, 6.0))


@pytest.mark.parametrize("clockwise", [False, True])
def test_obstacles_are_dark_and_their_holes_are_not(clockwise: bool) -> None:
    ring = shapely.box(1, 1, 5, 5).difference(shapely.box(2, 2, 4, 4))
    outline = shapely.MultiPolygon([ring.reverse() if clockwise else ring, shapely.box(6, 1, 7, 2)])
    figure, ax = new_figure((0.0, 0.0, 1.0, 1.0))
    visible = np.ones((ROWS, COLS), dtype=np.bool_)
    draw_truth(outline, visible=visible, origin=(0.0, 0.0), resolution=1.0, ax=ax)
    for place in ((1.5, 3.0), (6.5, 1.5)):
        np.testing.assert_allclose(pixel(figure, ax, place), OBSTACLE, atol=0.01)
    for place in ((3.0, 3.0), (5.5, 3.0)):
        np.testing.assert_allclose(pixel(figure, ax, place), GROUND, atol=0.01)


@pytest.mark.parametrize("nothing", [shapely.Polygon(), shapely.union_all([])])
def test_a_world_without_obstacles_can_be_drawn(nothing: shapely.Geometry) -> None:
    figure, ax = new_figure((0.0, 0.0, 1.0, 1.0))
    visible = np.ones((ROWS, COLS), dtype=np.bool_)
    draw_truth(nothing, visible=visible, origin=(0.0, 0.0), resolution=1.0, ax=ax)
    np.testing.assert_allclose(pixel(figure, ax, (4.0, 3.0)), GROUND, atol=0.01)


def test_the_panels_of_a_case_show_the_same_place() -> None:
    figure = case(title="a post")
    assert [ax.get_title(loc="left") for ax in figure.axes] == [
        "truth",
        "map",
        "map against truth [cells]",
    ]
    assert {(ax.get_xlim(), ax.get_ylim()) for ax in figure.axes} == {((0.0, 8.0), (0.0, 6.0))}


@pytest.mark.parametrize(("cols", "shape"), [(8, (1, 3)), (40, (3, 1))])
def test_panels_of_wide_maps_are_stacked(cols: int, shape: tuple[int, int]) -> None:
    place: Any = case(cols=cols).axes[0].get_subplotspec()
    assert place.get_gridspec().get_geometry() == shape


@pytest.mark.parametrize(("rows", "cols"), [(6, 8), (4, 60), (60, 4)])
def test_legends_stay_inside_the_picture_and_off_the_data(rows: int, cols: int) -> None:
    routes = [("r", np.array([(1.0, 1.0), (3.0, 3.0)]), 0.3)]
    figure = case(
        rows=rows, cols=cols, routes=routes, failed=[("f", (1, 2), (3, 1))],
        trajectory=[(1, 1, 0), (2, 2, 0)], title="a title",
    )  # fmt: skip
    rendered(figure)
    for ax in figure.axes:
        legend = ax.get_legend()
        assert legend is not None
        box = legend.get_window_extent()
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= figure.bbox.x1
        assert not any(box.overlaps(other.get_window_extent()) for other in figure.axes)


def test_routes_are_on_the_truth_and_on_the_map_but_not_on_the_difference() -> None:
    waypoints = np.array([(1.0, 1.0), (4.0, 5.0)])
    truth_ax, map_ax, difference = case(routes=[("across", waypoints, 0.5)]).axes
    for ax in (truth_ax, map_ax):
        assert any(np.array_equal(line.get_xydata(), waypoints) for line in ax.lines)
        assert "across" in [text.get_text() for text in ax.texts]
    assert not any(np.array_equal(line.get_xydata(), waypoints) for line in difference.lines)


def test_queries_without_a_route_are_marked_at_start_and_goal() -> None:
    for ax in case(failed=[("in vain", (1.0, 2.0), (7.0, 5.0))]).axes[:2]:
        marks = {line.get_marker(): line for line in ax.lines if isinstance(line, Line2D)}
        assert np.asarray(marks["P"].get_xydata()).tolist() == [[1.0, 2.0]]
        assert np.asarray(marks["X"].get_xydata()).tolist() == [[7.0, 5.0]]
        assert "in vain" in [text.get_text() for text in ax.texts]


def test_several_routes_are_in_the_legend_once() -> None:
    route = ("r", np.array([(1.0, 1.0), (4.0, 5.0)]), 0.5)
    still = ("stays", np.array([(1.0, 1.0)]), 0.5)
    names = legend_of(case(routes=[route, route, still]).axes[1])
    assert names.count("route") == names.count("swept footprint") == 1


def test_a_figure_becomes_a_png_of_its_size() -> None:
    figure = Figure(figsize=(4.0, 3.0))
    assert imread(io.BytesIO(figure_png(figure, dpi=50))).shape[:2] == (150, 200)
