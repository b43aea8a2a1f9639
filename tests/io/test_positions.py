"""Folders of positions without a rig or covariances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

from groundmap.errors import FileFormatError
from groundmap.io import read_views
from groundmap.view.stereo_rig import StereoRig

POSES = "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n"


def folder_of(path: Path, table: str, *, rig: str = "", kind: str = "points") -> Path:
    path.mkdir()
    (path / "rig.toml").write_text('world = "optical"\n' + rig)
    (path / "poses.txt").write_text(POSES)
    (path / f"{kind}.csv").write_text(table)
    return path


def test_five_columns_and_the_world_are_enough(tmp_path: Path) -> None:
    table = "view,id,x,y,z\n0,7,0.5,0,10\n1,7,-0.5,0,10\n2,-1,3,0,6\n"
    views = list(read_views(folder_of(tmp_path / "log", table)))
    assert [len(view.points) for view in views] == [1, 1, 1]
    assert views[0].rig.cx / views[0].rig.fx == 0.5  # the widest bearing of a feature
    # Two bearings, 1 m apart, certain to 2 mrad, of a landmark 10 m away.
    sigma = np.sqrt(np.diagonal(views[0].points.covariance[0]))
    npt.assert_allclose(sigma[[1, 2]], (0.02 / np.sqrt(2), 0.2 * np.sqrt(2)), rtol=0.05)
    # A depth that no other view confirms: half a percent of its square.
    alone = views[2].points.covariance[0]
    ray = views[2].points.xyz[0] / np.linalg.norm(views[2].points.xyz[0])
    npt.assert_allclose(np.sqrt(ray @ alone @ ray), 0.005 * 45, rtol=1e-6)


def test_with_a_rig_positions_have_the_covariance_of_its_pixels(tmp_path: Path) -> None:
    rig = StereoRig(fx=700, fy=700, cx=320, cy=240, baseline=0.5)
    seen = rig.triangulate([(355.0, 320.0, 275.0)])
    x, y, z = seen.xyz[0]
    text = "fx = 700\nfy = 700\ncx = 320\ncy = 240\nbaseline = 0.5\n"
    [view, *_] = read_views(
        folder_of(tmp_path / "log", f"view,id,x,y,z\n0,1,{x},{y},{z}\n", rig=text)
    )
    npt.assert_allclose(view.points.covariance, seen.covariance, rtol=1e-12)


def test_segments_may_be_positions_as_well(tmp_path: Path) -> None:
    table = "view,id,x0,y0,z0,x1,y1,z1\n1,3,0,0,5,1,0,5\n"
    views = list(read_views(folder_of(tmp_path / "log", table, kind="segments")))
    npt.assert_array_equal(views[1].segments.xyz, [[(0, 0, 5), (1, 0, 5)]])
    assert np.linalg.eigvalsh(views[1].segments.covariance).min() > 0


@pytest.mark.parametrize(
    ("rig", "table", "message"),
    [
        ("", "view,id,uL,uR,v\n0,1,355,320,275\n", r"fx, fy, cx, cy, baseline, as points are in"),
        ("fx = 700\n", "view,id,x,y,z\n", r"fy to be a value, got none. Give all of fx, fy, cx,"),
        ("", "view,id,x,y,z\n0,1,5,6\n", r"points.csv: expected 5 columns, got 4 at line 2"),
    ],
)
def test_what_a_folder_lacks_is_named(tmp_path: Path, rig: str, table: str, message: str) -> None:
    with pytest.raises(FileFormatError, match=message):
        list(read_views(folder_of(tmp_path / "log", table, rig=rig)))
