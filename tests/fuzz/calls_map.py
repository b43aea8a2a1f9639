"""Calls of `groundmap`: rigs, views, grids, mapping, logs, simulated worlds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import shapely

from fuzz.calls import Call
from fuzz.draw import Draw
from fuzz.problems import grid, settings_of
from fuzz.readers import use_map
from fuzz.values import array, number, odd, word
from groundmap import (
    CellState,
    ConfidenceGrid,
    Features,
    GroundMapper,
    GroundPlane,
    GroundSettings,
    MapperSettings,
    RegistrationSettings,
    StereoRig,
    View,
    estimate_poses,
    fit_ground,
    load_map,
    read_views,
    register,
    write_views,
)
from groundmap.evaluate.protocols import evaluate
from groundmap.grid.collapse import as_planes
from groundmap.grid.fusion import Absolute, Average, Capped, Exponential, LogOdds
from groundmap.io import export
from groundmap.simulate import (
    DriveSettings,
    Hole,
    SensorSettings,
    Solid,
    World,
    drive,
    observe,
    sample_landmarks,
)
from groundmap.simulate.shapes import box, pole, polygon, table, wall
from groundmap.simulate.world_file import HoleSettings, SolidSettings

OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]])
PIXELS = np.array([[350.0, 300, 400], [300, 250, 420], [355, 300, 410], [320, 280, 250]])
LINES = np.array([[[250.0, 180, 240], [300, 230, 260]], [[400, 370, 260], [450, 420, 300]]])
PLAIN_RIG = StereoRig(fx=700, fy=700, cx=320, cy=240, baseline=0.5, T_base_camera=OPTICAL)
SPREAD = np.diag([0.01, 0.01, 0.04])


def _rig(draw: Draw, odds: float = 0.06) -> StereoRig:
    options: dict[str, Any] = {
        "fx": number(draw, 100, 1000, odds),
        "fy": number(draw, 100, 1000, odds),
        "cx": number(draw, 0, 600, odds),
        "cy": number(draw, 0, 400, odds),
        "baseline": number(draw, 0.05, 2, odds),
    }
    if draw.chance(0.3):
        options["pixel_noise_px"] = number(draw, 0.1, 2, 3 * odds)
    if draw.chance(0.6):
        options["T_base_camera"] = array(draw, OPTICAL, 2 * odds)
    for name, value in options.items():
        draw.noted(name, value)
    return StereoRig(**options)


def _pose(draw: Draw, odds: float = 0.2) -> Any:
    pose = np.eye(4)
    turn = draw.number(-3, 3)
    pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    pose[:2, 3] = draw.number(-5, 5), draw.number(-5, 5)
    if draw.chance(0.05):
        pose[:2, 3] += draw.pick((5.4e6, 1e8, 1e9, 1e300))
    return draw.noted("T_map_base", array(draw, pose, odds))


def _view(draw: Draw, rig: StereoRig | None = None, odds: float = 0.1) -> View:
    options: dict[str, Any] = {"points_px": array(draw, PIXELS, odds)}
    if draw.chance(0.5):
        options["segments_px"] = array(draw, LINES, odds)
    if draw.chance(0.5):
        options["point_ids"] = array(draw, np.arange(len(PIXELS)), 2 * odds)
    if draw.chance(0.2):
        options["segment_ids"] = array(draw, np.arange(len(LINES)), 2 * odds)
    if draw.chance(0.3):
        options["timestamp"] = number(draw, 0, 10, 3 * odds)
    for name, value in options.items():
        draw.noted(name, value)
    return View.from_pixels(_pose(draw, odds), rig or _rig(draw, odds / 3), **options)


def rig(draw: Draw, _folder: Path) -> None:
    """Make a rig, and triangulate."""
    made = _rig(draw, 0.15)
    made.triangulate(draw.noted("pixels", array(draw, draw.pick((PIXELS, LINES)), 0.7)))


def features(draw: Draw, _folder: Path) -> None:
    """Make features and a view of them."""
    if draw.chance(0.5):
        xyz, spread = np.array([[0.5, 1.2, 5.0], [1, 1, 4]]), np.tile(SPREAD, (2, 1, 1))
        make = Features.points
    else:
        xyz = np.array([[[0.5, 1.2, 5.0], [1, 1, 4]], [[0.5, 1.2, 9.0], [1, 1, 9]]])
        spread, make = np.tile(SPREAD, (2, 2, 1, 1)), Features.segments
    ids = draw.either(0.5, lambda: None, lambda: array(draw, np.array([3, 4]), 0.5))
    draw.noted("ids", ids)
    made = make(
        draw.noted("xyz", array(draw, xyz, 0.4)),
        draw.noted("covariance", array(draw, spread, 0.4)),
        ids,
    )
    kind = "points" if made.xyz.ndim == 2 else "segments"
    given: dict[str, Any] = {kind: made, "timestamp": number(draw, 0, 1)}
    _mapped(View(T_map_base=_pose(draw), rig=_rig(draw, 0.0), **given), draw)


def view(draw: Draw, _folder: Path) -> None:
    """Make a view of pixels, and map it."""
    _mapped(_view(draw, odds=0.2), draw)


def _mapped(seen: View, draw: Draw) -> None:
    settings = settings_of(draw, MapperSettings, odds=0.1)
    mapper = GroundMapper(**settings)
    for one in fit_ground([seen], camera_height=draw.noted("height", number(draw, 0.5, 2, 0.1))):
        mapper.integrate(one)
    use_map(mapper.grid)


def registration(draw: Draw, _folder: Path) -> None:
    """Register two views with odd features and settings, and estimate their poses."""
    corners = np.random.default_rng(0).uniform((-4, -1, 5), (4, 2, 12), (40, 3))
    spread = np.tile(1e-3 * SPREAD, (40, 1, 1))
    views = []
    for shift in (0.0, 0.4):
        xyz = array(draw, corners - np.array([0.0, 0.0, shift]), 0.2)
        points = Features.points(
            draw.noted("xyz", xyz), draw.noted("covariance", array(draw, spread, 0.2))
        )
        views.append(View(T_map_base=_pose(draw), rig=_rig(draw, 0.05), points=points))
    settings = settings_of(draw, RegistrationSettings)
    if draw.chance(0.5):
        register(*views, guess=draw.noted("guess", array(draw, np.eye(4), 0.3)), **settings)
    else:
        mode: Any = draw.noted("mode", draw.pick(("estimate", "refine", "")))
        estimate_poses(views, mode=mode, **settings)


def mapper_settings(draw: Draw, _folder: Path) -> None:
    """Map with odd settings."""
    mapper = GroundMapper(**settings_of(draw, MapperSettings))
    seen = View.from_pixels(np.eye(4), PLAIN_RIG, points_px=PIXELS, segments_px=LINES)
    for one in fit_ground([seen, seen], **settings_of(draw, GroundSettings)):
        mapper.integrate(one)
    use_map(mapper.grid)


def plane(draw: Draw, _folder: Path) -> None:
    """Give views a ground plane."""
    normal = draw.noted("normal", array(draw, np.array([0.0, 0, 1]), 0.4))
    offset = draw.noted("offset", number(draw, -2, 2))
    sigma = draw.noted("sigma_tilt", number(draw, 0, 0.1))
    made = GroundPlane(normal=normal, offset=offset, sigma_tilt=sigma)
    made.height(np.array([[1.0, 2.0, 3.0]]))
    seen = _view(draw, odds=0.02)
    mapper = GroundMapper()
    for one in fit_ground([seen], plane=made):
        mapper.integrate(one)
    use_map(mapper.grid)


def confidence_grid(draw: Draw, folder: Path) -> None:
    """Make a grid, fuse, and ask it."""
    options: dict[str, Any] = {
        "resolution": number(draw, 0.1, 2),
        "origin": array(draw, np.zeros(draw.pick((2, 2, 3))), 0.4),
        "frame": word(draw, "map"),
    }
    names = draw.random.sample(sorted(options), draw.whole(0, 3))
    made = ConfidenceGrid(**{name: draw.noted(name, options[name]) for name in names})
    made.fuse(np.zeros(made.ndim, dtype=np.int64), np.full((3,) * made.ndim, -0.5, np.float32))
    use_map(made)
    made.save(folder / "map.npz")
    use_map(load_map(folder / "map.npz"))


def grid_queries(draw: Draw, folder: Path) -> None:
    """Ask a grid, and change it."""
    on = grid(draw, flat=not draw.chance(0.2))
    corner, side = on.origin, 8 * on.resolution
    what = draw.noted("call", draw.pick(sorted(QUERIES)))
    low = [float(at) for at in corner]
    QUERIES[what](draw, on, np.array(low), side, folder)
    use_map(on)


def _at(draw: Draw, on: ConfidenceGrid, low: Any, side: float, _folder: Path) -> None:
    places = low + side * draw.numpy.random((3, on.ndim))
    places = draw.noted("xy", array(draw, draw.pick((places, places[0])), 0.7))
    on.confidence_at(places)
    on.count_at(places)


def _window(draw: Draw, on: ConfidenceGrid, low: Any, side: float, _folder: Path) -> None:
    bounds = draw.noted("bounds", array(draw, np.concatenate([low, low + side]), 0.7))
    window = on.window(bounds)
    window.states(epsilon=draw.noted("epsilon", number(draw, 0.001, 0.5)))
    cells = window.world_to_cell(draw.noted("xy", array(draw, low[None], 0.5)))
    window.contains(cells)
    window.cell_to_world(draw.noted("cells", array(draw, cells, 0.5)))


def _fuse(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    lower = draw.noted("lower", array(draw, np.zeros(on.ndim, dtype=np.int64), 0.5))
    z = np.linspace(-1, 1, 5**on.ndim, dtype=np.float32).reshape((5,) * on.ndim)
    on.fuse(lower, draw.noted("z", array(draw, z, 0.6)))


def _fuse_heights(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    z = np.linspace(-1, 1, 5**on.ndim, dtype=np.float32).reshape((5,) * on.ndim)
    height = draw.noted("height", array(draw, np.abs(z) - np.float32(0.2), 0.5))
    on.fuse(np.zeros(on.ndim, dtype=np.int64), z, height)


def _tile(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    index = draw.either(0.5, lambda: odd(draw), lambda: (1,) * on.ndim)
    on.tile(draw.noted("index", index))


def _merge(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    capped = Capped(cap=draw.noted("cap", number(draw, 1, 9)))
    rule = draw.pick((Average(), capped, Exponential(), LogOdds(), Absolute()))
    other = draw.pick((on, ConfidenceGrid(rule=rule), ConfidenceGrid(resolution=on.resolution)))
    use_map(on.merge(other))


def _export(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, folder: Path) -> None:
    name = draw.noted(
        "name", draw.pick(("m.npz", "m.yaml", "m", "", "a\x00.npz", "x" * 400 + ".npz"))
    )
    export(on, f"{folder}/{name}")


def _area(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    on.area(draw.pick(list(CellState)))


def _collapse(draw: Draw, on: ConfidenceGrid, _low: Any, _side: float, _folder: Path) -> None:
    planes = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    on.planes = as_planes(draw.noted("planes", array(draw, planes, 0.4)))
    low = draw.noted("low", number(draw, 0.0, 0.3))
    doubtful = draw.noted("doubtful", number(draw, 0.0, 1.0))
    use_map(on.collapse(low=low, free_below=0.5, high=2.0, doubtful=doubtful))


QUERIES = {
    "area": _area, "at": _at, "collapse": _collapse, "export": _export, "fuse": _fuse,
    "fuse heights": _fuse_heights, "merge": _merge, "tile": _tile, "window": _window,
}  # fmt: skip
PATHS = (
    "", ".", "nothing", "a\x00b", "\ud800", "\u202e.map", "x" * 300, "x" * 5000, "/dev/null", "/",
    "a/b/c.npz", "m.png", "m.yaml", "m.MAP", "m.3dmap", "\x1b[2J.yaml", "~", "-", "..", "CON",
)  # fmt: skip


def paths(draw: Draw, folder: Path) -> None:
    """Read from odd places."""
    name = draw.noted("path", draw.pick(PATHS))
    path = name if draw.chance(0.5) else f"{folder}/{name}"
    if draw.chance(0.5):
        load_map(path)
    else:
        format = draw.noted("format", draw.pick((None, "gtsam", "folder", "", "GTSAM", "x" * 5000)))
        list(read_views(path, format=format, poses=draw.pick((None, path))))


def write_log(draw: Draw, folder: Path) -> None:
    """Write a log and read it back."""
    one = _rig(draw, 0.0)
    views = [_view(draw, one, odds=0.05) for _ in range(draw.whole(0, 2))]
    target = folder / draw.noted("path", draw.pick(("log", "log", "log", *PATHS)))
    kind = draw.noted("features", draw.pick(("csv", "csv", "npz", "", "CSV")))
    write_views(views, target, features=kind)
    assert len(list(read_views(target))) == len(views)


def simulated_drive(draw: Draw, _folder: Path) -> None:
    """Drive from stop to stop."""
    stops = draw.noted("stops", array(draw, np.array([[0, 0, 0], [3.0, 0, 90]]), 0.4))
    given = settings_of(draw, DriveSettings, leave=("stops",), odds=0.3)
    drive(DriveSettings(stops=stops, **given), np.random.default_rng(1))


def shapes(draw: Draw, _folder: Path) -> None:
    """Make outlines, solids and a world of them."""
    odds = 0.12
    outline: Any = {
        "box": lambda: box(*(draw.noted("corner", number(draw, 0, 9, odds)) for _ in range(4))),
        "pole": lambda: pole(
            number(draw, 0, 9, odds),
            number(draw, 0, 9, odds),
            radius=number(draw, 0.01, 1, 2 * odds),
        ),
        "polygon": lambda: polygon(
            draw.noted("corners", array(draw, np.array([[0, 0], [2, 0], [1, 3.0]])))
        ),
        "wall": lambda: wall(
            draw.noted("points", array(draw, np.array([[0, 0], [2, 0], [1, 3.0]]))),
            thickness=draw.noted("thickness", number(draw, 0.1, 1, 2 * odds)),
        ),
        "odd": lambda: odd(draw),
        "table": lambda: (
            table(*(number(draw, 0, 9, odds) for _ in range(4)), height=number(draw, 0.3, 1))[
                0
            ].outline
        ),
    }[draw.noted("shape", draw.pick(("box", "pole", "polygon", "wall", "odd", "table")))]()
    options: dict[str, Any] = {"top": number(draw, 1, 3, odds)}
    for name in ("bottom", "texture", "lines", "repeat"):
        if draw.chance(0.3):
            options[name] = number(draw, 0, 1, 2 * odds)
    if draw.chance(0.2):
        options["velocity"] = array(draw, np.array([0.1, 0.2]), 0.5)
    if draw.chance(0.2):
        options["present"] = array(draw, np.array([1.0, 2.0]), 0.5)
    for name, value in options.items():
        draw.noted(name, value)
    solids = (Solid(outline, **options),)
    holes = (Hole(shapely.box(5, 5, 6, 6), depth=number(draw, 0.1, 1)),) if draw.chance(0.3) else ()
    _observed(World(bounds=(0, 0, 8, 8), ground_texture=0.5, solids=solids, holes=holes), draw)


def world(draw: Draw, _folder: Path) -> None:
    """Make a world, sample landmarks on it, and observe them."""
    options: dict[str, Any] = {"bounds": array(draw, np.array([0, 0, 8.0, 8.0]), 0.4)}
    for name in ("ground_texture", "ground_lines"):
        options[name] = number(draw, 0, 1, 0.2)
    for name, value in options.items():
        draw.noted(name, value)
    made = World(solids=(Solid(shapely.box(4, 4, 5, 5), top=1.0, texture=2.0),), **options)
    made.at(number(draw, 0, 2, 0.0))
    _observed(made, draw)


def _observed(made: World, draw: Draw) -> None:
    sensor = SensorSettings(**settings_of(draw, SensorSettings, odds=0.15, most=2))
    moves = drive(DriveSettings(stops=((1, 1, 45),)), np.random.default_rng(1))
    landmarks = sample_landmarks(made, np.random.default_rng(1))
    for seen in observe(made, landmarks, moves, sensor, seed=1):
        len(seen.points)


def parts(draw: Draw, _folder: Path) -> None:
    """Make solids and holes from settings."""
    if draw.chance(0.8):
        SolidSettings(**_shape(draw), **settings_of(draw, SolidSettings, leave=SHAPES)).solids()
    else:
        HoleSettings(**settings_of(draw, HoleSettings, odds=0.2)).hole()


SHAPES = ("box", "polygon", "wall", "pole", "table")


def _shape(draw: Draw) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "box": np.array([0, 0, 1, 2.0]), "polygon": np.array([[0, 0], [1, 0], [0, 1.0]]),
        "wall": np.array([[0, 0], [1, 0.0]]), "pole": np.array([1, 2.0]),
        "table": np.array([0, 0, 1, 2.0]),
    }  # fmt: skip
    name = draw.pick(SHAPES)
    given = array(draw, plain[name], 0.5)
    return {name: draw.noted(name, given.tolist() if isinstance(given, np.ndarray) else given)}


def evaluated(draw: Draw, _folder: Path) -> None:
    """Evaluate a log of few views."""
    one = _rig(draw, 0.0)
    views = [_view(draw, one, odds=0.01) for _ in range(draw.pick((0, 4, 5, 6)))]
    evaluate(views, ground=draw.pick((None, settings_of(draw, GroundSettings, odds=0.2))),
             **settings_of(draw, MapperSettings, odds=0.1))  # fmt: skip


def fitted(draw: Draw, _folder: Path) -> None:
    """Fit the ground to a log of few views with odd settings."""
    one = _rig(draw, 0.02)
    views = [_view(draw, one, odds=0.05) for _ in range(draw.whole(0, 3))]
    height = draw.pick((None, None, number(draw, 0.5, 2)))
    list(fit_ground(views, camera_height=height, **settings_of(draw, GroundSettings)))


MAP_CALLS: tuple[Call, ...] = (
    Call("rig", rig, weight=2),
    Call("features", features, weight=2),
    Call("view", view, weight=2),
    Call("registration", registration),
    Call("mapper-settings", mapper_settings, weight=2),
    Call("plane", plane),
    Call("grid", confidence_grid, weight=0.5),
    Call("grid-queries", grid_queries, weight=3, may_fail_on_disk=True),
    Call("paths", paths, weight=0.3),
    Call("write-log", write_log, weight=0.5, may_fail_on_disk=True),
    Call("drive", simulated_drive),
    Call("shapes", shapes, weight=2),
    Call("world", world),
    Call("parts", parts, weight=2),
    Call("evaluate", evaluated, weight=0.2),
    Call("fit-ground", fitted),
)
