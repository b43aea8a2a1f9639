"""Freespace found in one view by triangulation and by ray casting, over the number of features.

Figures of 20 rooms, seed 1, no noise; in brackets those of 100 other rooms. "Rays" is how many
times as many rays find as much freespace; "false" is the share of free cells that are wrong by more
than 0.3 m.

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

Limits of these figures:

- False freespace of the fan lies behind boxes lower than the camera: lines of sight pass over them,
  and too few features are on them. All of it is in a few rooms.
- A ray is as wide as a cell, a triangle is not, so rays gain with larger cells. 100 points
  correspond to 340, 170 and 110 rays at 0.05, 0.1 and 0.1524 m.
- With noise, freespace ends two standard deviations before a surface, which rays ignore: with
  0.5 px, 300 points find .929 and correspond to 540 rays.
- From 900 points on rays find as much: the features leave no gaps to interpolate.
"""

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
ROOM_FROM_OBSTACLES = 1.0  # [m], around the camera and the line ahead of it
CLEAR_AHEAD = 3.0  # [m], length of that line
RESOLUTION = 0.05  # [m], usual for indoor navigation
MARGIN = 1.0  # [m] around a room, where no cell is free
TEXTURE, LINES = 1000.0, 60.0  # [1/m²], points and segments: more than are needed anywhere
BUCKETS_PX = 12.0, 32.0  # sides of the image squares that hold one point, one segment
ALL = 10**6  # features

Spread = Literal["surfaces", "image"]


class Curve(NamedTuple):
    """Figures of one method over the number of features in the view; means over rooms."""

    counts: Ints  #: shape (n,), features in the view
    free_recall: Floats  #: shape (n,), share of the truly free visible cells that are free
    false_free_beyond: Floats  #: shape (n,), share of the free cells that are wrong by over 0.3 m


class Curves(NamedTuple):
    """The fan with points and with segments, and the ray caster with points."""

    points: Curve
    segments: Curve
    rays: Curve


class _Scene(NamedTuple):
    """A room, a view of it with more features than are needed, and the truth."""

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

    All maps of a room use the same view; a smaller set of features is a subset of a larger one.
    The fan and the ray caster use the same points and the true ground plane. No box is within 1 m
    of the camera or of the line 3 m ahead of it: a robot keeps that clearance when it looks
    around, and closer objects beside it are outside the image.

    Parameters
    ----------
    rooms : int
    seed : int
    spread : "surfaces" or "image"
        Distribution of the visible features. ``surfaces``: uniform on walls, boxes and ground, as
        texture is. ``image``: one in each square of the image, as detectors select them; most are
        then on the ground close to the camera and on high parts of the walls.
    lowest_box : float [m]
        Least height of a box; the greatest is 1.8 m, and the camera is at 1 m.
    pixel_noise_px : float [px]
        Noise of the matcher, which has no other errors.
    watch : callable
        Receives the list of rooms and yields each of them, to show progress.
    **settings
        `groundmap.settings.MapperSettings`; the default of ``resolution`` is 0.05 m.

    Raises
    ------
    InputError
        No room, an unknown `spread`, or a `lowest_box` that is not above 0 and at most 1.8 m.
    """
    _check_options(rooms, spread, lowest_box)
    sensor = SensorSettings(
        pixel_noise_px=pixel_noise_px,
        missing=0.0,
        false_matches=0.0,
        max_points=ALL,
        max_segments=ALL,
    )
    settings = {"resolution": RESOLUTION, **settings}
    mapper_settings = MapperSettings(**settings)
    figures = [
        _figures(_scene((seed, number), spread, lowest_box, sensor, mapper_settings), settings)
        for number in watch(list(range(rooms)))
    ]
    points, segments, rays = (np.mean(method, axis=0).T for method in zip(*figures, strict=True))
    return Curves(
        Curve(np.array(POINTS), *points),
        Curve(np.array(SEGMENTS), *segments),
        Curve(np.array(POINTS), *rays),
    )


def _check_options(rooms: int, spread: str, lowest_box: float) -> None:
    if rooms < 1:
        raise InputError("rooms", "1 or more", str(rooms))
    if spread not in get_args(Spread):
        raise InputError("spread", " or ".join(get_args(Spread)), repr(spread))
    if not 0.0 < lowest_box <= HIGHEST_BOX:
        raise InputError("lowest_box", f"above 0, up to {HIGHEST_BOX} [m]", str(lowest_box))


def random_room(rng: np.random.Generator, *, lowest_box: float = 0.5) -> World:
    """Return a room with sides of 8 to 14 m and 4 to 8 boxes, up to 1.8 m high.

    Parameters
    ----------
    rng : numpy.random.Generator
    lowest_box : float [m]
        Least height of a box.
    """
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
    window = _window(GroundMapper(**settings.model_dump()), world)
    return _Scene(world, view, truth_of(world, stop, sensor, window, settings))


def _pose(world: World, rng: np.random.Generator) -> Floats:
    """Return x, y [m] and yaw [rad] of a pose with clear space ahead."""
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
    """Return features in random order; for ``image``, one feature of each square of the image.

    `buckets` is the focal length in squares.
    """
    shuffled = features.select(rng.permutation(len(features)))
    if spread == "surfaces":  # landmarks are distributed evenly on surfaces
        return shuffled
    middle = shuffled.xyz.reshape(len(shuffled), -1, 3).mean(axis=1)
    bucket = np.floor(buckets * middle[:, :2] / middle[:, 2:])
    _, first = np.unique(bucket, axis=0, return_index=True)
    return shuffled.select(rng.permutation(first))


def _figures(scene: _Scene, settings: dict[str, Any]) -> tuple[Floats, Floats, Floats]:
    """Return the figures of the fan with points, with segments, and of the rays, (n, 2) each."""
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
    measures = measure(_window(mapper, scene.world), scene.truth)
    # The measures of a map without free cells are None.
    return measures.free_recall or 0.0, measures.false_free_beyond or 0.0


def _window(mapper: GroundMapper | RayCaster, world: World) -> GridWindow:
    """Return the cells of a map in the room and the margin around it."""
    bounds = np.array(world.bounds) + np.array([-MARGIN, -MARGIN, MARGIN, MARGIN])
    return mapper.grid.window(bounds)
