"""Pictures of maps and routes, checked by their pixels and artists."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.text import Text

from groundmap import CellSet, ConfidenceGrid, GroundMapper, StereoRig, View, fit_ground
from groundmap.draw import (
    draw_cells,
    draw_grid,
    draw_keep_out,
    draw_route,
    draw_routes,
    draw_trajectory,
    draw_verdicts,
    draw_view,
    known_bounds,
    new_figure,
    save_figure,
)
from groundmap.draw.maps import SHADES
from groundmap.errors import InputError
from groundmap.grid.window import CellState
from groundmap.view.frames import map_from_world


def small_grid() -> ConfidenceGrid:
    """Free, non-free, contested and unknown cells side by side, along x from 0."""
    grid = ConfidenceGrid(resolution=1.0)
    tile = grid.tile((0, 0))
    tile.confidence[0, :3] = -1.0, 1.0, 0.0
    tile.count[0, :3] = 3
    return grid


def luminance(color: tuple[float, float, float]) -> float:
    return float(np.dot(color, (0.299, 0.587, 0.114)))


def test_the_four_states_are_distinct_in_greyscale() -> None:
    levels = {state: sorted(map(luminance, shades)) for state, shades in SHADES.items()}
    order = [CellState.NONFREE, CellState.CONTESTED, CellState.UNKNOWN, CellState.FREE]
    for darker, lighter in pairwise(order):
        assert levels[darker][1] + 0.1 <= levels[lighter][0]


def test_each_cell_has_the_shade_of_its_state() -> None:
    bounds = (0.0, 0.0, 4.0, 1.0)
    _, ax = new_figure(bounds)
    image = draw_grid(small_grid(), bounds=bounds, ax=ax)[0]
    assert isinstance(image, AxesImage)
    shown = np.asarray(image.get_array())[0]
    order = (CellState.FREE, CellState.NONFREE, CellState.CONTESTED, CellState.UNKNOWN)
    for cell, state in enumerate(order):
        shade = SHADES[state][1] if state != CellState.CONTESTED else SHADES[state][0]
        np.testing.assert_allclose(shown[cell], shade)
    assert tuple(image.get_extent()) == (0.0, 4.0, 0.0, 1.0)


def test_row_0_is_at_the_bottom() -> None:
    grid = ConfidenceGrid(resolution=1.0)
    grid.fuse(np.array([0, 0]), np.array([[-1.0], [1.0]], dtype=np.float32))
    figure, ax = new_figure((0.0, 0.0, 1.0, 2.0))
    draw_grid(grid, bounds=(0.0, 0.0, 1.0, 2.0), ax=ax)
    pixels, height = rendered(figure)
    below = pixels[height - int(ax.transData.transform((0.8, 0.7))[1])]
    x = int(ax.transData.transform((0.8, 0.7))[0])
    above = pixels[height - int(ax.transData.transform((0.8, 1.3))[1])]
    assert below[x].mean() > 200
    assert above[x].mean() < 80


def rendered(figure: Figure) -> tuple[np.ndarray, int]:
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    return pixels, pixels.shape[0]


@pytest.mark.parametrize("width", [0.7, 3.0, 42.0, 880.0])
def test_the_scale_bar_has_its_stated_length(width: float) -> None:
    bounds = (5.0, 0.0, 5.0 + width, width / 2)
    _, ax = new_figure(bounds)
    _, bar, text, _ = draw_grid(small_grid(), bounds=bounds, ax=ax)
    assert isinstance(bar, Line2D)
    assert isinstance(text, Text)
    left, right = np.asarray(bar.get_xdata(), dtype=np.float64)
    assert text.get_text() == f"{right - left:g} m"
    assert width / 20 < right - left <= width / 6


def test_a_metre_is_as_long_along_x_as_along_y() -> None:
    figure, ax = new_figure((0.0, 0.0, 30.0, 4.0))
    draw_grid(small_grid(), bounds=(0.0, 0.0, 30.0, 4.0), ax=ax)
    rendered(figure)
    (x0, y0), (x1, y1) = ax.transData.transform([(1.0, 1.0), (2.0, 2.0)])
    assert x1 - x0 == pytest.approx(y1 - y0)


def test_the_footprint_along_a_route_has_its_true_size() -> None:
    _, ax = new_figure((0.0, 0.0, 20.0, 10.0))
    waypoints = np.array([(2.0, 5.0), (18.0, 5.0)])
    artists = draw_route(waypoints, footprint=0.9, ax=ax)
    band = next(artist for artist in artists if isinstance(artist, Polygon))
    corners = band.get_xy()
    assert corners.min(axis=0) == pytest.approx((1.1, 4.1), abs=1e-9)
    assert corners.max(axis=0) == pytest.approx((18.9, 5.9), abs=1e-9)
    circles = [artist for artist in artists if isinstance(artist, Circle)]
    assert len(circles) >= 2
    assert {circle.get_radius() for circle in circles} == {0.9}


def test_a_route_without_length_can_be_drawn() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 4.0))
    assert draw_route([(2.0, 2.0), (2.0, 2.0)], footprint=0.5, ax=ax)


def legend_of(ax: Axes) -> list[str]:
    legend = ax.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_the_legend_names_all_that_is_drawn_once() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 4.0))
    draw_grid(small_grid(), bounds=(0.0, 0.0, 4.0, 4.0), ax=ax)
    draw_trajectory([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], ax=ax)
    draw_route([(0.0, 0.0), (1.0, 1.0)], footprint=0.2, ax=ax)
    states = ["free", "non-free", "contested", "unknown"]
    assert legend_of(ax) == [*states, "camera", "route", "swept footprint"]


def test_an_empty_trajectory_draws_nothing() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 4.0))
    assert draw_trajectory(np.empty((0, 3)), ax=ax) == []


def test_verdicts_are_grouped_by_the_state_of_their_cell() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 1.0))
    places = np.array([(0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (3.5, 0.5), (99.0, 0.5)])
    artists = draw_verdicts(small_grid(), obstacles=places, grounds=places[:1], ax=ax)
    counts = {
        str(artist.get_label()): len(np.asarray(artist.get_xdata()))
        for artist in artists
        if isinstance(artist, Line2D)
    }
    assert counts == {
        "obstacle: agrees": 1,
        "obstacle: contradicts": 1,
        "obstacle: unknown": 3,
        "ground: agrees": 1,
        "ground: contradicts": 0,
        "ground: unknown": 0,
    }


def test_the_known_bounds_enclose_the_observed_cells() -> None:
    assert known_bounds(small_grid(), margin=0.5).tolist() == [-0.5, -0.5, 3.5, 1.5]


def test_an_empty_map_has_no_known_part() -> None:
    with pytest.raises(InputError, match="at least one known cell, got an empty map"):
        known_bounds(ConfidenceGrid())


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_pictures_are_files_of_the_requested_format(suffix: str, tmp_path: Path) -> None:
    figure, ax = new_figure((0.0, 0.0, 4.0, 1.0))
    draw_grid(small_grid(), ax=ax)
    path = tmp_path / f"map{suffix}"
    save_figure(figure, path)
    assert path.read_bytes()[:5] in {b"\x89PNG\r", b"%PDF-", b"<?xml"}
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_another_kind_of_picture_is_refused(tmp_path: Path) -> None:
    figure, _ = new_figure((0.0, 0.0, 4.0, 1.0))
    with pytest.raises(InputError, match=r"ending in \.png, \.pdf, \.svg, got .*map\.bmp"):
        save_figure(figure, tmp_path / "map.bmp")


def test_the_picture_of_a_view_shows_its_four_steps(tmp_path: Path) -> None:
    rig = StereoRig(fx=700.0, fy=700.0, cx=320.0, cy=240.0, baseline=0.5)
    view = View.from_pixels(
        map_from_world(np.eye(4), "optical"),
        rig,
        points_px=[(320.0, 250.0, 450.0), (420.0, 350.0, 240.0), (200.0, 150.0, 700.0)],
        segments_px=[[(250.0, 180.0, 240.0), (300.0, 230.0, 260.0)]],
    )
    mapper = GroundMapper()
    (grounded,) = fit_ground([view], camera_height=1.5)
    figure = draw_view(mapper.explain(grounded), mapper.grid, title="a view")
    titles = [ax.get_title() for ax in figure.axes]
    for step in ("features by height", "triangulation", "sight fan", "evidence"):
        assert any(step in title for title in titles)
    save_figure(figure, tmp_path / "view.png")
    assert (tmp_path / "view.png").stat().st_size > 10_000


def test_equal_routes_are_one_line_with_all_their_names() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 4.0))
    straight, bent = [(0.0, 0.0), (3.0, 3.0)], [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0)]
    artists = draw_routes({"a": straight, "b": bent, "c": straight}, ax=ax)
    lines = [artist for artist in artists[:-1] if isinstance(artist, Line2D)]
    assert [line.get_label() for line in lines] == ["a, c", "b"]
    assert lines[0].get_linewidth() > lines[1].get_linewidth()
    assert draw_routes({}, ax=ax) == []


def test_outlines_are_drawn_at_the_poses_of_the_robot() -> None:
    _, ax = new_figure((0.0, 0.0, 9.0, 9.0))
    outline = [(-1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (-1.0, 0.5)]
    places, headings = [(3.0, 3.0), (3.0, 5.0)], [np.pi / 2] * 2
    band = draw_route(places, footprint=outline, headings=headings, ax=ax)[0]
    assert isinstance(band, Polygon)
    np.testing.assert_allclose(band.get_xy().min(axis=0), (2.5, 2.0))
    np.testing.assert_allclose(band.get_xy().max(axis=0), (3.5, 7.0))


def test_cells_and_keep_out_areas_are_drawn_apart_with_a_name_each() -> None:
    bounds = (0.0, 0.0, 20.0, 20.0)
    grid = ConfidenceGrid(resolution=1.0)
    grid.fuse(np.array([0, 0]), np.full((20, 20), -1.0, dtype=np.float32))
    figure, ax = new_figure(bounds)
    draw_grid(grid, bounds=bounds, ax=ax)
    draw_cells(CellSet(np.array([[4, 5], [4, 6]]), 1.0, np.zeros(2)), label="now", ax=ax)
    holed = shapely.box(8, 8, 16, 16).difference(shapely.box(10, 10, 14, 14))
    draw_keep_out([holed], ax=ax)
    assert legend_of(ax)[-2:] == ["now", "keep-out area"]
    pixels, height = rendered(figure)
    seen = []
    for place in ((5.5, 4.5), (6.5, 4.5), (4.5, 4.5), (5.5, 5.5), (12.0, 12.0)):
        x, y = ax.transData.transform(place)
        seen.append(pixels[height - int(y), int(x)].tolist())
    drawn, also, *free = seen
    assert drawn == also == [232, 84, 47]
    assert all(each == free[0] != drawn for each in free)
    x, y = ax.transData.transform([(8.2, 8.2), (9.8, 15.8)]).astype(int).T
    hatched = pixels[height - y[1] : height - y[0], x[0] : x[1]].reshape(-1, 3)
    assert 0.02 < (hatched[:, 1] < 120).mean() < 0.5


def test_nothing_is_drawn_for_no_cells_and_no_areas() -> None:
    _, ax = new_figure((0.0, 0.0, 4.0, 4.0))
    none = CellSet(np.empty((0, 2), dtype=np.int64), 1.0, np.zeros(2))
    assert draw_cells(none, label="now", ax=ax) == draw_keep_out([], ax=ax) == []
    assert ax.get_legend() is None
