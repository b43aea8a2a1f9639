"""Pictures of 3-D maps, checked by their artists."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from groundmap import ConfidenceGrid
from groundmap.arrays import Bools, Floats
from groundmap.draw import voxels as drawing
from groundmap.draw.maps import SHADES
from groundmap.draw.voxels import voxel_figure
from groundmap.errors import InputError
from groundmap.grid.window import CellState

ROUTE = np.array([(1.0, 4.0, 1.0), (4.0, 4.0, 2.9), (7.0, 4.0, 1.0)])


def grid_of(nonfree: Bools, *, resolution: float = 0.5) -> ConfidenceGrid:
    grid = ConfidenceGrid(resolution=resolution, origin=(0, 0, 0))
    grid.fuse(np.zeros(3, dtype=np.int64), np.where(nonfree, 1.0, -1.0).astype(np.float32))
    return grid


def walled() -> ConfidenceGrid:
    """Return a room of 8 x 8 x 4 m with a wall across, which has a window."""
    nonfree = np.zeros((8, 16, 16), dtype=bool)
    nonfree[:, :, 8] = True
    nonfree[5:7, 7:10, 8] = False  # z from 2.5 to 3.5 m
    return grid_of(nonfree)


def faces_of(figure: Figure) -> Floats:
    [collection] = [
        each for each in figure.axes[0].collections if isinstance(each, Poly3DCollection)
    ]
    faces: Any = collection
    return np.array(faces._faces)


def test_the_surfaces_are_the_faces_of_non_free_voxels() -> None:
    nonfree = np.zeros((4, 5, 6), dtype=bool)
    nonfree[1, 2, 3:5] = True  # two cubes that share a face
    faces = faces_of(voxel_figure(grid_of(nonfree)))
    assert faces.shape == (10, 4, 3)
    assert faces.reshape(-1, 3).min(axis=0).tolist() == [1.5, 1.0, 0.5]
    assert faces.reshape(-1, 3).max(axis=0).tolist() == [2.5, 1.5, 1.0]
    spans = np.ptp(faces, axis=1)
    np.testing.assert_allclose(np.sort(spans, axis=1), np.tile([0.0, 0.5, 0.5], (10, 1)))
    inner = (faces[:, :, 0] == 2.0).all(axis=1)
    assert not inner.any()


def test_maps_of_many_faces_are_drawn_in_larger_cubes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "MOST_FACES", 200)
    nonfree = np.random.default_rng(1).random((8, 16, 16)) < 0.05
    figure = voxel_figure(grid_of(nonfree))
    faces = faces_of(figure)
    assert 0 < len(faces) <= 200
    assert "in cubes of" in figure.axes[0].get_title()
    centres = 0.5 * (np.argwhere(nonfree)[:, ::-1] + 0.5)
    assert (faces.reshape(-1, 3).min(axis=0) <= centres.min(axis=0)).all()
    assert (faces.reshape(-1, 3).max(axis=0) >= centres.max(axis=0)).all()


def test_the_section_shows_what_is_above_and_below_the_route() -> None:
    figure = voxel_figure(walled(), routes={"route": ROUTE}, footprint=0.3)
    image: Any = figure.axes[2].images[0]
    left, right, low, high = image.get_extent()
    assert (left, low, high) == (0.0, 0.0, 4.0)
    assert right == pytest.approx(6.0)
    shades = image.get_array()
    dark = np.isclose(shades, SHADES[CellState.NONFREE][1]).all(axis=2)
    columns = (np.arange(dark.shape[1]) + 0.5) * right / dark.shape[1]
    inside = (columns >= 3.0) & (columns < 3.5)  # x from 4.0 to 4.5 m
    expected = np.array([True] * 5 + [False] * 2 + [True])
    np.testing.assert_array_equal(dark[:, inside], np.tile(expected[:, None], inside.sum()))
    assert not dark[:, ~inside].any()


def test_the_layer_is_where_most_is_in_the_way_of_the_route() -> None:
    layer = voxel_figure(walled(), routes={"route": ROUTE}).axes[1]
    assert "z = 2.75 m" in layer.get_xlabel()
    image: Any = layer.images[0]
    dark = np.isclose(image.get_array(), SHADES[CellState.NONFREE][1]).all(axis=2)
    assert np.flatnonzero(dark[:, 8]).tolist() == [*range(7), *range(10, 16)]
    chosen = voxel_figure(walled(), routes={"route": ROUTE}, height=1.1).axes[1]
    assert "z = 1.25 m" in chosen.get_xlabel()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bounds": (0, 0, 1, 1)}, "bounds: expected"),
        ({"bounds": (0, 0, 0, 1, 1, 0)}, "bounds: expected an upper corner above the lower one"),
        ({"height": 5.0}, "height: expected a z from 0 to 4 m, got 5"),
        ({"footprint": -1.0}, "footprint: expected a radius of 0 or more"),
        ({"routes": {"a": [(0, 0)]}}, "route a: expected"),
        ({"routes": {"a": [(0, 0, 1e155)]}}, "route a: expected points within 1e\\+12 m"),
        ({"routes": {"a": np.empty((0, 3))}}, "route a: expected one or more points x, y, z"),
    ],
)
def test_what_can_not_be_drawn_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        voxel_figure(walled(), **options)


def test_a_2d_map_is_refused() -> None:
    with pytest.raises(InputError, match="grid: expected a 3-D map, got one of 2-D"):
        voxel_figure(ConfidenceGrid())
