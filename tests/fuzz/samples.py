"""Whole files of every format, small: what the fuzzer damages."""

from __future__ import annotations

import io
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

import sparse_bag
import sparse_binaries
import sparse_scene
import sparse_texts
from groundmap import ConfidenceGrid, Places
from groundmap.grid.fusion import Capped
from planners import PlanningProblem, Roadmap
from sample_views import few_views

Files = dict[str, bytes]

GTSAM: Files = {
    "VO_calibration.txt": b"718.856 718.856 0.0 607.1928 185.2157 0.5371657\n",
    "VO_camera_poses.txt": b"""\
4 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
7 0.99995 0 0.00999983 0.1 0 1 0 0 -0.00999983 0 0.99995 0.5 0 0 0 1
9 1 0 0 0.2 0 1 0 0 0 0 1 1 0 0 0 1
""",
    "VO_stereo_factors.txt": b"""\
4 3 650.0 612.0 290.0 0.6 1.48 10.16
4 4 620.5 580.25 300.5 0.17 1.54 9.6
7 3 652.0 612.0 292.0 0.6 1.43 9.65
7 12 700.0 690.0 190.0 3.6 0.18 38.6
9 -1 400.0 350.0 260.0 -2.2 0.8 7.7
9 5 100.0 110.0 100.0 0 0 0
""",
}
RIG = b"""\
world = "rep103"
fx = 700.0
fy = 705.0
cx = 320.0
cy = 240.0
baseline = 0.5
pixel_noise_px = 0.4
T_base_camera = [[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]]
"""
TUM = b"""\
# timestamp tx ty tz qx qy qz qw
0.0 0 0 0 0 0 0 1
0.1 0.5 0.01 0 0 0 0.0499792 0.99875
0.2 1.0 0.04 0 0 0 0.0998334 0.995004
"""
BY_ID = b"""\
9 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
4 1 0 0 0.5 0 1 0 0 0 0 1 0 0 0 0 1
7 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1
"""
POINTS = b"view,id,uL,uR,v\n0,1,350,300.5,400\n0,2,300,250,420\n1,1,355,300,410\n2,-1,320,310,200\n"
SEGMENTS = b"""\
view,id,uL0,uR0,v0,uL1,uR1,v1
0,7,250,180,240,300,230,260
2,8,250,180,240,300,229.5,260
"""
POINTS_XYZ = b"""\
view,id,x,y,z,cxx,cxy,cxz,cyy,cyz,czz
0,1,0.5,1.2,5,0.01,0,0,0.01,0,0.04
1,2,-0.5,1.2,6,0.01,0,0.002,0.01,0,0.05
"""
SEGMENTS_XYZ = b"""\
view,id,x0,y0,z0,cxx0,cxy0,cxz0,cyy0,cyz0,czz0,x1,y1,z1,cxx1,cxy1,cxz1,cyy1,cyz1,czz1
1,4,0.5,0.2,5,0.01,0,0,0.01,0,0.04,0.9,0.2,5,0.01,0,0,0.01,0,0.04
"""
YAML = b"""\
image: map.png
mode: trinary
resolution: 0.05
origin: [-1.0, 2.5, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
MOVINGAI = b"type octile\nheight 5\nwidth 6\nmap\n@@@@@@\n@....@\n@.TG.@\n@.SW.@\n@@@@@@\n"
VOXELS = b"voxel 6 5 4\n0 0 0\n5 4 3\n2 2 1\n3 2 1\n"
SCEN = b"version 1\n0 maps/arena.map 6 5 1 1 4 3 4.41421356\n1\tmy maps/x.map\t6 5 1 1 1 1 0\n"
SCEN_3D = b"version 1\narena.3dmap\n1 1 1 4 3 2 4.2 1.1\n0 0 0 0 0 0 0 1.0\n"
KEEP_OUT = b"""\
{"type": "FeatureCollection", "features": [
  {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon",
    "coordinates": [[[4, 3], [6, 3], [6, 5], [4, 5], [4, 3]]]}},
  {"type": "Feature", "properties": null, "geometry": {"type": "MultiPolygon",
    "coordinates": [[[[8, 8], [9, 8], [9, 9.5], [8, 8]]], [[[0, 9], [1, 9], [1, 10], [0, 9]]]]}}
]}
"""
SETTINGS = b"""\
[mapper]
resolution = 0.2
fusion = "capped"
cap = 20
max_range = 15.0

[ground]
window = 5
causal = true
min_support = 8
"""
SCENARIO = b"""\
why = "A box in a small world."
seed = 3
level_ground = true

[world]
kind = "rooms"
columns = 1
rows = 1
room_width = 4.0
boxes = 1
texture = 2.0

[[world.solids]]
wall = [[0, 0], [2, 0.5], [2, 3]]
thickness = 0.3
appears = 1.0
velocity = [0.1, 0.0]

[[world.holes]]
box = [3.0, 3.0, 4.0, 4.0]
depth = 0.4

[sensor]
fx = 600.0
max_points = 200
false_disparity_px = [5.0, 100.0]

[drive]
stops = [[1.5, 1.5, 0], [2.5, 1.5, 90.0]]
every = 0.5

[mapper]
resolution = 0.25

[ground]
window = 3

[[queries]]
name = "across"
start = [1.5, 1.5]
goal = [2.5, 2.5, 0.1]
footprint = [[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]
planner = "weighted_astar"
settings = { weight = 2.0 }
time_limit = 1.0
max_ratio = 2.0

[[queries]]
name = "nowhere"
start = [1.5, 1.5]
goal = [90, 2]
footprint = 0.2
expect = "OutsideMapError"
reason = "outside the (map|world)"

[bounds]
free_recall = { min = 0.2, max = 1.0 }
"""
SCENARIO_OF_IMAGE = b"""\
why = "The world of a map."

[world]
kind = "image"
path = "map.yaml"
height = 1.5
crop = [-1.0, 2.5, 0.0, 3.0]

[scan]
rays = 36

[drive]
stops = [[-0.5, 2.8, 0]]
"""
GEOJSON = b"""\
{"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[1, 1], [2.5, 1], [4, 2]]},
 "properties": {"length": 3.2}}
"""


@cache
def picture(mode: str, kind: str) -> bytes:
    """Return an image of 12 x 9 pixels of a mode of PIL, in a format of PIL."""
    pixels = np.full((9, 12), 254, dtype=np.uint8)
    pixels[[0, -1]] = 0
    pixels[4, 3:8] = 0
    pixels[6, 6:] = 205
    image = Image.fromarray(pixels)
    if mode == "I;16":
        image = Image.fromarray(pixels.astype(np.uint16) * 257)
    elif mode in ("I", "F"):
        image = Image.fromarray(pixels.astype(np.int32 if mode == "I" else np.float32))
    elif mode != "L":
        image = image.convert(mode)
    stream = io.BytesIO()
    image.save(stream, kind)
    return stream.getvalue()


PICTURES: tuple[tuple[str, str], ...] = (
    ("L", "PPM"), ("L", "PNG"), ("1", "PNG"), ("P", "PNG"), ("RGB", "PNG"), ("RGBA", "PNG"),
    ("LA", "PNG"), ("I;16", "PNG"), ("L", "TIFF"), ("1", "TIFF"), ("I;16", "TIFF"), ("I", "TIFF"),
    ("F", "TIFF"), ("RGB", "TIFF"), ("L", "BMP"), ("P", "GIF"), ("L", "JPEG"), ("CMYK", "TIFF"),
    ("1", "PPM"), ("RGB", "PPM"), ("I;16", "PPM"),
)  # fmt: skip


@cache
def grids() -> dict[str, dict[str, Any]]:
    """Return the arrays of map files by a name for each."""
    flat = ConfidenceGrid(resolution=0.25, origin=(-1.0, 2.0))
    flat.fuse(np.array([60, -3]), np.linspace(-1, 1, 80, dtype=np.float32).reshape(8, 10))
    flat.trajectory = np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.2]])
    capped = ConfidenceGrid(resolution=1.0, rule=Capped(cap=3))
    capped.fuse(np.array([0, 0]), np.full((4, 4), -1.0, dtype=np.float32))
    deep = ConfidenceGrid(resolution=0.5, origin=(0.0, 0.0, 0.0))
    deep.fuse(np.array([0, 0, 0]), np.full((3, 3, 3), -1.0, dtype=np.float32))
    with TemporaryDirectory() as folder:
        return {
            name: _saved(grid, Path(folder) / name)
            for name, grid in (("flat", flat), ("capped", capped), ("deep", deep))
        }


@cache
def tables() -> dict[str, Any]:
    """Return the arrays of a ``features.npz``."""
    points = np.loadtxt(io.StringIO(POINTS.decode()), delimiter=",", skiprows=1)
    segments = np.loadtxt(io.StringIO(SEGMENTS.decode()), delimiter=",", skiprows=1)
    return {
        "points": points,
        "points_columns": np.array(POINTS.decode().splitlines()[0].split(",")),
        "segments": segments,
        "segments_columns": np.array(SEGMENTS.decode().splitlines()[0].split(",")),
    }


@cache
def roadmap_problem() -> PlanningProblem:
    """Return the problem that the roadmap is grown for."""
    grid = ConfidenceGrid(resolution=0.5)
    floor = np.full((24, 24), -1.0, dtype=np.float32)
    floor[:16, 12] = 1.0
    grid.fuse(np.array([0, 0]), floor)
    return PlanningProblem(grid, start=(2, 2, 0), goal=(10, 2, 0), footprint=0.4)


@cache
def roadmap() -> dict[str, Any]:
    """Return the arrays of a roadmap's file."""
    grown = Roadmap.grow(roadmap_problem(), seconds=5.0, iterations=30, seed=1, space="r2")
    with TemporaryDirectory() as folder:
        return _saved(grown, Path(folder) / "roadmap.npz")


@cache
def places() -> dict[str, Any]:
    """Return the arrays of a file of places."""
    with TemporaryDirectory() as folder:
        return _saved(Places.of(few_views(1)), Path(folder) / "places.npz")


def _saved(what: Any, path: Path) -> dict[str, Any]:
    what.save(path)
    with np.load(path.with_name(path.name), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


@cache
def text_maps() -> dict[str, Files]:
    """Return small maps of SLAM and SfM systems in text, by the name of their target."""
    scene = sparse_scene.make_scene(views=3, landmarks=15)
    return {
        "map-bal": sparse_texts.bal(scene),
        "map-bundler": sparse_texts.bundler(scene),
        "map-colmap-text": sparse_texts.colmap_text(scene),
        "map-meshroom": sparse_texts.meshroom(scene),
        "map-nvm": sparse_texts.nvm(scene),
        "map-openmvg-json": sparse_texts.openmvg_json(scene),
        "map-opensfm": sparse_texts.opensfm(scene),
        "map-orbslam": sparse_texts.orbslam(scene),
    }


@cache
def binary_maps() -> dict[str, Files]:
    """Return small maps of SLAM and SfM systems in binary files, by the name of their target."""
    scene = sparse_scene.make_scene(views=3, landmarks=15)
    return {
        "map-bag-mcap": sparse_bag.files_of(sparse_bag.messages(), "mcap"),
        "map-bag-ros1": sparse_bag.ros1_file(),
        "map-bag-sqlite": sparse_bag.files_of(sparse_bag.messages(), "sqlite3"),
        "map-colmap-binary": sparse_binaries.colmap_binary(scene),
        "map-openmvg-binary": sparse_binaries.openmvg_binary(scene),
        "map-openmvs": sparse_binaries.openmvs(scene),
        "map-rtabmap": sparse_binaries.rtabmap(scene),
        "map-stella-msgpack": sparse_binaries.stella_msgpack(scene),
        "map-stella-sqlite": sparse_binaries.stella_sqlite(scene),
    }


def unseen_map() -> Files:
    """Return a trajectory and points without visibility."""
    scene = sparse_scene.make_scene(views=3, landmarks=15)
    lines = [f"{x} {y} {z}\n" for x, y, z in scene.landmarks.tolist()]
    return {
        "KeyFrameTrajectory.txt": sparse_texts.tum(scene),
        "MapPoints.txt": "".join(lines).encode(),
    }
