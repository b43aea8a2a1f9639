"""Why one triangulates: freespace that one view shows, by the number of its features."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import shapely
from shapely.affinity import rotate

from groundmap import Features, GroundMapper, GroundPlane, View
from groundmap.arrays import Floats, Ints
from groundmap.errors import InputError
from groundmap.grid.window import GridWindow
from groundmap.settings import MapperSettings
from groundmap.simulate import Drive, SensorSettings, Solid, World, observe, sample_landmarks
from groundmap.simulate.drive import to_transforms
from groundmap.simulate.measures import measure
from groundmap.simulate.truth import Truth, truth_of
from planners.compare.raycast import RayCaster

POINTS = (50, 100, 150, 200, 300, 600, 900, 1800)  # features in a view
SEGMENTS = (50, 100, 150, 200, 300)
WALL = 0.2  # [m], thickness
WALL_TOP = 2.0  # [m]
HIGHEST_BOX = 1.8  # [m]
ROOM_FROM_OBSTACLES = 1.0  # [m], around the camera and the way ahead of it
CLEAR_AHEAD = 3.0  # [m], so that there is something to see
RESOLUTION = 0.05  # [m], as maps for indoor navigation have
MARGIN = 1.0  # [m] around a room that is judged, too: nothing there is free
TEXTURE, LINES = 1000.0, 60.0  # [1/m²], points and segments: enough to choose from everywhere
BUCKETS_PX = 12.0, 32.0  # sides of the squares of the image that hold one point, one segment
ALL = 10**6  # features

Spread = Literal["surfaces", "image"]


class Curve(NamedTuple):
    """What one system makes of one view, by the number of features; means over rooms."""

    counts: Ints  #: shape (n,), features in the view
    free_recall: Floats  #: shape (n,), of truly free visible cells: free on the map
    false_free_beyond: Floats  #: shape (n,), of free cells: wrong by more than 0.3 m


class Curves(NamedTuple):
    """The fan with points and with segments, and the ray caster with points."""

    points: Curve
    segments: Curve
    rays: Curve


class _Scene(NamedTuple):
    """A room, one view of it with more features than are needed, and the truth."""

    world: World
    view: View
    truth: Truth


def compare_recall(
    *,
    rooms: int = 20,
    seed: int = 1,
    spread: Spread = "surfaces",
    lowest_box: float = 0.5,
    pixel_noise_px: float = 0.0,
    watch: Callable[[list[int]], Iterable[int]] = iter,
    **settings: Any,
) -> Curves:
    """Map single views of random rooms, by triangulation and by ray casting.

    Within a room all maps are made of the same view; fewer features are a part of more. The ray
    caster is given the points that the fan is given. Both know the ground plane. No box is within
    1 m of the camera or of the way 3 m ahead of it: a robot keeps that room when it looks around,
    and what is nearer and beside it one image misses.

    Parameters
    ----------
    rooms : int
    seed : int
    spread : "surfaces" or "image"
        Where features are, of all that are in sight. ``surfaces``: everywhere on walls, boxes and
        ground alike, as texture is. ``image``: one in each square of the image, as detectors
        thin theirs out; most are then on the ground nearby and on high parts of the walls.
    lowest_box : float [m]
        Boxes are this high to 1.8 m; the camera is at 1 m.
    pixel_noise_px : float [px]
        Noise of the matcher, which is perfect else.
    watch : callable
        Wraps the list of rooms, to show progress.
    **settings
        `groundmap.settings.MapperSettings`; ``resolution`` is 0.05 m unless told otherwise.

    Raises
    ------
    InputError
        No room, another `spread`, or a `lowest_box` that is not above 0 and up to 1.8 m.

    Notes
    -----
    20 rooms, seed 1, no noise; in brackets 100 other rooms. "Rays" is how many times as many rays
    find as much freespace; "false" is the share of free cells that are wrong by more than 0.3 m.

    ===============  ===========  =========  =============  ==========
    fan of           found        rays       false          of rays
    ===============  ===========  =========  =============  ==========
    50 points        .708 (.727)  3.4 (3.5)  .011 (.0000)   .031 (.011)
    100 points       .858 (.870)  3.4 (3.4)  .010 (.0000)   .028 (.012)
    300 points       .959 (.961)  2.5 (2.4)  .0000 (.0000)  .034 (.016)
    50 segments      .815 (.834)  5.4 (5.5)  .009 (.0002)
    100 segments     .921 (.937)  5.2 (5.5)  .009 (.0004)
    300 segments     .979 (.982)  3.9 (4.1)  .0001 (.0001)
    ===============  ===========  =========  =============  ==========

    What bounds these figures:

    - False freespace of the fan lies behind boxes lower than the camera: lines of sight pass over
      them, and too few features are on them. All of it is in a few rooms.
    - A ray is as wide as a cell, a triangle is not: rays gain with larger cells. 100 points do for
      340, 170 and 110 rays at 0.05, 0.1 and 0.1524 m.
    - With noise, freespace ends two standard deviations before a surface, which rays ignore: of
      0.5 px, 300 points find .929 and do for 540 rays.
    - From 900 points on rays find as much: there, features leave no gaps to be interpolated.
    """
    if rooms < 1:
        raise InputError("rooms", "1 or more", str(rooms))
    if spread not in get_args(Spread):
        raise InputError("spread", " or ".join(get_args(Spread)), repr(spread))
    if not 0.0 < lowest_box <= HIGHEST_BOX:
        raise InputError("lowest_box", f"above 0, up to {HIGHEST_BOX} [m]", str(lowest_box))
    sensor = SensorSettings(
        pixel_noise_px=pixel_noise_px,
        missing=0.0,
        false_matches=0.0,
        max_points=ALL,
        max_segments=ALL,
    )
    settings = {"resolution": RESOLUTION, **settings}
    checked = MapperSettings(**settings)
    figures = [
        _figures(_scene((seed, number), spread, lowest_box, sensor, checked), settings)
        for number in watch(list(range(rooms)))
    ]
    points, segments, rays = (np.mean(system, axis=0).T for system in zip(*figures, strict=True))
    return Curves(
        Curve(np.array(POINTS), *points),
        Curve(np.array(SEGMENTS), *segments),
        Curve(np.array(POINTS), *rays),
    )


def random_room(rng: np.random.Generator, *, lowest_box: float = 0.5) -> World:
    """Return a room of 8 to 14 m with 4 to 8 boxes in it, up to 1.8 m high."""
    size = rng.uniform(8.0, 14.0, 2)
    inside = shapely.box(0.0, 0.0, *size)
    walls = inside.buffer(WALL, join_style="mitre").difference(inside)
    solids = [Solid(walls, top=WALL_TOP, texture=TEXTURE, lines=LINES)]
    for _ in range(rng.integers(4, 9)):
        middle, half = rng.uniform((0.0, 0.0), size), rng.uniform(0.2, 0.6, 2)
        box = rotate(shapely.box(*(middle - half), *(middle + half)), rng.uniform(0.0, 90.0))
        top = rng.uniform(lowest_box, HIGHEST_BOX)
        solids.append(Solid(box.intersection(inside), top=top, texture=TEXTURE, lines=LINES))
    return World(
        bounds=inside.bounds,
        solids=tuple(solids),
        ground_texture=TEXTURE,
        ground_lines=LINES,
    )


def _scene(
    seed: tuple[int, int],
    spread: Spread,
    lowest_box: float,
    sensor: SensorSettings,
    settings: MapperSettings,
) -> _Scene:
    rng = np.random.default_rng(seed)
    world = random_room(rng, lowest_box=lowest_box)
    pose = to_transforms([_pose(world, rng)])
    stop = Drive(pose, pose, np.zeros(1))
    (view,) = observe(
        world, sample_landmarks(world, rng), stop, sensor, seed=int(rng.integers(2**31))
    )
    view = replace(
        view,
        points=_choose(view.points, spread, sensor.fx / BUCKETS_PX[0], rng),
        segments=_choose(view.segments, spread, sensor.fx / BUCKETS_PX[1], rng),
        plane=GroundPlane.below_camera(sensor.rig, sensor.camera_height),
    )
    window = _judged_cells(GroundMapper(**settings.model_dump()), world)
    return _Scene(world, view, truth_of(world, stop, sensor, window, settings))


def _pose(world: World, rng: np.random.Generator) -> Floats:
    """Return x, y [m] and yaw [rad] from where there is something to see."""
    obstacles = world.obstacles(0.0, WALL_TOP).buffer(ROOM_FROM_OBSTACLES)
    free = shapely.box(*world.bounds).difference(obstacles)
    while True:
        place, yaw = rng.uniform(world.bounds[:2], world.bounds[2:]), rng.uniform(-np.pi, np.pi)
        ahead = place + CLEAR_AHEAD * np.array([np.cos(yaw), np.sin(yaw)])
        if free.covers(shapely.LineString([place, ahead])):
            return np.array([*place, yaw])


def _choose(
    features: Features, spread: Spread, buckets: float, rng: np.random.Generator
) -> Features:
    """Return features in random order; those of ``image`` are one of each square of it.

    `buckets` is the number of squares to a focal length.
    """
    shuffled = features.select(rng.permutation(len(features)))
    if spread == "surfaces":  # landmarks are strewn evenly over them
        return shuffled
    middle = shuffled.xyz.reshape(len(shuffled), -1, 3).mean(axis=1)
    bucket = np.floor(buckets * middle[:, :2] / middle[:, 2:])
    _, first = np.unique(bucket, axis=0, return_index=True)
    return shuffled.select(rng.permutation(first))


def _figures(scene: _Scene, settings: dict[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Return the figures of the fan with points and segments, and of the rays, (counts, 2) each."""
    points = [_only(scene.view, points=count) for count in POINTS]
    segments = [_only(scene.view, segments=count) for count in SEGMENTS]
    return (
        np.array([_judge(GroundMapper(**settings), view, scene) for view in points]),
        np.array([_judge(GroundMapper(**settings), view, scene) for view in segments]),
        np.array([_judge(RayCaster(**settings), view, scene) for view in points]),
    )


def _only(view: View, *, points: int = 0, segments: int = 0) -> View:
    """Return the view with its first features only."""
    return replace(
        view,
        points=view.points.select(np.arange(points)),
        segments=view.segments.select(np.arange(segments)),
    )


def _judge(mapper: GroundMapper | RayCaster, view: View, scene: _Scene) -> tuple[float, float]:
    mapper.integrate(view)
    measures = measure(_judged_cells(mapper, scene.world), scene.truth)
    # A map without a free cell has none that is wrong.
    return measures.free_recall or 0.0, measures.false_free_beyond or 0.0


def _judged_cells(mapper: GroundMapper | RayCaster, world: World) -> GridWindow:
    """Return the cells of a map that are judged."""
    bounds = np.array(world.bounds) + np.array([-MARGIN, -MARGIN, MARGIN, MARGIN])
    return mapper.grid.window(bounds)
