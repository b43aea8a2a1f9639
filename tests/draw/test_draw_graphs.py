"""Pictures of trees and roadmaps: every edge is there, under the route, and named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from groundmap.draw import draw_route, new_figure, save_figure
from groundmap.draw.graphs import MANY, draw_graph
from groundmap.errors import InputError

VERTICES = np.array([(1.0, 1.0, 0.5), (3.0, 1.0, 0.0), (3.0, 4.0, -2.0)])
EDGES = np.array([(0, 1), (1, 2)])


def drawn(vertices: object = VERTICES, edges: object = EDGES) -> LineCollection:
    _, ax = new_figure((0.0, 0.0, 5.0, 5.0))
    (lines,) = draw_graph(vertices, edges, ax=ax)  # type: ignore[arg-type] # refused
    assert isinstance(lines, LineCollection)
    assert lines.axes is ax
    return lines


def test_every_edge_is_a_straight_line_between_its_vertices() -> None:
    segments = [segment.tolist() for segment in drawn().get_segments()]
    assert segments == [[[1.0, 1.0], [3.0, 1.0]], [[3.0, 1.0], [3.0, 4.0]]]


def test_a_graph_without_edges_draws_no_line() -> None:
    assert drawn(edges=[]).get_segments() == []
    assert drawn(vertices=[], edges=[]).get_segments() == []


def test_routes_lie_over_the_graph_and_the_legend_names_both() -> None:
    _, ax = new_figure((0.0, 0.0, 5.0, 5.0))
    lines = draw_graph(VERTICES, EDGES, ax=ax, label="roadmap")[0]
    artists = draw_route(VERTICES[:, :2], footprint=0.3, ax=ax)
    assert all(artist.get_zorder() > lines.get_zorder() for artist in artists)
    legend = ax.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "roadmap",
        "route",
        "swept footprint",
    ]


def test_drawing_a_graph_keeps_the_limits_of_the_axes() -> None:
    lines = drawn(vertices=VERTICES + 100.0)
    assert lines.axes is not None
    assert lines.axes.get_xlim() == (0.0, 5.0)


def test_many_edges_are_rasterised_in_vector_files(tmp_path: Path) -> None:
    sizes = []
    for count in (MANY - 1, 2 * MANY):
        figure, ax = new_figure((0.0, 0.0, 5.0, 5.0))
        edges = np.tile(EDGES, (count, 1))[:count]
        draw_graph(VERTICES, edges, ax=ax)
        save_figure(figure, tmp_path / "graph.svg")
        sizes.append((tmp_path / "graph.svg").stat().st_size)
    assert sizes[1] < sizes[0] / 4


@pytest.mark.parametrize(
    ("vertices", "edges", "match"),
    [
        (VERTICES[:, :1], EDGES, r"vertices: expected x and y, got shape \(3, 1\)"),
        (
            VERTICES,
            [(0, 1), (1, 3)],
            r"edges: expected indices of 3 vertices, got \[1, 3\] at row 1",
        ),
        (VERTICES, [(-1, 1)], r"edges: expected indices of 3 vertices, got \[-1, 1\] at row 0"),
        (VERTICES, [0, 1], r"edges: expected shape \(n, 2\), got shape \(2,\)"),
    ],
)
def test_an_invalid_graph_is_refused(vertices: object, edges: object, match: str) -> None:
    with pytest.raises(InputError, match=match):
        drawn(vertices, edges)
